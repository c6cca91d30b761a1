//! Orbits made to order: other satellites, days and heights than the samples, with another physics left out in each, and
//! what real files do to a reader.

use std::collections::BTreeMap;
use std::fmt::Write;

use nalgebra::Vector3;
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::measured::{self, Answer, MeasuredCase, MeasuredError};
use oare_ground::diagnose::orbit::arc::{Impulse, fly};
use oare_ground::diagnose::orbit::forces::{Air, Baseline, Environment, Finer, Term};
use oare_ground::physics::earth_orientation::{EarthOrientation, GpsInstant};
use oare_ground::physics::gravity_field::GravityField;
use oare_ground::physics::integrator::State;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

use super::ids;

const GM: f64 = 3.986_004_415e14;
pub const SIGMA_M: f64 = 0.025;
/// All that a maker of orbits has, so that one thing can be left out.
pub const ALL: [&str; 6] = ["gravity:12", "sun", "moon", "solar_radiation_pressure", "srp_y_bias", "srp_b_bias"];
const GPS_HEIGHT_M: f64 = 20_200e3;

/// A field of degree 12 by Kaula's rule, with the Earth's own flattening.
pub fn field() -> String {
    let mut rng = ChaCha12Rng::seed_from_u64(1);
    let mut text = String::from(
        "product_type gravity_field\nmodelname made\nearth_gravity_constant 0.3986004415E+15\nradius 6378136.3\nmax_degree 12\n\
         errors no\nnorm fully_normalized\ntide_system tide_free\nend_of_head =====\ngfc 0 0 1.0 0.0\n",
    );
    for n in 2..=12 {
        for m in 0..=n {
            let size = 1e-5 / f64::from(n * n);
            let (c, s) = ((2.0 * rng.random::<f64>() - 1.0) * size, (2.0 * rng.random::<f64>() - 1.0) * size);
            let c = if (n, m) == (2, 0) { -4.8416e-4 } else { c };
            let _ = writeln!(text, "gfc {n} {m} {c:e} {:e}", if m == 0 { 0.0 } else { s });
        }
    }
    text
}

/// Made Earth orientation for a week round a day.
pub fn orientation(mjd: f64) -> String {
    let mut text = String::from("mjd_utc,xp_arcsec,yp_arcsec,ut1_minus_utc_s,dx_mas,dy_mas\n");
    for day in -3..=4 {
        let d = f64::from(day);
        // UT1 does not jump with UTC: across the leap second at the end of 2016 the difference does.
        let jump = if mjd + d >= 57_754.0 { 1.0 } else { 0.0 };
        let _ = writeln!(
            text,
            "{},{},{},{},{},{}",
            mjd + d,
            0.08 + 0.002 * d,
            0.31 - 0.001 * d,
            -0.4 - 0.001 * d + jump,
            0.1,
            -0.2
        );
    }
    text
}

/// A circular orbit's state.
pub fn circular(height_m: f64, inclination_deg: f64, node_deg: f64, latitude_deg: f64) -> State {
    let r = 6_378_137.0 + height_m;
    let [i, node, u] = [inclination_deg, node_deg, latitude_deg].map(f64::to_radians);
    let towards = Vector3::new(node.cos(), node.sin(), 0.0);
    let across = Vector3::new(-node.sin() * i.cos(), node.cos() * i.cos(), i.sin());
    let speed = (GM / r).sqrt();
    State { r: (towards * u.cos() + across * u.sin()) * r, v: (across * u.cos() - towards * u.sin()) * speed }
}

pub struct Satellite {
    pub id: &'static str,
    pub start: State,
    pub terms: Vec<(Term, [f64; 2])>,
    /// Velocity steps in order of time.
    pub kicks: Vec<Impulse>,
}

impl Satellite {
    fn fly(&self, environment: &Environment, baseline: &Baseline, t_s: &[f64]) -> Vec<State> {
        let mut states = fly(environment, baseline, &self.terms, self.start, t_s, None);
        for kick in &self.kicks {
            let last = t_s.partition_point(|t| *t < kick.at_s) - 1;
            let rest = fly(environment, baseline, &self.terms, states[last], &t_s[last..], Some(*kick));
            states.splice(last.., rest);
        }
        states
    }
}

pub fn gps(id: &'static str, node_deg: f64, latitude_deg: f64) -> Satellite {
    let start = circular(GPS_HEIGHT_M, 55.0, node_deg, latitude_deg);
    let terms = vec![(Term::SolarRadiation, [9.3e-8, 0.0]), (Term::YBias, [4e-10, 0.0]), (Term::BBias, [-6e-10, 0.0])];
    Satellite { id, start, terms, kicks: Vec::new() }
}

/// A recording of some satellites.
pub struct Made {
    /// Date of the first epoch.
    pub date: (i32, u32, u32),
    pub spacing_s: f64,
    pub hours: f64,
    pub satellites: Vec<Satellite>,
    /// The finer terms of whoever computed it.
    pub finer: Finer,
    pub air: Air,
    /// Of the positions, m; what the case states is [`SIGMA_M`].
    pub noise_m: f64,
    /// What all of them feel.
    pub known: Vec<Term>,
}

impl Made {
    /// A position every quarter of an hour, with all the finer terms.
    pub fn every_quarter(date: (i32, u32, u32), hours: f64, satellites: Vec<Satellite>) -> Self {
        let known = vec![Term::Sun, Term::Moon];
        Self { date, spacing_s: 900.0, hours, satellites, finer: Finer::ALL, air: Air::MEAN, noise_m: SIGMA_M, known }
    }

    /// Epochs, s, and the states of every satellite there, with where they fly and from when on.
    pub fn flown(&self) -> (Vec<f64>, Vec<Vec<State>>, Environment, GpsInstant) {
        let (year, month, day) = self.date;
        let origin = GpsInstant::from_calendar(year, month, day, 0.0).expect("a date");
        let eop = EarthOrientation::from_csv(&orientation(origin.mjd)).expect("orientation");
        let gravity = GravityField::from_gfc(&field(), origin.mjd).expect("a field");
        let span_s = self.hours * 3600.0;
        let mut environment = Environment::new(origin, span_s, &eop, gravity).expect("an environment");
        (environment.finer, environment.air) = (self.finer, self.air);
        let t_s: Vec<f64> = (0..=(span_s / self.spacing_s) as usize).map(|i| i as f64 * self.spacing_s).collect();
        let baseline = Baseline { degree: 12, known: self.known.clone(), estimated: Vec::new() };
        let flown = self.satellites.iter().map(|s| s.fly(&environment, &baseline, &t_s)).collect();
        (t_s, flown, environment, origin)
    }

    pub fn sp3(&self) -> String {
        let (year, month, day) = self.date;
        let (t_s, flown, environment, origin) = self.flown();
        let mut rng = ChaCha12Rng::seed_from_u64(5);
        let mut normal = || ((0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0) * self.noise_m;
        let mut text = format!("#cV{year:4} {month:2} {day:2}  0  0  0.00000000     {:3} ORBIT MADE\n", t_s.len());
        text.push_str("%c M  cc GPS ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc\n");
        for (k, t) in t_s.iter().enumerate() {
            let (days, rest) = ((t / 86_400.0).floor(), t % 86_400.0);
            let (_, month, day, _) = calendar(origin.mjd + days);
            let year = calendar(origin.mjd + days).0;
            let _ = writeln!(
                text,
                "*  {year:4} {month:2} {day:2} {:2} {:2} {:11.8}",
                (rest / 3600.0).floor(),
                (rest % 3600.0 / 60.0).floor(),
                rest % 60.0
            );
            for (satellite, states) in self.satellites.iter().zip(&flown) {
                let noisy = states[k].r + Vector3::new(normal(), normal(), normal());
                let km = environment.rotation.inertial_to_fixed(*t) * noisy / 1000.0;
                let _ = writeln!(text, "P{}{:14.6}{:14.6}{:14.6} 999999.999999", satellite.id, km.x, km.y, km.z);
                let _ = writeln!(text, "V{}{:14.6}{:14.6}{:14.6} 999999.999999", satellite.id, 1.0, 2.0, 3.0);
            }
        }
        text.push_str("EOF\n");
        text
    }

    pub fn diagnose(&self, includes: &[&str]) -> Answer {
        self.diagnose_text(self.sp3(), includes).expect("an answer")
    }

    fn diagnose_text(&self, sp3: String, includes: &[&str]) -> Result<Answer, MeasuredError> {
        let (year, month, day) = self.date;
        let origin = GpsInstant::from_calendar(year, month, day, 0.0).expect("a date");
        let quoted: Vec<String> = includes.iter().map(|w| format!("\"{w}\"")).collect();
        let case = format!(
            "[case]\nid = \"made\"\n[simulation]\nincludes = [{}]\n[recording]\nkind = \"orbit_sp3\"\nfiles = [\"a.sp3\"]\n\
             eop = \"eop.csv\"\ngravity = \"a.gfc\"\nsatellites = \"all\"\nposition_sigma_m = {SIGMA_M}\n",
            quoted.join(",")
        );
        let case = MeasuredCase::parse(&case, &[])?;
        let files = [("a.sp3", sp3), ("eop.csv", orientation(origin.mjd)), ("a.gfc", field())];
        let files: BTreeMap<String, String> = files.into_iter().map(|(name, text)| (name.to_owned(), text)).collect();
        measured::diagnose(&case, &files)
    }
}

fn calendar(mjd: f64) -> (i32, i32, i32, f64) {
    sofars::cal::jd2cal(2_400_000.5, mjd).expect("a date")
}

/// The baseline without one of its words.
pub fn without(word: &str) -> Vec<&'static str> {
    ALL.into_iter().filter(|w| *w != word).collect()
}

pub fn close(answer: &Answer, effect: usize, name: &str, truth: f64) {
    let p = answer.effects[effect].parameters.iter().find(|p| p.name == name).expect(name);
    // Three standard errors: a dozen such checks are made here, each a thousand times less likely to fail by chance.
    assert!((p.value - truth).abs() <= 3.0 * p.sigma, "{name}: {} +- {} against {truth}", p.value, p.sigma);
}

#[test]
fn a_full_model_of_another_year_lacks_nothing() {
    let made = Made::every_quarter((2023, 3, 20), 36.0, vec![gps("G07", 10.0, 50.0)]);
    let answer = made.diagnose(&ALL);
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Consistent, vec![]));
    assert!(answer.arcs[0].rms_after < 2.0 * SIGMA_M, "{}", answer.arcs[0].rms_after);
}

/// A computed orbit has what its program has: without tide and relativity it lacks nothing that could be named, and says so.
#[test]
fn a_computed_orbit_without_tides_lacks_nothing_and_is_told() {
    let mut low = gps("L51", 40.0, 20.0);
    low.start = circular(5_900e3, 52.6, 40.0, 20.0);
    low.terms.truncate(1);
    let neither = Finer { tide: false, relativity: false };
    let made = Made { spacing_s: 300.0, finer: neither, ..Made::every_quarter((2015, 4, 9), 30.0, vec![low]) };
    let answer = made.diagnose(&["gravity:12", "sun", "moon", "solar_radiation_pressure"]);
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Consistent, vec![]), "{:?}", answer.notes);
    assert!(
        answer.notes.iter().any(|note| note.starts_with("The recording has neither the tide")),
        "{:?}",
        answer.notes
    );
}

/// One position a metre off between quarters of an hour is left out, and counted.
#[test]
fn a_position_that_is_off_by_a_metre_is_left_out() {
    let made = Made::every_quarter((2023, 3, 20), 36.0, vec![gps("G07", 10.0, 50.0)]);
    let sp3 = made.sp3();
    let places: Vec<usize> = sp3.match_indices("PG07").map(|(place, _)| place).collect();
    let x = places[50] + 4..places[50] + 18;
    let off_km: f64 = sp3[x.clone()].trim().parse::<f64>().unwrap() + 0.001;
    let mut moved = sp3.clone();
    moved.replace_range(x, &format!("{off_km:14.6}"));
    let answer = made.diagnose_text(moved, &ALL).unwrap();
    assert_eq!((answer.verdict, ids(&answer), answer.arcs[0].masked), (Verdict::Consistent, vec![], 1));
    assert!(answer.arcs[0].rms_after < 2.0 * SIGMA_M, "{}", answer.arcs[0].rms_after);
}

#[test]
fn a_velocity_step_of_one_satellite_is_named_there_and_nowhere_else() {
    let mut satellites = vec![gps("G01", 0.0, 10.0), gps("G02", 120.0, 200.0), gps("G03", 240.0, 320.0)];
    let kick = Impulse { at_s: 52_345.0, dv_m_s: Vector3::new(0.03, -0.11, 0.05) };
    satellites[1].kicks.push(kick);
    let answer = Made::every_quarter((2019, 11, 2), 36.0, satellites).diagnose(&ALL);
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Explained, vec!["manoeuvre"]));
    let verdicts: Vec<Verdict> = answer.arcs.iter().map(|a| a.verdict).collect();
    assert_eq!(verdicts, [Verdict::Consistent, Verdict::Explained, Verdict::Consistent]);
    close(&answer, 0, "at_s", kick.at_s);
    close(&answer, 0, "dv_m_s", kick.dv_m_s.norm());
    assert!(answer.arcs[1].rms_before > 100.0 && answer.arcs[1].rms_after < 2.0 * SIGMA_M);
}

/// Of three satellites one has a push along its panels' axis that the simulation lacks.
#[test]
fn a_push_of_one_satellite_alone_is_named_there() {
    const Y_M_S2: f64 = 2.5e-9;
    let mut satellites = vec![gps("G01", 0.0, 10.0), gps("G02", 120.0, 200.0), gps("G03", 240.0, 320.0)];
    for satellite in &mut satellites {
        satellite.terms.retain(|(term, _)| *term != Term::YBias);
    }
    satellites[2].terms.push((Term::YBias, [Y_M_S2, 0.0]));
    let made = Made::every_quarter((2018, 5, 14), 40.0, satellites);
    let answer = made.diagnose(&without("srp_y_bias"));
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Explained, vec!["srp_y_bias"]), "{:?}", answer.notes);
    let verdicts: Vec<Verdict> = answer.arcs.iter().map(|a| a.verdict).collect();
    assert_eq!(verdicts, [Verdict::Consistent, Verdict::Consistent, Verdict::Explained]);
    close(&answer, 0, "accel_m_s2", Y_M_S2);
    assert!(answer.effects[0].why.starts_with("G03 alone: "), "{}", answer.effects[0].why);
    assert!(answer.arcs[2].rms_before > 1.0 && answer.arcs[2].rms_after < 2.0 * SIGMA_M);
}

#[test]
fn sunlight_is_found_beside_a_velocity_step_of_the_only_satellite() {
    let mut satellite = gps("E11", 77.0, 150.0);
    satellite.kicks.push(Impulse { at_s: 71_000.0, dv_m_s: Vector3::new(-0.02, 0.01, 0.06) });
    let made = Made::every_quarter((2021, 6, 21), 40.0, vec![satellite]);
    let answer = made.diagnose(&["gravity:12", "sun", "moon", "srp_y_bias", "srp_b_bias"]);
    let mut named = ids(&answer);
    named.sort_unstable();
    assert_eq!(named, ["manoeuvre", "solar_radiation_pressure"], "{:?}", answer.effects);
}

#[test]
fn the_moon_is_missed_across_a_leap_second() {
    let made = Made::every_quarter((2016, 12, 31), 36.0, vec![gps("R05", 33.0, 0.0)]);
    let answer = made.diagnose(&without("moon"));
    assert_eq!(ids(&answer), ["third_body_moon"]);
    close(&answer, 0, "fraction", 1.0);
}

#[test]
fn degrees_are_missed_at_the_height_of_glonass() {
    let mut satellite = gps("R09", 200.0, 90.0);
    satellite.start = circular(19_130e3, 64.8, 200.0, 90.0);
    let made = Made::every_quarter((2012, 9, 9), 30.0, vec![satellite]);
    let mut includes = without("gravity:12");
    includes.push("gravity:4");
    let answer = made.diagnose(&includes);
    assert_eq!(ids(&answer), ["gravity_degree"]);
    close(&answer, 0, "from_degree", 5.0);
}

#[test]
fn the_sun_is_missed_in_the_geostationary_ring() {
    let mut satellite = gps("C01", 0.0, 140.0);
    satellite.start = circular(35_786e3, 1.5, 60.0, 80.0);
    let made = Made::every_quarter((2020, 1, 15), 48.0, vec![satellite]);
    let answer = made.diagnose(&without("sun"));
    assert_eq!(ids(&answer), ["third_body_sun"]);
}

/// A satellite low enough to feel the air.
pub fn low() -> Satellite {
    let start = circular(480e3, 89.0, 30.0, 0.0);
    Satellite {
        id: "L09",
        start,
        terms: vec![(Term::SolarRadiation, [3e-8, 0.0]), (Term::Drag, [1.7, 0.0])],
        kicks: Vec::new(),
    }
}

#[test]
fn drag_is_missed_in_a_low_orbit() {
    let made = Made { spacing_s: 300.0, ..Made::every_quarter((2008, 5, 14), 24.0, vec![low()]) };
    let answer = made.diagnose(&["gravity:12", "sun", "moon", "solar_radiation_pressure"]);
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Explained, vec!["aerodynamic_drag"]));
    close(&answer, 0, "fraction", 1.7);
}

#[test]
fn a_low_orbit_is_followed_from_sparse_positions() {
    let made = Made::every_quarter((2008, 5, 14), 24.0, vec![low()]);
    let answer = made.diagnose(&["gravity:12", "sun", "moon", "solar_radiation_pressure", "aerodynamic_drag"]);
    assert_eq!((answer.verdict, ids(&answer)), (Verdict::Consistent, vec![]));
}

#[test]
fn gaps_absent_and_wrong_positions_are_left_out_and_counted() {
    let made = Made::every_quarter(
        (2015, 7, 7),
        36.0,
        vec![gps("G01", 0.0, 10.0), gps("G02", 120.0, 200.0), gps("G03", 240.0, 320.0)],
    );
    let mut lines: Vec<String> = made.sp3().lines().map(str::to_owned).collect();
    let mut seen = 0;
    for line in lines.iter_mut().filter(|line| line.starts_with("PG01")) {
        seen += 1;
        match seen {
            20 | 21 => *line = "PG01      0.000000      0.000000      0.000000 999999.999999".to_owned(),
            40 => *line = "PG01 999999.999999 999999.999999 999999.999999 999999.999999".to_owned(),
            // Three kilometres off.
            60 => {
                let x: f64 = line[4..18].trim().parse().expect("x");
                line.replace_range(4..18, &format!("{:14.6}", x + 3.0));
            }
            _ => {}
        }
    }
    // The second appears late; the third only for an hour.
    let (mut second, mut third) = (0, 0);
    lines.retain(|line| {
        second += usize::from(line.starts_with("PG02"));
        third += usize::from(line.starts_with("PG03"));
        let late = line.starts_with("PG02") && second < 30;
        let gone = line.starts_with("PG03") && third > 4;
        !late && !gone
    });
    let answer = made.diagnose_text(lines.join("\n"), &without("solar_radiation_pressure")).expect("an answer");
    assert_eq!(ids(&answer), ["solar_radiation_pressure"]);
    let arcs: Vec<(&str, usize)> = answer.arcs.iter().map(|a| (a.id.as_str(), a.masked)).collect();
    assert_eq!(arcs, [("G01", 4), ("G02", 0)]);
    assert!(answer.notes.iter().any(|n| n.starts_with("Left out: G03")), "{:?}", answer.notes);
}

#[test]
fn what_cannot_be_used_is_told_in_one_sentence() {
    let made = Made::every_quarter((2015, 7, 7), 6.0, vec![gps("G01", 0.0, 10.0)]);
    let sp3 = made.sp3();
    let said = |text: String, includes: &[&str]| made.diagnose_text(text, includes).expect_err("an error").to_string();
    assert_eq!(said("<html>".to_owned(), &ALL), "a.sp3, line 1: expected a line starting with #, found \"<html>\"");
    assert_eq!(said(sp3.lines().take(2).collect::<Vec<_>>().join("\n"), &ALL), "the recording does not hold an epoch");
    assert!(
        said(sp3.replace("PG01", "PG01 x"), &ALL).contains("line 4: expected P, a satellite and three coordinates")
    );
    let other_day = sp3.replace("*  2015", "*  1999");
    assert!(
        said(other_day, &ALL).starts_with("eop.csv: Earth orientation covers MJD"),
        "{}",
        said(sp3.replace("*  2015", "*  1999"), &ALL)
    );
    assert!(said(sp3.clone(), &["gravity:12", "tea"]).ends_with("found \"tea\""));
    let short: String = sp3.lines().take(2 + 3 * 5).map(|l| format!("{l}\n")).collect();
    assert_eq!(said(short, &ALL), "G01 has 5 usable positions to fit, expected at least 12");
}
