//! How loud the windows of an axis are.

use crate::math::rms::rms;

/// How loud each window of an axis is, beside the noise that all of them have.
#[derive(Debug, Clone, Default, PartialEq)]
pub struct Loudness {
    /// Level that the crew's activity gives the short noise of a window and the white noise of the samples that the window is the first
    /// to have; mean square 1.
    pub activity: Vec<f64>,
    /// Variance of the samples that a window is the first to have, over their usual one: above 1 where they are out of the ordinary.
    /// The window after it shares them, so that a burst is one event, not two.
    pub burst: Vec<f64>,
    /// Variance that a window has for itself, over that of its new samples: above nothing where it is out of the ordinary and the window that
    /// shares samples with it is not, as a trimmed mean may be.
    pub alone: Vec<f64>,
}

impl Loudness {
    /// Of activity alone: no bursts.
    pub fn even(activity: Vec<f64>) -> Self {
        Self { burst: vec![1.0; activity.len()], alone: vec![0.0; activity.len()], activity }
    }

    /// From the crew's sleep: so loud awake, and so loud asleep.
    pub fn of_crew([awake, asleep]: [f64; 2], sleeps: &[bool]) -> Self {
        let raw: Vec<f64> = sleeps.iter().map(|sleeps| if *sleeps { asleep } else { awake }).collect();
        Self::of_levels(&raw)
    }

    /// From a level for each window, of whatever mean square.
    pub fn of_levels(levels: &[f64]) -> Self {
        let rms = rms(levels);
        Self::even(levels.iter().map(|level| level / rms).collect())
    }

    /// Level while the crew is awake, in the mean of squares; that of all windows where it never is.
    pub fn awake(&self, sleeps: &[bool]) -> f64 {
        let awake: Vec<f64> = self.activity.iter().zip(sleeps).filter(|(_, s)| !**s).map(|(level, _)| *level).collect();
        if awake.is_empty() { 1.0 } else { rms(&awake) }
    }

    /// The same with more windows behind it, up to so many, all of one level and without bursts.
    pub fn gone_on(&self, level: f64, windows: usize) -> Self {
        let mut longer = self.clone();
        longer.activity.resize(windows, level);
        longer.burst.resize(windows, 1.0);
        longer.alone.resize(windows, 0.0);
        longer
    }

    /// Some of the windows.
    pub fn pick(&self, index: &[usize]) -> Self {
        let of = |series: &[f64]| index.iter().map(|i| series[*i]).collect();
        Self { activity: of(&self.activity), burst: of(&self.burst), alone: of(&self.alone) }
    }

    /// Whether a window is out of the ordinary.
    pub fn is_odd(&self, i: usize) -> bool {
        self.burst[i] > 1.0 || self.alone[i] > 0.0
    }
}
