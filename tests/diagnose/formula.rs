//! A formula told of an unlisted law can be evaluated: it gives the law that was put in.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::{Settings, diagnose};

/// Deviation of the law over the record, ng.
const SIZE_NG: f64 = 60.0;

#[test]
fn the_formula_of_an_unlisted_law_gives_its_size_back() {
    let order = Order { kind: Kind::Clean, seed: 1_191_002, only: None, manner: Manner::default() };
    let mut files = draw_order(&order).files;
    let table = |name: &str| -> (Vec<String>, Vec<Vec<f64>>) {
        let text = String::from_utf8(files.iter().find(|(n, _)| n == name).unwrap().1.clone()).unwrap();
        let mut lines = text.lines();
        let header = lines.next().unwrap().split(',').map(str::to_string).collect();
        (header, lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect())
    };
    let (names, ancillary) = table("ancillary.csv");
    let place = |name: &str| names.iter().position(|n| n == name).unwrap();
    let [t, wx, wz] = ["clock_s", "wx_rad_s", "wz_rad_s"].map(place);
    // The law on the rows of the ancillary data, straight between them, as the mean over the 50 s of a window.
    let at = |clock_s: f64| {
        let i = ancillary.partition_point(|row| row[t] < clock_s).clamp(1, ancillary.len() - 1);
        let (a, b) = (&ancillary[i - 1], &ancillary[i]);
        let [before, after] = [a, b].map(|row| row[wx] * row[wz]);
        before + (after - before) * (clock_s - a[t]) / (b[t] - a[t])
    };
    let law = |clock_s: f64| (0..50).map(|i| at(clock_s - 24.5 + f64::from(i))).sum::<f64>() / 50.0;
    let (header, mut recording) = table("recording.csv");
    let laws: Vec<f64> = recording.iter().map(|row| law(row[0])).collect();
    let mean = laws.iter().sum::<f64>() / laws.len() as f64;
    let variance = laws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / laws.len() as f64;
    // ng for (rad/s)^2.
    let size = SIZE_NG / variance.sqrt();
    let mut text = header.join(",");
    for (row, law) in recording.iter_mut().zip(laws) {
        row[2] += size * law;
        let cells: Vec<String> = row.iter().map(f64::to_string).collect();
        text.push('\n');
        text.push_str(&cells.join(","));
    }
    files.iter_mut().find(|(name, _)| name == "recording.csv").unwrap().1 = (text + "\n").into_bytes();
    let found = diagnose(&super::case(&files), &Settings::default()).unwrap();
    let hypothesis = found.hypothesis.unwrap();
    assert_eq!((found.verdict, hypothesis.axis.as_str()), (Verdict::Unexplained, "y"), "{hypothesis:?}");
    // `[amplitude(error)] ng x (form) / [deviation]`
    let (amplitudes, rest) = hypothesis.formula.strip_prefix('[').unwrap().split_once("] ng x (wx wz) / [").unwrap();
    let deviation: f64 = rest.strip_suffix(']').unwrap().parse().unwrap();
    let (amplitude, error) = amplitudes.strip_suffix(')').unwrap().split_once('(').unwrap();
    let [amplitude, error] = [amplitude, error].map(|number| number.parse::<f64>().unwrap() / deviation);
    assert!((amplitude - size).abs() < 2.5 * error && error < 0.1 * size, "{amplitude:.3e} +- {error:.3e}, {size:.3e}");
}
