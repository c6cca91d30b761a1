//! The search over sets of effects, by evidence.
//!
//! A bank holds every family (a catalogue effect, or an open form) at all its starting points, whitened for the noise
//! at hand. Sets grow from nothing in a beam, are refined in their nonlinear parameters, and are then weighed each with
//! the noise fitted to its own residual: slow noise and a slow effect compete on equal terms. It decides nothing.

mod entry;
mod grow;
mod imitate;
mod peaks;
mod refine;
mod volume;
mod weigh;

use nalgebra::{DMatrix, DVector};

pub use entry::{Entry, Family};
pub use grow::{best_of_entry, grow};
pub use imitate::imitation;
pub use refine::refine;
pub use weigh::{Left, Weighed, fit_noise, height, residual, weigh_with_own_noise};

use super::axes;
use super::catalogue::{Shape, Theta};
use super::design::{Chosen, Column, Frame, Normal, OnAxis};
use super::scene::{Axes, Scene};
use crate::math::shared_work;

/// Effects in a set at most.
pub const SET_MAX: usize = 4;
/// Sets kept while they grow.
const BEAM: usize = 4;
/// Sets weighed each with its own noise.
const FINALISTS: usize = 10;

/// Log prior odds of every member beyond the second: three things left out at once are rarer than their odds one by one say,
/// and three effects together imitate nearly anything.
const CROWD: f64 = -4.0;

fn crowd(members: usize) -> f64 {
    CROWD * members.saturating_sub(2) as f64
}

/// A family at one point, whitened.
#[derive(Clone)]
pub struct Whitened {
    theta: Theta,
    columns: Vec<Column>,
    fixed: bool,
}

/// Every entry, whitened for one noise.
pub struct Bank<'a> {
    /// The entries.
    pub entries: &'a [Entry],
    points: Vec<Vec<Whitened>>,
    /// The normal equations of each point alone.
    alone: Vec<Vec<Normal>>,
}

/// A bank, and what its points have in common with data.
pub struct Seen<'a> {
    bank: &'a Bank<'a>,
    alone: Vec<Vec<Normal>>,
}

/// Shapes at their points, whitened all at once.
fn whiten_all(frame: &Frame, points: &[(Theta, &Shape, &Entry)]) -> Vec<Whitened> {
    let shapes: Vec<Vec<Vec<OnAxis>>> =
        points.iter().map(|(_, shape, entry)| shape.on_axes(&entry.sizes, 1.0)).collect();
    let counts: Vec<usize> = shapes.iter().map(Vec::len).collect();
    let mut columns = frame.columns(&shapes.into_iter().flatten().collect::<Vec<Vec<OnAxis>>>()).into_iter();
    let whitened = |((theta, shape, entry), count): (&(Theta, &Shape, &Entry), usize)| {
        Whitened::new(*theta, shape, columns.by_ref().take(count).collect(), entry, 1.0)
    };
    points.iter().zip(counts).map(whitened).collect()
}

fn whiten(frame: &Frame, theta: Theta, shape: &Shape, entry: &Entry, scale: f64) -> Whitened {
    let columns = match shape {
        Shape::Columns(raws) => {
            raws.iter().zip(&entry.sizes).map(|(raw, size)| frame.column(raw, scale * size)).collect()
        }
        Shape::Scalar { .. } | Shape::Several(_) | Shape::Fixed(_) => {
            frame.columns(&shape.on_axes(&entry.sizes, scale))
        }
    };
    Whitened::new(theta, shape, columns, entry, scale)
}

impl Whitened {
    fn new(theta: Theta, shape: &Shape, columns: Vec<Column>, entry: &Entry, scale: f64) -> Self {
        let fixed = matches!(shape, Shape::Fixed(_));
        let priors = entry.means.iter().zip(&entry.sizes).map(|(mean, size)| mean / (scale * size));
        let columns =
            if fixed { columns } else { columns.into_iter().zip(priors).map(|(c, mean)| c.about(mean)).collect() };
        Self { theta, columns, fixed }
    }
}

impl<'a> Bank<'a> {
    /// Whiten all.
    pub fn new(frame: &Frame, entries: &'a [Entry]) -> Self {
        let points: Vec<(Theta, &Shape, &Entry)> =
            entries.iter().flat_map(|e| e.points.iter().map(move |(theta, shape)| (*theta, shape, e))).collect();
        let mut whitened = whiten_all(frame, &points).into_iter();
        let points: Vec<Vec<Whitened>> =
            entries.iter().map(|e| whitened.by_ref().take(e.points.len()).collect()).collect();
        let alone = shared_work::map(&points, |points| points.iter().map(|p| Normal::of(&p.columns)).collect());
        Self { entries, points, alone }
    }

    /// The same before data.
    pub fn before(&self, data: &Column) -> Seen<'_> {
        let entries: Vec<usize> = (0..self.points.len()).collect();
        let before = |index: &usize| {
            let points = self.points[*index].iter().zip(&self.alone[*index]);
            points.map(|(p, alone)| alone.before(&p.columns, data)).collect()
        };
        Seen { bank: self, alone: shared_work::map(&entries, before) }
    }
}

/// One family of a set at its nonlinear parameters.
#[derive(Clone)]
pub struct Member {
    /// Place in the entries.
    pub entry: usize,
    /// Axes it acts on, where an open form was narrowed to one.
    pub axis: Option<usize>,
    /// What its prior sizes are multiplied by.
    pub scale: f64,
    /// Nonlinear parameters.
    pub theta: Theta,
    /// Log share of their prior that their posterior fills.
    pub log_occam: f64,
    /// Standard errors of the nonlinear parameters.
    pub theta_sigma: Theta,
    point: Whitened,
}

/// A set of families.
#[derive(Clone, Default)]
pub struct Set {
    /// Its members, in order of entries.
    pub members: Vec<Member>,
    /// Log evidence against nothing at the noise of the search, with all priors.
    pub score: f64,
}

impl Set {
    /// Key: which entries.
    pub fn key(&self) -> Vec<usize> {
        let mut key: Vec<usize> = self.members.iter().map(|m| m.entry).collect();
        key.sort_unstable();
        key
    }

    /// Columns chosen, for more to be added.
    pub fn chosen(&self, frame: &Frame) -> Chosen<'_> {
        let linear = self.members.iter().filter(|m| !m.point.fixed).flat_map(|m| &m.point.columns).collect();
        let fixed: Vec<&Column> =
            self.members.iter().filter(|m| m.point.fixed).flat_map(|m| &m.point.columns).collect();
        Chosen::new(frame, linear, &fixed)
    }

    /// The linear columns alone chosen, beside data in which they are expected to be nothing.
    pub fn chosen_about_nothing(&self, frame: &Frame) -> Chosen<'_> {
        let linear = self.members.iter().filter(|m| !m.point.fixed).flat_map(|m| &m.point.columns).collect();
        Chosen::about_nothing(frame, linear)
    }

    /// The set without one of its members.
    pub fn without(&self, i: usize) -> Set {
        let mut set = Set { score: 0.0, ..self.clone() };
        set.members.remove(i);
        set
    }

    /// The set and one member more, by which so much log score is gained.
    pub fn joined_by(mut self, member: Member, gain: f64) -> Set {
        let before = self.members.len();
        self.members.push(member);
        self.members.sort_by_key(|m| m.entry);
        self.score += gain + crowd(before + 1) - crowd(before);
        self
    }

    /// Log evidence and priors at the noise of the frame.
    pub fn weigh(&mut self, frame: &Frame, entries: &[Entry]) {
        let priors: f64 = self.members.iter().map(|m| entries[m.entry].log_prior + m.log_occam).sum();
        self.score = self.chosen(frame).log_evidence + priors + crowd(self.members.len());
    }

    /// Whiten the members again for another noise.
    pub fn rewhiten(&mut self, scene: &Scene, frame: &Frame, entries: &[Entry]) {
        for m in &mut self.members {
            if let Some(point) = point_at(scene, frame, &entries[m.entry], m, &m.theta) {
                m.point = point;
            }
        }
    }

    /// The same with every prior size so many times the usual one, or the one at which it was found where that is larger.
    pub fn with_prior_sizes(&self, times: f64) -> Self {
        let mut other = self.clone();
        for m in other.members.iter_mut().filter(|m| !m.point.fixed) {
            let scale = times * m.scale.max(1.0);
            m.point.columns = m.point.columns.iter().map(|column| column.times(scale / m.scale)).collect();
            m.scale = scale;
        }
        other
    }

    /// Mean and covariance of all linear coefficients in their own units, members in order.
    pub fn coefficients(&self, frame: &Frame, entries: &[Entry]) -> (DVector<f64>, DMatrix<f64>) {
        let sizes: Vec<f64> = self.members.iter().filter(|m| !m.point.fixed).flat_map(|m| m.sizes(entries)).collect();
        let (mean, covariance) = self.chosen(frame).posterior();
        let scale = DMatrix::from_diagonal(&DVector::from_vec(sizes));
        (&scale * mean, &scale * covariance * &scale)
    }

    /// Member `i` with its coefficients at this noise, whitened: at the windows, and what flips see of it.
    pub fn whitened(&self, i: usize, frame: &Frame) -> Column {
        let (mean, _) = self.chosen(frame).posterior();
        let first: usize = self.members[..i].iter().map(Member::linear).sum();
        let point = &self.members[i].point;
        let times = |j: usize| if point.fixed { 1.0 } else { mean[first + j] };
        let columns = point.columns.iter().enumerate();
        columns.fold(Column::default(), |sum, (j, column)| sum.less(column, -times(j)))
    }

    /// The series of every member at the windows, ng, with the coefficients at this noise.
    pub fn contributions(&self, scene: &Scene, frame: &Frame, entries: &[Entry]) -> Vec<Axes> {
        let (mean, _) = self.coefficients(frame, entries);
        let mut next = 0;
        let n = scene.schedule.len();
        self.members
            .iter()
            .map(|m| {
                let mut sum = axes::nothing(n);
                let Some(shape) = shape_at(scene, &entries[m.entry], &m.theta) else { return sum };
                let columns = shape.columns();
                let picked: Vec<usize> = m.axis.map_or_else(|| (0..columns.len()).collect(), |a| vec![a]);
                for j in picked {
                    let factor = if m.point.fixed { 1.0 } else { mean[next] };
                    next += usize::from(!m.point.fixed);
                    axes::add_regressor(&mut sum, &columns[j], factor);
                }
                sum
            })
            .collect()
    }
}

impl Member {
    /// Linear coefficients this member has.
    pub fn linear(&self) -> usize {
        if self.point.fixed { 0 } else { self.point.columns.len() }
    }

    /// Prior sizes of its linear coefficients.
    pub fn sizes(&self, entries: &[Entry]) -> Vec<f64> {
        let sizes = &entries[self.entry].sizes;
        let picked = self.axis.map_or_else(|| sizes.clone(), |a| vec![sizes[a]]);
        picked.iter().map(|size| self.scale * size).collect()
    }
}

fn shape_at(scene: &Scene, entry: &Entry, theta: &Theta) -> Option<Shape> {
    match entry.effect() {
        Some(effect) => (effect.signature)(scene, theta),
        None => entry.points.get(theta[0] as usize).map(|(_, shape)| shape.clone()),
    }
}

fn point_at(scene: &Scene, frame: &Frame, entry: &Entry, m: &Member, theta: &Theta) -> Option<Whitened> {
    let known = entry.points.iter().find(|(t, _)| t == theta);
    let mut point = match known {
        Some((_, shape)) => whiten(frame, *theta, shape, entry, m.scale),
        None => whiten(frame, *theta, &shape_at(scene, entry, theta)?, entry, m.scale),
    };
    if let Some(axis) = m.axis {
        point.columns = vec![point.columns.swap_remove(axis)];
    }
    Some(point)
}

/// Sorts sets by their score and keeps the best of those that have the same members.
pub fn distinct(sets: &mut Vec<Set>) {
    sets.sort_by(|a, b| b.score.total_cmp(&a.score));
    retain_first(sets, Set::key);
}

/// Keeps the first of those that have the same members.
pub fn retain_first<T>(sets: &mut Vec<T>, key: impl Fn(&T) -> Vec<usize>) {
    let mut keys: Vec<Vec<usize>> = Vec::new();
    sets.retain(|set| {
        let key = key(set);
        let new = !keys.contains(&key);
        keys.push(key);
        new
    });
}
