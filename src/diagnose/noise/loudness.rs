//! How loud the windows of an axis are.

/// How loud each window of an axis is, beside the noise that all of them have.
#[derive(Debug, Clone, PartialEq)]
pub struct Loudness {
    /// Level of the white and the short noise that the crew's activity gives; mean square 1.
    pub activity: Vec<f64>,
    /// Variance of the samples that a window is the first to have, over their usual one: above 1 where they are out of the ordinary.
    /// The window after it shares them, so that a burst is one event, not two.
    pub burst: Vec<f64>,
}

impl Loudness {
    /// Of activity alone: no bursts.
    pub fn even(activity: Vec<f64>) -> Self {
        Self { burst: vec![1.0; activity.len()], activity }
    }

    /// From the average deviation and the crew's sleep.
    pub fn of_crew(dev_ng: &[f64], asleep: &[bool]) -> Self {
        Self::even(activity(dev_ng, asleep))
    }

    /// Some of the windows.
    pub fn pick(&self, index: &[usize]) -> Self {
        let of = |series: &[f64]| index.iter().map(|i| series[*i]).collect();
        Self { activity: of(&self.activity), burst: of(&self.burst) }
    }
}

/// Activity of every window, from the average deviation in sleep and wake; mean square 1.
fn activity(dev_ng: &[f64], asleep: &[bool]) -> Vec<f64> {
    let mean = |state: bool| {
        let (sum, n) = dev_ng
            .iter()
            .zip(asleep)
            .filter(|(_, a)| **a == state)
            .fold((0.0, 0usize), |(s, n), (d, _)| (s + d, n + 1));
        (n >= 30).then(|| sum / n as f64)
    };
    let level = match (mean(false), mean(true)) {
        (Some(wake), Some(sleep)) if wake > 0.0 && sleep > 0.0 => [wake, sleep],
        _ => [1.0, 1.0],
    };
    let raw: Vec<f64> = asleep.iter().map(|a| level[usize::from(*a)]).collect();
    let rms = (raw.iter().map(|x| x * x).sum::<f64>() / raw.len().max(1) as f64).sqrt();
    raw.iter().map(|x| x / rms).collect()
}
