//! A finding on trial, on concealed cases.

use super::case;
use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::case::Case;
use oare_ground::diagnose::catalogue::{Shape, gravity_gradient};
use oare_ground::diagnose::scene::Scene;
use oare_ground::diagnose::{Analysis, Settings, analyse};

fn files(kind: Kind, seed: u64, only: &'static str) -> Vec<(String, Vec<u8>)> {
    draw_order(&Order { kind, seed, only: Some(only), manner: Manner::default() }).files
}

fn analysed(case: &Case, bootstraps: usize) -> Analysis {
    analyse(case, &Settings { bootstraps, ..Settings::default() }).unwrap()
}

#[test]
fn a_finding_predicts_an_attitude_left_out_and_its_placebo_does_not_do_as_well() {
    let case = case(&files(Kind::One, 31, "cg_offset"));
    let found = analysed(&case, 0).diagnosis;
    assert_eq!(found.verdict, Verdict::Explained, "{found:?}");
    let fit = found.fit.unwrap();
    let attitudes = fit.left_out_attitudes.unwrap();
    assert!(attitudes.scheme.contains("attitudes left out") && attitudes.log_score_gain > 0.0, "{attitudes:?}");
    assert!(fit.held_out.log_score_gain > 0.0 && fit.held_out.excess_removed > 0.9, "{:?}", fit.held_out);
    assert!(fit.above_placebo.unwrap() > 3.0, "{:?}", fit.above_placebo);
}

#[test]
fn events_that_all_lie_in_one_half_of_the_long_blocks_are_parted_by_shorter_ones() {
    let mut files = files(Kind::Clean, 32, "cg_offset");
    let edit = |files: &mut Vec<(String, Vec<u8>)>, name: &str, lines: &dyn Fn(Vec<&str>) -> Vec<String>| {
        let octets = &mut files.iter_mut().find(|(n, _)| n == name).unwrap().1;
        let text = lines(std::str::from_utf8(octets).unwrap().lines().collect()).join("\n") + "\n";
        *octets = text.into_bytes();
    };
    let clock = |line: &str| line.split(',').next().and_then(|t| t.parse::<f64>().ok());
    let recording = &files.iter().find(|(n, _)| n == "recording.csv").unwrap().1;
    let start = std::str::from_utf8(recording).unwrap().lines().find_map(clock).unwrap();
    // Two dumps in the third quarter of the first day, both in an even block of six hours.
    let dumps = [start + 45_000.0, start + 60_000.0];
    edit(&mut files, "events.csv", &|lines| {
        let kept = lines.into_iter().filter(|line| !line.contains("water_dump")).map(str::to_string);
        kept.chain(dumps.map(|t| format!("{t:.1},2000.0,water_dump,"))).collect()
    });
    edit(&mut files, "recording.csv", &|lines| {
        let pushed = |t: f64| dumps.iter().any(|dump| (dump + 30.0..dump + 1970.0).contains(&t));
        let line = |line: &str| match clock(line).filter(|t| pushed(*t)) {
            Some(_) => {
                let mut fields: Vec<String> = line.split(',').map(str::to_string).collect();
                fields[2] = format!("{:.3}", fields[2].parse::<f64>().unwrap() + 300.0);
                fields.join(",")
            }
            None => line.to_string(),
        };
        lines.into_iter().map(line).collect()
    });
    let case = case(&files);
    let found = analysed(&case, 0).diagnosis;
    let held = found.fit.unwrap().held_out;
    assert!(held.scheme != "alternate 6 h blocks" && held.excess_removed > 0.5, "{held:?}");
}

/// The same replicates, however they are screened: what a first look passes over must not reach what is asked about.
#[test]
fn the_bootstrap_says_the_same_every_time_and_forbids_nothing_that_is_loud() {
    let loud = case(&files(Kind::One, 31, "cg_offset"));
    let probability = || analysed(&loud, 40).diagnosis.false_alarm_probability;
    let first = probability();
    assert!(first <= 0.002 / 0.8 && first == probability(), "{first}");
    let clean = case(&files(Kind::Clean, 31, "cg_offset"));
    let quiet = analysed(&clean, 40).diagnosis;
    assert!(quiet.verdict == Verdict::Consistent && quiet.false_alarm_probability > 0.01, "{quiet:?}");
}

/// A simulation that counts the gravity gradient twice leaves it out minus once: no omission, and the formula says what it is.
#[test]
fn what_a_simulation_has_twice_is_no_omission_and_its_formula_is_what_was_fitted() {
    for seed in [41, 42] {
        let mut case = case(&files(Kind::Clean, seed, "gravity_gradient"));
        let once = {
            let scene = Scene::new(&case).unwrap();
            assert_eq!(scene.schedule.len(), case.recording.clock_s.len());
            match (gravity_gradient::EFFECT.signature)(&scene, &[0.0; 2]) {
                Some(Shape::Columns(columns)) => columns[0].clone(),
                _ => panic!("no columns"),
            }
        };
        for (recorded, once) in case.recording.a_ng.iter_mut().zip(&once) {
            recorded.iter_mut().zip(once.as_ref().unwrap()).for_each(|(ng, once)| *ng -= once);
        }
        let found = analysed(&case, 0).diagnosis;
        assert_eq!((found.verdict, found.effects.len()), (Verdict::Unexplained, 0), "{found:?}");
        let hypothesis = found.hypothesis.expect("a formula");
        let equation = format!("({}) with fraction = ", gravity_gradient::EFFECT.equation);
        let fraction = hypothesis.formula.strip_prefix(&equation).expect("its own formula");
        let fraction: f64 = fraction.split('(').next().unwrap().parse().unwrap();
        assert!((fraction + 1.0).abs() < 0.05, "{hypothesis:?}");
        assert!(found.notes.iter().any(|note| note.starts_with("gravity_gradient is refused")), "{:?}", found.notes);
        assert!(found.fit.unwrap().held_out.excess_removed > 0.9);
    }
}
