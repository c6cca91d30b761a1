//! One satellite's arc: positions by integration, their partial derivatives by variational equations, and the fit of
//! the initial state with any terms' coefficients by Gauss-Newton.
//!
//! A step never straddles an edge of the shadow. Not here: which terms to fit (see `search`).

use nalgebra::{DMatrix, DVector, Matrix6, Vector3};

use super::OrbitError;
use super::forces::{Baseline, Environment, Moment, Term, sunlit};
use super::sp3::Track;
use crate::diagnose::measured::spread::median;
use crate::physics::earth_orientation::lagrange_weights;
use crate::physics::integrator::{Collocation, State, Step};

/// Six nodes: order 12.
const STAGES: usize = 6;
/// Steps are no longer than this part of a revolution.
const STEPS_PER_REVOLUTION: f64 = 40.0;
/// Looked at for shadow inside a step, at this many points: a crossing of the penumbra alone is longer.
const SHADOW_LOOKS: usize = 24;
/// A shadow's edge is placed to this, s: at 1e-7 m/s^2 that is 1e-9 m/s.
const EDGE_S: f64 = 0.01;
/// Up to this angle between two points the polynomial through nine gives the velocity to a part in 1e4.
const SMOOTH_RAD: f64 = 0.35;
const ITERATIONS_MAX: usize = 16;
/// A first fit begins with this part of a revolution and grows by this factor, so that a rough first state is enough.
const FIRST_REVOLUTIONS: f64 = 0.3;
const GROWTH: f64 = 4.0;
/// Fewest epochs of such a fit.
const FIRST_EPOCHS: usize = 6;
/// Fewest epochs of an arc, or of a part of one that is to say something of the rest: twice as many coordinates as there may be unknowns.
pub(super) const EPOCHS_MIN: usize = 12;
/// Positions that change by less than this between iterations have converged, m.
const CONVERGED_M: f64 = 1e-4;

/// Observed positions of one satellite in the inertial frame.
#[derive(Debug, Clone)]
pub struct Arc {
    /// Such as `G05`.
    pub id: String,
    /// Seconds after the recording's origin.
    pub t_s: Vec<f64>,
    /// Inertial positions, m.
    pub observed_m: Vec<Vector3<f64>>,
    /// How many of them, from the first, are fitted; the rest are predicted.
    pub fitted: usize,
    /// Epochs not usable.
    pub masked: usize,
    start: State,
    step_s: f64,
}

/// A velocity step at an instant.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct Impulse {
    /// Seconds after the recording's origin.
    pub at_s: f64,
    /// Inertial, m/s.
    pub dv_m_s: Vector3<f64>,
}

/// What a fit leaves.
#[derive(Debug, Clone)]
pub struct ArcFit {
    /// State at the first epoch.
    pub start: State,
    /// The terms fitted, in order, with their coefficients.
    pub coefficients: Vec<(Term, [f64; 2])>,
    /// Observed minus computed, m, every epoch.
    pub residuals_m: Vec<Vector3<f64>>,
    /// Partials of every position (rows 3i..3i+3): six for the state, then those of `columns`.
    pub partials: DMatrix<f64>,
    /// The term each further column belongs to, scaled by [`Term::scale`].
    pub columns: Vec<(Term, usize)>,
    /// Velocity steps in the model, in order of time; the four columns of each (three of velocity, one of its instant) stand after all others.
    pub impulses: Vec<Impulse>,
    /// State at each epoch against the state at the first.
    pub transitions: Vec<Matrix6<f64>>,
}

impl Arc {
    /// From an Earth-fixed track; the first `fit_s` seconds of the recording are for the fit.
    pub fn new(track: &Track, environment: &Environment, fit_s: f64) -> Result<Self, OrbitError> {
        let inertial = |(t, r): (&f64, &Vector3<f64>)| environment.rotation.to_inertial(*t, r);
        let observed_m: Vec<_> = track.t_s.iter().zip(&track.fixed_m).map(inertial).collect();
        let fitted = track.t_s.partition_point(|t| *t <= fit_s);
        if fitted < EPOCHS_MIN {
            return Err(OrbitError::TooFew { id: track.id.clone(), found: fitted, expected: EPOCHS_MIN });
        }
        let start = first_state(&track.t_s, &observed_m, environment.field.gm_m3_s2());
        // The fastest part of the orbit sets the step.
        let lowest = observed_m.iter().map(|r| r.norm()).fold(f64::INFINITY, f64::min);
        let rate = (environment.field.gm_m3_s2() / lowest.powi(3)).sqrt();
        let step_s = std::f64::consts::TAU / rate / STEPS_PER_REVOLUTION;
        let (id, masked) = (track.id.clone(), track.masked);
        Ok(Self { id, t_s: track.t_s.clone(), observed_m, fitted, masked, start, step_s })
    }

    /// Leaves epochs out, as masked.
    pub fn leave_out(&mut self, epochs: &[usize]) {
        let kept = |i: &usize| !epochs.contains(i);
        self.fitted = (0..self.fitted).filter(kept).count();
        self.t_s = (0..self.t_s.len()).filter(kept).map(|i| self.t_s[i]).collect();
        self.observed_m = (0..self.observed_m.len()).filter(kept).map(|i| self.observed_m[i]).collect();
        self.masked += epochs.len();
    }

    /// Lowest height over the equatorial radius, m.
    pub fn height_min_m(&self) -> f64 {
        let lowest = self.observed_m.iter().map(|r| r.norm()).fold(f64::INFINITY, f64::min);
        lowest - crate::physics::third_body::EARTH_RADIUS_M
    }

    /// Height over the equatorial radius that half of the positions are above, m.
    pub fn height_median_m(&self) -> f64 {
        median(self.observed_m.iter().map(|r| r.norm())) - crate::physics::third_body::EARTH_RADIUS_M
    }

    /// Fit the state and the coefficients of `active` (and the velocity step of `from`, where it has one), and give partials
    /// for `active` and `candidates`. `from` starts the iteration (an earlier fit of the same arc).
    pub fn fit(
        &self,
        environment: &Environment,
        baseline: &Baseline,
        active: &[Term],
        candidates: &[Term],
        from: Option<&ArcFit>,
    ) -> ArcFit {
        let mut fit = self.first_guess(active, &[], from);
        if from.is_none() {
            // The state alone, over a growing part of the arc.
            let mut bare = self.first_guess(&[], &[], None);
            let mut span_s = FIRST_REVOLUTIONS * STEPS_PER_REVOLUTION * self.step_s;
            while span_s < self.t_s[self.fitted - 1] - self.t_s[0] {
                let epochs =
                    self.t_s.partition_point(|t| *t <= self.t_s[0] + span_s).max(FIRST_EPOCHS).min(self.fitted);
                self.iterate(environment, baseline, &mut bare, epochs);
                span_s *= GROWTH;
            }
            fit.start = bare.start;
        }
        self.iterate(environment, baseline, &mut fit, self.fitted);
        // The candidates' columns are wanted once only, along the orbit that was found.
        fit.columns = self.first_guess(active, candidates, None).columns;
        self.propagate(environment, baseline, &mut fit, self.t_s.len());
        fit
    }

    /// Gauss-Newton over the first epochs.
    fn iterate(&self, environment: &Environment, baseline: &Baseline, fit: &mut ArcFit, epochs: usize) {
        let mut best: Option<(f64, ArcFit)> = None;
        for _ in 0..ITERATIONS_MAX {
            self.propagate(environment, baseline, fit, epochs);
            let rms = fit.rms_m(0..epochs);
            if best.as_ref().is_none_or(|(least, _)| rms < *least) {
                best = Some((rms, fit.clone()));
            }
            let design = fit.partials.view((0, 0), (3 * epochs, fit.partials.ncols())).into_owned();
            let residuals =
                DVector::from_iterator(3 * epochs, fit.residuals_m[..epochs].iter().flat_map(|r| [r.x, r.y, r.z]));
            let Some(step) = solve(&design, &residuals) else { break };
            let moved_m = (&design * &step).amax();
            if !moved_m.is_finite() {
                break;
            }
            self.apply(fit, &step);
            if moved_m < CONVERGED_M {
                return;
            }
        }
        // Not converged: the best that was seen, rather than wherever the last step went.
        if let Some((_, seen)) = best {
            *fit = seen;
        }
    }

    fn first_guess(&self, active: &[Term], candidates: &[Term], from: Option<&ArcFit>) -> ArcFit {
        let earlier = |term: &Term| {
            let found = from.and_then(|fit| fit.coefficients.iter().find(|(t, _)| t == term));
            (*term, found.map_or([0.0; 2], |(_, value)| *value))
        };
        let of = |term: &Term| (0..term.parameters().len()).map(|k| (*term, k)).collect::<Vec<_>>();
        let others = candidates.iter().filter(|term| !active.contains(term));
        ArcFit {
            start: from.map_or(self.start, |fit| fit.start),
            coefficients: active.iter().map(earlier).collect(),
            residuals_m: Vec::new(),
            partials: DMatrix::zeros(0, 0),
            columns: active.iter().chain(others).flat_map(of).collect(),
            impulses: from.map_or_else(Vec::new, |fit| fit.impulses.clone()),
            transitions: Vec::new(),
        }
    }

    fn apply(&self, fit: &mut ArcFit, step: &DVector<f64>) {
        fit.start.r += Vector3::new(step[0], step[1], step[2]);
        fit.start.v += Vector3::new(step[3], step[4], step[5]);
        let mut next = 6;
        for (term, value) in &mut fit.coefficients {
            for v in value.iter_mut().take(term.parameters().len()) {
                *v += step[next] * term.scale();
                next += 1;
            }
        }
        let (first, last) = (self.t_s[1], self.t_s[self.fitted - 2]);
        for impulse in &mut fit.impulses {
            impulse.dv_m_s += Vector3::new(step[next], step[next + 1], step[next + 2]);
            impulse.at_s = (impulse.at_s + step[next + 3].clamp(-7_200.0, 7_200.0)).clamp(first, last);
            next += 4;
        }
        fit.impulses.sort_by(|a, b| a.at_s.total_cmp(&b.at_s));
    }

    /// Integrate over the first epochs, filling residuals and partials.
    fn propagate(&self, environment: &Environment, baseline: &Baseline, fit: &mut ArcFit, epochs: usize) {
        let flight = Flight { environment, baseline, gauss: Collocation::gauss(STAGES) };
        let columns = 6 + fit.columns.len() + 4 * fit.impulses.len();
        let impulses = fit.impulses.clone();
        let zero = State { r: Vector3::zeros(), v: Vector3::zeros() };
        let mut carried = vec![zero; columns];
        for axis in 0..3 {
            carried[axis].r[axis] = 1.0;
            carried[axis + 3].v[axis] = 1.0;
        }
        fit.partials = DMatrix::zeros(3 * epochs, columns);
        fit.residuals_m = Vec::with_capacity(epochs);
        fit.transitions = Vec::with_capacity(epochs);
        let (mut state, mut t) = (fit.start, self.t_s[0]);
        for (i, &epoch) in self.t_s[..epochs].iter().enumerate() {
            let begun = t;
            for (k, impulse) in impulses.iter().enumerate().filter(|(_, one)| one.at_s > begun && one.at_s <= epoch) {
                state = self.advance(&flight, (t, impulse.at_s), state, fit, &mut carried);
                let first = carried.len() - 4 * (impulses.len() - k);
                kick(impulse, &mut state, &mut carried[first..first + 4]);
                t = impulse.at_s;
            }
            state = self.advance(&flight, (t, epoch), state, fit, &mut carried);
            t = epoch;
            fit.residuals_m.push(self.observed_m[i] - state.r);
            for (k, column) in carried.iter().enumerate() {
                fit.partials.fixed_view_mut::<3, 1>(3 * i, k).copy_from(&column.r);
            }
            let of = |row: usize, k: usize| if row < 3 { carried[k].r[row] } else { carried[k].v[row - 3] };
            fit.transitions.push(Matrix6::from_fn(of));
        }
    }

    fn advance(
        &self,
        flight: &Flight,
        (from, to): (f64, f64),
        mut state: State,
        fit: &ArcFit,
        carried: &mut [State],
    ) -> State {
        let parts = ((to - from) / self.step_s).ceil().max(1.0);
        let h = (to - from) / parts;
        for part in 0..parts as usize {
            if h > 0.0 {
                state = flight.advance(from + part as f64 * h, state, h, fit, carried);
            }
        }
        state
    }
}

/// A velocity step, and what it does to its columns: later by dt, it leaves the satellite `dv dt` behind.
fn kick(impulse: &Impulse, state: &mut State, carried: &mut [State]) {
    state.v += impulse.dv_m_s;
    for axis in 0..3 {
        carried[axis].v[axis] = 1.0;
    }
    carried[3].r = -impulse.dv_m_s;
}

/// Positions and velocities of a satellite that starts in `start` at the first of `t_s` and feels a baseline and further
/// terms: a recording made to order. `kick` is a velocity step on the way.
pub fn fly(
    environment: &Environment,
    baseline: &Baseline,
    terms: &[(Term, [f64; 2])],
    start: State,
    t_s: &[f64],
    kick: Option<Impulse>,
) -> Vec<State> {
    let flight = Flight { environment, baseline, gauss: Collocation::gauss(STAGES) };
    let fit = ArcFit {
        start,
        coefficients: terms.to_vec(),
        residuals_m: Vec::new(),
        partials: DMatrix::zeros(0, 0),
        columns: Vec::new(),
        impulses: Vec::new(),
        transitions: Vec::new(),
    };
    let rate = (environment.field.gm_m3_s2() / start.r.norm().powi(3)).sqrt();
    // Half the analyser's step: the two must agree because both are right, not because they are the same.
    let step_s = 0.5 * std::f64::consts::TAU / rate / STEPS_PER_REVOLUTION;
    let (mut state, mut t) = (start, t_s[0]);
    let mut out = Vec::with_capacity(t_s.len());
    let to = |state: &mut State, t: &mut f64, end: f64| {
        let parts = ((end - *t) / step_s).ceil().max(1.0);
        let h = (end - *t) / parts;
        for part in 0..parts as usize {
            if h > 0.0 {
                *state = flight.advance(*t + part as f64 * h, *state, h, &fit, &mut []);
            }
        }
        *t = end;
    };
    for &epoch in t_s {
        if let Some(kick) = kick.filter(|kick| kick.at_s > t && kick.at_s <= epoch) {
            to(&mut state, &mut t, kick.at_s);
            state.v += kick.dv_m_s;
        }
        to(&mut state, &mut t, epoch);
        out.push(state);
    }
    out
}

impl ArcFit {
    /// Rms of the 3-D residual over a range of epochs, m.
    pub fn rms_m(&self, epochs: std::ops::Range<usize>) -> f64 {
        let n = epochs.len().max(1) as f64;
        let rms = (self.residuals_m[epochs].iter().map(|r| r.norm_squared()).sum::<f64>() / n).sqrt();
        // An orbit that could not be followed is infinitely far off.
        if rms.is_nan() { f64::INFINITY } else { rms }
    }

    /// Places in `partials` of the columns of all that was fitted, but for terms that `keep` leaves out: the state, the velocity steps, the
    /// coefficients.
    pub(super) fn fitted_columns(&self, keep: impl Fn(Term) -> bool) -> Vec<usize> {
        let active: usize = self.coefficients.iter().map(|(term, _)| term.parameters().len()).sum();
        let mut used: Vec<usize> = (0..6).collect();
        used.extend(self.partials.ncols() - 4 * self.impulses.len()..self.partials.ncols());
        used.extend((0..active).filter(|j| keep(self.columns[*j].0)).map(|j| 6 + j));
        used
    }

    /// How many numbers were fitted.
    pub fn unknowns(&self) -> usize {
        self.fitted_columns(|_| true).len()
    }

    /// Coefficients of a fitted term.
    pub fn coefficient(&self, term: Term) -> Option<[f64; 2]> {
        self.coefficients.iter().find(|(t, _)| *t == term).map(|(_, value)| *value)
    }
}

/// Least squares by QR on normalised columns; none if one is nothing beside those before it.
pub(super) fn solve(design: &DMatrix<f64>, y: &DVector<f64>) -> Option<DVector<f64>> {
    let norms: Vec<f64> = design.column_iter().map(|c| c.norm().max(1e-300)).collect();
    let mut scaled = design.clone();
    for (mut column, norm) in scaled.column_iter_mut().zip(&norms) {
        column /= *norm;
    }
    let qr = scaled.qr();
    let step = qr.r().solve_upper_triangular(&qr.q().tr_mul(y))?;
    Some(DVector::from_iterator(norms.len(), step.iter().zip(&norms).map(|(s, n)| s / n)))
}

struct Flight<'a> {
    environment: &'a Environment,
    baseline: &'a Baseline,
    gauss: Collocation,
}

impl Flight<'_> {
    fn acceleration(&self, t_s: f64, state: &State, coefficients: &[(Term, [f64; 2])]) -> Vector3<f64> {
        let moment = Moment::new(self.environment, t_s, state);
        let mut sum = moment.baseline(self.environment, self.baseline);
        for (term, value) in coefficients {
            let [a, b] = moment.columns(self.environment, *term);
            sum += a * value[0] + b * value[1];
        }
        sum
    }

    fn step(&self, t_s: f64, state: State, h_s: f64, coefficients: &[(Term, [f64; 2])]) -> Step {
        self.gauss.step(t_s, state, h_s, &mut |t, s| self.acceleration(t, s, coefficients))
    }

    /// Advance by `h_s`, splitting at the edges of the shadow.
    fn advance(&self, t_s: f64, state: State, h_s: f64, fit: &ArcFit, carried: &mut [State]) -> State {
        let whole = self.step(t_s, state, h_s, &fit.coefficients);
        let edges = self.shadow_edges(&whole);
        if edges.is_empty() {
            self.carry(&whole, fit, carried);
            return whole.end;
        }
        let mut now = state;
        let mut from = 0.0;
        for to in edges.into_iter().chain([h_s]) {
            let step = self.step(t_s + from, now, to - from, &fit.coefficients);
            self.carry(&step, fit, carried);
            (now, from) = (step.end, to);
        }
        now
    }

    fn gradients(&self, step: &Step) -> Vec<nalgebra::Matrix3<f64>> {
        let pole = Moment::new(self.environment, step.t_s, &step.start).pole();
        step.inner.iter().map(|state| self.environment.field.gradient(&state.r, &pole)).collect()
    }

    fn carry(&self, step: &Step, fit: &ArcFit, carried: &mut [State]) {
        if carried.is_empty() {
            return;
        }
        let gradient = self.gradients(step);
        let moments: Vec<Moment> = self
            .gauss
            .nodes()
            .iter()
            .zip(&step.inner)
            .map(|(c, state)| Moment::new(self.environment, step.t_s + c * step.h_s, state))
            .collect();
        let quiet = [Vector3::zeros(); STAGES];
        for (k, column) in carried.iter_mut().enumerate() {
            let forcing: Vec<Vector3<f64>> = match k.checked_sub(6).filter(|j| *j < fit.columns.len()) {
                None => quiet.to_vec(),
                Some(j) => {
                    let (term, part) = fit.columns[j];
                    moments.iter().map(|m| m.columns(self.environment, term)[part] * term.scale()).collect()
                }
            };
            *column = self.gauss.step_linear(step.h_s, *column, &gradient, &forcing);
        }
    }

    /// Instants inside a step at which full light or full shadow begins or ends, s after its start.
    fn shadow_edges(&self, step: &Step) -> Vec<f64> {
        let light = |s: f64| {
            let r = self.gauss.position_in(step, s / step.h_s);
            sunlit(&r, &self.environment.bodies.at(step.t_s + s))
        };
        let grade = |light: f64| if light >= 1.0 { 2 } else { i32::from(light > 0.0) };
        let mut edges = Vec::new();
        let mut looked = 0.0;
        let mut last = grade(light(0.0));
        for i in 1..=SHADOW_LOOKS {
            let s = step.h_s * i as f64 / SHADOW_LOOKS as f64;
            let now = grade(light(s));
            if now != last {
                locate_edges(&light, &grade, (looked, last), (s, now), &mut edges);
            }
            (looked, last) = (s, now);
        }
        edges.retain(|s| *s > 10.0 * EDGE_S && *s < step.h_s - 10.0 * EDGE_S);
        edges
    }
}

/// Bisect between two instants of different grade; a jump over a grade holds two edges.
fn locate_edges(
    light: &dyn Fn(f64) -> f64,
    grade: &dyn Fn(f64) -> i32,
    from: (f64, i32),
    to: (f64, i32),
    edges: &mut Vec<f64>,
) {
    if to.0 - from.0 < EDGE_S {
        edges.push(0.5 * (from.0 + to.0));
        return;
    }
    let middle = (0.5 * (from.0 + to.0), grade(light(0.5 * (from.0 + to.0))));
    if middle.1 != from.1 {
        locate_edges(light, grade, from, middle, edges);
    }
    if middle.1 != to.1 {
        locate_edges(light, grade, middle, to, edges);
    }
}

/// A first state from the positions alone: the polynomial through the first points, its slope as the velocity; where
/// the first points are too far apart, the velocity that two-body motion needs to reach the second.
fn first_state(t_s: &[f64], r_m: &[Vector3<f64>], gm: f64) -> State {
    let mut n = 1;
    let spacing = t_s[1] - t_s[0];
    while n < 9.min(t_s.len() - 1) && (t_s[n] - t_s[n - 1] - spacing).abs() < 1.0 {
        n += 1;
    }
    let nodes: Vec<f64> = t_s[..n].iter().map(|t| t - t_s[0]).collect();
    let delta = spacing * 1e-3;
    let (ahead, behind) = (lagrange_weights(&nodes, delta), lagrange_weights(&nodes, -delta));
    let slope: Vector3<f64> = (0..n).map(|i| r_m[i] * ((ahead[i] - behind[i]) / (2.0 * delta))).sum();
    let first = r_m[0];
    let rate = (gm / first.norm().powi(3)).sqrt();
    if n >= 7 && rate * spacing < SMOOTH_RAD {
        return State { r: first, v: slope };
    }
    let (sin, cos) = (rate * spacing).sin_cos();
    State { r: first, v: (r_m[1] - first * cos) * (rate / sin) }
}
