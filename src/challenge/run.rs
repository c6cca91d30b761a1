//! A run: cases drawn, truths sealed, analysed blind on all cores, revealed.
//!
//! The seals of all cases are made before the first analysis; at the reveal each case's truth is drawn again from its seed
//! and must hash to its seal. Not here: the analyser (an argument) and the figures (see `score`).

use std::io;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::path::Path;
use std::sync::Mutex;
use std::time::Instant;

use indicatif::ProgressBar;
use rayon::prelude::*;

use super::conceal::{Concealed, Kind, Manner, Order, Truth, draw_order};
use super::score::{Answer, Outcome};
use super::seal::Seal;

/// What an analyser gets, and nothing else.
pub enum Material<'a> {
    /// Names and octets of the files.
    Files(&'a [(String, Vec<u8>)]),
    /// A directory that holds them.
    Directory(&'a Path),
}

/// Whoever answers: `diagnosis.json` as a value, or one sentence why not. The effect to strike from the catalogue is told,
/// when there is one.
pub trait Analyser: Sync {
    /// Answers one case.
    fn answer(&self, material: &Material, deleted: Option<&str>) -> Result<serde_json::Value, String>;
}

/// Shares of the kinds in a run of all kinds, of 100.
const SHARES: [(Kind, usize); 7] = [
    (Kind::Clean, 30),
    (Kind::Slow, 22),
    (Kind::One, 20),
    (Kind::Two, 8),
    (Kind::Unknown, 10),
    (Kind::Single, 5),
    (Kind::Deleted, 5),
];

/// So many cases of these kinds, in the usual shares; the seeds of every kind count up from `seed`.
pub fn plan(cases: usize, seed: u64, kinds: &[Kind], manner: Manner, only: Option<&'static str>) -> Vec<Order> {
    let wanted: Vec<(Kind, usize)> = SHARES.into_iter().filter(|(kind, _)| kinds.contains(kind)).collect();
    let total: usize = wanted.iter().map(|(_, share)| share).sum();
    let mut orders = Vec::with_capacity(cases);
    // The kind that lags furthest behind its share is next: any beginning of the list has the shares too.
    let mut made = vec![0usize; wanted.len()];
    for k in 1..=cases {
        let lag = |j: &usize| (wanted[*j].1 * k) as f64 / total as f64 - made[*j] as f64;
        let next = (0..wanted.len()).max_by(|a, b| lag(a).total_cmp(&lag(b)));
        let Some(next) = next else { break };
        orders.push(Order { kind: wanted[next].0, seed: seed + made[next] as u64, only, manner });
        made[next] += 1;
    }
    orders
}

/// Draws every case once and seals its truth.
pub fn seal(orders: &[Order], progress: &ProgressBar) -> Vec<Seal> {
    orders
        .par_iter()
        .map(|order| {
            let seal = Seal::new(&draw_order(order).truth, rand::random());
            progress.inc(1);
            seal
        })
        .collect()
}

/// Analyses every case blind, then reveals its truth. A broken seal is an error of the run.
pub fn run(
    orders: &[Order],
    seals: &[Seal],
    analyser: &dyn Analyser,
    progress: &ProgressBar,
) -> Result<Vec<Outcome>, super::seal::BrokenSeal> {
    let pairs: Vec<(&Order, &Seal)> = orders.iter().zip(seals).collect();
    pairs
        .into_par_iter()
        .map(|(order, seal)| {
            let Concealed { files, truth, .. } = draw_order(order);
            let deleted = truth.deleted.clone();
            let (answer, seconds) = timed(analyser, &Material::Files(&files), deleted.as_deref());
            seal.check(&truth)?;
            progress.inc(1);
            Ok(Outcome { truth, answer, seconds })
        })
        .collect()
}

/// Analyses case directories that carry their `truth.json` (the open cases); those without are left out.
pub fn run_open(directory: &Path, analyser: &dyn Analyser, progress: &ProgressBar) -> io::Result<Vec<Outcome>> {
    let mut cases: Vec<std::path::PathBuf> = std::fs::read_dir(directory)?
        .filter_map(|entry| entry.ok().map(|e| e.path()))
        .filter(|path| path.join("truth.json").is_file())
        .collect();
    if cases.is_empty() {
        return Err(io::Error::new(io::ErrorKind::NotFound, "none has its truth.json with it"));
    }
    cases.sort();
    progress.set_length(cases.len() as u64);
    let outcomes = Mutex::new(Vec::new());
    cases.par_iter().try_for_each(|path| -> io::Result<()> {
        let file = path.join("truth.json");
        let in_file = |error: &dyn std::fmt::Display| io::Error::other(format!("{}: {error}", file.display()));
        let text = std::fs::read_to_string(&file).map_err(|error| in_file(&error))?;
        let truth: Truth = serde_json::from_str(&text).map_err(|error| in_file(&error))?;
        let (answer, seconds) = timed(analyser, &Material::Directory(path), truth.deleted.as_deref());
        progress.inc(1);
        outcomes.lock().unwrap_or_else(|e| e.into_inner()).push(Outcome { truth, answer, seconds });
        Ok(())
    })?;
    let mut outcomes = outcomes.into_inner().unwrap_or_else(|e| e.into_inner());
    outcomes.sort_by(|a, b| a.truth.case.cmp(&b.truth.case));
    Ok(outcomes)
}

/// Writes cases as directories, and their truths apart from them, with the seals.
pub fn write(orders: &[Order], seals: &[Seal], directory: &Path, progress: &ProgressBar) -> io::Result<()> {
    let truths = directory.join("truth");
    std::fs::create_dir_all(&truths)?;
    let published: String = seals.iter().map(|seal| format!("{} {}\n", seal.id, seal.hash)).collect();
    std::fs::write(directory.join("commitments.txt"), published)?;
    orders.par_iter().zip(seals).try_for_each(|(order, seal)| {
        let case = draw_order(order);
        let home = directory.join("cases").join(&case.id);
        std::fs::create_dir_all(&home)?;
        for (name, octets) in &case.files {
            std::fs::write(home.join(name), octets)?;
        }
        let revealed = serde_json::json!({ "nonce": seal.nonce, "truth": case.truth });
        let text = serde_json::to_string_pretty(&revealed).map_err(io::Error::other)?;
        std::fs::write(truths.join(format!("{}.json", case.id)), text)?;
        progress.inc(1);
        Ok(())
    })
}

fn timed(analyser: &dyn Analyser, material: &Material, deleted: Option<&str>) -> (Result<Answer, String>, f64) {
    let begin = Instant::now();
    // A panic is a defect of the analyser and costs it the case, not the run.
    let answer = catch_unwind(AssertUnwindSafe(|| analyser.answer(material, deleted)))
        .unwrap_or_else(|_| Err("the analyser panicked".into()));
    let seconds = begin.elapsed().as_secs_f64();
    let answer = answer.and_then(|value| {
        serde_json::from_value(value).map_err(|error| format!("the answer is not of the schema: {error}"))
    });
    (answer, seconds)
}

#[cfg(test)]
mod tests {
    use super::*;

    struct Silent;

    impl Analyser for Silent {
        fn answer(&self, material: &Material, _: Option<&str>) -> Result<serde_json::Value, String> {
            let Material::Files(files) = material else { return Err("files were promised".into()) };
            let leaks = |octets: &[u8]| octets.windows(3).any(|word| word == b"snr");
            assert!(!files.iter().any(|(_, octets)| leaks(octets)), "the truth leaked");
            Ok(serde_json::json!({ "verdict": "consistent" }))
        }
    }

    /// Answers with what it was told to leave out.
    struct Telling;

    impl Analyser for Telling {
        fn answer(&self, _: &Material, without: Option<&str>) -> Result<serde_json::Value, String> {
            Ok(serde_json::json!({ "verdict": without.unwrap_or("nothing") }))
        }
    }

    #[test]
    fn what_the_truth_of_an_open_case_deletes_is_left_out() {
        let folder = tempfile::tempdir().unwrap();
        for (name, deleted) in [("a", Some("vent_leak")), ("b", None)] {
            let truth = Truth { case: name.into(), deleted: deleted.map(str::to_string), ..Truth::default() };
            std::fs::create_dir(folder.path().join(name)).unwrap();
            std::fs::write(folder.path().join(name).join("truth.json"), serde_json::to_string(&truth).unwrap())
                .unwrap();
        }
        let outcomes = run_open(folder.path(), &Telling, &ProgressBar::hidden()).unwrap();
        let told: Vec<String> = outcomes.into_iter().map(|outcome| outcome.answer.unwrap().verdict).collect();
        assert_eq!(told, ["vent_leak", "nothing"]);
    }

    #[test]
    fn any_beginning_of_a_plan_has_its_shares() {
        let orders = plan(100, 1, &Kind::ALL, Manner::default(), None);
        for (kind, share) in SHARES {
            assert_eq!(orders.iter().filter(|o| o.kind == kind).count(), share);
            let half = orders[..50].iter().filter(|o| o.kind == kind).count();
            assert!(half.abs_diff(share / 2) <= 1, "{kind:?}: {half}");
        }
    }

    #[test]
    fn a_sealed_run_reveals_what_it_committed_to() {
        let orders = plan(3, 11, &[Kind::Clean, Kind::One], Manner::default(), None);
        let progress = ProgressBar::hidden();
        let mut seals = seal(&orders, &progress);
        let outcomes = run(&orders, &seals, &Silent, &progress).unwrap();
        assert_eq!(outcomes.len(), 3);
        seals[0].hash = "0".repeat(64);
        assert!(run(&orders, &seals, &Silent, &progress).is_err());
    }
}
