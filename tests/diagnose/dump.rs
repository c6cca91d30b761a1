//! Recordings that are dumps of the payload recorder, on concealed cases: what a calibration leaves open is no finding.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::{EffectAnswer, Verdict};
use oare_ground::diagnose::{Diagnosis, Settings, diagnose};
use oare_ground::ingest::wire::LinkConfig;
use oare_ground::ingest::wire::record::Record;
use oare_ground::physics::Vec3;
use oare_ground::simulate::expected::case_files;
use oare_ground::simulate::forces::Push;
use oare_ground::simulate::noise::NoisePlan;
use oare_ground::simulate::recorder::{RecorderConfig, frames};
use oare_ground::simulate::{Fault, Mission, MissionConfig, playbacks};
use oare_ground::telemetry::{AccRecord, Mode};

fn answer(kind: Kind, seed: u64, only: Option<&'static str>) -> Diagnosis {
    let manner = Manner { dump: true, ..Manner::default() };
    let concealed = draw_order(&Order { kind, seed, only, manner });
    diagnose(&super::case(&concealed.files), &Settings::default()).unwrap()
}

/// The bias of these two is fitted 2.4 standard errors off: 70 ng along y, and 42 ng along z, that come and go over a day and a half.
#[test]
fn a_bias_fitted_two_standard_errors_off_is_no_finding() {
    for seed in [1017, 1030] {
        let found = answer(Kind::Clean, seed, None);
        assert_eq!(found.verdict, Verdict::Consistent, "{seed}: {found:?}");
    }
}

#[test]
fn an_acceleration_in_a_dump_is_named_and_sized() {
    let found = answer(Kind::One, 1001, Some("cg_offset"));
    assert_eq!((found.verdict, found.effects[0].id.as_str()), (Verdict::Explained, "cg_offset"), "{found:?}");
    // Along y the tensor of these attitudes says little.
    for (parameter, most) in found.effects[0].parameters.iter().zip([0.05, 0.5, 0.05]) {
        assert!(parameter.sigma > 0.0 && parameter.sigma < most, "{parameter:?}");
    }
}

/// What the calibration leaves open goes on into an observation to come.
#[test]
fn sets_that_a_dump_cannot_tell_apart_have_an_observation_that_would() {
    let found = answer(Kind::Two, 1012, None);
    assert_eq!(found.verdict, Verdict::Ambiguous, "{found:?}");
    let observation = found.separating_observation.unwrap();
    assert!(observation.gain.is_some_and(|gain| gain > 0.0), "{observation:?}");
}

/// The files of a flight of so many hours with faults.
fn files(hours: f64, faults: Vec<Fault>) -> Vec<(String, Vec<u8>)> {
    files_of(MissionConfig { faults, ..MissionConfig::sts65(5, hours) })
}

/// The files of a flight.
fn files_of(config: MissionConfig) -> Vec<(String, Vec<u8>)> {
    files_of_what_came(config, |_| true)
}

/// The files of a flight of which only some science records came down.
fn files_of_what_came(config: MissionConfig, came: impl Fn(&AccRecord) -> bool) -> Vec<(String, Vec<u8>)> {
    let seed = config.seed;
    let mission = Mission::new(config).unwrap();
    let link = LinkConfig::default();
    let flown = mission.fly().map(|mut second| {
        second.sent.retain(|sent| !matches!(&sent.record, Record::Acc(record) if !came(record)));
        second
    });
    let passes = playbacks(&frames(flown, link), &link, &RecorderConfig::clean(), seed);
    let mut files: Vec<(String, Vec<u8>)> = case_files(&mission, "with-fault", "recording.dump")
        .unwrap()
        .into_iter()
        .map(|(name, text)| (name.to_string(), text.into_bytes()))
        .collect();
    files.push(("recording.dump".into(), passes.into_iter().flat_map(|pass| pass.octets).collect()));
    files
}

/// The diagnosis of a flight of twelve hours with a fault.
fn with_fault(fault: Fault) -> Diagnosis {
    diagnose(&super::case(&files(12.0, vec![fault])), &Settings::default()).unwrap()
}

/// A bump drives an axis to its rail, and the instrument takes a coarser range: it is told, and no effect. At the rail in every range for
/// half a minute is one.
#[test]
fn a_rail_that_autoranging_answers_is_told_and_no_effect() {
    let bump = with_fault(Fault::Saturation { axis: 2, from_clock_s: 40_000.3, seconds: 2.0 });
    assert_eq!((bump.verdict, bump.effects.len()), (Verdict::Consistent, 0), "{bump:?}");
    assert!(bump.notes.iter().any(|note| note.contains("was at the rail for")), "{:?}", bump.notes);
    let long = with_fault(Fault::Saturation { axis: 2, from_clock_s: 40_000.3, seconds: 30.0 });
    let [effect] = &long.effects[..] else { panic!("{long:?}") };
    assert_eq!((long.verdict, effect.id.as_str()), (Verdict::Explained, "saturation"));
}

/// Records that name range C while the sensor is in range A, for an hour: the windows are corrected, and the fault is told with its span.
#[test]
fn records_that_name_a_wrong_range_are_an_effect_with_their_span() {
    const SPAN_S: [f64; 2] = [40_000.0, 43_600.0];
    let found = with_fault(Fault::RangeMisreport { from_clock_s: SPAN_S[0] as u32, seconds: 3600 });
    let [effect] = &found.effects[..] else { panic!("{found:?}") };
    assert_eq!((found.verdict, effect.id.as_str()), (Verdict::Explained, "range_misreport"), "{found:?}");
    for (parameter, truth) in effect.parameters.iter().zip(SPAN_S) {
        assert!((parameter.value - truth).abs() <= 2.0 * parameter.sigma, "{parameter:?}");
    }
    assert!(found.notes.contains(&effect.why), "{:?}", found.notes);
    let json = serde_json::to_string(&found).unwrap();
    assert!(!json.contains("\"confirmed\":null"), "what is not known is absent");
}

/// In the quietest records, where a count of range A is more than what scatters, the means of the corrected windows follow the signal in
/// steps: that is the fault, and no physics.
#[test]
fn a_wrong_range_of_a_quiet_record_is_the_only_finding() {
    for seed in [5, 6] {
        let faults = vec![Fault::RangeMisreport { from_clock_s: 40_000, seconds: 5400 }];
        let config = MissionConfig { faults, noise: NoisePlan::quiet(), ..MissionConfig::sts65(seed, 16.0) };
        let found = diagnose(&super::case(&files_of(config)), &Settings::default()).unwrap();
        let ids: Vec<&str> = found.effects.iter().map(|effect| effect.id.as_str()).collect();
        assert_eq!((found.verdict, &ids[..]), (Verdict::Explained, &["range_misreport"][..]), "{seed}: {found:?}");
    }
}

/// A record in which no scale factor was measured is compared all the same; that of the instrument at large is hardly known, and its
/// error is no finding.
#[test]
fn a_dump_without_a_scale_calibration_is_a_case() {
    for (seed, off) in [(5, 1.0), (6, 1.04), (7, 0.96)] {
        let mut config = MissionConfig::sts65(seed, 12.0);
        config.instrument.scale_correction.iter_mut().flatten().for_each(|correction| *correction *= off);
        let case = super::case(&files_of_what_came(config, |record| record.mode != Mode::Scale));
        assert!(case.recording.scale_errors.iter().all(|axis| axis.iter().flatten().any(|share| *share >= 0.1)));
        let found = diagnose(&case, &Settings::default()).unwrap();
        assert_eq!(found.verdict, Verdict::Consistent, "{seed}: {found:?}");
    }
}

/// A bias that steps is seen by the calibrations behind it, and the law takes what it can of it: what is left in the windows, by two flights of
/// one seed, is what the fitted law says. At every calibration it sees the step whole.
#[test]
fn of_a_step_of_the_bias_the_windows_keep_what_the_law_does_not_take() {
    const STEP: [(usize, f64); 2] = [(0, 120.0), (2, -90.0)];
    const AT_S: u32 = 60_000;
    let steps = STEP.map(|(axis, ng)| Fault::BiasStep { axis, at_clock_s: AT_S, ng });
    let [without, with] = [Vec::new(), steps.to_vec()].map(|faults| super::case(&files(30.0, faults)).recording);
    assert_eq!(without.clock_s, with.clock_s);
    for (body, size_ng) in [(0, 120.0), (1, -90.0), (2, 0.0)] {
        let step = |clock_s: &[f64]| -> Vec<f64> {
            clock_s.iter().map(|t| if *t > f64::from(AT_S) { size_ng } else { 0.0 }).collect()
        };
        let mut expected = step(&without.clock_s);
        let whole = expected.clone();
        for law in &without.bias_laws[body] {
            law.take_from(&mut expected, &step(&law.measured_s));
        }
        let found: Vec<f64> = with.a_ng[body].iter().zip(&without.a_ng[body]).map(|(a, b)| a - b).collect();
        let rms = |of: &dyn Fn(usize) -> f64| {
            ((0..found.len()).map(|i| of(i).powi(2)).sum::<f64>() / found.len() as f64).sqrt()
        };
        let away = rms(&|i| found[i] - expected[i]);
        eprintln!("axis {body}: {away:.2} ng rms from the law, {:.2} from the step", rms(&|i| found[i] - whole[i]));
        assert!(away < 0.1 * rms(&|i| found[i] - whole[i]).max(10.0), "axis {body}: {away}");
        // The flips of the table themselves say how large it is, and without it that it is none.
        for (recording, size_ng) in [(&with, size_ng), (&without, 0.0)] {
            for law in &recording.bias_laws[body] {
                let one: Vec<f64> =
                    law.measured_s.iter().map(|t| if *t > f64::from(AT_S) { 1.0 } else { 0.0 }).collect();
                let seen = law.flips.filtered(&one);
                let product = |a: &[f64], b: &[f64]| -> f64 { a.iter().zip(b).map(|(a, b)| a * b).sum() };
                let information = product(&seen, &seen);
                let (found_ng, sigma_ng) = (product(&seen, &law.flips.rest) / information, information.sqrt().recip());
                eprintln!("axis {body}, {} flips: {found_ng:.1} ± {sigma_ng:.1} ng for {size_ng}", one.len());
                assert!((found_ng - size_ng).abs() < 3.0 * sigma_ng, "axis {body}: {found_ng} for {size_ng}");
            }
        }
    }
}

/// The records carry UTC of their own: an epoch of another year in `case.toml` is told, since Sun and shadow are by it.
#[test]
fn an_epoch_that_is_not_that_of_the_records_is_told() {
    let mut files = files(8.0, Vec::new());
    let told = |files: &[(String, Vec<u8>)]| {
        let found = diagnose(&super::case(files), &Settings::default()).unwrap();
        found.notes.iter().filter(|note| note.contains("own UTC is -31536000 s from that of `epoch_utc`")).count()
    };
    assert_eq!(told(&files), 0);
    let (_, octets) = files.iter_mut().find(|(name, _)| name == "case.toml").unwrap();
    *octets = String::from_utf8(octets.clone()).unwrap().replace("1994-07-", "1995-07-").into_bytes();
    assert_eq!(told(&files), 1);
}

/// The leak of 9000 s of a flight, which is all that is found.
fn only_leak(seed: u64, hours: f64, from_clock_s: f64, body_ng: Vec3) -> EffectAnswer {
    let mut config = MissionConfig::sts65(seed, hours);
    config.forces.pushes.push(Push { from_clock_s, until_clock_s: f64::INFINITY, tau_s: Some(9000.0), body_ng });
    let found = diagnose(&super::case(&files_of(config)), &Settings::default()).unwrap();
    let [leak] = &found.effects[..] else { panic!("{seed}: {found:?}") };
    assert_eq!((found.verdict, leak.id.as_str()), (Verdict::Explained, "vent_leak"), "{seed}");
    leak.clone()
}

/// The calibration begins a minute after the leak: what is seen behind it alone is the same whenever the leak began in it.
#[test]
fn a_leak_that_begins_just_before_a_calibration_is_one_and_no_push() {
    for seed in [23, 28] {
        let leak = only_leak(seed, 36.0, 90_000.0, Vec3::new(250.0, -190.0, 160.0));
        for (name, truth) in [("onset_s", 90_000.0), ("tau_s", 9000.0)] {
            let of_leak = leak.parameters.iter().find(|parameter| parameter.name == name).unwrap();
            assert!((of_leak.value - truth).abs() < 4.0 * of_leak.sigma, "{seed}: {of_leak:?}, and it was {truth}");
        }
    }
}

/// Half a day is short for a leak, and the errors of the bias that all windows share are large: at the noise of a step it is out of reach.
#[test]
fn a_leak_in_half_a_day_is_no_step() {
    for seed in [101, 104, 106] {
        let leak = only_leak(seed, 12.0, 36_000.0, Vec3::new(250.0, -120.0, 300.0));
        for parameter in &leak.parameters {
            let truth = match parameter.name.as_str() {
                "onset_s" => 36_000.0,
                "tau_s" => 9000.0,
                "ax_ng" => 250.0,
                "ay_ng" => -120.0,
                "az_ng" => 300.0,
                other => panic!("a leak has no {other}"),
            };
            assert!(
                (parameter.value - truth).abs() < 4.0 * parameter.sigma,
                "{seed}: {parameter:?}, and it was {truth}"
            );
        }
    }
}
