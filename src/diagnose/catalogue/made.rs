//! A flight for the tests of the catalogue: six hours round a circular orbit at 300 km, nose ahead and belly down, with an entry of
//! every kind in its log. Its geometry and its drag are written here a second time, apart from the project's physics.

use std::f64::consts::TAU;
use std::fmt::Write;

use nalgebra::{Matrix3, Rotation3, UnitQuaternion, Vector3};

use super::{Effect, Theta};
use crate::diagnose::case::{Case, Header, Texts};
use crate::diagnose::scene::{Axes, Scene};

pub const START_S: f64 = 100_000.0;
pub const LENGTH_S: f64 = 21_600.0;
pub const RADIUS_M: f64 = 6_678_137.0;
pub const OFFSET_M: [f64; 3] = [2.0, 3.0, 5.0];
pub const MASS_KG: f64 = 104_000.0;
pub const AREA_M2: [f64; 3] = [60.0, 250.0, 370.0];
pub const DENSITY_KG_M3: f64 = 2e-11;
pub const NG_M_S2: f64 = 9.80665e-9;
/// Start and length of the entries of the log, by kind.
pub const LOG: [(&str, f64, f64); 7] = [
    ("crew_sleep", 103_600.0, 5400.0),
    ("water_dump", 110_010.0, 600.0),
    ("evaporator", 102_000.0, 300.0),
    ("evaporator", 115_000.0, 300.0),
    ("thruster", 104_000.0, 80.0),
    ("thruster", 104_040.0, 80.0),
    ("mass_change", 112_000.0, 0.0),
];
const DRAG_COEFFICIENT: f64 = 2.2;
const INCLINATION_RAD: f64 = 0.4966;
const STEP_S: f64 = 20.0;

/// Rate of the orbit, rad/s.
pub fn rate_rad_s() -> f64 {
    (3.986_004_418e14 / RADIUS_M.powi(3)).sqrt()
}

/// Position, m, velocity, m/s, and the body axes (ahead, to starboard, down), inertial.
pub fn orbit(t: f64) -> (Vector3<f64>, Vector3<f64>, Matrix3<f64>) {
    let (sin, cos) = (rate_rad_s() * (t - START_S)).sin_cos();
    let (sin_i, cos_i) = INCLINATION_RAD.sin_cos();
    let up = Vector3::new(cos, sin * cos_i, sin * sin_i);
    let ahead = Vector3::new(-sin, cos * cos_i, cos * sin_i);
    let starboard = ahead.cross(&up);
    (up * RADIUS_M, ahead * (RADIUS_M * rate_rad_s()), Matrix3::from_columns(&[ahead, starboard, -up]))
}

/// Drag in body axes, ng, in air that turns `turns` times as fast as the Earth and has this wind besides, inertial, m/s.
pub fn drag_ng(t: f64, turns: f64, wind_m_s: Vector3<f64>) -> Vector3<f64> {
    let (r, v, body) = orbit(t);
    let air = Vector3::new(-r.y, r.x, 0.0) * (turns * 7.292_115_9e-5) + wind_m_s;
    let relative = body.transpose() * (v - air);
    let unit = relative.normalize();
    let area: f64 = (0..3).map(|k| unit[k].abs() * AREA_M2[k]).sum();
    relative * (-0.5 * DENSITY_KG_M3 * DRAG_COEFFICIENT * area * relative.norm() / MASS_KG / NG_M_S2)
}

/// What the simulation expects, ng.
pub fn simulated_ng(t: f64) -> Vector3<f64> {
    let phase = TAU * (t - START_S) / 5400.0;
    Vector3::new(100.0 * phase.sin(), 60.0 * phase.cos(), 30.0 + 40.0 * (2.0 * phase).sin())
}

/// Its temperature swings in this time, s.
pub const TEMPERATURE_PERIOD_S: f64 = 5400.0;

/// The temperature of the sensor, C.
pub fn temperature_c(t: f64) -> f64 {
    20.0 + 3.0 * (TAU * (t - START_S) / TEMPERATURE_PERIOD_S).cos()
}

/// The case.
pub fn case() -> Case {
    let end_s = START_S + LENGTH_S;
    let toml = format!(
        "[case]\nid = \"made\"\nepoch_utc = \"1994-07-08T12:53:01Z\"\nliftoff_clock_s = 13800\nstart_s = {START_S:.1}\n\
         end_s = {end_s:.1}\n[vehicle]\nmass_kg = {MASS_KG:.1}\ndrag_coefficient = {DRAG_COEFFICIENT}\narea_m2 = {AREA_M2:?}\n\
         sensor_offset_m = {OFFSET_M:?}\nsrp_coefficient = 1.3\n[simulation]\nfile = \"simulation.csv\"\nincludes = []\n\
         [recording]\nfile = \"recording.csv\"\nkind = \"acceleration_csv\"\n[ancillary]\nfile = \"ancillary.csv\"\n\
         events = \"events.csv\"\n"
    );
    let mut simulation = "clock_s,ax_ng,ay_ng,az_ng\n".to_string();
    let mut ancillary =
        "clock_s,rx_m,ry_m,rz_m,vx_m_s,vy_m_s,vz_m_s,qw,qx,qy,qz,wx_rad_s,wy_rad_s,wz_rad_s,density_kg_m3,\
                         temperature_c\n"
            .to_string();
    let mut t = START_S - 600.0;
    while t <= end_s + 600.0 {
        let (r, v, body) = orbit(t);
        let q = UnitQuaternion::from_rotation_matrix(&Rotation3::from_matrix_unchecked(body.transpose()));
        let m = simulated_ng(t);
        let _ = writeln!(simulation, "{t},{},{},{}", m.x, m.y, m.z);
        let _ = writeln!(
            ancillary,
            "{t},{},{},{},{},{},{},{},{},{},{},0,{},0,{DENSITY_KG_M3},{}",
            r.x,
            r.y,
            r.z,
            v.x,
            v.y,
            v.z,
            q.w,
            q.i,
            q.j,
            q.k,
            -rate_rad_s(),
            temperature_c(t)
        );
        t += STEP_S;
    }
    let mut recording = "clock_s,ax_ng,ay_ng,az_ng,dev_x_ng,dev_y_ng,dev_z_ng\n".to_string();
    let mut t = START_S + 25.0;
    while t <= end_s - 25.0 {
        // Any noise: no series of the catalogue knows of it.
        let noise = 50.0 * (t * 1.7).sin();
        let _ = writeln!(recording, "{t},{noise},{},{},600,300,350", 0.5 * noise, 1.0 - 0.6 * noise);
        t += 25.0;
    }
    let mut events = "clock_s,duration_s,kind,detail\n".to_string();
    for (kind, clock_s, duration_s) in LOG {
        let _ = writeln!(events, "{clock_s},{duration_s},{kind},");
    }
    let texts = Texts {
        recording: Some(recording),
        simulation: Some(simulation),
        ancillary: Some(ancillary),
        events: Some(events),
    };
    Case::from_texts(Header::parse(&toml, &[]).unwrap(), &texts).unwrap()
}

/// The columns of an effect at a theta, zero on the axes that they do not act on.
pub fn columns(scene: &Scene, effect: &Effect, theta: Theta) -> Vec<Axes> {
    let windows = scene.clock_s().len();
    let filled = |raw: crate::diagnose::design::Raw| raw.map(|series| series.unwrap_or_else(|| vec![0.0; windows]));
    (effect.signature)(scene, &theta).expect("a series").columns().into_iter().map(filled).collect()
}

/// The mean over the window centred there, by fifty points.
pub fn mean_ng(clock_s: f64, of: impl Fn(f64) -> Vector3<f64>) -> Vector3<f64> {
    (0..50).map(|i| of(clock_s - 24.5 + f64::from(i))).sum::<Vector3<f64>>() / 50.0
}

/// That a series is what is expected in every window: within four thousandths of the largest value, which a grid of 20 s may take from it
/// where the projected area has a kink.
pub fn is_everywhere(scene: &Scene, found: &Axes, expected_ng: impl Fn(f64) -> Vector3<f64>) {
    let expected: Vec<Vector3<f64>> = scene.clock_s().iter().map(|t| mean_ng(*t, &expected_ng)).collect();
    let largest = expected.iter().map(|a| a.amax()).fold(0.0, f64::max);
    assert!(largest > 0.0, "something is expected");
    for (i, (t, a)) in scene.clock_s().iter().zip(&expected).enumerate() {
        for k in 0..3 {
            assert!((found[k][i] - a[k]).abs() < 4e-3 * largest, "axis {k} at {t}: {} for {}", found[k][i], a[k]);
        }
    }
}

/// The value of a series in the window centred there.
pub fn at(scene: &Scene, series: &[f64], clock_s: f64) -> f64 {
    let i = scene.clock_s().iter().position(|t| (t - clock_s).abs() < 1e-6).expect("a window there");
    series[i]
}

/// That column `n` of an effect at a theta is what is expected, everywhere.
pub fn gives(effect: &Effect, theta: Theta, n: usize, expected_ng: impl Fn(f64) -> Vector3<f64>) {
    let case = case();
    let scene = Scene::new(&case).unwrap();
    is_everywhere(&scene, &columns(&scene, effect, theta)[n], expected_ng);
}

/// That the push of an effect at a theta has these shares of itself in the windows centred there: (centre, share), on every axis alike.
pub fn has_shares(effect: &Effect, theta: Theta, shares: &[(f64, f64)]) {
    let case = case();
    let scene = Scene::new(&case).unwrap();
    for (axis, column) in columns(&scene, effect, theta).iter().enumerate() {
        for (centre_s, share) in shares {
            let found = at(&scene, &column[axis], *centre_s);
            assert!((found - share).abs() < 1e-9, "axis {axis} at {centre_s}: {found} for {share}");
        }
    }
}
