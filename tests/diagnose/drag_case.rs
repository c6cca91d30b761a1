//! A concealed case of strong drag, and the same with something changed in its files.

use oare_ground::challenge::conceal::{Kind, Manner, Order, draw_order};
use oare_ground::challenge::engine;
use oare_ground::challenge::run::Material;
use oare_ground::diagnose::case::Case;
use oare_ground::diagnose::{Settings, diagnose};

pub(super) type Files = Vec<(String, Vec<u8>)>;

/// A concealed case of strong drag.
pub(super) fn files() -> Files {
    let order = Order { kind: Kind::One, seed: 1_191_000, only: Some("aerodynamic_drag"), manner: Manner::default() };
    draw_order(&order).files
}

/// The same with the lines of one file changed.
pub(super) fn with_lines(file: &str, change: impl Fn(&mut Vec<String>)) -> Files {
    let mut files = files();
    let (_, octets) = files.iter_mut().find(|(name, _)| name == file).unwrap();
    let mut lines: Vec<String> = String::from_utf8_lossy(octets).lines().map(str::to_string).collect();
    change(&mut lines);
    *octets = (lines.join("\n") + "\n").into_bytes();
    files
}

/// The same with one cell changed, on a line or on all of them.
pub(super) fn with_cell(file: &str, line: Option<usize>, column: &str, value: &str) -> Files {
    with_lines(file, |lines| {
        let place = lines[0].split(',').position(|name| name == column).unwrap();
        let all = 1..lines.len();
        for i in line.map_or(all, |line| line..line + 1) {
            let mut cells: Vec<&str> = lines[i].split(',').collect();
            cells[place] = value;
            lines[i] = cells.join(",");
        }
    })
}

pub(super) fn read(files: &Files) -> Result<Case, String> {
    engine::read(&Material::Files(files))
}

/// The same with another value of a key of `case.toml`.
pub(super) fn with_key(key: &str, value: &str) -> Files {
    with_lines("case.toml", |lines| {
        for line in lines.iter_mut().filter(|line| line.starts_with(&format!("{key} ="))) {
            *line = format!("{key} = {value}");
        }
    })
}

/// The same with a column of the ancillary data, and the two after it, put through a function.
pub(super) fn turned(first: &str, how: impl Fn(f64) -> f64) -> Files {
    with_lines("ancillary.csv", |lines| {
        let place = lines[0].split(',').position(|name| name == first).unwrap();
        for line in &mut lines[1..] {
            let mut cells: Vec<String> = line.split(',').map(str::to_string).collect();
            for cell in &mut cells[place..place + 3] {
                *cell = how(cell.parse().unwrap()).to_string();
            }
            *line = cells.join(",");
        }
    })
}

/// Whether drag is named, its fraction, and the notes.
pub(super) fn drag(files: &Files) -> (f64, f64, Vec<String>) {
    let found = diagnose(&read(files).unwrap(), &Settings::default()).unwrap();
    assert_eq!(super::ids(&found), ["aerodynamic_drag"], "{found:?}");
    let fraction = &found.effects[0].parameters[0];
    (fraction.value, fraction.sigma, found.notes)
}
