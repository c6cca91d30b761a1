//! A triad held still in many poses: the magnitude of gravity is the same in all, so what the ideal triad lacks shows in
//! it (Tedaldi et al. 2014: bias, scale factors, axes not at right angles; a rigid rotation cannot show).
//!
//! u - u0 - b = diag(1 + k) U a / s, the rows of U being unit vectors along the sensing axes: the product of two of them is the sine of an
//! angle, positive where they make less than a right one. The common scale s is a nuisance.
//!
//! Readings err, and not the magnitude: what a model leaves is |a| - g over its slope by the readings, the distance of a reading from
//! where the model has the size of gravity (Sampson 1982). Without that, poses about one direction are best explained by a zero far off and a
//! scale near nothing, which makes every error small.

pub mod blunder;
mod report;
pub mod still;
mod structure;
#[cfg(test)]
mod tests;

use std::collections::BTreeMap;

use nalgebra::{DMatrix, DVector, Dyn, Owned, Vector3};

use self::blunder::without_blunders;
use self::still::{Pose, find_poses};
use crate::diagnose::keys::texts;
use crate::diagnose::measured::plates::PosesPlate;
use crate::diagnose::measured::{Answer, MeasuredCase, MeasuredError, Plates};
use crate::math::rms::rms;

/// Readings at zero acceleration that makers of triads use: none, or the middle of so many bits.
const ZEROS: [f64; 9] = [0.0, 512.0, 2_048.0, 8_192.0, 32_768.0, 131_072.0, 524_288.0, 2_097_152.0, 8_388_608.0];
/// Evidence needed for a term; as for orbits.
const SCORE_MIN: f64 = 18.0;
/// A middle of the readings this close to nothing, in half their range, is nothing.
const NEAR_ZERO: f64 = 0.3;
/// Poses needed beyond the unknowns of a model that is tried.
const SPARE_POSES: usize = 4;
const POSES_MIN: usize = 9;

/// A part of the sensor's model.
#[derive(Debug, Clone, Copy, PartialEq, Eq, PartialOrd, Ord, Hash)]
pub enum Part {
    /// Zero offset of each axis, counts.
    Bias,
    /// Each axis' scale beside the common one.
    Scale,
    /// Three angles.
    NonOrthogonality,
}

impl Part {
    /// All, in the catalogue's order.
    pub const ALL: [Self; 3] = [Self::Bias, Self::Scale, Self::NonOrthogonality];

    /// The catalogue's name.
    pub fn id(self) -> &'static str {
        match self {
            Self::Bias => "bias",
            Self::Scale => "scale_factor",
            Self::NonOrthogonality => "non_orthogonality",
        }
    }

    fn name(self) -> &'static str {
        match self {
            Self::Bias => "Zero offset",
            Self::Scale => "Scale factors of the axes",
            Self::NonOrthogonality => "Axes not at right angles",
        }
    }

    /// Independent unknowns; the mean of the scale fractions belongs to the common scale.
    fn unknowns(self) -> usize {
        if self == Self::Scale { 2 } else { 3 }
    }

    fn names(self) -> [&'static str; 3] {
        match self {
            Self::Bias => ["x", "y", "z"],
            Self::Scale => ["fraction_x", "fraction_y", "fraction_z"],
            Self::NonOrthogonality => ["xy_rad", "xz_rad", "yz_rad"],
        }
    }

    fn unit(self) -> &'static str {
        match self {
            Self::Bias => "counts",
            Self::Scale => "1",
            Self::NonOrthogonality => "rad",
        }
    }
}

/// A fitted sensor model.
#[derive(Debug, Clone)]
pub struct Triad {
    /// Parts in the model.
    pub parts: Vec<Part>,
    /// Metres per second squared and count.
    pub scale: f64,
    /// The same if the triad were ideal.
    usual_scale: f64,
    unknowns: DVector<f64>,
    covariance: DMatrix<f64>,
    /// How far every pose fitted is from gravity's size, at the usual scale, m/s^2: |a| - g where the triad is nearly ideal.
    pub residuals: Vec<f64>,
    /// |a| - g of every pose fitted, m/s^2.
    pub misfits: Vec<f64>,
    /// Derivatives of the residuals by the unknowns.
    slopes: DMatrix<f64>,
    /// Share of its own misfit that every pose takes by being fitted.
    leverages: Vec<f64>,
}

impl Triad {
    /// Rms of |a| - g, m/s^2.
    pub fn rms(&self) -> f64 {
        rms(&self.misfits)
    }

    /// Rms of what the fit of another model changes, m/s^2.
    fn rms_from(&self, other: &Self) -> f64 {
        rms(&self.misfits.iter().zip(&other.misfits).map(|(a, b)| a - b).collect::<Vec<f64>>())
    }

    /// Value and standard error of a part's three numbers.
    pub fn values(&self, part: Part) -> [(f64, f64); 3] {
        let Some(at) = place(&self.parts, part) else { return [(0.0, 0.0); 3] };
        let unit = if part == Part::Bias { BIAS_UNIT / self.scale } else { 1.0 };
        let rows = part_rows(part);
        std::array::from_fn(|k| {
            let weights = &rows[k][..part.unknowns()];
            let value: f64 = weights.iter().enumerate().map(|(j, w)| w * self.unknowns[at + j]).sum();
            let mut variance = 0.0;
            for (i, wi) in weights.iter().enumerate() {
                for (j, wj) in weights.iter().enumerate() {
                    variance += wi * wj * self.covariance[(at + i, at + j)];
                }
            }
            (value * unit, variance.max(0.0).sqrt() * unit)
        })
    }

    /// |a| - g this model gives for other poses, m/s^2.
    pub fn predict(&self, poses: &[Pose], gravity: f64) -> Vec<f64> {
        poses.iter().map(|pose| misfit(&self.parts, &self.unknowns, pose, gravity)).collect()
    }

    /// Direction of gravity's reaction in the triad in a pose.
    fn direction(&self, pose: &Pose) -> Vector3<f64> {
        acceleration(&self.parts, &self.unknowns, pose).normalize()
    }
}

/// Biases are solved in m/s^2, so that all unknowns are of one order whatever the readings' unit.
const BIAS_UNIT: f64 = 1.0;

/// How a part's three numbers follow from its unknowns: the scale fractions add to nothing.
fn part_rows(part: Part) -> [[f64; 3]; 3] {
    match part {
        Part::Scale => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [-1.0, -1.0, 0.0]],
        _ => [[1.0, 0.0, 0.0], [0.0, 1.0, 0.0], [0.0, 0.0, 1.0]],
    }
}

fn place(parts: &[Part], part: Part) -> Option<usize> {
    let at = parts.iter().position(|p| *p == part)?;
    Some(1 + parts[..at].iter().map(|p| p.unknowns()).sum::<usize>())
}

fn three(parts: &[Part], unknowns: &DVector<f64>, part: Part) -> Vector3<f64> {
    let Some(at) = place(parts, part) else { return Vector3::zeros() };
    let rows = part_rows(part);
    Vector3::from_fn(|k, _| (0..part.unknowns()).map(|j| rows[k][j] * unknowns[at + j]).sum())
}

/// The sensing axes: unit vectors, z along that of the frame, y in its y-z plane.
struct SensingAxes {
    x: Vector3<f64>,
    y: Vector3<f64>,
}

impl SensingAxes {
    /// From the angles of x and y, x and z, y and z.
    fn new(angle: &Vector3<f64>) -> Self {
        let [xy, xz, yz] = [angle.x, angle.y, angle.z].map(f64::sin);
        let y = Vector3::new(0.0, (1.0 - yz * yz).max(LEAST_COSINE).sqrt(), yz);
        let along_y = (xy - xz * yz) / y.y;
        let along_x = (1.0 - along_y * along_y - xz * xz).max(LEAST_COSINE).sqrt();
        Self { x: Vector3::new(along_x, along_y, xz), y }
    }

    /// The vector that the axes read as `reading`.
    fn read_as(&self, reading: &Vector3<f64>) -> Vector3<f64> {
        let z = reading.z;
        let y = (reading.y - self.y.z * z) / self.y.y;
        Vector3::new((reading.x - self.x.y * y - self.x.z * z) / self.x.x, y, z)
    }

    /// By how much the readings of each axis move something of which the slopes along the frame are `slopes`.
    fn by_readings(&self, slopes: &Vector3<f64>) -> Vector3<f64> {
        let x = slopes.x / self.x.x;
        let y = (slopes.y - self.x.y * x) / self.y.y;
        Vector3::new(x, y, slopes.z - self.x.z * x - self.y.z * y)
    }
}

/// Square of the least cosine that axes on the way to a fit have.
const LEAST_COSINE: f64 = 1e-4;

fn acceleration(parts: &[Part], unknowns: &DVector<f64>, pose: &Pose) -> Vector3<f64> {
    let bias = three(parts, unknowns, Part::Bias) * BIAS_UNIT;
    let scale = three(parts, unknowns, Part::Scale);
    let axes = SensingAxes::new(&three(parts, unknowns, Part::NonOrthogonality));
    let raw = pose.mean * unknowns[0].exp() - bias;
    // What the recording has: an axis that reads (1 + k) times the truth is divided by it.
    axes.read_as(&Vector3::from_fn(|k, _| raw[k] / (1.0 + scale[k])))
}

/// |a| - g, m/s^2.
fn misfit(parts: &[Part], unknowns: &DVector<f64>, pose: &Pose, gravity: f64) -> f64 {
    acceleration(parts, unknowns, pose).norm() - gravity
}

/// How far a pose's reading is from where gravity has its size, at the usual scale, m/s^2.
fn distance(parts: &[Part], unknowns: &DVector<f64>, pose: &Pose, [gravity, usual_scale]: [f64; 2]) -> f64 {
    let scale = three(parts, unknowns, Part::Scale);
    let axes = SensingAxes::new(&three(parts, unknowns, Part::NonOrthogonality));
    let a = acceleration(parts, unknowns, pose);
    let size = a.norm();
    let by_readings = axes.by_readings(&(a / size));
    let slope = Vector3::from_fn(|k, _| by_readings[k] / (1.0 + scale[k])).norm() * unknowns[0].exp();
    (size - gravity) * usual_scale / slope
}

/// How large zero, scales and angles of a triad may be, in gravity, shares and radians: where poses do not tell them, as those about one
/// direction do not, they are no more than that. Poses that do tell them hardly notice.
const USUAL: f64 = 0.3;
/// The least that a pose is out by, in gravity.
const LEAST_ERROR: f64 = 1e-6;

struct Problem<'a> {
    parts: &'a [Part],
    poses: &'a [Pose],
    gravity: f64,
    usual_scale: f64,
    /// What every unknown is multiplied by to be as likely to be one as a pose is to be out by its error.
    beliefs: DVector<f64>,
    unknowns: DVector<f64>,
}

impl Problem<'_> {
    /// How far the poses are off, and behind them the unknowns.
    fn at(&self, unknowns: &DVector<f64>) -> DVector<f64> {
        let one = |pose: &Pose| distance(self.parts, unknowns, pose, [self.gravity, self.usual_scale]);
        let believed = unknowns.iter().zip(&self.beliefs).map(|(value, belief)| value * belief);
        DVector::from_iterator(self.poses.len() + self.beliefs.len(), self.poses.iter().map(one).chain(believed))
    }

    /// Central differences: all unknowns are of order one, and the function is smooth.
    fn slopes(&self) -> DMatrix<f64> {
        const STEP: f64 = 1e-5;
        let mut slopes = DMatrix::zeros(self.poses.len() + self.beliefs.len(), self.unknowns.len());
        for k in 0..self.unknowns.len() {
            let (mut up, mut down) = (self.unknowns.clone(), self.unknowns.clone());
            up[k] += STEP;
            down[k] -= STEP;
            slopes.set_column(k, &((self.at(&up) - self.at(&down)) / (2.0 * STEP)));
        }
        slopes
    }
}

impl levenberg_marquardt::LeastSquaresProblem<f64, Dyn, Dyn> for Problem<'_> {
    type ParameterStorage = Owned<f64, Dyn>;
    type ResidualStorage = Owned<f64, Dyn>;
    type JacobianStorage = Owned<f64, Dyn, Dyn>;

    fn set_params(&mut self, x: &DVector<f64>) {
        self.unknowns.copy_from(x);
    }

    fn params(&self) -> DVector<f64> {
        self.unknowns.clone()
    }

    fn residuals(&self) -> Option<DVector<f64>> {
        Some(self.at(&self.unknowns))
    }

    fn jacobian(&self) -> Option<DMatrix<f64>> {
        Some(self.slopes())
    }
}

/// Fit the common scale and the parts to the poses.
pub fn fit(parts: &[Part], poses: &[Pose], gravity: f64) -> Triad {
    let size: f64 = poses.iter().map(|p| p.mean.norm()).sum::<f64>() / poses.len() as f64;
    let mut unknowns = DVector::zeros(1 + parts.iter().map(|p| p.unknowns()).sum::<usize>());
    let usual_scale = gravity / size;
    unknowns[0] = usual_scale.ln();
    let error = (rms(&poses.iter().map(|p| p.error).collect::<Vec<f64>>()) * usual_scale).max(LEAST_ERROR * gravity);
    let mut beliefs = DVector::from_element(unknowns.len(), error / USUAL);
    // Of the common scale nothing is believed, and biases are of gravity's order.
    beliefs[0] = 0.0;
    if let Some(at) = place(parts, Part::Bias) {
        beliefs.rows_mut(at, 3).fill(error * BIAS_UNIT / (USUAL * gravity));
    }
    let start = Problem { parts, poses, gravity, usual_scale, beliefs, unknowns };
    let (solved, _) = levenberg_marquardt::LevenbergMarquardt::new().minimize(start);
    let residuals: Vec<f64> = solved.at(&solved.unknowns).iter().take(poses.len()).copied().collect();
    let slopes = solved.slopes();
    let free = (poses.len() as f64 - solved.unknowns.len() as f64).max(1.0);
    let variance = residuals.iter().map(|r| r * r).sum::<f64>() / free;
    let n = solved.unknowns.len();
    let inverse =
        slopes.tr_mul(&slopes).try_inverse().unwrap_or_else(|| DMatrix::from_diagonal_element(n, n, f64::MAX));
    let slopes = slopes.rows(0, poses.len()).into_owned();
    let scale = solved.unknowns[0].exp();
    let misfits = poses.iter().map(|pose| misfit(parts, &solved.unknowns, pose, gravity)).collect();
    let leverages = slopes.row_iter().map(|row| (row * &inverse * row.transpose())[0]).collect();
    Triad {
        leverages,
        parts: parts.to_vec(),
        scale,
        usual_scale,
        unknowns: solved.unknowns,
        covariance: inverse * variance,
        residuals,
        misfits,
        slopes,
    }
}

/// Parts found, with the evidence for each, and the fits on the way.
pub struct Found {
    /// Fits: before anything was added, then after each step.
    pub fits: Vec<Triad>,
    /// Parts in the order they were added, with their evidence.
    pub added: Vec<(Part, f64)>,
    /// Evidence of the strongest part refused.
    pub refused: f64,
    /// Other sets that are as likely as what was found, but for odds of twenty.
    pub rivals: Vec<Vec<Part>>,
}

/// Forward search from the parts the simulation has. A part may be needed only together with another (scale factors
/// show little while the axes' angles are wrong), so pairs and then all together are tried when nothing smaller convinces.
pub fn search(included: &[Part], poses: &[Pose], gravity: f64) -> Found {
    let mut fits = vec![fit(included, poses, gravity)];
    let mut added: Vec<(Part, f64)> = Vec::new();
    loop {
        let now = &fits[fits.len() - 1];
        let open: Vec<Part> = Part::ALL.into_iter().filter(|p| !now.parts.contains(p)).collect();
        let mut best: (f64, Vec<Part>) = (0.0, Vec::new());
        for set in subsets(&open) {
            let parts: Vec<Part> = now.parts.iter().chain(&set).copied().collect();
            if poses.len() < poses_needed(&parts) {
                continue;
            }
            let score = evidence(now, &fit(&parts, poses, gravity), &set);
            if score > best.0 && (best.0 < SCORE_MIN || set.len() == best.1.len()) {
                best = (score, set);
            }
        }
        if best.0 < SCORE_MIN {
            let named: Vec<Part> = added.iter().map(|(part, _)| *part).collect();
            return Found { rivals: rivals(&fits, &named, poses, gravity), fits, added, refused: best.0 };
        }
        for part in best.1 {
            let mut parts = fits[fits.len() - 1].parts.clone();
            parts.push(part);
            added.push((part, best.0));
            fits.push(fit(&parts, poses, gravity));
        }
    }
}

/// Sets that are as likely as the named, none of them a part of the other.
fn rivals(fits: &[Triad], named: &[Part], poses: &[Pose], gravity: f64) -> Vec<Vec<Part>> {
    const EQUAL: f64 = 6.0;
    let (bare, Some(last)) = (&fits[0], fits.last().filter(|_| !named.is_empty())) else { return Vec::new() };
    let best = evidence(bare, last, named);
    let within = |one: &[Part], other: &[Part]| one.iter().all(|part| other.contains(part));
    let open: Vec<Part> = Part::ALL.into_iter().filter(|p| !bare.parts.contains(p)).collect();
    let rival = |set: &Vec<Part>| {
        let parts = [&bare.parts[..], set].concat();
        !within(set, named)
            && !within(named, set)
            && poses.len() >= poses_needed(&parts)
            && evidence(bare, &fit(&parts, poses, gravity), set) > best - EQUAL
    };
    subsets(&open).into_iter().filter(rival).collect()
}

/// The parts of the fullest model that so many poses can carry, `None` where they cannot carry the common scale.
fn fullest(poses: usize) -> Option<&'static [Part]> {
    (0..=Part::ALL.len()).rev().map(|n| &Part::ALL[..n]).find(|parts| poses >= poses_needed(parts))
}

/// How many poses a model asks for.
fn poses_needed(parts: &[Part]) -> usize {
    1 + parts.iter().map(|p| p.unknowns()).sum::<usize>() + SPARE_POSES
}

/// All choices of one or more parts, smaller ones first.
fn subsets(parts: &[Part]) -> Vec<Vec<Part>> {
    let chosen = |mask: u32| parts.iter().enumerate().filter(move |(i, _)| mask >> i & 1 == 1).map(|(_, part)| *part);
    let mut sets: Vec<Vec<Part>> = (1..1 << parts.len()).map(|mask| chosen(mask).collect()).collect();
    sets.sort_by_key(Vec::len);
    sets
}

fn evidence(before: &Triad, after: &Triad, set: &[Part]) -> f64 {
    let n = after.residuals.len() as f64;
    let k: usize = set.iter().map(|p| p.unknowns()).sum();
    // What is left of few poses after many unknowns is small by fitting alone: only the poses to spare count.
    let free = n - after.unknowns.len() as f64;
    let fitted = (n / free).sqrt() * rms(&after.residuals).max(1e-12);
    let bare = (n / (free + k as f64)).sqrt() * rms(&before.residuals);
    2.0 * free * (bare / fitted).ln() - k as f64 * n.ln()
}

/// Analyse a case of static poses.
pub fn diagnose(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<(Answer, Plates), MeasuredError> {
    let gravity = gravity(case)?;
    let (poses, far_off) = without_blunders(poses(case, files)?, gravity);
    let found = search(&included(case)?, &poses, gravity);
    let remains = fullest(poses.len()).and_then(|parts| structure::structure(&fit(parts, &poses, gravity), &poses));
    let added = std::iter::once("as it stands").chain(found.added.iter().map(|(part, _)| part.id()));
    let plate = PosesPlate {
        added: added.map(str::to_owned).collect(),
        residuals: found.fits.iter().map(|fit| fit.misfits.clone()).collect(),
    };
    let seen = report::Seen { poses: &poses, far_off: &far_off, gravity, found: &found, remains };
    Ok((report::answer(case, &seen), Plates::Poses(plate)))
}

/// The size of gravity where the poses were held, m/s^2.
pub fn gravity(case: &MeasuredCase) -> Result<f64, MeasuredError> {
    let key = "recording.gravity_m_s2";
    case.number(key)?.filter(|g| *g > 0.0).ok_or_else(|| case.wrong(key, "a number above zero"))
}

/// The parts that the simulation has.
pub fn included(case: &MeasuredCase) -> Result<Vec<Part>, MeasuredError> {
    let mut parts = Vec::new();
    for token in case.includes.iter().filter(|t| t.as_str() != "ideal_triad" && t.as_str() != "constant") {
        let part = Part::ALL
            .into_iter()
            .find(|p| p.id() == token || (token == "misalignment" && *p == Part::NonOrthogonality));
        parts.push(part.ok_or_else(|| {
            case.wrong("simulation.includes", "some of ideal_triad, bias, scale_factor, non_orthogonality")
        })?);
    }
    Ok(parts)
}

/// The static poses of the case's recording.
pub fn poses(case: &MeasuredCase, files: &BTreeMap<String, String>) -> Result<Vec<Pose>, MeasuredError> {
    let name = case.text("recording.file")?;
    let columns = texts(&case.table, "recording.columns");
    let rows = still::read(&name, &files[&name], columns.as_deref())?;
    let mut poses = find_poses(&rows);
    let zero = zero(case, &poses)?;
    for pose in &mut poses {
        pose.mean -= Vector3::repeat(zero);
    }
    if poses.len() < POSES_MIN {
        return Err(MeasuredError::TooFew { what: "static poses", found: poses.len(), expected: POSES_MIN });
    }
    Ok(poses)
}

/// The reading at zero acceleration that the simulation takes: what the case says, or the usual one nearest to the middle
/// of what was read.
fn zero(case: &MeasuredCase, poses: &[Pose]) -> Result<f64, MeasuredError> {
    if let Some(zero) = case.number("recording.zero_counts")? {
        return Ok(zero);
    }
    let range = |axis: usize| {
        poses.iter().fold((f64::INFINITY, f64::NEG_INFINITY), |(l, h), p| (l.min(p.mean[axis]), h.max(p.mean[axis])))
    };
    let middle = (0..3).map(range).map(|(low, high)| 0.5 * (low + high)).sum::<f64>() / 3.0;
    let half = (0..3).map(range).map(|(low, high)| 0.5 * (high - low)).fold(0.0, f64::max);
    // Readings on both sides of nothing have it as their zero.
    if middle.abs() < NEAR_ZERO * half {
        return Ok(0.0);
    }
    Ok(ZEROS.into_iter().min_by(|a, b| (a - middle).abs().total_cmp(&(b - middle).abs())).unwrap_or(0.0))
}
