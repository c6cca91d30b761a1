//! How long a diagnosis takes: concealed records of 48 h, each from its files to its answer on all processors, alone and with a
//! bootstrap of 999; beside the usual methods on the same files.
//!
//! `cargo bench --bench diagnosis`; the usual methods need `pip install -r benches/peers/requirements.txt`.

use std::path::Path;
use std::process::Command;
use std::time::{Duration, Instant};

use indicatif::ProgressBar;
use oare_ground::challenge::conceal::{Kind, Manner};
use oare_ground::challenge::engine::Engine;
use oare_ground::challenge::run::{self, Analyser, Material};

/// Records, of all kinds in the usual shares, and the first seed of each kind.
const CASES: usize = 21;
const SEED: u64 = 1;
/// Of these so many are bootstrapped.
const BOOTSTRAPPED: usize = 7;
const HOURS: u32 = 48;

fn timed(engine: &Engine, directory: &Path) -> Duration {
    let start = Instant::now();
    let answer = engine.answer(&Material::Directory(directory), None);
    assert!(answer.is_ok(), "{answer:?}");
    start.elapsed()
}

fn told(what: &str, mut times: Vec<Duration>) {
    times.sort_unstable();
    let seconds = |time: Duration| time.as_secs_f64();
    let worst = times.last().map_or(0.0, |last| seconds(*last));
    println!("{what}: median {:.2} s, {worst:.2} s at most, {} records", seconds(times[times.len() / 2]), times.len());
}

fn main() -> std::io::Result<()> {
    let orders = run::plan(CASES, SEED, &Kind::ALL, Manner { hours: HOURS, ..Manner::default() }, None);
    let quiet = ProgressBar::hidden();
    let place = tempfile::tempdir()?;
    run::write(&orders, &run::seal(&orders, &quiet), place.path(), &quiet)?;
    let mut cases: Vec<_> = std::fs::read_dir(place.path().join("cases"))?
        .map(|entry| entry.map(|e| e.path()))
        .collect::<Result<_, _>>()?;
    cases.sort();
    println!("{HOURS} h records on {} processors", rayon::current_num_threads());
    told("search and answer", cases.iter().map(|case| timed(&Engine::default(), case)).collect());
    let bootstrapped = Engine { bootstraps: 999, seed: 1 };
    let some = cases.iter().step_by(CASES / BOOTSTRAPPED);
    told("the same with 999 bootstraps", some.map(|case| timed(&bootstrapped, case)).collect());
    let peers = Command::new("python3")
        .arg(concat!(env!("CARGO_MANIFEST_DIR"), "/benches/peers/peers.py"))
        .args([place.path().join("cases"), place.path().join("truth")])
        .arg("--times")
        .output();
    match peers {
        Ok(output) if output.status.success() => print!("{}", String::from_utf8_lossy(&output.stdout)),
        _ => println!("no python3 with NumPy, SciPy and scikit-learn: the usual methods are left out"),
    }
    Ok(())
}
