//! How much larger the error of a window's mean is than if its samples were independent, from the windows themselves.
//!
//! The filter passes DC to 1 Hz and ten samples a second are taken, so neighbours are far from independent. Second differences
//! of the trimmed means of windows 75 s apart hold the noise of the means and hardly any of the quasi-steady signal, whose
//! periods are those of the orbit; the ratio of their variance to the one expected of independent samples is the factor
//! squared. Differences over 300 s hold the slope of the signal, which a two-position measurement takes for bias.

use crate::pipeline::window::{Window, Windows};
use crate::telemetry::Quality;
use crate::units::Clock;

/// Cells between the windows of a second difference: 75 s, the lag of Rice 1996, section 6.
const LAG_CELLS: i64 = 3;
/// Cells between the windows of a slope: 300 s.
const SLOPE_CELLS: i64 = 12;
/// Cells remembered: more than the longest lag.
const RING: usize = 16;
/// Second differences for which the factor configured counts.
const PRIOR_DIFFERENCES: f64 = 60.0;
/// A difference counts no more than this many variances: windows disturbed by bursts say nothing of the rest.
const VARIANCES_MAX: f64 = 12.0;

/// The factor is given in steps of 5 %, finer than the error bar needs: otherwise every late window would revise the
/// error bar, and with it the revision, of every other.
const FACTOR_STEP: f64 = 0.05;

/// Rounded to whole steps of its logarithm.
fn in_steps(factor: f64) -> f64 {
    ((factor.ln() / FACTOR_STEP).round() * FACTOR_STEP).exp()
}

/// What the windows up to some clock say of the noise, per OARE axis.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct NoiseFactors {
    /// Standard error of a window's mean over that of independent samples.
    pub factor: [f64; 3],
    /// Variance of half the change of the signal over 75 s, ng^2 at nominal scale.
    pub half_drift_variance_ng2: [f64; 3],
    /// RMS of (S(t+75 s) - S(t))/2 in counts of range C [Rice 1996, Table 4], its mean, and the number of differences.
    pub signal_differences: [[f64; 3]; 3],
}

/// Running sums of differences, and the factors at any clock.
#[derive(Debug, Default)]
pub struct NoiseHistory {
    /// By known-since: sums after that window.
    entries: Vec<(Clock, [Sums; 3])>,
}

#[derive(Debug, Clone, Copy, Default)]
struct Sums {
    ratio: f64,
    differences: f64,
    slope: f64,
    slopes: f64,
    half: f64,
    half_squared: f64,
    halves: f64,
}

impl NoiseHistory {
    /// Sums over all whole windows of normal mode.
    pub fn new(windows: &Windows, resolution_ng: &[[f64; 3]; 3]) -> Self {
        let mut sums = [Sums::default(); 3];
        let mut entries = Vec::new();
        // The windows of the last cells, by the cell's remainder: looking them up in the map again and again costs the most.
        let mut ring: [(i64, Option<&Window>); RING] = [(i64::MIN, None); RING];
        let place = |cell: i64| cell.rem_euclid(RING as i64) as usize;
        for (cell, window) in windows {
            ring[place(*cell)] = (*cell, Some(&**window).filter(|w| w.quality == Quality::GOOD));
            let whole = |cell: i64| Some(ring[place(cell)]).filter(|(of, _)| *of == cell).and_then(|(_, w)| w);
            let (Some(last), Some(before)) = (whole(*cell), whole(cell - LAG_CELLS)) else { continue };
            for axis in 0..3 {
                let figures = |w: &Window| {
                    let a = w.axes[axis]?;
                    Some((a.range, a.estimate.mean, a.estimate.independent_standard_error().powi(2)))
                };
                let (Some(c), Some(b)) = (figures(last), figures(before)) else { continue };
                if c.0 != b.0 {
                    continue;
                }
                let sum = &mut sums[axis];
                if c.0 == crate::telemetry::Range::C {
                    let half = 0.5 * (c.1 - b.1);
                    sum.half += half;
                    sum.half_squared += half * half;
                    sum.halves += 1.0;
                }
                if let Some(a) = whole(cell - 2 * LAG_CELLS).and_then(figures).filter(|a| a.0 == c.0) {
                    let expected = a.2 + 4.0 * b.2 + c.2;
                    if expected > 0.0 {
                        let square = (a.1 - 2.0 * b.1 + c.1).powi(2);
                        // Seven to eight times the independent variance is usual: the filter's.
                        sum.ratio += (square / expected).min(8.0 * VARIANCES_MAX);
                        sum.differences += 1.0;
                    }
                }
                if let Some(a) = whole(cell - SLOPE_CELLS).and_then(figures).filter(|a| a.0 == c.0) {
                    let unit = resolution_ng[axis][c.0.index()].powi(2);
                    let noise = 8.0 * (a.2 + c.2);
                    let square = (c.1 - a.1).powi(2);
                    sum.slope += (square.min(VARIANCES_MAX * noise.max(1.0)) - noise) * unit / 64.0;
                    sum.slopes += 1.0;
                }
            }
            entries.push((last.known_since, sums));
        }
        entries.sort_by_key(|(known, _)| *known);
        Self { entries }
    }

    /// The factors from the windows known at a clock; `configured` is the factor before there are any.
    pub fn at(&self, clock: Clock, configured: f64) -> NoiseFactors {
        let place = self.entries.partition_point(|(known, _)| *known <= clock);
        let sums = place.checked_sub(1).map_or([Sums::default(); 3], |n| self.entries[n].1);
        let pooled = sums.iter().fold((0.0, 0.0), |t, s| (t.0 + s.ratio, t.1 + s.differences));
        let prior = configured.powi(2);
        // All axes have the same filter: their common factor first, then what sets one apart.
        let common = (pooled.0 + PRIOR_DIFFERENCES * prior) / (pooled.1 + PRIOR_DIFFERENCES);
        NoiseFactors {
            factor: sums.map(|s| in_steps(((s.ratio + 500.0 * common) / (s.differences + 500.0)).sqrt())),
            half_drift_variance_ng2: sums.map(|s| if s.slopes > 50.0 { (s.slope / s.slopes).max(0.0) } else { 0.0 }),
            signal_differences: sums.map(|s| {
                let n = s.halves.max(1.0);
                [(s.half_squared / n).sqrt(), s.half / n, s.halves]
            }),
        }
    }
}
