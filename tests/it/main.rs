//! The whole, from outside: sample dumps through the core, the service through real sockets, the shape of the sources.

mod api;
mod bad_input;
mod commands;
mod dashboard;
mod diagnosis;
mod layering;
mod live;
mod replay;
mod samples;
mod service_support;
mod station;
mod store;

use std::path::{Path, PathBuf};

/// A folder of the shared sample data; None, said loudly, where they are not at hand.
pub fn shared_data(name: &str) -> Option<PathBuf> {
    let root = std::env::var_os("OARE_SHARED_DATA")
        .map_or_else(|| Path::new(env!("CARGO_MANIFEST_DIR")).join("../shared/data"), PathBuf::from);
    let folder = root.join(name);
    if folder.is_dir() {
        return Some(folder);
    }
    eprintln!("SKIPPED: no sample data at {} (set OARE_SHARED_DATA)", folder.display());
    None
}
