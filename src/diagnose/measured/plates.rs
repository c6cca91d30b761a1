//! What the figures of these cases show. Not here: how they are drawn (`page`).

/// Numbers behind the figures of one case.
#[derive(Debug, Clone)]
pub enum Plates {
    /// One an axis, controls after them.
    Series(Vec<SeriesPlate>),
    /// All arcs, level by level.
    Orbit(OrbitPlate),
    /// All poses, level by level.
    Poses(PosesPlate),
}

/// One axis of a series, as block means about what its simulation holds.
#[derive(Debug, Clone)]
pub struct SeriesPlate {
    /// Column.
    pub name: String,
    /// Unit.
    pub unit: String,
    /// Time, s.
    pub t_s: Vec<f64>,
    /// Without the effects.
    pub before: Vec<f64>,
    /// With them.
    pub after: Vec<f64>,
    /// Whether nothing is expected in it.
    pub control: bool,
}

/// Rms of every arc at every level of the search, m.
#[derive(Debug, Clone)]
pub struct OrbitPlate {
    /// Satellites.
    pub arcs: Vec<String>,
    /// What each level added.
    pub added: Vec<String>,
    /// Level by level, arc by arc: 3-D rms of what the fit leaves, m.
    pub rms_m: Vec<Vec<f64>>,
    /// The same of what follows the fit, where there is any.
    pub predicted_m: Vec<Vec<f64>>,
    /// Rms beyond which an arc is called unexplained, m.
    pub rms_max_m: f64,
}

/// |a| - g of every pose at every level, m/s^2.
#[derive(Debug, Clone)]
pub struct PosesPlate {
    /// What each level added.
    pub added: Vec<String>,
    /// Level by level, pose by pose.
    pub residuals: Vec<Vec<f64>>,
}
