//! Poses that are none: a hand still on the triad, a table that was jolted. They are left out by a test for several outliers at once,
//! beside the fullest model that the poses can carry, so that nothing a sensor may lack is taken for a blunder.
//!
//! Generalised extreme studentised deviate (Rosner 1983): the worst pose is taken out, and the next, up to a sixth of all; the last of
//! them that is worse than chance makes the worst of so many is a blunder, and with it all before, which may have hidden it.

use statrs::distribution::{ContinuousCDF, StudentsT};

use super::still::Pose;
use super::{Triad, fit, fullest};

/// Of so many poses one may be a blunder.
const SHARE: usize = 6;
/// Share beyond which those found are no blunders but what the model lacks, and how many always may be.
const SHARE_OUT: usize = 10;
const ALWAYS: usize = 2;
/// Probability with which a triad without blunders loses a pose.
const CHANCE: f64 = 1e-3;

/// A pose that is left out, and by how much its acceleration is off gravity beside the poses kept, m/s^2.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Blunder {
    /// The pose.
    pub pose: Pose,
    /// |a| - g there, m/s^2.
    pub off_m_s2: f64,
}

/// Poses that are far off all others beside the fullest model.
#[derive(Debug, Clone, PartialEq)]
pub enum FarOff {
    /// Blunders, which are left out.
    Blunders(Vec<Blunder>),
    /// So many that it is what the model lacks: none of them is left out.
    TooMany(Vec<Blunder>),
}

impl FarOff {
    /// Those that are left out.
    pub fn left_out(&self) -> &[Blunder] {
        if let Self::Blunders(out) = self { out } else { &[] }
    }
}

/// The poses without blunders, in order, and what is far off.
pub fn without_blunders(poses: Vec<Pose>, gravity: f64) -> (Vec<Pose>, FarOff) {
    let (kept, out) = far_off(&poses, gravity);
    let too_many = out.len() > ALWAYS.max(poses.len() / SHARE_OUT);
    if too_many { (poses, FarOff::TooMany(out)) } else { (kept, FarOff::Blunders(out)) }
}

fn far_off(poses: &[Pose], gravity: f64) -> (Vec<Pose>, Vec<Blunder>) {
    let most = poses.len() / SHARE;
    let Some(parts) = fullest(poses.len().saturating_sub(most)) else { return (poses.to_vec(), Vec::new()) };
    let mut kept: Vec<usize> = (0..poses.len()).collect();
    let mut taken: Vec<usize> = Vec::new();
    let mut blunders = 0;
    for _ in 0..most {
        let left: Vec<Pose> = kept.iter().map(|i| poses[*i]).collect();
        let Some((worst, chance)) = worst(&fit(parts, &left, gravity)) else { break };
        taken.push(kept.remove(worst));
        if chance < CHANCE {
            blunders = taken.len();
        }
    }
    let out = &taken[..blunders];
    let left: Vec<Pose> = (0..poses.len()).filter(|i| !out.contains(i)).map(|i| poses[i]).collect();
    let model = fit(parts, &left, gravity);
    let mut out: Vec<Blunder> =
        out.iter().map(|i| Blunder { pose: poses[*i], off_m_s2: model.predict(&[poses[*i]], gravity)[0] }).collect();
    out.sort_by(|a, b| a.pose.start_s.total_cmp(&b.pose.start_s));
    (left, out)
}

/// The pose furthest from a fit, each by its own error without it, and the chance that the furthest of so many is as far.
fn worst(fit: &Triad) -> Option<(usize, f64)> {
    let n = fit.residuals.len();
    let free = n as f64 - fit.unknowns.len() as f64;
    let variance = fit.residuals.iter().map(|r| r * r).sum::<f64>() / free;
    let squared = |i: usize| fit.residuals[i].powi(2) / (variance * (1.0 - fit.leverages[i]).max(1e-9));
    let worst = (0..n).max_by(|a, b| squared(*a).total_cmp(&squared(*b)))?;
    // Of all of the variance by one pose nothing is left for the others.
    let far = squared(worst).min(free * (1.0 - 1e-12));
    let t = (far * (free - 1.0) / (free - far)).sqrt();
    let tails = StudentsT::new(0.0, 1.0, free - 1.0).ok()?.sf(t) * 2.0;
    Some((worst, (n as f64 * tails).min(1.0)))
}
