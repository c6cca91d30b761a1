//! The unlisted competitor: formulas of covariates, events and memory that no catalogue entry claims.
//!
//! A dictionary of several hundred forms on the same evidence scale as the catalogue. Every form is dimensionless: centred and
//! scaled to unit deviation over the record, so its coefficient is in ng. A form that wins is a hypothesis with a
//! formula and a place, never a physical name.

use crate::physics::{Vec3, sun, time};

use super::catalogue::Shape;
use super::design::Raw;
use super::measure::{coverage, decay};
use super::scene::{Axes, Scene};

/// Prior size of the coefficient of a form, ng.
pub const SIZE_NG: f64 = 30.0;

/// One form.
pub struct Atom {
    /// The formula.
    pub formula: String,
    /// Covariate it belongs to.
    pub covariate: &'static str,
    /// Where it lives, in words.
    pub location: &'static str,
    /// Its series.
    pub shape: Shape,
}

struct Collector<'a> {
    scene: &'a Scene<'a>,
    atoms: Vec<Atom>,
}

impl Collector<'_> {
    /// A number on the grid.
    fn grid(
        &mut self,
        formula: impl Into<String>,
        covariate: &'static str,
        location: &'static str,
        f: impl Fn(usize) -> f64,
    ) {
        let series = self.scene.measure_scalar(f);
        self.windows(formula, covariate, location, series);
    }

    /// A series at the windows.
    fn windows(
        &mut self,
        formula: impl Into<String>,
        covariate: &'static str,
        location: &'static str,
        series: Vec<f64>,
    ) {
        if let Some(series) = standard(&series) {
            self.atoms.push(Atom { formula: formula.into(), covariate, location, shape: Shape::Scalar(series) });
        }
    }

    /// Several numbers on the grid, each with a coefficient on every body axis.
    fn several(
        &mut self,
        formula: impl Into<String>,
        covariate: &'static str,
        location: &'static str,
        parts: &[&dyn Fn(usize) -> f64],
    ) {
        let series: Vec<Vec<f64>> = parts.iter().filter_map(|f| standard(&self.scene.measure_scalar(f))).collect();
        if series.len() == parts.len() {
            let columns: Vec<Raw> = series
                .iter()
                .flat_map(|s| (0..3).map(|k| std::array::from_fn(|j| (j == k).then(|| s.clone()))))
                .collect();
            self.atoms.push(Atom { formula: formula.into(), covariate, location, shape: Shape::Columns(columns) });
        }
    }

    /// Vectors on the grid, one coefficient each, scaled to unit deviation over all axes.
    fn vectors(
        &mut self,
        formula: impl Into<String>,
        covariate: &'static str,
        location: &'static str,
        parts: &[&dyn Fn(usize) -> Vec3],
    ) {
        let columns: Vec<Raw> =
            parts.iter().filter_map(|f| standard_vector(&self.scene.measure(f))).map(|axes| axes.map(Some)).collect();
        if columns.len() == parts.len() {
            self.atoms.push(Atom { formula: formula.into(), covariate, location, shape: Shape::Columns(columns) });
        }
    }
}

/// Unit deviation, `None` for what hardly varies.
fn standard(series: &[f64]) -> Option<Vec<f64>> {
    let n = series.len() as f64;
    let mean = series.iter().sum::<f64>() / n;
    let deviation = (series.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / n).sqrt();
    let largest = series.iter().fold(0.0_f64, |m, x| m.max(x.abs()));
    let zero_at_rest = series.iter().filter(|x| **x == 0.0).count() * 2 > series.len();
    // A form that is zero most of the time keeps its zeros: its support is where it lives.
    let shift = if zero_at_rest { 0.0 } else { mean };
    (deviation.is_finite() && deviation > 1e-9 * largest && deviation > 0.0)
        .then(|| series.iter().map(|x| (x - shift) / deviation).collect())
}

fn standard_vector(axes: &Axes) -> Option<Axes> {
    let n = axes[0].len() as f64;
    let mean: [f64; 3] = std::array::from_fn(|k| axes[k].iter().sum::<f64>() / n);
    let deviation =
        ((0..3).map(|k| axes[k].iter().map(|x| (x - mean[k]).powi(2)).sum::<f64>()).sum::<f64>() / n).sqrt();
    let largest = axes.iter().flatten().fold(0.0_f64, |m, x| m.max(x.abs()));
    (deviation.is_finite() && deviation > 1e-6 * largest && deviation > 0.0)
        .then(|| std::array::from_fn(|k| axes[k].iter().map(|x| (x - mean[k]) / deviation).collect()))
}

/// The dictionary for a case.
pub fn dictionary(scene: &Scene) -> Vec<Atom> {
    let mut c = Collector { scene, atoms: Vec::new() };
    rates(&mut c);
    orbit(&mut c);
    sunlight(&mut c);
    terminator(&mut c);
    field(&mut c);
    surroundings(&mut c);
    sensor(&mut c);
    events(&mut c);
    clock(&mut c);
    c.atoms
}

const AXIS: [&str; 3] = ["x", "y", "z"];

fn rates(c: &mut Collector) {
    let s = c.scene;
    let place = "manoeuvres and deadband motion";
    for i in 0..3 {
        c.grid(format!("w{}", AXIS[i]), "body_rate", place, |g| s.w_rad_s[g][i]);
        c.grid(format!("|w{}|", AXIS[i]), "body_rate", place, |g| s.w_rad_s[g][i].abs());
        c.grid(format!("w{0} |w{0}|", AXIS[i]), "body_rate", place, |g| s.w_rad_s[g][i] * s.w_rad_s[g][i].abs());
        c.grid(format!("dw{}/dt", AXIS[i]), "body_rate", place, |g| s.wdot_rad_s2[g][i]);
        for j in i..3 {
            c.grid(format!("w{} w{}", AXIS[i], AXIS[j]), "body_rate", place, |g| s.w_rad_s[g][i] * s.w_rad_s[g][j]);
        }
    }
    c.grid("|w|", "body_rate", place, |g| s.w_rad_s[g].norm());
    c.grid("w.w", "body_rate", place, |g| s.w_rad_s[g].norm_squared());
}

/// Angles of the orbit at every grid point: argument of latitude, and the angle past orbital noon.
fn angles(scene: &Scene) -> (Vec<f64>, Vec<f64>) {
    (0..scene.grid_s.len())
        .map(|g| {
            let normal = scene.r_m[g].cross(&scene.v_m_s[g]).normalize();
            let node = Vec3::new(-normal.y, normal.x, 0.0).normalize();
            let u = scene.r_m[g].dot(&normal.cross(&node)).atan2(scene.r_m[g].dot(&node));
            let noon = (scene.sun[g] - normal * normal.dot(&scene.sun[g])).normalize();
            (u, scene.r_m[g].dot(&normal.cross(&noon)).atan2(scene.r_m[g].dot(&noon)))
        })
        .unzip()
}

fn lvlh(scene: &Scene, g: usize) -> [Vec3; 3] {
    let normal = scene.r_m[g].cross(&scene.v_m_s[g]).normalize();
    let radial = scene.r_m[g].normalize();
    [normal.cross(&radial), normal, radial]
}

fn orbit(c: &mut Collector) {
    let s = c.scene;
    let (u, noon) = angles(s);
    let bodies: [Vec<Vec3>; 3] =
        std::array::from_fn(|k| (0..s.grid_s.len()).map(|g| s.body[g] * lvlh(s, g)[k]).collect());
    let place = "a phase of the orbit";
    for k in 1..=6 {
        let n = k as f64;
        c.several(
            format!("sin {k}u, cos {k}u"),
            "argument_of_latitude",
            place,
            &[&|g| (n * u[g]).sin(), &|g| (n * u[g]).cos()],
        );
        c.several(
            format!("sin {k}(u - u_noon), cos {k}(u - u_noon)"),
            "sun_phase",
            place,
            &[&|g| (n * noon[g]).sin(), &|g| (n * noon[g]).cos()],
        );
        if k <= 3 {
            for (name, b) in ["along-track", "cross-track", "radial"].into_iter().zip(&bodies) {
                c.vectors(
                    format!("sin {k}u, cos {k}u {name}"),
                    "argument_of_latitude",
                    place,
                    &[&|g| b[g] * (n * u[g]).sin(), &|g| b[g] * (n * u[g]).cos()],
                );
                c.vectors(
                    format!("sin {k}(u - u_noon), cos {k}(u - u_noon) {name}"),
                    "sun_phase",
                    place,
                    &[&|g| b[g] * (n * noon[g]).sin(), &|g| b[g] * (n * noon[g]).cos()],
                );
            }
        }
    }
    c.vectors(
        "a constant in the local vertical frame",
        "attitude",
        "changes of attitude",
        &[&|g| bodies[0][g], &|g| bodies[1][g], &|g| bodies[2][g]],
    );
    let fixed = |k: usize| move |g: usize| s.body[g].column(k).into_owned();
    c.vectors("a constant in inertial axes", "attitude", "changes of attitude", &[&fixed(0), &fixed(1), &fixed(2)]);
}

fn sunlight(c: &mut Collector) {
    let s = c.scene;
    let body_sun: Vec<Vec3> = (0..s.grid_s.len()).map(|g| s.body[g] * s.sun[g]).collect();
    let place = "the side towards the Sun";
    for i in 0..3 {
        c.grid(format!("s{}", AXIS[i]), "sun_angle", place, |g| body_sun[g][i]);
        c.grid(format!("nu s{}", AXIS[i]), "sun_angle", place, |g| s.sunlit[g] * body_sun[g][i]);
        c.grid(format!("nu |s{}|", AXIS[i]), "sun_angle", place, |g| s.sunlit[g] * body_sun[g][i].abs());
        c.grid(format!("nu max(0, s{})", AXIS[i]), "sun_angle", place, |g| s.sunlit[g] * body_sun[g][i].max(0.0));
        c.grid(format!("nu max(0, -s{})", AXIS[i]), "sun_angle", place, |g| s.sunlit[g] * (-body_sun[g][i]).max(0.0));
        for j in i..3 {
            c.grid(format!("s{} s{}", AXIS[i], AXIS[j]), "sun_angle", place, |g| body_sun[g][i] * body_sun[g][j]);
        }
    }
    c.grid("cos(Sun zenith angle)", "sun_angle", place, |g| s.sun[g].dot(&s.r_m[g].normalize()));
    c.grid("max(0, cos(Sun zenith angle))", "sun_angle", place, |g| s.sun[g].dot(&s.r_m[g].normalize()).max(0.0));
    c.vectors(
        "radial, day side",
        "sun_angle",
        place,
        &[&|g| s.body[g] * s.r_m[g].normalize() * s.sun[g].dot(&s.r_m[g].normalize()).max(0.0)],
    );
    c.grid("nu", "shadow", "sunlit parts of the orbit", |g| s.sunlit[g]);
    c.grid(
        "penumbra",
        "shadow",
        "edges of the shadow",
        |g| if s.sunlit[g] > 0.0 && s.sunlit[g] < 1.0 { 1.0 } else { 0.0 },
    );
}

/// Instants at which a grid series crosses a level, with the sign of the crossing.
fn crossings(grid: &[f64], series: &[f64], level: f64) -> Vec<(f64, f64)> {
    let mut out = Vec::new();
    for i in 1..series.len() {
        let (a, b) = (series[i - 1] - level, series[i] - level);
        if a * b <= 0.0 && a != b {
            out.push((grid[i - 1] + (grid[i] - grid[i - 1]) * a / (a - b), (b - a).signum()));
        }
    }
    out
}

/// Sum of decays after instants, each forgetting the one before: exp(-(t - last)/tau).
fn since(scene: &Scene, instants: &[(f64, f64)], tau_s: f64) -> Vec<f64> {
    let clock = scene.clock_s();
    let mut sum = vec![0.0; clock.len()];
    for (n, (instant, amplitude)) in instants.iter().enumerate() {
        let next = instants.get(n + 1).map_or(f64::INFINITY, |(t, _)| *t);
        let first = clock.partition_point(|t| t + 25.0 <= *instant);
        let last = clock.partition_point(|t| t - 25.0 < next.min(instant + 12.0 * tau_s)).max(first);
        let pulse = decay(&clock[first..last], *instant, tau_s);
        // What the next one replaces: the same decay continued after it.
        let gone = if next.is_finite() { decay(&clock[first..last], next, tau_s) } else { vec![0.0; last - first] };
        let left = if next.is_finite() { (-(next - instant) / tau_s).exp() } else { 0.0 };
        for ((total, p), g) in sum[first..last].iter_mut().zip(pulse).zip(gone) {
            *total += amplitude * (p - left * g);
        }
    }
    sum
}

fn terminator(c: &mut Collector) {
    let s = c.scene;
    let all = crossings(&s.grid_s, &s.sunlit, 0.5);
    let only = |sign: f64| all.iter().filter(|x| x.1 == sign).map(|x| (x.0, 1.0)).collect::<Vec<_>>();
    let place = "after the edges of the shadow";
    for tau in [60.0, 150.0, 300.0, 600.0, 1200.0, 2400.0] {
        let both: Vec<(f64, f64)> = all.iter().map(|x| (x.0, 1.0)).collect();
        for (what, list) in [
            ("every terminator crossing", both),
            ("every terminator crossing, signed", all.clone()),
            ("sunrise", only(1.0)),
            ("sunset", only(-1.0)),
        ] {
            c.windows(format!("exp(-(time since {what})/{tau:.0} s)"), "shadow", place, since(s, &list, tau));
        }
    }
}

fn field(c: &mut Collector) {
    let s = c.scene;
    let place = "strong parts of the geomagnetic field";
    c.grid("|B|", "geomagnetic_field", place, |g| s.field_body_t[g].norm());
    c.grid("B.B", "geomagnetic_field", place, |g| s.field_body_t[g].norm_squared());
    for i in 0..3 {
        c.grid(format!("|B{}|", AXIS[i]), "geomagnetic_field", place, |g| s.field_body_t[g][i].abs());
        for j in i..3 {
            c.grid(format!("B{} B{}", AXIS[i], AXIS[j]), "geomagnetic_field", place, |g| {
                s.field_body_t[g][i] * s.field_body_t[g][j]
            });
        }
        let last = s.grid_s.len() - 1;
        c.grid(format!("dB{}/dt", AXIS[i]), "geomagnetic_field", place, |g| {
            let [a, b] = [g.saturating_sub(1), (g + 1).min(last)];
            (s.field_body_t[b][i] - s.field_body_t[a][i]) / (s.grid_s[b] - s.grid_s[a])
        });
    }
    c.vectors("v x B", "geomagnetic_field", place, &[&|g| (s.body[g] * s.v_m_s[g]).cross(&s.field_body_t[g])]);
    c.vectors("w x B", "geomagnetic_field", place, &[&|g| s.w_rad_s[g].cross(&s.field_body_t[g])]);
}

fn surroundings(c: &mut Collector) {
    let s = c.scene;
    let rho = &s.case.ancillary.density_kg_m3;
    let height: Vec<f64> = s.r_m.iter().map(|r| r.norm()).collect();
    let mean_height = height.iter().sum::<f64>() / height.len() as f64;
    let mean_rho = rho.iter().sum::<f64>() / rho.len() as f64;
    let latitude: Vec<f64> = s.r_m.iter().map(|r| r.z / r.norm()).collect();
    let unix: Vec<f64> = s.grid_s.iter().map(|t| s.case.header.unix_s(*t)).collect();
    let ascension: Vec<f64> = s.r_m.iter().map(|r| r.y.atan2(r.x)).collect();
    let longitude: Vec<f64> = ascension.iter().zip(&unix).map(|(a, t)| a - time::gmst_rad(*t)).collect();
    let sun_ra = sun::right_ascension_rad(unix[0]);
    let place = "a height, latitude or local time";
    c.grid("rho", "density", place, |g| rho[g]);
    c.grid("rho^2", "density", place, |g| rho[g] * rho[g]);
    c.grid("h - <h>", "altitude", place, |g| height[g] - mean_height);
    c.grid("(h - <h>)^2", "altitude", place, |g| (height[g] - mean_height).powi(2));
    c.grid("sin(latitude)", "latitude", place, |g| latitude[g]);
    c.grid("sin^2(latitude)", "latitude", place, |g| latitude[g] * latitude[g]);
    c.grid("|sin(latitude)|", "latitude", place, |g| latitude[g].abs());
    c.several(
        "sin(longitude), cos(longitude)",
        "longitude",
        place,
        &[&|g| longitude[g].sin(), &|g| longitude[g].cos()],
    );
    c.several(
        "sin(2 longitude), cos(2 longitude)",
        "longitude",
        place,
        &[&|g| (2.0 * longitude[g]).sin(), &|g| (2.0 * longitude[g]).cos()],
    );
    for k in 1..=3 {
        let n = k as f64;
        c.several(
            format!("sin {k}LT, cos {k}LT"),
            "local_time",
            place,
            &[&|g| (n * (ascension[g] - sun_ra)).sin(), &|g| (n * (ascension[g] - sun_ra)).cos()],
        );
    }
    c.grid("tanh(4 sin(LT))", "local_time", place, |g| (4.0 * (ascension[g] - sun_ra).sin()).tanh());
    c.grid("tanh(4 cos(LT))", "local_time", place, |g| (4.0 * (ascension[g] - sun_ra).cos()).tanh());
    let along = "along the drag";
    c.vectors("a_d rho/<rho>", "density", along, &[&|g| s.drag_ng[g] * (rho[g] / mean_rho)]);
    c.vectors("a_d (h - <h>)", "altitude", along, &[&|g| s.drag_ng[g] * (height[g] - mean_height)]);
    c.vectors("a_d (t - <t>)", "time", along, &[&|g| s.drag_ng[g] * (s.grid_s[g] - s.grid_s[0])]);
    c.vectors("a_d sin^2(latitude)", "latitude", along, &[&|g| s.drag_ng[g] * latitude[g] * latitude[g]]);
    c.vectors(
        "a_d sin 2LT, a_d cos 2LT",
        "local_time",
        along,
        &[&|g| s.drag_ng[g] * (2.0 * (ascension[g] - sun_ra)).sin(), &|g| {
            s.drag_ng[g] * (2.0 * (ascension[g] - sun_ra)).cos()
        }],
    );
    c.vectors("a_d nu", "shadow", along, &[&|g| s.drag_ng[g] * s.sunlit[g]]);
}

fn sensor(c: &mut Collector) {
    let s = c.scene;
    let m = s.simulated_ng.clone();
    let place = "a large modelled signal";
    for i in 0..3 {
        c.windows(format!("m{}", AXIS[i]), "modelled_signal", place, m[i].clone());
        c.windows(format!("|m{}|", AXIS[i]), "modelled_signal", place, m[i].iter().map(|x| x.abs()).collect());
        c.windows(format!("m{}^3", AXIS[i]), "modelled_signal", place, m[i].iter().map(|x| x.powi(3)).collect());
        for j in i..3 {
            c.windows(
                format!("m{} m{}", AXIS[i], AXIS[j]),
                "modelled_signal",
                place,
                m[i].iter().zip(&m[j]).map(|(a, b)| a * b).collect(),
            );
        }
        c.windows(
            format!("average deviation {}", AXIS[i]),
            "activity",
            "noisy windows",
            s.case.recording.dev_ng[i].clone(),
        );
    }
    let t = &s.temperature_c;
    let mean = t.iter().sum::<f64>() / t.len() as f64;
    let last = t.len() - 1;
    let slope = |g: usize| {
        let [a, b] = [g.saturating_sub(15), (g + 15).min(last)];
        (t[b] - t[a]) / (s.grid_s[b] - s.grid_s[a])
    };
    c.grid("dT/dt", "temperature", "changing temperature", slope);
    c.grid("|dT/dt|", "temperature", "changing temperature", |g| slope(g).abs());
    c.grid("(T - <T>)^2", "temperature", "extreme temperature", |g| (t[g] - mean).powi(2));
    c.grid("(T - <T>)^3", "temperature", "extreme temperature", |g| (t[g] - mean).powi(3));
    c.vectors(
        "m (T - <T>)",
        "temperature",
        "a large modelled signal",
        &[&|g| {
            Vec3::new(s.simulated_grid_ng[0][g], s.simulated_grid_ng[1][g], s.simulated_grid_ng[2][g]) * (t[g] - mean)
        }],
    );
}

fn events(c: &mut Collector) {
    let s = c.scene;
    let mut kinds: Vec<&str> = s.case.events.iter().map(|e| e.kind.as_str()).collect();
    kinds.sort_unstable();
    kinds.dedup();
    for kind in kinds {
        let spans = s.case.spans(kind);
        let starts: Vec<(f64, f64)> = spans.iter().map(|x| (x[0], 1.0)).collect();
        let ends: Vec<(f64, f64)> = spans.iter().map(|x| (x[1], 1.0)).collect();
        for tau in [200.0, 600.0, 2000.0, 6000.0] {
            c.windows(
                format!("exp(-(time since start of {kind})/{tau:.0} s)"),
                "time_since_event",
                "after logged events",
                since(s, &starts, tau),
            );
            c.windows(
                format!("exp(-(time since end of {kind})/{tau:.0} s)"),
                "time_since_event",
                "after logged events",
                since(s, &ends, tau),
            );
        }
        for lag in [120.0, 300.0, 900.0, 2700.0] {
            let late: Vec<[f64; 2]> = spans.iter().map(|x| [x[0] + lag, x[1] + lag]).collect();
            c.windows(
                format!("{kind}, {lag:.0} s late"),
                "time_since_event",
                "after logged events",
                coverage(s.clock_s(), &late),
            );
        }
        let count: Vec<f64> = s.clock_s().iter().map(|t| starts.iter().filter(|x| x.0 <= *t).count() as f64).collect();
        c.windows(format!("number of {kind} so far"), "time_since_event", "after logged events", count);
        if !matches!(kind, "water_dump" | "evaporator" | "thruster" | "crew_sleep") {
            c.windows(
                format!("{kind} lasts"),
                "time_since_event",
                "during logged events",
                coverage(s.clock_s(), &spans),
            );
        }
    }
    let speed: Vec<f64> = s.wdot_rad_s2.iter().map(|w| w.norm()).collect();
    let mut sorted = speed.clone();
    sorted.sort_by(f64::total_cmp);
    let level = 8.0 * sorted[sorted.len() / 2] + 1e-7;
    let ends: Vec<(f64, f64)> =
        crossings(&s.grid_s, &speed, level).into_iter().filter(|x| x.1 < 0.0).map(|x| (x.0, 1.0)).collect();
    for tau in [300.0, 1000.0, 3000.0, 10_000.0] {
        c.windows(
            format!("exp(-(time since manoeuvre)/{tau:.0} s)"),
            "time_since_manoeuvre",
            "after manoeuvres",
            since(s, &ends, tau),
        );
    }
}

fn clock(c: &mut Collector) {
    let s = c.scene;
    let [start, end] = s.span_s();
    let t: Vec<f64> = s.clock_s().iter().map(|t| (t - start) / (end - start) * 2.0 - 1.0).collect();
    c.windows("t^2", "time", "the whole record", t.iter().map(|x| x * x).collect());
    c.windows("t^3", "time", "the whole record", t.iter().map(|x| x.powi(3)).collect());
    for hours in [6.0, 8.0, 12.0, 24.0, 48.0] {
        let rate = std::f64::consts::TAU / (hours * 3600.0);
        c.several(
            format!("sin, cos of a {hours:.0} h cycle"),
            "time",
            "a daily or shorter cycle",
            &[&|g| (rate * s.grid_s[g]).sin(), &|g| (rate * s.grid_s[g]).cos()],
        );
    }
    for cycles in (1..=40).map(|i| 0.05 * f64::from(i)).chain([2.5, 8.0, 12.0, 16.0]) {
        let rate = std::f64::consts::TAU * cycles / s.period_s;
        c.several(
            format!("sin, cos at {cycles:.2} cycles per orbit"),
            "per_orbit_line",
            "a line of the spectrum",
            &[&|g| (rate * s.grid_s[g]).sin(), &|g| (rate * s.grid_s[g]).cos()],
        );
    }
}
