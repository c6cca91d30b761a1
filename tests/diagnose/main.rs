//! The diagnosis on the open cases, and its refusals. Shared data are read where they are; absent, the claim is skipped aloud.

mod bursts;
mod drag_case;
mod dump;
mod formula;
mod lag;
mod large;
mod leaks;
mod limits;
mod listed;
mod logs;
mod loud;
mod odd;
mod passing;
mod refused;
mod resonant;
mod separating;
mod smooth;
mod terms;
mod trial;
mod unlisted;
mod unlogged;
mod wind;

use std::path::PathBuf;

use oare_ground::challenge::engine;
use oare_ground::challenge::run::Material;
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::case::{Case, Header, Texts};
use oare_ground::diagnose::error::CaseError;
use oare_ground::diagnose::{Diagnosis, Settings, diagnose};

fn shared() -> PathBuf {
    std::env::var_os("OARE_SHARED_DATA")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data")), PathBuf::from)
}

/// `case.toml` and the texts of an open case, or nothing with a loud word.
fn texts(id: &str) -> Option<(String, Texts)> {
    let directory = shared().join("cases").join(id);
    let read = |name: &str| std::fs::read_to_string(directory.join(name)).ok();
    let Some(toml) = read("case.toml") else {
        eprintln!("SKIPPED: {} is not there", directory.display());
        return None;
    };
    let texts = Texts {
        recording: read("recording.csv"),
        simulation: read("simulation.csv"),
        ancillary: read("ancillary.csv"),
        events: read("events.csv"),
    };
    Some((toml, texts))
}

/// A concealed case, from its files.
fn case(files: &[(String, Vec<u8>)]) -> Case {
    engine::read(&Material::Files(files)).unwrap()
}

fn answer(id: &str) -> Option<Diagnosis> {
    let (toml, texts) = texts(id)?;
    let case = Case::from_texts(Header::parse(&toml, &[]).unwrap(), &texts).unwrap();
    Some(diagnose(&case, &Settings::default()).unwrap())
}

fn ids(diagnosis: &Diagnosis) -> Vec<&str> {
    diagnosis.effects.iter().map(|e| e.id.as_str()).collect()
}

#[test]
fn a_clean_record_is_consistent_and_says_how_small_everything_must_be() {
    let Some(d) = answer("open-01") else { return };
    assert_eq!(d.verdict, Verdict::Consistent, "{d:?}");
    assert!(d.effects.is_empty() && d.upper_limits.len() > 15);
    assert!(d.upper_limits.iter().all(|l| l.limit_ng > 0.0 && l.limit_ng.is_finite()), "{:?}", d.upper_limits);
}

#[test]
fn a_simulation_that_claims_gravity_gradient_and_lacks_it_is_found_out() {
    let Some(d) = answer("open-06") else { return };
    assert_eq!((d.verdict, ids(&d)), (Verdict::Explained, vec!["gravity_gradient"]), "{d:?}");
    let fraction = &d.effects[0].parameters[0];
    assert!((fraction.value - 1.0).abs() < 4.0 * fraction.sigma, "{fraction:?}");
}

#[test]
fn a_dump_goes_through_the_whole_calibration_and_two_effects_are_named() {
    let directory = shared().join("cases/open-30");
    if !directory.is_dir() {
        eprintln!("SKIPPED: {} is not there", directory.display());
        return;
    }
    let d = diagnose(&engine::read(&Material::Directory(&directory)).unwrap(), &Settings::default()).unwrap();
    let mut named = ids(&d);
    named.sort_unstable();
    assert_eq!((d.verdict, named), (Verdict::Explained, vec!["cg_offset", "water_dump"]), "{d:?}");
    let dump_z = d.effects.iter().flat_map(|e| &e.parameters).find(|p| p.name == "az_ng").unwrap();
    assert!((dump_z.value + 369.9).abs() < 4.0 * dump_z.sigma, "{dump_z:?}");
}

#[test]
fn drag_and_a_leak_together_are_both_named_with_their_sizes() {
    let Some(d) = answer("open-25") else { return };
    assert_eq!(d.verdict, Verdict::Explained, "{d:?}");
    let mut named = ids(&d);
    named.sort_unstable();
    assert_eq!(named, ["aerodynamic_drag", "vent_leak"]);
    let drag = d.effects.iter().find(|e| e.id == "aerodynamic_drag").unwrap();
    assert!((drag.parameters[0].value - 0.2649).abs() < 3.0 * drag.parameters[0].sigma, "{drag:?}");
}

#[test]
fn a_law_outside_the_catalogue_gets_a_formula_and_no_name() {
    let Some(d) = answer("open-28") else { return };
    assert_eq!(d.verdict, Verdict::Unexplained, "{d:?}");
    assert!(d.effects.is_empty());
    let hypothesis = d.hypothesis.unwrap();
    assert!(hypothesis.formula.contains("wx wz") && hypothesis.axis == "y", "{hypothesis:?}");
}

fn refusal(change: impl Fn(&mut String, &mut Texts)) -> Option<CaseError> {
    let (mut toml, mut texts) = texts("open-01")?;
    change(&mut toml, &mut texts);
    Some(Header::parse(&toml, &[]).and_then(|h| Case::from_texts(h, &texts)).map(|_| ()).unwrap_err())
}

fn edit(text: &mut Option<String>, how: impl Fn(&str) -> String) {
    *text = text.as_deref().map(how);
}

fn edit_line(text: &str, line: usize, how: impl Fn(&str) -> String) -> String {
    text.lines()
        .enumerate()
        .map(|(i, l)| if i + 1 == line { how(l) } else { l.to_string() })
        .collect::<Vec<_>>()
        .join("\n")
}

#[test]
fn bad_cases_are_refused_in_one_sentence_with_the_place() {
    let Some(missing) = refusal(|_, t| t.simulation = None) else { return };
    assert_eq!(missing, CaseError::MissingFile { file: "simulation.csv".into() });
    let column = refusal(|_, t| edit(&mut t.recording, |x| x.replacen("ay_ng", "ay_ug", 1))).unwrap();
    assert!(matches!(&column, CaseError::MissingColumn { column, .. } if column == "ay_ng"), "{column}");
    let nan = refusal(|_, t| {
        edit(&mut t.recording, |x| edit_line(x, 7, |l| l.rsplit_once(',').unwrap().0.to_string() + ",NaN"))
    })
    .unwrap();
    assert!(matches!(&nan, CaseError::NotANumber { line: 7, .. }), "{nan}");
    let order =
        refusal(|_, t| edit(&mut t.recording, |x| edit_line(x, 9, |l| "1.0".to_string() + &l[l.find(',').unwrap()..])))
            .unwrap();
    assert!(matches!(&order, CaseError::TimeOrder { line: 9, .. }), "{order}");
    let one = refusal(|_, t| edit(&mut t.recording, |x| x.lines().take(2).collect::<Vec<_>>().join("\n"))).unwrap();
    assert!(matches!(&one, CaseError::TooFew { found: 1, .. }), "{one}");
    let apart = refusal(|toml, _| {
        *toml = toml.replace("start_s = 388480.0", "start_s = 900000.0").replace("end_s = 518080.0", "end_s = 990000.0")
    })
    .unwrap();
    assert!(matches!(&apart, CaseError::NoOverlap { common: 0, .. }), "{apart}");
    let scaled = |x: &str| {
        let mut lines = x.lines().map(str::to_string).collect::<Vec<_>>();
        for line in lines.iter_mut().skip(1) {
            let cells: Vec<String> = line
                .split(',')
                .enumerate()
                .map(
                    |(i, c)| {
                        if (1..4).contains(&i) { format!("{:e}", c.parse::<f64>().unwrap() * 1e-9) } else { c.into() }
                    },
                )
                .collect();
            *line = cells.join(",");
        }
        lines.join("\n")
    };
    let unit = refusal(|_, t| edit(&mut t.recording, scaled)).unwrap();
    assert!(matches!(&unit, CaseError::Unit { unit: "ng", .. }), "{unit}");
}
