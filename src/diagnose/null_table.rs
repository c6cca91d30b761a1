//! How high the search scores on records in which nothing is missing.
//!
//! The statistic is the log posterior odds of the best hypothesis against none, the noise fitted anew for every hypothesis and its
//! slow part marginalised: the maximum over everything searched. Where there is slow noise an effect may take its place, and the
//! statistic reaches higher; so there are two tables, of records that are quiet (see [`is_quiet`]) and of the others. They are what
//! 2,500 simulated records score in which nothing is missing, 1,442 of white and short noise at activity and 1,058 with slow noise of
//! up to 30 ng and 5 min to 3 h beside it; 1,248 of them are quiet. `oare challenge --cases 1500 --seed 760000 --kinds clean,slow`
//! prints the shares of some, `--cases 1000 --seed 720000` those of the others. The tables are made for their tails: the last shares of
//! each are of 2,600 records more beside those (`--cases 1000` of seeds 950000 and 1000000, `--cases 400 --seed 1040000` with both kinds
//! and with `--kinds slow`), the very last stands for three or four of some 2,500, and beyond they fall as exp(-T), the bound of Ville
//! for evidence ratios. Where the probability itself matters, ask for the bootstrap.

/// Log likelihood of slow noise, when nothing is left out, below which a record is quiet: half of the nulls are.
const QUIET: f64 = 2.5;

/// Statistic, and the share of quiet records of noise alone that reach it.
const OF_QUIET: [(f64, f64); 13] = [
    (-6.5, 1.0),
    (-4.91, 0.95),
    (-4.36, 0.75),
    (-4.0, 0.5),
    (-3.45, 0.25),
    (-2.67, 0.1),
    (-2.12, 0.05),
    (-1.72, 0.03),
    (-1.22, 0.02),
    (-0.61, 0.01),
    (0.2, 0.0058),
    (1.35, 0.0026),
    (2.4, 0.0014),
];
/// The same of records with slow noise.
const OF_SLOW: [(f64, f64); 12] = [
    (-6.5, 1.0),
    (-4.57, 0.95),
    (-4.17, 0.75),
    (-3.74, 0.5),
    (-3.01, 0.25),
    (-2.02, 0.1),
    (-1.45, 0.05),
    (-0.85, 0.03),
    (-0.41, 0.02),
    (0.34, 0.01),
    (1.71, 0.0032),
    (2.4, 0.0011),
];

/// Whether a record is quiet, from the log likelihood of slow noise in it above that of hardly any when nothing is left out. An effect
/// that slow noise could take makes a record look slow; then it is weighed as such.
pub fn is_quiet(slow_evidence: f64) -> bool {
    slow_evidence < QUIET
}

/// Probability that a record of noise alone scores `statistic` or more, when slow noise is as likely in it as `slow_evidence` says.
pub fn false_alarm_probability(statistic: f64, slow_evidence: f64) -> f64 {
    let table: &[(f64, f64)] = if is_quiet(slow_evidence) { &OF_QUIET } else { &OF_SLOW };
    if statistic <= table[0].0 {
        return 1.0;
    }
    for pair in table.windows(2) {
        let [(t0, p0), (t1, p1)] = [pair[0], pair[1]];
        if statistic <= t1 {
            let share = (statistic - t0) / (t1 - t0);
            return (p0.ln() + share * (p1.ln() - p0.ln())).exp();
        }
    }
    let (last, p) = table[table.len() - 1];
    (p * (-(statistic - last)).exp()).max(1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_tables_fall_and_their_tails_continue_them() {
        for slow_evidence in [-1.0, 50.0] {
            let mut before = 1.1;
            for i in 0..400 {
                let p = false_alarm_probability(-8.0 + 0.1 * f64::from(i), slow_evidence);
                assert!(p <= before && p > 0.0, "{i}");
                before = p.min(1.0);
            }
        }
    }
}
