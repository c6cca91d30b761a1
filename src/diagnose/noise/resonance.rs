//! Noise that resonates.

/// Noise that oscillates about a period and forgets its phase: a damped oscillator that white noise drives, an autoregression of the second
/// order.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Resonance {
    /// RMS, ng, at activity 1.
    pub rms_ng: f64,
    /// Period, s.
    pub period_s: f64,
    /// Time in which its phase is forgotten, s.
    pub tau_s: f64,
    /// Whether it follows the crew's activity, or is as loud whatever the crew does.
    pub follows_crew: bool,
}

impl Resonance {
    /// One of no size.
    pub(super) const NONE: Self = Self { rms_ng: 0.0, period_s: 600.0, tau_s: 600.0, follows_crew: false };

    /// How loud it is at an activity, beside that at 1.
    pub(super) fn loudness(&self, activity: f64) -> f64 {
        if self.follows_crew { activity } else { 1.0 }
    }

    /// What a step makes of its displacement and velocity, both in ng (the velocity over the frequency without damping, so that both are as
    /// large), by rows; and with it how much it is like itself that much later, the first of them.
    pub(super) fn transition(&self, step_s: f64) -> [[f64; 2]; 2] {
        let keep = (-step_s / self.tau_s).exp();
        if keep == 0.0 {
            return [[0.0; 2]; 2];
        }
        let damped = std::f64::consts::TAU / self.period_s;
        let (sin, cos) = (damped * step_s).sin_cos();
        let damping = sin / (damped * self.tau_s);
        let across = sin * (1.0 + (damped * self.tau_s).powi(-2)).sqrt();
        [[keep * (cos + damping), keep * across], [-keep * across, keep * (cos - damping)]]
    }

    /// The next displacement and velocity after a step, from two standard normal numbers.
    pub(super) fn next(&self, [x, v]: [f64; 2], step_s: f64, normal: [f64; 2]) -> [f64; 2] {
        let [a, b] = self.transition(step_s);
        // What is new keeps the covariance as it is: unity less that of what is kept.
        let new = [1.0 - a[0] * a[0] - a[1] * a[1], -a[0] * b[0] - a[1] * b[1], 1.0 - b[0] * b[0] - b[1] * b[1]];
        let first = new[0].max(0.0).sqrt();
        let shared = if first > 0.0 { new[1] / first } else { 0.0 };
        let second = (new[2] - shared * shared).max(0.0).sqrt();
        let [p, q] = normal.map(|normal| self.rms_ng * normal);
        [a[0] * x + a[1] * v + first * p, b[0] * x + b[1] * v + shared * p + second * q]
    }
}
