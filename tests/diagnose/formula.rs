//! A formula told of an unlisted law can be evaluated: it gives the law that was put in.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::diagnose::answer::Verdict;
use oare_ground::diagnose::{Settings, diagnose};

/// Deviation of the law over the record, ng.
const SIZE_NG: f64 = 60.0;

/// A row of the ancillary data by the names of its columns, and its unix time.
type Law = fn(&dyn Fn(&str) -> f64, f64) -> f64;

/// Right ascension of the Sun, rad, to a hundredth of a degree (Astronomical Almanac, low-precision formulas).
fn sun_right_ascension(unix_s: f64) -> f64 {
    let days = unix_s / 86_400.0 - 10_957.5;
    let [longitude, anomaly] = [280.460 + 0.985_647_4 * days, 357.528 + 0.985_600_3 * days].map(f64::to_radians);
    let ecliptic = longitude + (1.915 * anomaly.sin() + 0.020 * (2.0 * anomaly).sin()).to_radians();
    let obliquity = (23.439 - 4e-7 * days).to_radians();
    (obliquity.cos() * ecliptic.sin()).atan2(ecliptic.cos())
}

/// Forms as they are told, and the same evaluated here.
const LAWS: [(&str, Law); 2] = [
    ("wx wz", |row, _| row("wx_rad_s") * row("wz_rad_s")),
    // Local time as an angle, twelve hours where the Sun is overhead.
    ("tanh(4 sin(LT))", |row, unix_s| {
        let hour_angle = row("ry_m").atan2(row("rx_m")) - sun_right_ascension(unix_s);
        (4.0 * (hour_angle + std::f64::consts::PI).sin()).tanh()
    }),
];

/// The header of a CSV and its rows.
fn table(files: &[(String, Vec<u8>)], name: &str) -> (Vec<String>, Vec<Vec<f64>>) {
    let text = String::from_utf8(files.iter().find(|(n, _)| n == name).unwrap().1.clone()).unwrap();
    let mut lines = text.lines();
    let header = lines.next().unwrap().split(',').map(str::to_string).collect();
    (header, lines.map(|line| line.split(',').map(|cell| cell.parse().unwrap()).collect()).collect())
}

#[test]
fn the_formula_of_an_unlisted_law_gives_its_size_back() {
    for (form, law) in LAWS {
        gives_its_size_back(form, law);
    }
}

fn gives_its_size_back(form: &str, law: Law) {
    let order = Order { kind: Kind::Clean, seed: 1_191_002, only: None, manner: Manner::default() };
    let mut files = draw_order(&order).files;
    let header = super::case(&files).expected.header.clone();
    let (names, ancillary) = table(&files, "ancillary.csv");
    let place = |name: &str| names.iter().position(|n| n == name).unwrap();
    let t = place("clock_s");
    let values: Vec<f64> =
        ancillary.iter().map(|row| law(&|name: &str| row[place(name)], header.unix_s(row[t]))).collect();
    // The law on the rows of the ancillary data, straight between them, as the mean over the 50 s of a window.
    let at = |clock_s: f64| {
        let i = ancillary.partition_point(|row| row[t] < clock_s).clamp(1, ancillary.len() - 1);
        let [a, b] = [i - 1, i].map(|i| ancillary[i][t]);
        values[i - 1] + (values[i] - values[i - 1]) * (clock_s - a) / (b - a)
    };
    let mean_of_window = |clock_s: f64| (0..50).map(|i| at(clock_s - 24.5 + f64::from(i))).sum::<f64>() / 50.0;
    let (columns, mut recording) = table(&files, "recording.csv");
    let laws: Vec<f64> = recording.iter().map(|row| mean_of_window(row[0])).collect();
    let mean = laws.iter().sum::<f64>() / laws.len() as f64;
    let variance = laws.iter().map(|x| (x - mean).powi(2)).sum::<f64>() / laws.len() as f64;
    // ng for one of the law.
    let size = SIZE_NG / variance.sqrt();
    let mut text = columns.join(",");
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
    let told = hypothesis.formula.strip_prefix('[').unwrap().split_once(&format!("] ng x ({form}) / ["));
    let (amplitudes, rest) = told.unwrap_or_else(|| panic!("{form}: {hypothesis:?}"));
    let deviation: f64 = rest.strip_suffix(']').unwrap().parse().unwrap();
    let (amplitude, error) = amplitudes.strip_suffix(')').unwrap().split_once('(').unwrap();
    let [amplitude, error] = [amplitude, error].map(|number| number.parse::<f64>().unwrap() / deviation);
    assert!((amplitude - size).abs() < 2.5 * error && error < 0.1 * size, "{amplitude:.3e} +- {error:.3e}, {size:.3e}");
}
