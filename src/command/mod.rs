//! The commands of `oare`, one a file: arguments in, exit code out. The work is in the library.

pub mod challenge;
mod challenge_real;
pub mod demo;
pub mod diagnose;
pub mod export;
mod output;
pub mod pad;
pub mod process;
pub mod replay;
pub mod serve;
pub mod simulate;

use std::io::IsTerminal;
use std::process::ExitCode;

/// Done.
pub const DONE: ExitCode = ExitCode::SUCCESS;

/// Code of [`failed`].
pub const FAILED: u8 = 1;

/// Failed.
pub fn failed() -> ExitCode {
    ExitCode::from(FAILED)
}

/// Wrong usage, configuration, or an unusable case.
pub fn unusable() -> ExitCode {
    ExitCode::from(2)
}

/// Done, and some input could not be used.
pub fn done_in_part() -> ExitCode {
    ExitCode::from(3)
}

/// Logs go to standard error; `RUST_LOG` chooses which.
pub fn log_to_stderr() {
    let filter = tracing_subscriber::EnvFilter::try_from_default_env().unwrap_or_else(|_| "info".into());
    let _ = tracing_subscriber::fmt()
        .with_env_filter(filter)
        .with_ansi(std::io::stderr().is_terminal())
        .with_writer(std::io::stderr)
        .try_init();
}

/// The runtime of a service.
pub fn runtime() -> anyhow::Result<tokio::runtime::Runtime> {
    Ok(tokio::runtime::Builder::new_multi_thread().enable_all().build()?)
}

/// An error and its causes in one sentence; a cause that the sentence before it names already is left out.
pub fn told_once(error: &anyhow::Error) -> String {
    let mut told = String::new();
    for cause in error.chain().map(ToString::to_string).filter(|cause| !cause.is_empty()) {
        if !told.contains(&cause) {
            told = if told.is_empty() { cause } else { format!("{told}: {cause}") };
        }
    }
    told
}
