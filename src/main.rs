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
enum Command {
    Challenge(command::challenge::Args),
}

fn main() -> ExitCode {
    let result = match Arguments::parse().command {
        Command::Challenge(args) => command::challenge::run(args),
    };
    result.unwrap_or_else(|error| {
        eprintln!("oare: {error:#}");
        command::unusable()
    })
}
