//! How high the search scores on records in which nothing is missing.
//!
//! The statistic is the log posterior odds of the best hypothesis against none, the noise fitted anew for every hypothesis and its
//! slow part marginalised: the maximum over everything searched. Where there is slow noise an effect may take its place, and the
//! statistic reaches higher; so there are two tables, of records that are quiet (see [`is_quiet`]) and of the others. They are what
//! 8,300 simulated records score in which nothing is missing, 3,339 of them with slow noise of up to 30 ng and 5 min to 3 h beside
//! the others' white and short noise at activity; 4,405 are quiet. `oare challenge` prints the shares of each part: `--cases 3000
//! --seed 1206000 --kinds clean,slow`, `--cases 1500` of seeds 1130000 and 1210000 with both kinds and of 1200000 with `--kinds
//! clean`, `--cases 800 --seed 1203000 --kinds slow`. In the tails the counted shares are rounded up, by about their standard error:
//! the very last stand for one or two records. Beyond they fall as exp(-T), the bound of Ville for evidence ratios. Where the
//! probability itself matters, ask for the bootstrap.

use super::answer::LEAST_PROBABILITY;

/// Log likelihood of slow noise, when nothing is left out, below which a record is quiet: half of the nulls are.
const QUIET: f64 = 2.5;

/// Statistic, and the share of quiet records of noise alone that reach it.
const OF_QUIET: [(f64, f64); 17] = [
    (-6.5, 1.0),
    (-4.99, 0.95),
    (-4.42, 0.75),
    (-4.07, 0.5),
    (-3.46, 0.25),
    (-2.68, 0.1),
    (-2.09, 0.05),
    (-1.66, 0.03),
    (-1.33, 0.02),
    (-0.81, 0.0105),
    (-0.38, 0.006),
    (0.13, 0.0027),
    (0.4, 0.0022),
    (0.88, 0.0014),
    (1.41, 0.0011),
    (1.77, 0.0008),
    (4.23, 0.00045),
];
/// The same of records with slow noise.
const OF_SLOW: [(f64, f64); 16] = [
    (-6.5, 1.0),
    (-4.57, 0.95),
    (-4.19, 0.75),
    (-3.74, 0.5),
    (-2.94, 0.25),
    (-1.87, 0.1),
    (-1.13, 0.05),
    (-0.64, 0.031),
    (-0.38, 0.021),
    (-0.05, 0.011),
    (0.38, 0.007),
    (0.87, 0.0042),
    (1.36, 0.0028),
    (1.9, 0.0021),
    (2.31, 0.0015),
    (2.54, 0.0009),
];

/// Whether a record is quiet, from the log likelihood of slow noise in it above that of hardly any when nothing is left out. An effect
/// that slow noise could take makes a record look slow; then it is weighed as such.
pub fn is_quiet(slow_evidence: f64) -> bool {
    slow_evidence < QUIET
}

/// Probability that a record of noise alone scores `statistic` or more, when slow noise is as likely in it as `slow_evidence` says.
pub fn false_alarm_probability(statistic: f64, slow_evidence: f64) -> f64 {
    let table: &[(f64, f64)] = if is_quiet(slow_evidence) { &OF_QUIET } else { &OF_SLOW };
    if statistic.is_nan() || statistic <= table[0].0 {
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
    (p * (-(statistic - last)).exp()).max(LEAST_PROBABILITY)
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
