//! Second-order equations of motion by Gauss-Legendre collocation: x'' = f(t, x, v), order twice the number of stages.
//!
//! Chosen over a tabulated Runge-Kutta pair because its weights are computed rather than copied, its polynomial gives the
//! position anywhere inside the step (where a shadow's edge falls), and linear equations ride on the same nodes. The
//! stages are solved by fixed-point iteration, which shrinks errors by (h w)^2/10 a sweep at angular rate w: steps of
//! up to a tenth of a revolution need three or four sweeps. Not here: step-size control; the caller knows its orbit.

use nalgebra::Vector3;

/// Nodes and weights on the unit step.
#[derive(Debug, Clone)]
pub struct Collocation {
    nodes: Vec<f64>,
    /// `to_velocity[i][j]`: integral of the j-th Lagrange polynomial from 0 to node i.
    to_velocity: Vec<Vec<f64>>,
    /// Double integral of the same.
    to_position: Vec<Vec<f64>>,
    weights: Vec<f64>,
}

/// Position and velocity, m and m/s.
#[derive(Debug, Clone, Copy, PartialEq)]
pub struct State {
    /// Position, m.
    pub r: Vector3<f64>,
    /// Velocity, m/s.
    pub v: Vector3<f64>,
}

/// One step taken: its start, and the acceleration at each node.
#[derive(Debug, Clone)]
pub struct Step {
    /// Time at the start, s.
    pub t_s: f64,
    /// Length, s.
    pub h_s: f64,
    /// State at the start.
    pub start: State,
    /// State at the end.
    pub end: State,
    /// States at the nodes.
    pub inner: Vec<State>,
    /// Accelerations at the nodes, m/s^2.
    pub accelerations: Vec<Vector3<f64>>,
}

/// Stages agree to this before a step is taken as solved, m: five digits below the measurement, and the next sweep
/// would change it by a hundredth of that.
const TOLERANCE_M: f64 = 1e-6;
const SWEEPS_MAX: usize = 40;

impl Collocation {
    /// With this many Gauss nodes.
    pub fn gauss(stages: usize) -> Self {
        let x = legendre_roots(stages);
        let weight = |x: f64| {
            let slope = stages as f64 * (legendre(stages - 1, x) - x * legendre(stages, x)) / (1.0 - x * x);
            2.0 / ((1.0 - x * x) * slope * slope)
        };
        let w: Vec<f64> = x.iter().map(|&x| weight(x)).collect();
        let row = |at: f64, integral: &dyn Fn(usize, f64) -> f64, scale: f64| -> Vec<f64> {
            // L_j(x) = w_j sum_k (2k + 1)/2 P_k(x_j) P_k(x), exact for k < stages.
            let one = |j: usize| {
                let sum = |k: usize| (2 * k + 1) as f64 / 2.0 * legendre(k, x[j]) * integral(k, at);
                scale * w[j] * (0..stages).map(sum).sum::<f64>()
            };
            (0..stages).map(one).collect()
        };
        let to_velocity = x.iter().map(|&at| row(at, &integral_of_legendre, 0.5)).collect();
        let to_position = x.iter().map(|&at| row(at, &double_integral_of_legendre, 0.25)).collect();
        let nodes = x.iter().map(|x| 0.5 * (x + 1.0)).collect();
        Self { nodes, to_velocity, to_position, weights: w.iter().map(|w| 0.5 * w).collect() }
    }

    /// The nodes, as fractions of the step.
    pub fn nodes(&self) -> &[f64] {
        &self.nodes
    }

    /// Take one step of `h_s` from `start`. `guess` starts the stages (accelerations of a step before it, if any).
    pub fn step(&self, t_s: f64, start: State, h_s: f64, force: &mut dyn FnMut(f64, &State) -> Vector3<f64>) -> Step {
        let stages = self.nodes.len();
        let first = force(t_s, &start);
        let mut accelerations = vec![first; stages];
        let mut inner = vec![start; stages];
        for _ in 0..SWEEPS_MAX {
            let mut change_m: f64 = 0.0;
            for i in 0..stages {
                let state = self.state_at(
                    &self.to_velocity[i],
                    &self.to_position[i],
                    self.nodes[i] * h_s,
                    h_s,
                    &start,
                    &accelerations,
                );
                change_m = change_m.max((state.r - inner[i].r).norm());
                inner[i] = state;
            }
            for (i, state) in inner.iter().enumerate() {
                accelerations[i] = force(t_s + self.nodes[i] * h_s, state);
            }
            if change_m < TOLERANCE_M {
                break;
            }
        }
        let to_position: Vec<f64> = self.weights.iter().zip(&self.nodes).map(|(w, c)| w * (1.0 - c)).collect();
        let end = self.state_at(&self.weights, &to_position, h_s, h_s, &start, &accelerations);
        Step { t_s, h_s, start, end, inner, accelerations }
    }

    fn state_at(
        &self,
        to_velocity: &[f64],
        to_position: &[f64],
        t: f64,
        h: f64,
        start: &State,
        accelerations: &[Vector3<f64>],
    ) -> State {
        let (mut dv, mut dr) = (Vector3::zeros(), Vector3::zeros());
        for (j, a) in accelerations.iter().enumerate() {
            dv += a * to_velocity[j];
            dr += a * to_position[j];
        }
        State { r: start.r + start.v * t + dr * (h * h), v: start.v + dv * h }
    }

    /// Position inside a step already taken, at the fraction `theta` of it, m.
    pub fn position_in(&self, step: &Step, theta: f64) -> Vector3<f64> {
        let stages = self.nodes.len();
        let at = 2.0 * theta - 1.0;
        let mut dr = Vector3::zeros();
        for j in 0..stages {
            let x = 2.0 * self.nodes[j] - 1.0;
            let sum = |k: usize| (2 * k + 1) as f64 / 2.0 * legendre(k, x) * double_integral_of_legendre(k, at);
            dr += step.accelerations[j] * (0.25 * 2.0 * self.weights[j] * (0..stages).map(sum).sum::<f64>());
        }
        step.start.r + step.start.v * (theta * step.h_s) + dr * (step.h_s * step.h_s)
    }

    /// Carry linear columns y'' = G(t) y + f(t) over a step, with G and f given at its nodes.
    pub fn step_linear(
        &self,
        h: f64,
        start: State,
        gradient: &[nalgebra::Matrix3<f64>],
        forcing: &[Vector3<f64>],
    ) -> State {
        let stages = self.nodes.len();
        let mut accelerations: Vec<Vector3<f64>> =
            (0..stages).map(|i| gradient[i] * (start.r + start.v * (self.nodes[i] * h)) + forcing[i]).collect();
        // The same contraction as in `step`: a relative 1e-12 is reached in five sweeps at a tenth of a revolution.
        for _ in 0..SWEEPS_MAX {
            let before = accelerations.clone();
            for i in 0..stages {
                let y =
                    self.state_at(&self.to_velocity[i], &self.to_position[i], self.nodes[i] * h, h, &start, &before).r;
                accelerations[i] = gradient[i] * y + forcing[i];
            }
            let change = accelerations.iter().zip(&before).map(|(a, b)| (a - b).norm()).fold(0.0, f64::max);
            let size = accelerations.iter().map(|a| a.norm()).fold(0.0, f64::max);
            if change <= 1e-11 * size {
                break;
            }
        }
        let to_position: Vec<f64> = self.weights.iter().zip(&self.nodes).map(|(w, c)| w * (1.0 - c)).collect();
        self.state_at(&self.weights, &to_position, h, h, &start, &accelerations)
    }
}

fn legendre(n: usize, x: f64) -> f64 {
    let (mut p0, mut p1) = (1.0, x);
    if n == 0 {
        return p0;
    }
    for k in 1..n {
        (p0, p1) = (p1, ((2 * k + 1) as f64 * x * p1 - k as f64 * p0) / (k + 1) as f64);
    }
    p1
}

/// Integral of P_k from -1 to x.
fn integral_of_legendre(k: usize, x: f64) -> f64 {
    match k {
        0 => x + 1.0,
        _ => (legendre(k + 1, x) - legendre(k - 1, x)) / (2 * k + 1) as f64,
    }
}

/// Double integral of P_k from -1 to x.
fn double_integral_of_legendre(k: usize, x: f64) -> f64 {
    match k {
        0 => 0.5 * (x + 1.0) * (x + 1.0),
        _ => (integral_of_legendre(k + 1, x) - integral_of_legendre(k - 1, x)) / (2 * k + 1) as f64,
    }
}

fn legendre_roots(n: usize) -> Vec<f64> {
    let root = |i: usize| {
        let mut x = -((i as f64 + 0.75) / (n as f64 + 0.5) * std::f64::consts::PI).cos();
        for _ in 0..50 {
            let slope = n as f64 * (legendre(n - 1, x) - x * legendre(n, x)) / (1.0 - x * x);
            let step = legendre(n, x) / slope;
            x -= step;
            if step.abs() < 1e-16 {
                break;
            }
        }
        x
    };
    (0..n).map(root).collect()
}

#[cfg(test)]
mod tests {
    use super::*;

    const MU: f64 = 3.986_004_418e14;

    fn kepler(r: &Vector3<f64>) -> Vector3<f64> {
        r * (-MU / r.norm().powi(3))
    }

    #[test]
    fn an_eccentric_orbit_closes_after_a_revolution() {
        let (a, e) = (2.66e7_f64, 0.02_f64);
        let rp = a * (1.0 - e);
        let start =
            State { r: Vector3::new(rp, 0.0, 0.0), v: Vector3::new(0.0, (MU * (2.0 / rp - 1.0 / a)).sqrt(), 0.0) };
        let period = std::f64::consts::TAU * (a.powi(3) / MU).sqrt();
        let gauss = Collocation::gauss(6);
        let mut state = start;
        for i in 0..48 {
            let h = period / 48.0;
            state = gauss.step(i as f64 * h, state, h, &mut |_, s| kepler(&s.r)).end;
        }
        // Closed orbit: the only truth is the start itself. A tenth of a millimetre is a 250th of the measurement.
        assert!((state.r - start.r).norm() < 1e-4, "{}", (state.r - start.r).norm());
    }

    #[test]
    fn inside_a_step_the_polynomial_follows_the_motion() {
        let start = State { r: Vector3::new(2.66e7, 0.0, 0.0), v: Vector3::new(0.0, (MU / 2.66e7_f64).sqrt(), 0.0) };
        let gauss = Collocation::gauss(6);
        let step = gauss.step(0.0, start, 900.0, &mut |_, s| kepler(&s.r));
        let rate = (MU / 2.66e7_f64.powi(3)).sqrt();
        for theta in [0.0, 0.3, 0.77, 1.0] {
            let angle = rate * 900.0 * theta;
            let exact = Vector3::new(angle.cos(), angle.sin(), 0.0) * 2.66e7;
            assert!((gauss.position_in(&step, theta) - exact).norm() < 1e-4);
        }
    }

    #[test]
    fn linear_columns_follow_differences_of_orbits() {
        let start = State { r: Vector3::new(2.66e7, 0.0, 0.0), v: Vector3::new(0.0, 3800.0, 600.0) };
        let gauss = Collocation::gauss(6);
        let push = Vector3::new(1e-7, -2e-7, 3e-7);
        let one = gauss.step(0.0, start, 900.0, &mut |_, s| kepler(&s.r));
        let two = gauss.step(0.0, start, 900.0, &mut |_, s| kepler(&s.r) + push);
        let gradient: Vec<_> = one
            .inner
            .iter()
            .map(|s| {
                let r = s.r.norm();
                (nalgebra::Matrix3::identity() - s.r * s.r.transpose() * (3.0 / (r * r))) * (-MU / r.powi(3))
            })
            .collect();
        let zero = State { r: Vector3::zeros(), v: Vector3::zeros() };
        let column = gauss.step_linear(900.0, zero, &gradient, &[push; 6]);
        assert!((column.r - (two.end.r - one.end.r)).norm() < 1e-6 * column.r.norm());
    }
}
