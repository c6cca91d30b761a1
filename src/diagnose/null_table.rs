//! How high the search scores on records in which nothing is missing.
//!
//! The statistic is the log posterior odds of the best hypothesis against none, the noise fitted anew for every hypothesis and its
//! slow part marginalised: the maximum over everything searched. Where there is slow noise an effect may take its place, and the
//! statistic reaches higher; so there are two tables, of records that are quiet (see [`is_quiet`]) and of the others. They are what
//! 6,800 simulated records score in which nothing is missing, 2,704 of them with slow noise of up to 30 ng and 5 min to 3 h beside
//! the others' white and short noise at activity; 3,626 are quiet. `oare challenge` prints the shares of each part: `--cases 3000
//! --seed 1206000 --kinds clean,slow`, `--cases 1500 --seed 1130000 --kinds clean,slow`, `--cases 1500 --seed 1200000 --kinds clean`,
//! `--cases 800 --seed 1203000 --kinds slow`. In the tails the counted shares are rounded up, since the very last stand for one to
//! five records; beyond they fall as exp(-T), the bound of Ville for evidence ratios. Where the probability itself matters, ask for
//! the bootstrap.

/// Log likelihood of slow noise, when nothing is left out, below which a record is quiet: half of the nulls are.
const QUIET: f64 = 2.5;

/// Statistic, and the share of quiet records of noise alone that reach it.
const OF_QUIET: [(f64, f64); 15] = [
    (-6.5, 1.0),
    (-4.98, 0.95),
    (-4.41, 0.75),
    (-4.06, 0.5),
    (-3.44, 0.25),
    (-2.67, 0.1),
    (-2.11, 0.05),
    (-1.7, 0.03),
    (-1.33, 0.02),
    (-0.82, 0.01),
    (-0.38, 0.0055),
    (0.1, 0.0024),
    (0.5, 0.0014),
    (1.0, 0.0007),
    (1.41, 0.0005),
];
/// The same of records with slow noise.
const OF_SLOW: [(f64, f64); 14] = [
    (-6.5, 1.0),
    (-4.58, 0.95),
    (-4.2, 0.75),
    (-3.75, 0.5),
    (-2.95, 0.25),
    (-1.88, 0.1),
    (-1.11, 0.05),
    (-0.6, 0.03),
    (-0.34, 0.022),
    (0.0, 0.011),
    (0.5, 0.0062),
    (0.87, 0.0038),
    (1.9, 0.0016),
    (2.5, 0.0009),
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
