//! Everything the case implies before any search: the residual, and the physics of its orbit on the ancillary grid.
//!
//! All here comes from epoch, position, attitude and the log, by the project's own physics; no regressor is read from
//! the simulation but its signal itself. Not here: which of it explains anything.

mod angles;

use std::ops::Deref;
use std::sync::{Arc, OnceLock};

use crate::math::rms::{about_mean, rms_about_mean};
use crate::math::shared_work;
use crate::physics::{self, Mat3, Vec3};
use crate::units::NANO_G_M_S2;

use super::case::{Case, Expectation, HALF_WINDOW_S};
use super::earlier;
use super::error::CaseError;
use super::measure::{self, Measurement, coverage, union};
use super::noise::{self, Contradicted, Flips, Loudness, Schedule};
use super::recorder::NEGLIGIBLE_NG;

pub use super::axes::Axes;

/// The physics of the orbit on the ancillary grid: all of a scene that no window of the recording changes.
#[derive(Clone)]
pub struct Surroundings {
    /// The simulation on the ancillary grid, ng.
    pub simulated_grid_ng: Axes,
    /// The vehicle, for the force models.
    pub vehicle: physics::vehicle::Vehicle,
    /// Ancillary grid.
    pub grid_s: Vec<f64>,
    /// Rotation from inertial to body axes on the grid.
    pub body: Vec<Mat3>,
    /// Position on the grid.
    pub r_m: Vec<Vec3>,
    /// Velocity on the grid.
    pub v_m_s: Vec<Vec3>,
    /// Body rate on the grid.
    pub w_rad_s: Vec<Vec3>,
    /// Its derivative.
    pub wdot_rad_s2: Vec<Vec3>,
    /// Unit vector to the Sun, inertial.
    pub sun: Vec<Vec3>,
    /// Sunlit fraction.
    pub sunlit: Vec<f64>,
    /// Geomagnetic field, body axes, T.
    pub field_body_t: Vec<Vec3>,
    /// Velocity relative to an atmosphere that turns with the Earth, body axes, m/s.
    pub relative_m_s: Vec<Vec3>,
    /// Directions along the track and across it, body axes.
    pub track: Vec<[Vec3; 2]>,
    /// Drag as modelled with a co-rotating atmosphere, body axes, ng.
    pub drag_ng: Vec<Vec3>,
    /// Density the simulation used.
    pub density_kg_m3: Vec<f64>,
    /// Sensor temperature.
    pub temperature_c: Vec<f64>,
    /// Orbital period, s.
    pub period_s: f64,
}

/// What was measured: the windows, and the bias beside them.
pub struct Measured {
    /// Recording less measured simulation, ng.
    pub residual_ng: Axes,
    /// The flips of the table, per axis.
    pub flips: [Flips; 3],
}

/// The case, measured and furnished with its physics.
#[derive(Clone)]
pub struct Scene<'a> {
    /// The case.
    pub case: &'a Case,
    /// Window centres and steps.
    pub schedule: Schedule,
    /// How loud each window is, per axis.
    pub loudness: [Loudness; 3],
    /// Where the windows contradict what the deviations say of that.
    pub contradicted: [Option<Contradicted>; 3],
    /// Recording less measured simulation, ng.
    pub residual_ng: Axes,
    /// The measured simulation, ng.
    pub simulated_ng: Axes,
    /// From the ancillary grid to the windows.
    pub measurement: Measurement,
    /// The sensor temperature with what its cycles tell of it before the ancillary grid.
    pub temperature_and_earlier: Arc<earlier::Series>,
    lever_arms_ng: OnceLock<Arc<[Axes; 3]>>,
    surroundings: Arc<Surroundings>,
}

impl Deref for Scene<'_> {
    type Target = Surroundings;

    fn deref(&self) -> &Surroundings {
        &self.surroundings
    }
}

impl Surroundings {
    /// The physics along the ancillary data of an expectation.
    ///
    /// # Errors
    /// [`CaseError`] where an attitude or an instant defeats the physics.
    pub fn new(expected: &Expectation) -> Result<Self, CaseError> {
        let anc = &expected.ancillary;
        let vector = |v: &[f64; 3]| Vec3::new(v[0], v[1], v[2]);
        let r_m: Vec<Vec3> = anc.r_m.iter().map(vector).collect();
        let v_m_s: Vec<Vec3> = anc.v_m_s.iter().map(vector).collect();
        let w_rad_s: Vec<Vec3> = anc.w_rad_s.iter().map(vector).collect();
        let body = bodies(&anc.q)?;
        let vehicle = expected.header.vehicle.for_physics();
        let unix: Vec<f64> = anc.clock_s.iter().map(|t| expected.header.unix_s(*t)).collect();
        let sun: Vec<Vec3> = unix.iter().map(|t| physics::sun::direction(*t)).collect();
        let sunlit = r_m.iter().zip(&sun).map(|(r, s)| physics::shadow::sunlit_fraction(r, s)).collect();
        let field_body_t = fields(&unix, &r_m, &body)?;
        let relative =
            |i: usize| body[i] * physics::drag::relative_velocity_m_s(&r_m[i], &v_m_s[i], 1.0, &Vec3::zeros());
        let relative_m_s: Vec<Vec3> = (0..r_m.len()).map(relative).collect();
        let unit_wind = |i: usize, along, cross| body[i] * physics::drag::wind_m_s(&r_m[i], &v_m_s[i], along, cross);
        let track = (0..r_m.len()).map(|i| [unit_wind(i, 1.0, 0.0), unit_wind(i, 0.0, 1.0)]).collect();
        let drag_ng = relative_m_s.iter().zip(&anc.density_kg_m3).map(|(v, rho)| drag_ng(&vehicle, *rho, v)).collect();
        let period_s = period_s(&r_m[0], &v_m_s[0]);
        let simulation = &expected.simulation;
        Ok(Self {
            simulated_grid_ng: std::array::from_fn(|k| {
                interpolate(&simulation.clock_s, &simulation.a_ng[k], &anc.clock_s)
            }),
            vehicle,
            grid_s: anc.clock_s.clone(),
            wdot_rad_s2: gradient(&anc.clock_s, &w_rad_s),
            body,
            r_m,
            v_m_s,
            w_rad_s,
            sun,
            sunlit,
            field_body_t,
            relative_m_s,
            track,
            drag_ng,
            density_kg_m3: anc.density_kg_m3.clone(),
            temperature_c: anc.temperature_c.clone(),
            period_s,
        })
    }
}

impl Surroundings {
    /// The first grid points.
    pub fn until(&self, points: usize) -> Self {
        let mut cut = self.clone();
        cut.simulated_grid_ng.iter_mut().for_each(|series| series.truncate(points));
        cut.body.truncate(points);
        cut.track.truncate(points);
        for series in [
            &mut cut.r_m,
            &mut cut.v_m_s,
            &mut cut.w_rad_s,
            &mut cut.wdot_rad_s2,
            &mut cut.sun,
            &mut cut.field_body_t,
            &mut cut.relative_m_s,
            &mut cut.drag_ng,
        ] {
            series.truncate(points);
        }
        for series in [&mut cut.grid_s, &mut cut.sunlit, &mut cut.density_kg_m3, &mut cut.temperature_c] {
            series.truncate(points);
        }
        cut
    }

    /// These, and what comes later.
    pub fn then(mut self, later: &Self) -> Self {
        for (series, more) in self.simulated_grid_ng.iter_mut().zip(&later.simulated_grid_ng) {
            series.extend(more);
        }
        self.body.extend(&later.body);
        self.r_m.extend(&later.r_m);
        self.v_m_s.extend(&later.v_m_s);
        self.w_rad_s.extend(&later.w_rad_s);
        self.wdot_rad_s2.extend(&later.wdot_rad_s2);
        self.sun.extend(&later.sun);
        self.field_body_t.extend(&later.field_body_t);
        self.relative_m_s.extend(&later.relative_m_s);
        self.track.extend(&later.track);
        self.drag_ng.extend(&later.drag_ng);
        self.grid_s.extend(&later.grid_s);
        self.sunlit.extend(&later.sunlit);
        self.density_kg_m3.extend(&later.density_kg_m3);
        self.temperature_c.extend(&later.temperature_c);
        self
    }
}

impl<'a> Scene<'a> {
    /// What no window changes.
    pub fn surroundings(&self) -> &Surroundings {
        &self.surroundings
    }

    /// Furnish a checked case.
    ///
    /// # Errors
    /// As [`Surroundings::new`].
    pub fn new(case: &'a Case) -> Result<Self, CaseError> {
        Ok(Self::within(case, Arc::new(Surroundings::new(&case.expected)?)))
    }

    /// The scene of a case in surroundings that are known already: those of its expectation.
    pub fn within(case: &'a Case, surroundings: Arc<Surroundings>) -> Self {
        let mut scene = Self::as_loud(case, surroundings, Default::default());
        let [dev_ng, residuals_ng] =
            [&case.recording.dev_ng, &scene.residual_ng].map(|axes| axes.each_ref().map(|x| &x[..]));
        (scene.loudness, scene.contradicted) = noise::settled(dev_ng, &asleep(case), residuals_ng, &scene.schedule);
        scene
    }

    /// The scene of a case that begins as this one and goes on with windows not taken yet: those are as loud as these are while the
    /// crew is awake.
    pub fn gone_on<'b>(&self, case: &'b Case, surroundings: Arc<Surroundings>) -> Scene<'b> {
        let asleep = asleep(self.case);
        let loudness =
            self.loudness.each_ref().map(|known| known.gone_on(known.awake(&asleep), case.recording.clock_s.len()));
        let mut scene = Scene { contradicted: self.contradicted, ..Scene::as_loud(case, surroundings, loudness) };
        scene.schedule.slow_seen = self.schedule.slow_seen;
        scene
    }

    fn as_loud(case: &'a Case, surroundings: Arc<Surroundings>, loudness: [Loudness; 3]) -> Self {
        let windows = &case.recording.clock_s;
        let to_windows = Measurement::new(&case.simulation.clock_s, windows);
        let simulated_ng = case.simulation.a_ng.each_ref().map(|series| to_windows.apply(series));
        let residual_ng: Axes =
            std::array::from_fn(|k| case.recording.a_ng[k].iter().zip(&simulated_ng[k]).map(|(a, m)| a - m).collect());
        Self {
            schedule: Schedule::new(windows).with_shared(shared_errors(case, &to_windows, &simulated_ng)).with_flips(
                case.recording.bias_laws.each_ref().map(|laws| laws.iter().map(|law| &law.flips).collect()),
            ),
            loudness,
            contradicted: [None; 3],
            residual_ng,
            simulated_ng,
            measurement: Measurement::new(&surroundings.grid_s, windows),
            temperature_and_earlier: Arc::new(earlier::with_earlier(
                &surroundings.grid_s,
                &surroundings.temperature_c,
                surroundings.period_s,
            )),
            lever_arms_ng: OnceLock::new(),
            surroundings,
            case,
        }
    }

    /// The same scene of a case that differs in its log alone.
    pub fn with_log_of<'b>(&self, case: &'b Case) -> Scene<'b>
    where
        'a: 'b,
    {
        Scene { case, ..self.clone() }
    }

    /// The same scene with other measurements, of windows and of the bias: a bootstrap replicate.
    pub fn with_measured(&self, Measured { residual_ng, flips }: Measured) -> Self {
        let schedule = self.schedule.clone().with_flips(flips);
        Self { residual_ng, schedule, ..self.clone() }
    }

    /// Window centres.
    pub fn clock_s(&self) -> &[f64] {
        &self.schedule.clock_s
    }

    /// Measure a vector given on the grid.
    pub fn measure(&self, on_grid: impl Fn(usize) -> Vec3) -> Axes {
        let series: Vec<Vec3> = (0..self.grid_s.len()).map(on_grid).collect();
        std::array::from_fn(|k| self.measurement.apply(&series.iter().map(|v| v[k]).collect::<Vec<f64>>()))
    }

    /// Measure a number given on the grid.
    pub fn measure_scalar(&self, on_grid: impl Fn(usize) -> f64) -> Vec<f64> {
        self.measurement.apply(&(0..self.grid_s.len()).map(on_grid).collect::<Vec<f64>>())
    }

    /// Drag at grid point `i` in a wind along the track and across it, ng, body axes.
    pub fn drag_in_wind(&self, i: usize, along_m_s: f64, cross_m_s: f64) -> Vec3 {
        let [along, cross] = &self.track[i];
        let relative = self.relative_m_s[i] - along * along_m_s - cross * cross_m_s;
        drag_ng(&self.vehicle, self.density_kg_m3[i], &relative)
    }

    /// Drag at grid point `i` in an atmosphere at rest, ng, body axes.
    pub fn drag_at_rest(&self, i: usize) -> Vec3 {
        let relative = physics::drag::relative_velocity_m_s(&self.r_m[i], &self.v_m_s[i], 0.0, &Vec3::zeros());
        drag_ng(&self.vehicle, self.density_kg_m3[i], &(self.body[i] * relative))
    }

    /// Tensor T of a = T r: what a sensor offset of one metre feels, 1/s^2, at grid point `i`, body axes.
    pub fn tensor_s2(&self, i: usize) -> Mat3 {
        self.rotation_s2(i) - self.gradient_s2(i)
    }

    /// What a sensor offset of one metre along each body axis feels, measured, ng.
    pub fn lever_arms_ng(&self) -> &[Axes; 3] {
        self.lever_arms_ng.get_or_init(|| {
            let arm = |axis: usize| self.measure(|i| self.tensor_s2(i).column(axis) / NANO_G_M_S2);
            Arc::new(std::array::from_fn(arm))
        })
    }

    /// Gravity gradient G in body axes, 1/s^2.
    pub fn gradient_s2(&self, i: usize) -> Mat3 {
        physics::gravity_gradient::tensor_s2(&(self.body[i] * self.r_m[i]))
    }

    /// [w x][w x] + [dw/dt x], 1/s^2.
    pub fn rotation_s2(&self, i: usize) -> Mat3 {
        physics::rotation::tensor_s2(&self.w_rad_s[i], &self.wdot_rad_s2[i])
    }

    /// First and last instant any window sees.
    pub fn span_s(&self) -> [f64; 2] {
        let clock = self.clock_s();
        [clock[0] - HALF_WINDOW_S, clock[clock.len() - 1] + HALF_WINDOW_S]
    }
}

/// What the calibration leaves open, the same in all windows, ng: of the scale factor in proportion to what is expected, for what was
/// recorded holds the noise that is to be explained. And what is missed of the simulation between its rows: in no window much, and in all of a
/// quick motion the same.
fn shared_errors(case: &Case, to_windows: &Measurement, simulated_ng: &Axes) -> [Vec<Vec<f64>>; 3] {
    let recording = &case.recording;
    std::array::from_fn(|k| {
        let missed = about_mean(
            &to_windows.apply(&measure::missed_by_cubics(&case.simulation.clock_s, &case.simulation.a_ng[k])),
        );
        let of_scale = recording.scale_errors[k].iter().map(|shares| {
            let errors: Vec<f64> = shares.iter().zip(&simulated_ng[k]).map(|(share, ng)| share * ng).collect();
            about_mean(&errors)
        });
        let told = of_scale.chain([missed]).filter(|errors| rms_about_mean(errors) > NEGLIGIBLE_NG);
        recording.bias_errors_ng[k].iter().cloned().chain(told).collect()
    })
}

/// Whether the crew sleeps, by its log, about the middle of the samples that each window is the first to have.
fn asleep(case: &Case) -> Vec<bool> {
    let clock_s = &case.recording.clock_s;
    let new_s = |i: usize| if i == 0 { f64::INFINITY } else { clock_s[i] - clock_s[i - 1] }.min(2.0 * HALF_WINDOW_S);
    let middles: Vec<f64> = clock_s.iter().enumerate().map(|(i, t)| t + HALF_WINDOW_S - 0.5 * new_s(i)).collect();
    coverage(&middles, &union(case.spans("crew_sleep"))).iter().map(|share| *share > 0.5).collect()
}

fn bodies(q: &[[f64; 4]]) -> Result<Vec<Mat3>, CaseError> {
    q.iter()
        .map(|q| {
            let attitude = physics::attitude::from_scalar_first(q[0], q[1], q[2], q[3]);
            attitude
                .map(|a| physics::attitude::body_from_inertial(&a))
                .ok_or_else(|| CaseError::Numeric(format!("ancillary data: {q:?} is no attitude")))
        })
        .collect()
}

fn fields(unix: &[f64], r_m: &[Vec3], body: &[Mat3]) -> Result<Vec<Vec3>, CaseError> {
    let at = |i: usize| {
        physics::magnetic::geomagnetic_field_t(unix[i], &r_m[i])
            .map(|b| body[i] * b)
            .map_err(|e| CaseError::Numeric(format!("case.toml: `case.epoch_utc` or a position is out of range: {e}")))
    };
    shared_work::map_range(unix.len(), at).into_iter().collect()
}

fn drag_ng(vehicle: &physics::vehicle::Vehicle, density_kg_m3: f64, relative_body_m_s: &Vec3) -> Vec3 {
    physics::drag::acceleration_m_s2(vehicle, density_kg_m3, relative_body_m_s) / NANO_G_M_S2
}

fn period_s(r: &Vec3, v: &Vec3) -> f64 {
    let energy = 0.5 * v.norm_squared() - physics::MU_M3_S2 / r.norm();
    let axis = (-physics::MU_M3_S2 / (2.0 * energy)).abs();
    std::f64::consts::TAU * (axis.powi(3) / physics::MU_M3_S2).sqrt()
}

/// Rates of change: by the six points about each where they are evenly spaced, or the four, elsewhere central differences, one-sided at the
/// ends.
fn gradient(grid: &[f64], values: &[Vec3]) -> Vec<Vec3> {
    let last = grid.len() - 1;
    let by = |i: usize, weights: &[f64]| {
        let reach = weights.len();
        let is_inside = i >= reach && i + reach <= last && measure::is_even(&grid[i - reach..=i + reach]);
        let sum = || weights.iter().zip(1..).map(|(weight, n)| (values[i + n] - values[i - n]) * *weight).sum::<Vec3>();
        is_inside.then(|| sum() * (2 * reach) as f64 / (grid[i + reach] - grid[i - reach]))
    };
    let central = |i: usize| {
        let [a, b] = [i.saturating_sub(1), (i + 1).min(last)];
        (values[b] - values[a]) / (grid[b] - grid[a])
    };
    let six = [3.0 / 4.0, -3.0 / 20.0, 1.0 / 60.0];
    let four = [2.0 / 3.0, -1.0 / 12.0];
    (0..grid.len()).map(|i| by(i, &six).or_else(|| by(i, &four)).unwrap_or_else(|| central(i))).collect()
}

fn interpolate(grid: &[f64], values: &[f64], at: &[f64]) -> Vec<f64> {
    at.iter()
        .map(|t| {
            let j = grid.partition_point(|g| g <= t).clamp(1, grid.len() - 1);
            let share = ((t - grid[j - 1]) / (grid[j] - grid[j - 1])).clamp(0.0, 1.0);
            values[j - 1] + share * (values[j] - values[j - 1])
        })
        .collect()
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::diagnose::catalogue::made;

    /// A rate that swings once in 500 s on a grid of 20 s: by central differences its change is a hundredth short.
    #[test]
    fn a_rate_of_change_is_that_of_what_is_smooth() {
        let rate = std::f64::consts::TAU / 500.0;
        let even: Vec<f64> = (0..100).map(|i| 20.0 * f64::from(i)).collect();
        let mut uneven = even.clone();
        uneven[50] += 7.0;
        for (grid, beside) in [(&even, 0..0), (&uneven, 48..53)] {
            let swing: Vec<Vec3> = grid.iter().map(|t| Vec3::new((rate * t).sin(), 2.0 * t, 1.0)).collect();
            for (i, slope) in gradient(grid, &swing).iter().enumerate() {
                let share = if i > 1 && i < 98 && !beside.contains(&i) { 2e-4 } else { 0.2 };
                assert!((slope.x - rate * (rate * grid[i]).cos()).abs() < share * rate, "{} at {i}", slope.x);
                assert!((slope.y - 2.0).abs() < 1e-12 && slope.z == 0.0);
            }
        }
    }

    /// Windows to come have no values yet: that they are not noisy says nothing.
    #[test]
    fn windows_to_come_are_as_loud_as_those_awake_and_those_known_stay() {
        let case = made::case();
        let asleep = asleep(&case);
        let mut scene = Scene::new(&case).unwrap();
        scene.loudness = [1.0, 0.7, 0.5].map(|quiet| Loudness::of_crew([1.0, quiet], &asleep));
        scene.loudness[0].burst[7] = 30.0;
        let known = case.recording.clock_s.len();
        let mut longer = case.clone();
        let last_s = longer.recording.clock_s[known - 1];
        longer.recording.clock_s.extend((1..=100).map(|i| last_s + 25.0 * f64::from(i)));
        for k in 0..3 {
            longer.recording.a_ng[k].resize(known + 100, 0.0);
            longer.recording.dev_ng[k].resize(known + 100, 0.0);
        }
        let ahead = scene.gone_on(&longer, scene.surroundings.clone());
        let i = asleep.iter().position(|sleeps| !sleeps).unwrap();
        for (was, is) in scene.loudness.iter().zip(&ahead.loudness) {
            assert_eq!(is.activity[..known], was.activity);
            assert_eq!(is.burst[..known], was.burst);
            for level in &is.activity[known..] {
                assert!((level / was.activity[i] - 1.0).abs() < 1e-9, "{level} for {}", was.activity[i]);
            }
            assert_eq!(is.burst[known..], [1.0; 100]);
        }
    }
}
