//! The simulator and its physics against the sample data, which others made.

mod anomalies;
mod calibration;
mod coverage;
mod flown;
mod onboard;
mod open_cases;
mod settling;

use std::path::{Path, PathBuf};

/// A file or folder of the shared sample data; None, said loudly, where it is not at hand.
pub fn shared_data(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("OARE_SHARED_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let path = root.join(name);
    if path.exists() {
        return Some(path);
    }
    eprintln!("SKIPPED: no sample data at {} (set OARE_SHARED_DATA)", path.display());
    None
}
