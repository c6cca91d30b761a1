//! How high the search scores on records in which nothing is missing.
//!
//! The statistic is the log posterior odds of the best hypothesis against none, the noise fitted anew for every hypothesis and its
//! slow part marginalised: the maximum over everything searched. The table is the pooled score of 2,100 simulated records in which
//! nothing is missing, 1,212 of white and short noise at activity and 888 with slow noise of up to 30 ng and 5 min to 3 h beside
//! it (`oare challenge --cases 1100 --seed 200000 --kinds clean,slow` prints its share, `--cases 1000 --seed 720000` the other). The
//! middle of the table differs from record to record, slow noise scores higher; it is made for its tail. The last share stands for
//! three of them; beyond, the tail falls as exp(-T), the bound of Ville for evidence ratios. Where the probability itself
//! matters, ask for the bootstrap.

/// Statistic, and the share of records of noise alone that reach it.
const TABLE: [(f64, f64); 12] = [
    (-6.5, 1.0),
    (-4.85, 0.95),
    (-4.35, 0.75),
    (-3.97, 0.5),
    (-3.3, 0.25),
    (-2.42, 0.1),
    (-1.63, 0.05),
    (-1.11, 0.03),
    (-0.67, 0.02),
    (0.2, 0.01),
    (0.97, 0.005),
    (2.4, 0.0016),
];

/// Probability that a record of noise alone scores `statistic` or more.
pub fn false_alarm_probability(statistic: f64) -> f64 {
    if statistic <= TABLE[0].0 {
        return 1.0;
    }
    for pair in TABLE.windows(2) {
        let [(t0, p0), (t1, p1)] = [pair[0], pair[1]];
        if statistic <= t1 {
            let share = (statistic - t0) / (t1 - t0);
            return (p0.ln() + share * (p1.ln() - p0.ln())).exp();
        }
    }
    let (last, p) = TABLE[TABLE.len() - 1];
    (p * (-(statistic - last)).exp()).max(1e-12)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_table_falls_and_its_tail_continues_it() {
        let mut before = 1.1;
        for i in 0..400 {
            let p = false_alarm_probability(-8.0 + 0.1 * f64::from(i));
            assert!(p <= before && p > 0.0, "{i}");
            before = p.min(1.0);
        }
    }
}
