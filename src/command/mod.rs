//! The commands of `oare`, one a file: arguments in, exit code out. The work is in the library.

pub mod challenge;
mod challenge_real;

use std::process::ExitCode;

pub mod process;

/// Done.
pub const DONE: ExitCode = ExitCode::SUCCESS;

/// Failed.
pub fn failed() -> ExitCode {
    ExitCode::from(1)
}

/// Wrong usage, configuration, or an unusable case.
pub fn unusable() -> ExitCode {
    ExitCode::from(2)
}

/// Done, and some input could not be used.
pub fn done_in_part() -> ExitCode {
    ExitCode::from(3)
}
