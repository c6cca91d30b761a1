//! `oare`: arguments to a command, a command to an exit code.

mod command;

use std::process::ExitCode;

use clap::{Parser, Subcommand};

/// Ground station of the Orbital Acceleration Research Experiment.
#[derive(Parser)]
#[command(name = "oare", version, about)]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {}

fn main() -> ExitCode {
    let arguments = Arguments::parse();
    match arguments.command {}
}
