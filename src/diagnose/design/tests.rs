use super::*;

const WINDOWS: i32 = 400;

fn schedule() -> Schedule {
    Schedule::new(&(0..WINDOWS).map(|i| 25.0 * f64::from(i)).collect::<Vec<f64>>())
}

/// A residual behind the filters of even noise with so much of a slow part.
fn framed(slow_ng: f64, schedule: Schedule, residual_ng: &Axes) -> Frame {
    let noise =
        AxisNoise { white_ng: 50.0, short_ng: 5.0, short_tau_s: 100.0, slow_ng, slow_tau_s: 3000.0, resonance: None };
    let loudness = std::array::from_fn(|_| Loudness::even(vec![1.0; schedule.len()]));
    Frame::new(&[noise; 3], &schedule, &loudness, residual_ng)
}

fn full_column(frame: &Frame, series: &[f64], size: f64) -> Column {
    frame.column(&std::array::from_fn(|_| Some(series.to_vec())), size)
}

/// A prior about one is a prior about nothing of what the whole column leaves.
#[test]
fn a_prior_about_a_mean_is_one_about_nothing_of_what_the_mean_leaves() {
    let wave = |rate: f64| -> Vec<f64> { (0..WINDOWS).map(|i| 30.0 * (rate * f64::from(i)).sin()).collect() };
    let (term, other) = (wave(0.05), wave(0.07));
    let residual = |share: f64| -> Axes {
        std::array::from_fn(|_| term.iter().zip(&other).map(|(x, y)| share * x + 0.3 * y).collect())
    };
    let frame = |share: f64| framed(8.0, schedule(), &residual(share));
    // The recording has 0.85 of the term; less the whole of it, -0.15.
    let (all, less) = (frame(0.85), frame(-0.15));
    let whole = full_column(&all, &term, 0.1);
    let beside = full_column(&all, &other, 1.0);
    let likelihood = less.log_null - all.log_null;
    let about_one = Chosen::new(&all, vec![&whole.clone().about(10.0), &beside], &[]).log_evidence;
    let about_nothing = Chosen::new(&less, vec![&whole, &beside], &[]).log_evidence;
    assert!((about_one - about_nothing - likelihood).abs() < 1e-6 * about_one.abs(), "{about_one} {about_nothing}");

    let grown = Chosen::new(&all, vec![&beside], &[]).normal(&[whole.clone().about(10.0)]);
    let first = Chosen::new(&all, vec![&beside], &[]).log_evidence;
    assert!((first + grown.gain(1.0) - about_one).abs() < 1e-6 * about_one.abs());
    assert!((grown.gain(1.0) - grown.gain_of(0, 1.0)).abs() < 1e-9 * about_one.abs());
    // Three times the size is the column three times as large.
    let wider = full_column(&all, &term, 0.3).about(10.0 / 3.0);
    let other_way = Chosen::new(&all, vec![&beside], &[]).normal(&[wider]).gain(1.0);
    assert!((grown.gain(3.0) - other_way).abs() < 1e-6 * other_way.abs());
    let size = 0.1 * grown.posterior().0[0];
    assert!(0.85 < size && size < 1.0, "between what the data say and what the prior does: {size}");
}

/// Choices side by side are each as if alone, whether they share a column or have none.
#[test]
fn columns_beside_several_choices_are_those_beside_each() {
    let wave = |rate: f64| -> Vec<f64> { (0..WINDOWS).map(|i| 30.0 * (rate * f64::from(i)).sin()).collect() };
    let residual: Axes = [wave(0.05), wave(0.06), wave(0.07)];
    let frame = framed(8.0, schedule(), &residual);
    let [a, b, c] = [0.051, 0.055, 0.062].map(|rate| full_column(&frame, &wave(rate), 1.0));
    let louder = a.times(3.0);
    let whole = full_column(&frame, &wave(0.3), 1.0);
    let tried = [full_column(&frame, &wave(0.058), 1.0), full_column(&frame, &wave(0.066), 2.0)];
    let alone = Normal::of(&tried).before(&tried, &frame.data);
    let chosen = || {
        vec![
            Chosen::new(&frame, vec![&a, &b], &[]),
            Chosen::new(&frame, vec![&c, &a], &[&whole]),
            Chosen::new(&frame, Vec::new(), &[]),
            Chosen::new(&frame, vec![&louder], &[]),
        ]
    };
    let which = [0, 1, 2, 3, 1];
    let together = Choices::new(chosen()).beside(&which, &tried, &alone);
    for (choice, normal) in which.iter().zip(&together) {
        let own = chosen()[*choice].beside(&tried, &alone);
        assert_eq!((normal.gain(1.0), normal.gain(8.0)), (own.gain(1.0), own.gain(8.0)), "{choice}");
    }
    assert_ne!(together[0].gain(1.0), together[3].gain(1.0));
}

/// A constant is nuisance however large it is: also to what subtracts whole series, as a clock offset does.
#[test]
fn a_constant_a_thousand_times_the_noise_changes_no_evidence() {
    let wave: Vec<f64> = (0..WINDOWS).map(|i| 60.0 * (0.05 * f64::from(i)).sin()).collect();
    let evidence = |constant: f64| {
        let residual: Axes = std::array::from_fn(|_| wave.iter().map(|x| constant + 0.9 * x).collect());
        let frame = framed(8.0, schedule(), &residual);
        Chosen::new(&frame, Vec::new(), &[&full_column(&frame, &wave, 1.0)]).log_evidence
    };
    let (none, large) = (evidence(0.0), evidence(1e6));
    assert!(none > 10.0 && (none - large).abs() < 1e-4 * none, "{none} {large}");
}

/// Of an error that all windows share the data decide the share that their energy has beside its prior, and no column along it
/// explains more than what is left.
#[test]
fn an_error_that_all_windows_share_is_no_finding() {
    let drift: Vec<f64> = (0..WINDOWS).map(|i| 40.0 * f64::from(i) / f64::from(WINDOWS)).collect();
    // The recording is the drift, two of its own errors large, on y.
    let residual: Axes = std::array::from_fn(|k| drift.iter().map(|x| if k == 1 { 2.0 * x } else { 0.0 }).collect());
    let alone = framed(0.5, schedule(), &residual);
    let shared = [Vec::new(), vec![drift.clone()], Vec::new()];
    let known = framed(0.5, schedule().with_shared(shared), &residual);
    let column = |frame: &Frame| frame.scalar(1, &drift, 1.0);
    let (free, bound) = (column(&alone), column(&known));
    let energy = free.dot(&free);
    assert!((bound.dot(&bound) - energy / (1.0 + energy)).abs() < 1e-6 * energy, "{energy} {}", bound.dot(&bound));
    // A drift of 2 is 2^2/2 against the prior of 1 and nothing against the data: the likelihood falls by that and by the volume.
    let log_ratio = known.log_null - alone.log_null;
    let expected = 0.5 * 4.0 * energy - 0.5 * 4.0 * energy / (1.0 + energy) - 0.5 * (1.0 + energy).ln();
    assert!((log_ratio - expected).abs() < 1e-6 * expected.abs(), "{log_ratio} {expected}");
    // Taken from the residual it leaves the share that the prior holds back, and a constant.
    let [x, left, _] = known.less_shared_errors(&residual, &[Vec::new(), vec![drift.clone()], Vec::new()]);
    let kept = 2.0 / (1.0 + energy);
    assert!(x == residual[0]);
    assert!(left.iter().zip(&drift).all(|(left, drift)| (left - kept * drift).abs() < 1e-6 * 40.0));
}
