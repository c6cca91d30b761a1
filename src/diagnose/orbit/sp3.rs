//! SP3 precise orbits (versions a to d): text in, one track a satellite out.
//!
//! Missing positions (0.000000), predicted ones and isolated blunders are left out and counted, never filled. Not here:
//! clocks, velocities, correlations.

use std::collections::{BTreeMap, HashSet};

use nalgebra::Vector3;

use super::OrbitError;
use crate::diagnose::measured::spread::median;
use crate::physics::earth_orientation::{GpsInstant, TAI_MINUS_GPS_S, lagrange_weights, tai_minus_utc_s};

/// A position further than this from the polynomial through its neighbours is a blunder, m, where the polynomial itself is good enough.
const BLUNDER_M: f64 = 1.0;
/// Else it is so many times what the polynomial misses, 0.9 m for a navigation satellite at 15 minutes: an eccentric orbit turns faster
/// near the Earth than the circle through the place, by which that is reckoned.
const BLUNDER_TIMES: f64 = 10.0;
/// The same over what positions of the arc are off it as a rule.
const USUAL_TIMES: f64 = 8.0;
/// A polynomial that itself misses more is no judge, m.
const POLYNOMIAL_M: f64 = 10.0;
/// GPS time minus BeiDou time, s (exact).
const GPS_MINUS_BDT_S: f64 = 14.0;
/// What some makers write where there is no coordinate, km.
const ABSENT_KM: f64 = 999_999.0;
const GM_M3_S2: f64 = 3.986e14;
const EARTH_RATE_RAD_S: f64 = 7.292e-5;

/// One satellite's positions in the Earth-fixed frame.
#[derive(Debug, Clone, Default)]
pub struct Track {
    /// Such as `G05`.
    pub id: String,
    /// Seconds after the recording's origin, increasing.
    pub t_s: Vec<f64>,
    /// Earth-fixed positions, m.
    pub fixed_m: Vec<Vector3<f64>>,
    /// Epochs announced for the satellite and not usable.
    pub masked: usize,
    /// Epochs flagged as manoeuvres by the maker of the orbit.
    pub manoeuvre_flags: usize,
}

/// A recording: one or more files of the same satellites.
#[derive(Debug, Clone)]
pub struct Recording {
    /// The first epoch.
    pub origin: GpsInstant,
    /// The satellites, by name.
    pub tracks: Vec<Track>,
    /// What files lack or hold twice, in words: fewer epochs than their first line announces, positions of one epoch.
    pub amiss: Vec<String>,
}

impl Recording {
    /// Read one or more files, given as (name, text); an epoch that two files hold is taken from the later.
    pub fn read(files: &[(String, String)]) -> Result<Self, OrbitError> {
        let mut satellites: BTreeMap<String, BTreeMap<i64, Found>> = BTreeMap::new();
        let mut origin: Option<GpsInstant> = None;
        let mut amiss = Vec::new();
        for (name, text) in files {
            let Held { epochs: held, twice } = read_file(name, text, &mut origin, &mut satellites)?;
            // Columns 33 to 39 of the first line: how many epochs follow.
            let announced = text.get(32..39).and_then(|count| count.trim().parse::<usize>().ok());
            if let Some(announced) = announced.filter(|announced| held < *announced) {
                amiss.push(format!("{name} announces {announced} epochs and holds {held}"));
            }
            if twice > 0 {
                let positions = if twice == 1 { "a position".to_owned() } else { format!("{twice} positions") };
                amiss.push(format!("of {positions} that {name} gives twice, the earlier"));
            }
        }
        let origin = origin.ok_or(OrbitError::Empty { what: "an epoch".to_owned() })?;
        if let Some(what) = no_kilometres(&satellites) {
            return Err(OrbitError::Empty { what });
        }
        let first_us = satellites.values().filter_map(|found| found.keys().next()).min().copied().unwrap_or(0);
        let shift_s = first_us as f64 / 1e6;
        let tracks = satellites.into_iter().map(|(id, found)| track(id, found, shift_s)).collect();
        Ok(Self { origin: origin.plus_s(shift_s), tracks, amiss })
    }

    /// Length of the recording, s.
    pub fn span_s(&self) -> f64 {
        self.tracks.iter().filter_map(|track| track.t_s.last()).copied().fold(0.0, f64::max)
    }
}

#[derive(Clone, Copy)]
struct Found {
    fixed_m: Vector3<f64>,
    usable: bool,
    manoeuvre: bool,
}

/// Where no position can be one in kilometres: what was looked for, and what is there.
fn no_kilometres(satellites: &BTreeMap<String, BTreeMap<i64, Found>>) -> Option<String> {
    let mut all = satellites.iter().flat_map(|(id, found)| found.values().map(move |one| (id, one)));
    if all.clone().any(|(_, one)| one.usable) {
        return None;
    }
    let is_absent = |x: &f64| (x.abs() / 1000.0 - ABSENT_KM).abs() < 1.0;
    let written = |one: &Found| one.fixed_m.norm() > 0.0 && !one.fixed_m.iter().any(is_absent);
    let (id, one) = all.find(|(_, one)| written(one))?;
    let km = one.fixed_m.norm() / 1000.0;
    Some(format!("a position in km, 6000 to 999999 from the Earth's centre: that of {id} is {km:.3}"))
}

/// What a file holds.
struct Held {
    epochs: usize,
    twice: usize,
}

/// Read one file.
fn read_file(
    name: &str,
    text: &str,
    origin: &mut Option<GpsInstant>,
    satellites: &mut BTreeMap<String, BTreeMap<i64, Found>>,
) -> Result<Held, OrbitError> {
    if !text.starts_with('#') {
        let found = text.lines().next().unwrap_or("").chars().take(20).collect();
        return Err(OrbitError::Sp3 { file: name.to_owned(), line: 1, expected: "a line starting with #", found });
    }
    let mut scale = String::from("GPS");
    let mut now_us: Option<i64> = None;
    let mut held = Held { epochs: 0, twice: 0 };
    let mut seen = HashSet::new();
    for (i, line) in text.lines().enumerate() {
        let bad = |expected| OrbitError::Sp3 { file: name.to_owned(), line: i + 1, expected, found: line.to_owned() };
        match line.as_bytes().first() {
            Some(b'%') if line.starts_with("%c") && line.get(9..12).is_some_and(|s| s != "ccc") => {
                scale = line[9..12].to_owned();
            }
            Some(b'*') => {
                let instant =
                    epoch(line, &scale).ok_or_else(|| bad("an epoch: * year month day hour minute second"))?;
                held.epochs += 1;
                let base = *origin.get_or_insert(instant);
                now_us = Some((instant.since_s(base) * 1e6).round() as i64);
            }
            Some(b'P') => {
                let now_us = now_us.ok_or_else(|| bad("an epoch line before the first position"))?;
                let (id, found) = position(line).ok_or_else(|| bad("P, a satellite and three coordinates in km"))?;
                held.twice += usize::from(!seen.insert((id.clone(), now_us)));
                satellites.entry(id).or_default().insert(now_us, found);
            }
            _ if line.starts_with("EOF") => break,
            _ => {}
        }
    }
    Ok(held)
}

fn epoch(line: &str, scale: &str) -> Option<GpsInstant> {
    let fields: Vec<&str> = line[1..].split_whitespace().collect();
    let &[year, month, day, hour, minute, second] = fields.as_slice() else { return None };
    let s_of_day =
        hour.parse::<f64>().ok()? * 3600.0 + minute.parse::<f64>().ok()? * 60.0 + second.parse::<f64>().ok()?;
    let instant = GpsInstant::from_calendar(year.parse().ok()?, month.parse().ok()?, day.parse().ok()?, s_of_day)?;
    match scale {
        "TAI" => Some(instant.plus_s(-TAI_MINUS_GPS_S)),
        "BDT" => Some(instant.plus_s(GPS_MINUS_BDT_S)),
        "UTC" | "GLO" => Some(instant.plus_s(tai_minus_utc_s(instant.mjd).ok()? - TAI_MINUS_GPS_S)),
        _ => Some(instant),
    }
}

fn position(line: &str) -> Option<(String, Found)> {
    let id = line.get(1..4)?.trim();
    // Version a writes a bare number for a GPS satellite.
    let id =
        if id.starts_with(|c: char| c.is_ascii_alphabetic()) { id.replace(' ', "0") } else { format!("G{:0>2}", id) };
    // Columns are fixed; a maker who did not keep to them has blanks between his numbers.
    let column = |from: usize| line.get(from..from + 14)?.trim().parse::<f64>().ok();
    let word = |k: usize| line.get(4..)?.split_whitespace().nth(k)?.parse::<f64>().ok();
    let [x, y, z] = match (column(4), column(18), column(32)) {
        (Some(x), Some(y), Some(z)) => [x, y, z],
        _ => [word(0)?, word(1)?, word(2)?],
    };
    let fixed_m = Vector3::new(x, y, z) * 1000.0;
    let flag = |column: usize| line.as_bytes().get(column).copied().unwrap_or(b' ');
    let there = fixed_m.iter().all(|x| x.is_finite() && x.abs() < ABSENT_KM * 1000.0);
    let usable = there && fixed_m.norm() > 6.0e6 && flag(79) != b'P';
    Some((id, Found { fixed_m, usable, manoeuvre: flag(78) == b'M' }))
}

fn track(id: String, found: BTreeMap<i64, Found>, shift_s: f64) -> Track {
    let mut track = Track { id, ..Track::default() };
    for (us, one) in found {
        track.manoeuvre_flags += usize::from(one.manoeuvre);
        if one.usable {
            track.t_s.push(us as f64 / 1e6 - shift_s);
            track.fixed_m.push(one.fixed_m);
        } else {
            track.masked += 1;
        }
    }
    drop_blunders(&mut track);
    track
}

/// Drop isolated positions that the eight neighbours contradict, where the orbit is smooth enough for their polynomial.
fn drop_blunders(track: &mut Track) {
    let n = track.t_s.len();
    // What a position is off its polynomial, and how much of that is a blunder.
    let miss = |i: usize| -> (f64, f64) {
        const NONE: (f64, f64) = (0.0, f64::INFINITY);
        if i < 4 || i + 4 >= n {
            return NONE;
        }
        // What the polynomial itself misses at its middle: (w h)^8 r (4!)^2 / 8!, at the angular rate seen from the ground where the radius is
        // least.
        let radius = (i - 4..=i + 4).map(|j| track.fixed_m[j].norm()).fold(f64::INFINITY, f64::min);
        let rate = (GM_M3_S2 / radius.powi(3)).sqrt() + EARTH_RATE_RAD_S;
        let spacing = (track.t_s[i + 4] - track.t_s[i - 4]) / 8.0;
        let polynomial_m = (rate * spacing).powi(8) * radius / 70.0;
        if polynomial_m > POLYNOMIAL_M {
            return NONE;
        }
        let around: Vec<usize> = (i - 4..=i + 4).filter(|&j| j != i).collect();
        let nodes: Vec<f64> = around.iter().map(|&j| track.t_s[j] - track.t_s[i]).collect();
        let weights = lagrange_weights(&nodes, 0.0);
        let through: Vector3<f64> = around.iter().zip(&weights).map(|(&j, w)| track.fixed_m[j] * *w).sum();
        ((through - track.fixed_m[i]).norm(), BLUNDER_M.max(BLUNDER_TIMES * polynomial_m))
    };
    let (misses, most): (Vec<f64>, Vec<f64>) = (0..n).map(miss).unzip();
    // Positions that scatter by metres are no blunders.
    let usual = median(misses.iter().zip(&most).filter(|(_, most)| most.is_finite()).map(|(miss, _)| *miss));
    // A blunder spoils its neighbours' polynomials too, by less: only local maxima go.
    let blunder = |i: usize| {
        let around = i.saturating_sub(4)..(i + 5).min(n);
        misses[i] > most[i].max(USUAL_TIMES * usual) && around.clone().all(|j| misses[j] <= misses[i])
    };
    let keep: Vec<bool> = (0..n).map(|i| !blunder(i)).collect();
    track.masked += keep.iter().filter(|k| !**k).count();
    let mut kept = keep.iter();
    track.t_s.retain(|_| *kept.next().unwrap_or(&true));
    let mut kept = keep.iter();
    track.fixed_m.retain(|_| *kept.next().unwrap_or(&true));
}

#[cfg(test)]
mod tests {
    use super::*;

    const HEAD: &str = "#cP2010  7  1  0  0  0.00000000       3 ORBIT IGS05 HLM  IGS\n\
        %c G  cc GPS ccc cccc cccc cccc cccc ccccc ccccc ccccc ccccc\n";

    fn read(body: &str) -> Result<Recording, OrbitError> {
        Recording::read(&[("a.sp3".to_owned(), format!("{HEAD}{body}EOF\n"))])
    }

    #[test]
    fn missing_positions_are_counted_and_left_out() {
        let recording = read(
            "*  2010  7  1  0  0  0.00000000\nPG01  18392.619117   7490.690408 -17846.346485 999999.999999\n\
             PG02      0.000000      0.000000      0.000000 999999.999999\n\
             *  2010  7  1  0 15  0.00000000\nPG01  18392.619117   7490.690408 -17846.346485 999999.999999\n\
             PG02 -14889.160729  -5131.952946 -21416.801336    269.108429  7  6  8 110\n",
        )
        .unwrap();
        let counts: Vec<_> = recording.tracks.iter().map(|t| (t.id.as_str(), t.t_s.len(), t.masked)).collect();
        assert_eq!(counts, [("G01", 2, 0), ("G02", 1, 1)]);
        assert_eq!(recording.tracks[1].t_s, [900.0]);
        assert_eq!(recording.origin, GpsInstant { mjd: 55_378.0, s: 0.0 });
    }

    /// A navigation satellite every quarter of an hour: ten metres off at one epoch is left out, and nothing of the rest.
    #[test]
    fn a_blunder_of_ten_metres_is_left_out_alone() {
        let at = |i: usize, off_m: f64| {
            let (turn, ground) = (1.4586e-4 * 900.0 * i as f64, 7.2921e-5 * 900.0 * i as f64);
            let (x, y, z) = (turn.cos(), turn.sin() * 0.574, turn.sin() * 0.819);
            let (x, y) = (x * ground.cos() + y * ground.sin(), y * ground.cos() - x * ground.sin());
            Vector3::new(x, y, z) * 26_560e3 + Vector3::new(off_m, 0.0, 0.0)
        };
        for off_m in [0.0, 10.0, -30.0] {
            let fixed_m = (0..96).map(|i| at(i, if i == 40 { off_m } else { 0.0 })).collect();
            let t_s = (0..96).map(|i| 900.0 * f64::from(i)).collect();
            let mut track = Track { id: "G01".into(), t_s, fixed_m, ..Track::default() };
            drop_blunders(&mut track);
            assert_eq!(track.masked, usize::from(off_m != 0.0), "{off_m}");
            assert_eq!(track.t_s.contains(&36_000.0), off_m == 0.0, "{off_m}");
        }
    }

    /// The same file in metres; and one that gives an epoch twice.
    #[test]
    fn metres_are_refused_and_what_is_given_twice_is_told() {
        let lines = "*  2010  7  1  0  0  0.00000000\nPG01 18392619.1170  7490690.4080 -17846346.485 999999.999999\n";
        let error = read(lines).unwrap_err().to_string();
        assert!(error.ends_with("from the Earth's centre: that of G01 is 26700018.046"), "{error}");
        let once = "*  2010  7  1  0  0  0.00000000\nPG01  18392.619117   7490.690408 -17846.346485 999999.999999\n";
        let recording = read(&format!("{once}{once}")).unwrap();
        assert!(recording.amiss.iter().any(|words| words.starts_with("of a position that a.sp3 gives twice")));
        assert_eq!(recording.tracks[0].t_s.len(), 1);
    }

    #[test]
    fn a_broken_line_is_named_with_its_place() {
        let error = read("*  2010  7  1  0  0  0.0\nPG01  oops\n").unwrap_err();
        assert!(
            error.to_string().starts_with("a.sp3, line 4: expected P, a satellite and three coordinates in km"),
            "{error}"
        );
    }
}
