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
    /// Dumps in, product files out: the pipeline without sockets.
    Process(command::process::Args),
    /// A mission flown: its dump and its truth.
    Simulate(command::simulate::Args),
    /// The service: dumps in at a TCP port, products out over HTTP and WebSocket.
    Serve(command::serve::Args),
    /// The whole thing with nothing prepared: the service, and a simulated mission flown into it.
    Demo(command::demo::Args),
    /// Sends dump files as a recorder playback would arrive.
    Replay(command::replay::Args),
    /// Products out of a data directory.
    Export(command::export::Args),
    /// Says what physics a simulation left out, from a case directory.
    Diagnose(command::diagnose::Args),
    /// A PAD file of the space station's archive: what it holds, and as CSV.
    Pad(command::pad::Args),
    /// Makes, seals, runs and scores concealed cases.
    Challenge(command::challenge::Args),
}

/// A reader that goes away (`oare diagnose CASE | head -1`) ends the command, and is no failure to report; a full disk behind standard
/// output is one.
fn end_when_nobody_reads() {
    let report = std::panic::take_hook();
    std::panic::set_hook(Box::new(move |panic| {
        let unprinted = panic.payload_as_str().and_then(|text| text.strip_prefix("failed printing to stdout: "));
        match unprinted {
            Some(reason) if reason.starts_with("Broken pipe") => std::process::exit(0),
            Some(reason) => {
                eprintln!("oare: cannot write to standard output: {reason}");
                std::process::exit(command::FAILED.into())
            }
            None => report(panic),
        }
    }));
}

fn main() -> ExitCode {
    end_when_nobody_reads();
    let done = match Arguments::parse().command {
        Command::Process(args) => command::process::run(args),
        Command::Simulate(args) => command::simulate::run(args),
        Command::Serve(args) => command::serve::run(args),
        Command::Demo(args) => command::demo::run(args),
        Command::Replay(args) => command::replay::run(args),
        Command::Export(args) => command::export::run(args),
        Command::Diagnose(args) => command::diagnose::run(args),
        Command::Pad(args) => command::pad::run(args),
        Command::Challenge(args) => command::challenge::run(args),
    };
    done.unwrap_or_else(|error| {
        eprintln!("oare: {}", command::told_once(&error));
        command::failed()
    })
}
