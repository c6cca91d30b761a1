//! What real files do to a reader: each case is answered rightly, or refused in one sentence with exit code 2.

use std::fmt::Write;
use std::process::Command;

use oare_ground::physics::earth_orientation::GpsInstant;
use rand::{RngExt, SeedableRng};
use rand_chacha::ChaCha12Rng;

use super::made::{Made, field, gps, orientation};

/// What `oare diagnose` did with a folder: exit code, standard output, standard error.
fn run(case: &str, files: &[(&str, &str)]) -> (i32, String, String) {
    let place = tempfile::tempdir().expect("a folder");
    std::fs::write(place.path().join("case.toml"), case).expect("a case");
    for (name, text) in files {
        std::fs::write(place.path().join(name), text).expect("a file");
    }
    let out = Command::new(env!("CARGO_BIN_EXE_oare"))
        .args(["diagnose", "--json"])
        .arg(place.path())
        .output()
        .expect("the program runs");
    let text = |bytes: &[u8]| String::from_utf8_lossy(bytes).replace(&format!("{}/", place.path().display()), "");
    (out.status.code().unwrap_or(-1), text(&out.stdout), text(&out.stderr))
}

/// The sentence with which a case is refused.
fn refused(case: &str, files: &[(&str, &str)]) -> String {
    let (code, _, err) = run(case, files);
    assert_eq!((code, err.trim_end().lines().count()), (2, 1), "{err}");
    err.trim_end().trim_start_matches("oare: ").to_owned()
}

/// The answer, and the ids of its effects.
fn answered(case: &str, files: &[(&str, &str)]) -> (serde_json::Value, Vec<String>) {
    let (code, out, err) = run(case, files);
    assert_eq!(code, 0, "{err}");
    let answer: serde_json::Value = serde_json::from_str(&out).expect("JSON");
    let effects = answer["effects"].as_array().expect("effects");
    let ids = effects.iter().map(|e| e["id"].as_str().unwrap_or_default().to_owned()).collect();
    (answer, ids)
}

fn slope(answer: &serde_json::Value) -> (f64, f64) {
    let p = &answer["effects"][0]["parameters"][0];
    (p["value"].as_f64().expect("a value"), p["sigma"].as_f64().expect("an error"))
}

// ---- series

const SLOPE: f64 = 0.4;

fn normal(rng: &mut ChaCha12Rng) -> f64 {
    (0..12).map(|_| rng.random::<f64>()).sum::<f64>() - 6.0
}

/// Rows of time, temperature and an axis that follows it under white noise.
fn rows(count: usize, step_s: f64) -> Vec<[f64; 3]> {
    let mut rng = ChaCha12Rng::seed_from_u64(11);
    let span_s = count as f64 * step_s;
    let mut wander = 0.0;
    let row = |i: usize| {
        let t = i as f64 * step_s;
        wander = 0.99 * wander + 0.05 * normal(&mut rng);
        let temperature = 20.0 + 3.0 * (t / span_s * 17.0).sin() + wander;
        [t, temperature, SLOPE * temperature + 0.2 * normal(&mut rng)]
    };
    (0..count).map(row).collect()
}

fn csv(rows: &[[f64; 3]]) -> String {
    let mut text = String::from("t,temp,a\n");
    for [t, temperature, a] in rows {
        let _ = writeln!(text, "{t},{temperature:.5},{a:.5}");
    }
    text
}

fn series_case(more: &str) -> String {
    format!(
        "[case]\nid = \"made\"\n[simulation]\nincludes = [\"constant\"]\n[recording]\nkind = \"series_csv\"\nfile = \"s.csv\"\n{more}\n"
    )
}

const USUAL: &str = "time = { column = \"t\" }\nvalues = [{ column = \"a\", unit = \"g\", axis = \"x\" }]\n\
                     covariates = [{ column = \"temp\", unit = \"C\" }]";

/// The slope is found within three standard errors: a dozen such checks are made here.
fn follows(case: &str, text: &str, expected: f64) {
    let (answer, ids) = answered(case, &[("s.csv", text)]);
    assert_eq!(ids, ["temperature_bias"], "{answer:#}");
    let (value, sigma) = slope(&answer);
    assert!((value - expected).abs() < 3.0 * sigma && sigma < 0.2 * expected.abs(), "{value} +- {sigma}");
}

/// A covariate that nobody can read is told, and the others serve; a control in which something is found is told.
#[test]
fn an_unreadable_covariate_and_a_control_that_responds_are_told() {
    let mut text = String::from("t,temp,hum,a,gx\n");
    for [t, temperature, a] in rows(2_000, 60.0) {
        let _ = writeln!(text, "{t},{temperature:.5},,{a:.5},{a:.5}");
    }
    let case = series_case(
        "time = { column = \"t\" }\nvalues = [{ column = \"a\", unit = \"g\", axis = \"x\" }]\n\
         controls = [{ column = \"gx\", unit = \"rad/s\" }]\n\
         covariates = [{ column = \"temp\", unit = \"C\" }, { column = \"hum\", unit = \"%\" }]",
    );
    let (answer, ids) = answered(&case, &[("s.csv", &text)]);
    assert_eq!(ids, ["temperature_bias"]);
    let notes: Vec<&str> = answer["notes"].as_array().unwrap().iter().filter_map(|note| note.as_str()).collect();
    assert!(notes.iter().any(|note| note.starts_with("hum cannot be read")), "{notes:?}");
    assert!(
        notes.iter().any(|note| note.starts_with("gx is a control") && note.contains("temperature_bias")),
        "{notes:?}"
    );
}

#[test]
fn a_series_of_any_rate_gives_its_slope() {
    for (count, step_s) in [(6_000, 0.1), (9_000, 1.0), (2_000, 60.0), (1_500, 600.0), (400, 3_600.0), (90, 86_400.0)] {
        follows(&series_case(USUAL), &csv(&rows(count, step_s)), SLOPE);
    }
}

#[test]
fn names_units_and_order_of_columns_are_the_case_s_own() {
    let mut text = String::from("note;x,Housing Temp,when,Az (mg)\n");
    for [t, temperature, a] in rows(2_000, 60.0) {
        let when = jiff::Timestamp::from_millisecond(1_262_304_000_000 + (t * 1000.0) as i64).expect("an instant");
        let _ = writeln!(text, "ok,{:.5},{when},{a:.5}", temperature + 273.15);
    }
    for unit in ["K", "kelvin"] {
        let case = series_case(&format!(
            "time = {{ column = \"when\" }}\nvalues = [{{ column = \"Az (mg)\", unit = \"mg\", axis = \"z\" }}]\n\
             covariates = [{{ column = \"Housing Temp\", unit = \"{unit}\" }}]"
        ));
        follows(&case, &text, SLOPE);
    }
    for unit in ["degC", "°C", "celsius", "deg C"] {
        follows(&series_case(&USUAL.replace("\"C\"", &format!("\"{unit}\""))), &csv(&rows(1_000, 60.0)), SLOPE);
    }
}

#[test]
fn holes_repeated_times_and_rows_out_of_order_change_nothing() {
    let mut lines: Vec<String> = csv(&rows(4_000, 10.0)).lines().map(str::to_owned).collect();
    let value = |line: &str| line.rsplit(',').next().unwrap_or_default().to_owned();
    lines[100] = format!("990,,{}", value(&lines[100]));
    lines[200] = format!("1990,NaN,{}", value(&lines[200]));
    lines[300] = "2990,21.0,n/a".to_owned();
    lines[400] = String::new();
    lines[500] = "4990".to_owned();
    lines[700] = lines[699].clone();
    lines.swap(900, 1_400);
    let (answer, ids) = answered(&series_case(USUAL), &[("s.csv", &lines.join("\r\n"))]);
    assert_eq!(ids, ["temperature_bias"]);
    let (value, sigma) = slope(&answer);
    assert!((value - SLOPE).abs() < 3.0 * sigma, "{value} +- {sigma}");
    // An empty line is no row, one without a value is left out, and one without a temperature has its value.
    assert_eq!(answer["arcs"][0]["masked"], 2);
    // The newest first.
    let mut lines: Vec<String> = csv(&rows(4_000, 10.0)).lines().map(str::to_owned).collect();
    lines[1..].reverse();
    follows(&series_case(USUAL), &lines.join("\n"), SLOPE);
}

#[test]
fn a_series_without_a_covariate_or_without_a_change_lacks_nothing() {
    let noise: Vec<[f64; 3]> = rows(2_000, 60.0).into_iter().map(|[t, c, a]| [t, c, a - SLOPE * c]).collect();
    let bare = "time = { column = \"t\" }\nvalues = [{ column = \"a\", unit = \"g\" }]";
    let still: Vec<[f64; 3]> = noise.iter().map(|[t, _, a]| [*t, 21.3, *a]).collect();
    let flat: Vec<[f64; 3]> = noise.iter().map(|[t, c, _]| [*t, *c, 0.1]).collect();
    for (case, rows) in [(bare, &noise), (USUAL, &noise), (USUAL, &still), (USUAL, &flat)] {
        let (answer, ids) = answered(&series_case(case), &[("s.csv", &csv(rows))]);
        assert!(ids.is_empty() && answer["verdict"] == "consistent", "{answer:#}");
        let limits = answer["upper_limits"].as_array().expect("limits");
        let of = |id: &str| limits.iter().find(|limit| limit["id"] == id).and_then(|limit| limit["limit"].as_f64());
        let moves = |column: usize| rows.iter().any(|row| row[column] != rows[0][column]);
        // Of what does not change there is none.
        assert_eq!(of("temperature_bias").is_some(), case == USUAL && moves(1) && moves(2), "{limits:?}");
        // White noise of 0.2 and 2,000 rows: less than that would be seen.
        for id in ["bias_step", "bias_drift"] {
            assert_eq!(of(id).is_some_and(|limit| 0.0 < limit && limit < 0.2), moves(2), "{id}: {limits:?}");
        }
    }
}

#[test]
fn a_series_that_cannot_be_used_is_refused_with_its_place() {
    let good = csv(&rows(1_000, 60.0));
    let said = |case: &str, text: &str| refused(&series_case(case), &[("s.csv", text)]);
    assert_eq!(said(USUAL, &good.replace("temp", "heat")), "s.csv, line 1: expected a column temp, found \"t,heat,a\"");
    assert!(said(USUAL, "").starts_with("s.csv, line 1: expected a column t"));
    let stamped = USUAL.replace("\"t\" }", "\"t\", format = \"%Y-%m-%d %H:%M:%S\" }");
    assert_eq!(
        said(&stamped, &good),
        "s.csv, line 2: expected a time as %Y-%m-%d %H:%M:%S in column t (1000 of 1000 rows cannot be read), found \"0\""
    );
    let mut lines: Vec<String> = good.lines().map(str::to_owned).collect();
    lines[6..].iter_mut().for_each(|line| *line = line.replacen(",", ",warm", 1));
    assert!(
        said(USUAL, &lines.join("\n")).starts_with(
            "s.csv, line 7: expected a number in column temp (995 of 1000 rows cannot be read), found \"warm"
        ),
        "{}",
        said(USUAL, &lines.join("\n"))
    );
    let short: Vec<&str> = good.lines().take(20).collect();
    assert_eq!(said(USUAL, &short.join("\n")), "the recording holds 19 usable blocks of rows, expected at least 40");
    assert!(said(&format!("{USUAL}\nspans_h = [[5.0, 1.0]]"), &good).contains("`recording.spans_h`"));
    assert!(said(&format!("{USUAL}\nspans_h = [[500.0, 501.0]]"), &good).contains("holds 0 usable blocks"));
    assert!(said("time = { column = \"t\" }", &good).contains("`recording.values`: expected at least one column"));
    assert!(said("values = [{ column = \"a\" }]", &good).contains("`recording.time.column`: expected a text"));
    assert!(refused(&series_case(USUAL), &[]).starts_with("s.csv: "));
    let case = series_case(USUAL).replace("\"constant\"", "\"constant\", \"tea\"");
    assert!(refused(&case, &[("s.csv", &good)]).contains("`simulation.includes`"));
}

// ---- orbits

const ORBIT: &str = "[case]\nid = \"made\"\n[simulation]\n\
    includes = [\"gravity:12\", \"sun\", \"moon\", \"srp_y_bias\", \"srp_b_bias\", \"relativity\"]\n\
    [recording]\nkind = \"orbit_sp3\"\nfile = \"a.sp3\"\neop = \"eop.csv\"\ngravity = \"a.gfc\"\n";

fn orbit(spacing_s: f64) -> Made {
    Made { spacing_s, ..Made::every_quarter((2018, 4, 4), 30.0, vec![gps("E19", 40.0, 10.0)]) }
}

fn turning() -> String {
    let origin = GpsInstant::from_calendar(2018, 4, 4, 0.0).expect("a date");
    orientation(origin.mjd)
}

#[test]
fn orbits_of_any_spacing_and_version_lack_the_same() {
    for spacing_s in [120.0, 300.0, 1_800.0] {
        let sp3 = orbit(spacing_s).sp3();
        // Version d: longer satellite lists and comments.
        let head = "/* a comment\n+    1   E19  0  0\n++         0  0  0\n##  1995 259200.00000000   900.0 58212 0.0\n";
        let mut parts = sp3.splitn(2, '\n');
        let first = parts.next().unwrap_or_default().replace("#c", "#d");
        let text = format!("{first}\n{head}{}", parts.next().unwrap_or_default());
        let (answer, ids) = answered(ORBIT, &[("a.sp3", &text), ("eop.csv", &turning()), ("a.gfc", &field())]);
        assert_eq!(ids, ["solar_radiation_pressure"], "{spacing_s}: {answer:#}");
        let (value, sigma) = slope(&answer);
        assert!((value - 9.3e-8).abs() < 3.0 * sigma, "{spacing_s}: {value} +- {sigma}");
    }
}

#[test]
fn a_satellite_with_a_clock_alone_is_left_out_and_named() {
    let made = Made { satellites: vec![gps("G01", 0.0, 10.0), gps("G02", 120.0, 200.0)], ..orbit(900.0) };
    let clock = |line: &str| match line.strip_prefix("PG02") {
        Some(_) => "PG02      0.000000      0.000000      0.000000     12.345678".to_owned(),
        None => line.to_owned(),
    };
    let text: Vec<String> = made.sp3().lines().map(clock).collect();
    let files = [("a.sp3", text.join("\n")), ("eop.csv", turning()), ("a.gfc", field())];
    let files: Vec<(&str, &str)> = files.iter().map(|(n, t)| (*n, t.as_str())).collect();
    let (answer, ids) = answered(ORBIT, &files);
    assert_eq!(ids, ["solar_radiation_pressure"]);
    assert_eq!(answer["arcs"].as_array().map(Vec::len), Some(1));
    assert!(answer["notes"].to_string().contains("G02 has 0 usable positions"), "{}", answer["notes"]);
}

#[test]
fn a_file_that_ends_early_is_used_and_said() {
    let sp3 = orbit(900.0).sp3();
    let cut: Vec<&str> = sp3.lines().take(2 + 3 * 100).collect();
    let (answer, ids) = answered(ORBIT, &[("a.sp3", &cut.join("\n")), ("eop.csv", &turning()), ("a.gfc", &field())]);
    assert_eq!(ids, ["solar_radiation_pressure"]);
    assert!(answer["notes"].to_string().contains("a.sp3 announces 121 epochs and holds 100"), "{}", answer["notes"]);
}

#[test]
fn an_orbit_that_cannot_be_used_is_refused_with_its_place() {
    let (sp3, eop, gfc) = (orbit(900.0).sp3(), turning(), field());
    let said = |sp3: &str, eop: &str, gfc: &str| refused(ORBIT, &[("a.sp3", sp3), ("eop.csv", eop), ("a.gfc", gfc)]);
    let cut = &sp3[..sp3.find("PE19").map_or(0, |at| at + 20)];
    assert!(
        said(cut, &eop, &gfc)
            .starts_with("a.sp3, line 4: expected P, a satellite and three coordinates in km, found \"PE19")
    );
    assert!(
        said(&sp3.replacen("#c", "no", 1), &eop, &gfc).starts_with("a.sp3, line 1: expected a line starting with #")
    );
    assert!(said(&sp3.replacen("*  2018", "*  soon", 1), &eop, &gfc).starts_with("a.sp3, line 3: expected an epoch"));
    assert!(said("", &eop, &gfc).starts_with("a.sp3, line 1: "));

    let lines: Vec<&str> = eop.lines().collect();
    let day = |k: usize| lines[k].split(',').next().unwrap_or_default();
    assert_eq!(
        said(&sp3, &lines[..3].join("\n"), &gfc),
        format!("eop.csv: Earth orientation covers MJD {} to {}, and MJD 58211.833 is needed", day(1), day(2))
    );
    let bad = eop.replacen("0.31", "north", 1);
    assert!(said(&sp3, &bad, &gfc).starts_with("eop.csv: line "), "{}", said(&sp3, &bad, &gfc));
    assert!(said(&sp3, lines[0], &gfc).starts_with("eop.csv: Earth orientation has 0 days"));
    // A day missing in the middle of the table.
    let holed: Vec<&str> = lines.iter().enumerate().filter(|(i, _)| ![4, 5].contains(i)).map(|(_, l)| *l).collect();
    assert!(said(&sp3, &holed.join("\n"), &gfc).starts_with("eop.csv: Earth orientation has no row between MJD"));

    assert!(said(&sp3, &eop, "tea").starts_with("a.gfc: missing or invalid .gfc header key"));
    assert!(said(&sp3, &eop, &gfc.replacen("gfc 3 1", "gfc 3 x", 1)).starts_with("a.gfc: .gfc line "));
    assert!(said(&sp3, &eop, &gfc.replacen("1.0 0.0", "NaN 0.0", 1)).starts_with("a.gfc: "));
    let short: Vec<&str> = gfc.lines().take(40).collect();
    assert_eq!(said(&sp3, &eop, &short.join("\n")), "a.gfc: the records end inside degree 7: order 7 is missing");
    let high = ORBIT.replace("gravity:12", "gravity:20");
    assert_eq!(
        refused(&high, &[("a.sp3", &sp3), ("eop.csv", &eop), ("a.gfc", &gfc)]),
        "simulation.includes: gravity:20 is more than the field a.gfc holds, degree 12"
    );
    let few = format!("{ORBIT}satellites = [\"G99\"]\n");
    assert!(refused(&few, &[("a.sp3", &sp3), ("eop.csv", &eop), ("a.gfc", &gfc)]).contains("G99"));
    let short = format!("{ORBIT}fit_hours = 0.5\n");
    let short = refused(&short, &[("a.sp3", &sp3), ("eop.csv", &eop), ("a.gfc", &gfc)]);
    assert!(short.ends_with("usable positions to fit, expected at least 12"), "{short}");
}

// ---- poses

/// Rows at 100 Hz of a 12-bit triad with an offset, in some poses; time in milliseconds, in the last column.
fn triad(poses: usize) -> String {
    let mut rng = ChaCha12Rng::seed_from_u64(4);
    let mut text = String::from("x,y,z,ms\n");
    let mut ms = 5_000;
    for _ in 0..poses {
        let down = nalgebra::Vector3::new(normal(&mut rng), normal(&mut rng), normal(&mut rng)).normalize();
        for i in 0..500 {
            let shake = if i < 400 { 0.002 } else { 0.3 };
            let mut read = |k: usize, zero: f64| 2_048.0 + zero + 819.2 * (down[k] + shake * normal(&mut rng));
            let _ = writeln!(text, "{:.1},{:.1},{:.1},{ms}", read(0, 30.0), read(1, -18.0), read(2, 11.0));
            ms += 10;
        }
    }
    text
}

const POSES: &str = "[case]\nid = \"made\"\n[simulation]\nincludes = [\"ideal_triad\"]\n[recording]\nkind = \"static_poses\"\n\
    file = \"p.csv\"\ncolumns = [\"x_counts\", \"y_counts\", \"z_counts\", \"t_ms\"]\ngravity_m_s2 = 9.81\n";

#[test]
fn poses_of_other_counts_order_and_clock_give_their_bias() {
    for poses in [12, 20, 60] {
        let (answer, ids) = answered(POSES, &[("p.csv", &triad(poses))]);
        assert_eq!((ids, answer["arcs"][0]["fitted"].as_u64()), (vec!["bias".to_owned()], Some(poses as u64)));
        let bias = answer["effects"][0]["parameters"].as_array().expect("parameters");
        for (p, truth) in bias.iter().zip([30.0, -18.0, 11.0]) {
            let (value, sigma) = (p["value"].as_f64().unwrap_or(f64::NAN), p["sigma"].as_f64().unwrap_or(f64::NAN));
            assert!((value - truth).abs() < 3.0 * sigma, "{poses} poses: {value} +- {sigma} against {truth}");
        }
    }
}

#[test]
fn poses_that_cannot_be_used_are_refused_with_their_place() {
    let text = triad(12);
    let said = |case: &str, text: &str| refused(case, &[("p.csv", text)]);
    assert!(
        said(&POSES.replace("gravity_m_s2 = 9.81", ""), &text).contains("`recording.gravity_m_s2`: expected a number")
    );
    assert!(said(&POSES.replace("gravity_m_s2 = 9.81", "gravity_m_s2 = -1"), &text).contains("above zero"));
    assert!(said(&POSES.replace("\"z_counts\", ", ""), &text).contains("`recording.columns`"));
    let hole = text.lines().enumerate().map(|(i, l)| if i == 77 { "1,,3" } else { l }).collect::<Vec<_>>().join("\n");
    assert_eq!(said(POSES, &hole), "p.csv, line 78: expected a time and three counts, found \"1,,3\"");
    assert_eq!(said(POSES, &triad(5)), "the recording holds 5 usable static poses, expected at least 9");
    assert_eq!(said(POSES, ""), "the recording holds 0 usable static poses, expected at least 9");
}
