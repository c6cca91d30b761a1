//! Real recordings, measured by others; skipped, loudly, where they are not at hand.

mod ladder;

use std::path::PathBuf;

/// The folder of real recordings, or nothing, said plainly.
fn data(folder: &str) -> Option<PathBuf> {
    let root = std::env::var_os("OARE_REAL_DATA")
        .map_or_else(|| PathBuf::from(concat!(env!("CARGO_MANIFEST_DIR"), "/../shared/data/real")), PathBuf::from);
    let path = root.join(folder);
    if path.exists() {
        return Some(path);
    }
    println!("SKIPPED: no real recordings at {} (set OARE_REAL_DATA)", path.display());
    None
}
