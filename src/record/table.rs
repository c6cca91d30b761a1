//! Product tables of a span, in the form of `windows.csv`.

use crate::pipeline::Station;
use crate::pipeline::files::{WINDOW_COLUMNS, window_row};
use crate::units::Clock;

/// `windows.csv` of the windows that start in `[from, to]`.
pub fn windows_csv_between(station: &Station, from: Clock, to: Clock) -> String {
    let mut csv = WINDOW_COLUMNS.join(",");
    csv.push('\n');
    for product in station.products().filter(|product| (from..=to).contains(&product.start)) {
        window_row(&mut csv, product, station.settings());
    }
    csv
}
