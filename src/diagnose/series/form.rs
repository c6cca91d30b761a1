//! Forms of a covariate that are no effect of the catalogue: what a sensor may follow that nobody has listed. Not here: which of
//! them it follows (see `search`).

use super::follow::slope;
use crate::math::rms::{about_mean, rms_about_mean};

/// A form of a covariate.
#[derive(Debug, Clone, Copy, PartialEq, Eq)]
pub enum Form {
    /// In proportion to it.
    Linear,
    /// To the square of its deviation from its mean.
    Square,
    /// To the third power of that.
    Cube,
    /// To what follows it with a slack (the play operator of Prandtl 1928) of so many tenths of its deviation.
    Play(u8),
    /// To what it is above its mean by more than so many tenths of its deviation.
    Above(u8),
    /// To what it is below it by more than that.
    Below(u8),
    /// To its highest value of the last so many hours.
    Highest(u8),
    /// To its lowest.
    Lowest(u8),
    /// To how fast it rises, nothing while it falls.
    Rising,
    /// To how fast it falls, nothing while it rises.
    Falling,
}

impl Form {
    /// All of them.
    pub const ALL: [Self; 18] = [
        Self::Linear,
        Self::Square,
        Self::Cube,
        Self::Play(7),
        Self::Play(14),
        Self::Play(24),
        Self::Above(4),
        Self::Above(12),
        Self::Below(4),
        Self::Below(12),
        Self::Highest(4),
        Self::Highest(8),
        Self::Highest(16),
        Self::Lowest(4),
        Self::Lowest(8),
        Self::Lowest(16),
        Self::Rising,
        Self::Falling,
    ];

    /// Whether it may be late as well.
    pub fn may_be_late(self) -> bool {
        matches!(self, Self::Linear | Self::Square | Self::Cube | Self::Rising | Self::Falling)
    }

    /// The form of values at such times.
    pub fn of(self, t_s: &[f64], values: &[f64]) -> Vec<f64> {
        let x = about_mean(values);
        let each = |f: &dyn Fn(f64) -> f64| x.iter().map(|x| f(*x)).collect::<Vec<f64>>();
        match self {
            Self::Linear => x,
            Self::Square => each(&|x| x * x),
            Self::Cube => each(&|x| x.powi(3)),
            Self::Play(tenths) => {
                let half = 0.5 * part(tenths, values);
                let mut follower = x.first().copied().unwrap_or(0.0);
                let follow = |x: &f64| {
                    follower = follower.clamp(x - half, x + half);
                    follower
                };
                x.iter().map(follow).collect()
            }
            Self::Above(tenths) => {
                let from = part(tenths, values);
                each(&|x| (x - from).max(0.0))
            }
            Self::Below(tenths) => {
                let from = part(tenths, values);
                each(&|x| (-x - from).max(0.0))
            }
            Self::Highest(hours) => of_the_last(t_s, &x, hours, f64::max),
            Self::Lowest(hours) => of_the_last(t_s, &x, hours, f64::min),
            Self::Rising => slope(t_s, values).into_iter().map(|rate| rate.max(0.0)).collect(),
            Self::Falling => slope(t_s, values).into_iter().map(|rate| (-rate).max(0.0)).collect(),
        }
    }

    /// Its unit, of a covariate's.
    pub fn unit(self, unit: &str) -> String {
        match self {
            Self::Square => format!("{unit}^2"),
            Self::Cube => format!("{unit}^3"),
            Self::Rising | Self::Falling => format!("({unit}/s)"),
            _ => unit.to_owned(),
        }
    }

    /// As a formula of a covariate, by its name and its values.
    pub fn words(self, covariate: &str, values: &[f64], lag_s: f64) -> String {
        let about = format!("({covariate} - <{covariate}>)");
        let form = match self {
            Self::Linear => about,
            Self::Square => format!("{about}^2"),
            Self::Cube => format!("{about}^3"),
            Self::Play(tenths) => format!("{about}, followed with a slack of {:.3}", part(tenths, values)),
            Self::Above(tenths) => format!("max(0, {covariate} - <{covariate}> - {:.3})", part(tenths, values)),
            Self::Below(tenths) => format!("max(0, <{covariate}> - {covariate} - {:.3})", part(tenths, values)),
            Self::Highest(hours) => format!("the highest {about} of the last {hours} h"),
            Self::Lowest(hours) => format!("the lowest {about} of the last {hours} h"),
            Self::Rising => format!("max(0, d{covariate}/dt)"),
            Self::Falling => format!("max(0, -d{covariate}/dt)"),
        };
        if lag_s > 0.0 { format!("{form}, {lag_s:.0} s late") } else { form }
    }
}

/// So many tenths of the deviation of values.
fn part(tenths: u8, values: &[f64]) -> f64 {
    0.1 * f64::from(tenths) * rms_about_mean(values)
}

/// The extreme of the last so many hours, at each instant.
fn of_the_last(t_s: &[f64], x: &[f64], hours: u8, extreme: fn(f64, f64) -> f64) -> Vec<f64> {
    let reach_s = 3600.0 * f64::from(hours);
    let from = |i: usize| t_s.partition_point(|t| *t < t_s[i] - reach_s);
    (0..x.len()).map(|i| x[from(i)..=i].iter().copied().fold(x[i], extreme)).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn forms_remember_what_they_say() {
        let t: Vec<f64> = (0..7).map(|i| 3600.0 * f64::from(i)).collect();
        // About a mean of 3.
        let x = [3.0, 5.0, 3.0, 1.0, 3.0, 3.0, 3.0];
        assert_eq!(of_the_last(&t, &about_mean(&x), 2, f64::max), [0.0, 2.0, 2.0, 2.0, 0.0, 0.0, 0.0]);
        assert_eq!(Form::Highest(4).of(&t, &x)[5..], [2.0, 0.0]);
        assert_eq!(Form::Lowest(4).of(&t, &x), [0.0, 0.0, 0.0, -2.0, -2.0, -2.0, -2.0]);
        let deviation = (8.0_f64 / 7.0).sqrt();
        let above = Form::Above(4).of(&t, &x);
        assert!((above[1] - (2.0 - 0.4 * deviation)).abs() < 1e-12 && above[0] == 0.0 && above[3] == 0.0);
        assert_eq!(Form::Below(4).of(&t, &x)[3], above[1]);
        // Up by 2 in the first hour, down by 4 in the next two.
        let (rising, falling) = (Form::Rising.of(&t, &x), Form::Falling.of(&t, &x));
        assert!((rising[0] * 3600.0 - 2.0).abs() < 1e-12 && rising[2] == 0.0, "{rising:?}");
        assert!((falling[2] * 3600.0 - 2.0).abs() < 1e-12 && falling[0] == 0.0, "{falling:?}");
    }
}
