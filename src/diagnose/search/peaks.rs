//! The posterior of a parameter that has several peaks: the cycle of the orbit makes a lag nearly as likely a period sooner or later,
//! and one value (no lag at all) has half of the prior to itself.
//!
//! About the highest peak by its volume, away from it over the starting points, each for its share of the prior.

use crate::diagnose::catalogue::Theta;

/// What lies within so many standard errors of the peak is the peak's.
const WITHIN: f64 = 3.0;

/// A value of the parameters and what speaks for it.
#[derive(Debug, Clone, Copy)]
pub struct Peak {
    /// The parameters.
    pub theta: Theta,
    /// Log evidence there.
    pub gain: f64,
    /// Log share of the prior that the posterior fills.
    pub log_share: f64,
    /// Standard errors.
    pub sigma: Theta,
}

impl Peak {
    /// A starting point that stands for a share of the prior.
    pub fn start(theta: Theta, gain: f64, log_share: f64) -> Self {
        Self { theta, gain, log_share, sigma: [0.0; 2] }
    }

    /// The highest peak (its share that of the prior beside the atom) with all others: told at the atom where most of the posterior is
    /// there, with the spread of all of it beside the standard error.
    pub fn among(self, atom: &Theta, starts: &[Self]) -> Self {
        let own = Self { log_share: 0.5_f64.ln() + self.log_share, ..self };
        let others = starts.iter().filter(|start| {
            let apart = (start.theta[0] - self.theta[0]).abs() > WITHIN * self.sigma[0];
            apart || start.theta[1] != self.theta[1] || start.theta == *atom
        });
        let all: Vec<Self> = [own].into_iter().chain(others.copied()).collect();
        let masses: Vec<f64> = all.iter().map(|p| (p.gain - self.gain + p.log_share).exp()).collect();
        let whole: f64 = masses.iter().sum();
        let most = all.iter().zip(&masses).find(|(p, mass)| p.theta == *atom && **mass > 0.5 * whole);
        let told = most.map_or(own, |(atom, _)| *atom);
        let away = |p: &Self| (p.theta[0] - told.theta[0]).powi(2);
        let spread = all.iter().zip(&masses).map(|(p, mass)| mass / whole * away(p)).sum::<f64>();
        Self {
            log_share: whole.ln() + self.gain - told.gain,
            sigma: [spread.sqrt().hypot(self.sigma[0]), self.sigma[1]],
            ..told
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    const NO_LAG: Theta = [0.0; 2];

    fn peak(lag: f64, gain: f64, share: f64, sigma: f64) -> Peak {
        Peak { theta: [lag, 0.0], gain, log_share: share.ln(), sigma: [sigma, 0.0] }
    }

    fn start(lag: f64, gain: f64, share: f64) -> Peak {
        Peak::start([lag, 0.0], gain, share.ln())
    }

    #[test]
    fn other_peaks_add_their_share_and_widen_the_error() {
        let high = peak(9000.0, 20.0, 0.02, 250.0);
        let alone = high.among(&NO_LAG, &[start(0.0, -50.0, 0.5)]);
        assert_eq!((alone.theta[0], alone.sigma[0]), (9000.0, 250.0));
        assert!((alone.log_share - 0.01_f64.ln()).abs() < 1e-12);
        // A start of the peak itself says nothing new; one a period sooner is as likely.
        let starts = [start(0.0, -50.0, 0.5), start(3600.0, 20.0, 0.01), start(9600.0, 19.0, 0.014)];
        let two = high.among(&NO_LAG, &starts);
        assert!((two.log_share - 0.02_f64.ln()).abs() < 1e-12);
        assert!((two.sigma[0] - (0.5 * 5400.0_f64.powi(2) + 250.0_f64.powi(2)).sqrt()).abs() < 1e-9);
    }

    #[test]
    fn no_lag_is_told_where_most_of_the_posterior_is_there() {
        // Half of the prior is worth four log units here.
        let later = peak(4960.0, 12.0, 0.02, 240.0);
        for (gain, lag) in [(10.0, 0.0), (7.0, 4960.0)] {
            let told = later.among(&NO_LAG, &[start(0.0, gain, 0.5)]);
            let evidence = 0.5 * f64::exp(gain) + 0.01 * f64::exp(12.0);
            assert_eq!(told.theta[0], lag);
            assert!((told.gain + told.log_share - evidence.ln()).abs() < 1e-9, "{told:?}");
        }
        // And where it is the peak: all of the prior's half, and what the other half fills about it.
        let told = peak(0.0, 9.0, 0.01, 100.0).among(&NO_LAG, &[start(0.0, 9.0, 0.5), start(300.0, 4.0, 0.01)]);
        assert_eq!((told.theta[0], told.sigma[0]), (0.0, 100.0));
        assert!((told.log_share - 0.505_f64.ln()).abs() < 1e-12);
    }
}
