//! Bursts in the noise, on concealed cases.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::{Diagnosis, Settings, diagnose};
use rand::{RngExt, SeedableRng};

fn answer(kind: Kind, only: Option<&'static str>, manner: Manner) -> Diagnosis {
    let concealed = draw_order(&Order { kind, seed: 41, only, manner });
    diagnose(&super::case(&concealed.files), &Settings::default()).unwrap()
}

fn weigh_less(answer: &Diagnosis) -> bool {
    answer.notes.iter().any(|note| note.contains("values out of the ordinary weigh less"))
}

/// One half window in a hundred ten times as loud: the errors of the effect grow by what those windows were worth, and not by what
/// they are out by, which would be 1.4 times.
#[test]
fn bursts_are_no_finding_and_hide_none() {
    let bursts = Manner { bursts: true, ..Manner::default() };
    let nothing = answer(Kind::Clean, None, bursts);
    assert_eq!(nothing.verdict, Verdict::Consistent, "{nothing:?}");
    assert!(weigh_less(&nothing), "{:?}", nothing.notes);
    let [even, loud] = [Manner::default(), bursts].map(|manner| answer(Kind::One, Some("cg_offset"), manner));
    assert!(!weigh_less(&even) && weigh_less(&loud));
    for found in [&even, &loud] {
        assert_eq!((found.verdict, found.effects[0].id.as_str()), (Verdict::Explained, "cg_offset"), "{found:?}");
    }
    for (a, b) in even.effects[0].parameters.iter().zip(&loud.effects[0].parameters) {
        assert!(b.sigma < 1.2 * a.sigma, "{}: {} and {}", a.name, a.sigma, b.sigma);
        assert!((a.value - b.value).abs() < 4.0 * a.sigma.hypot(b.sigma), "{}: {} and {}", a.name, a.value, b.value);
    }
}

/// One window in a hundred off by five to forty standard deviations, alone, as no burst of samples is. Of so many some come at even distances
/// or some time after what is logged.
#[test]
fn spikes_at_chance_instants_are_no_finding() {
    for seed in 0..5 {
        let concealed =
            draw_order(&Order { kind: Kind::Clean, seed: 900 + seed, only: None, manner: Manner::default() });
        let mut case = super::case(&concealed.files);
        let mut rng = rand_chacha::ChaCha12Rng::seed_from_u64(seed);
        for axis in &mut case.recording.a_ng {
            let mut steps: Vec<f64> = axis.windows(2).map(|pair| (pair[1] - pair[0]).abs()).collect();
            steps.sort_by(f64::total_cmp);
            let deviation_ng = 1.5 * steps[steps.len() / 2];
            for x in axis.iter_mut() {
                let [is_off, size, sign] = std::array::from_fn(|_| rng.random::<f64>());
                if is_off < 0.01 {
                    *x += 5.0 * 8.0_f64.powf(size) * deviation_ng * if sign < 0.5 { 1.0 } else { -1.0 };
                }
            }
        }
        let found = diagnose(&case, &Settings::default()).unwrap();
        assert_eq!(found.verdict, Verdict::Consistent, "{seed}: {found:?}");
    }
}
