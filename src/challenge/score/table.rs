//! The score as a plain table.

use std::fmt;

use super::Score;

impl fmt::Display for Score {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        writeln!(f, "{:<56} {:>11} {:>8}  {:<17} aim", "metric", "cases", "share", "95 % interval")?;
        for rate in &self.rates {
            let [low, high] = rate.interval.map(|x| 100.0 * x);
            writeln!(
                f,
                "{:<56} {:>5}/{:<5} {:>6.1} %  {:<17} {}",
                rate.name,
                rate.hits,
                rate.of,
                100.0 * rate.share(),
                format!("{low:.1} to {high:.1} %"),
                rate.aim
            )?;
        }
        if let Some(size) = self.mean_set_size {
            writeln!(f, "{:<56} {:>20.2}  {:<17} <= 1.3", "mean set size, identifiable, SNR 8 and more", size, "")?;
        }
        if let Some([reported, floor]) = self.excess_removed {
            let value = format!("{:.1} % ({:.1} %)", 100.0 * reported, 100.0 * floor);
            writeln!(
                f,
                "{:<56} {:>20}  {:<17} 97 %",
                "held-out excess removed, SNR 20+ (by the true floor)", value, ""
            )?;
        }
        let [median, late] = self.seconds;
        writeln!(
            f,
            "{:<56} {:>18.2} s  {:<17} 1 s",
            "time a case, median (95th percentile)",
            median,
            format!("({late:.2} s)")
        )?;
        for (which, reached) in ["quiet", "slow"].into_iter().zip(&self.null_statistics) {
            let shares: Vec<String> =
                reached.iter().map(|(share, statistic)| format!("{share}: {statistic:.2}")).collect();
            if !shares.is_empty() {
                writeln!(f, "statistic of {which} nulls, share that reaches it: {}", shares.join(", "))?;
            }
        }
        for (case, reason) in &self.failed {
            writeln!(f, "no answer to {case}: {reason}")?;
        }
        writeln!(f, "\ntruth -> answers")?;
        for (truth, answers) in &self.confusion {
            let mut answers: Vec<_> = answers.iter().collect();
            answers.sort_by(|a, b| b.1.cmp(a.1).then(a.0.cmp(b.0)));
            let answers: Vec<String> = answers.iter().map(|(word, count)| format!("{count} {word}")).collect();
            writeln!(f, "{truth:<46} {}", answers.join(", "))?;
        }
        let missed = self.rates.iter().filter(|rate| !rate.look_at.is_empty());
        writeln!(f, "\ncases to look at")?;
        for rate in missed {
            writeln!(f, "{}: {}", rate.name.trim(), rate.look_at.join(" "))?;
        }
        Ok(())
    }
}
