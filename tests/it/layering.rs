//! Keeps the rooms in order and the pure ones pure.

use std::fs;
use std::path::{Path, PathBuf};

/// Rooms in their order, and whether they are pure. A room uses only itself and rooms before it.
const ROOMS: [(&str, bool); 18] = [
    ("units", true),
    ("math", true),
    ("paper", true),
    ("telemetry", true),
    ("ingest/wire", true),
    ("physics", true),
    ("pipeline", true),
    ("simulate", true),
    ("diagnose", true),
    ("challenge", false),
    ("config", false),
    ("hub", false),
    ("ingest", false),
    ("record", false),
    ("api", false),
    ("service", false),
    ("command", false),
    ("main", false),
];

/// What no pure room may name.
const IMPURE: [&str; 12] = [
    "std::fs",
    "std::net",
    "std::thread",
    "std::env",
    "std::process",
    "std::io::stdin",
    "SystemTime",
    "Instant::now",
    "Timestamp::now",
    "tokio",
    "rayon",
    "println!",
];

/// The one file of the pure rooms in which work is shared between processors, in an order that does not show.
fn shares_work(name: &str, word: &str) -> bool {
    name == "math/shared_work.rs" && word == "rayon"
}

fn room_of(path: &str) -> usize {
    let path = path.trim_end_matches(".rs").replace("::", "/");
    // The longest name that fits: `ingest/wire` before `ingest`.
    ROOMS
        .iter()
        .enumerate()
        .filter(|(_, (room, _))| path == *room || path.starts_with(&format!("{room}/")))
        .max_by_key(|(_, (room, _))| room.len())
        .map(|(place, _)| place)
        .unwrap_or_else(|| panic!("{path} is in no room"))
}

fn sources(folder: &Path, found: &mut Vec<PathBuf>) {
    for entry in fs::read_dir(folder).unwrap().map(Result::unwrap) {
        if entry.path().is_dir() {
            sources(&entry.path(), found);
        } else if entry.path().extension().is_some_and(|extension| extension == "rs") {
            found.push(entry.path());
        }
    }
}

/// Non-test lines without comments: up to the module of tests that stands in the file itself. One that is declared alone ends nothing.
fn code(text: &str) -> impl Iterator<Item = (usize, &str)> {
    let lines: Vec<&str> = text.lines().map(|line| line.split("//").next().unwrap_or("")).collect();
    let opens_tests = |n: &usize| {
        let next = lines.get(n + 1).map_or("", |line| line.trim());
        lines[*n].trim() == "#[cfg(test)]" && next.starts_with("mod ") && next.ends_with('{')
    };
    let end = (0..lines.len()).find(opens_tests).unwrap_or(lines.len());
    lines.into_iter().take(end).enumerate().map(|(n, line)| (n + 1, line))
}

/// The crate paths a line names: `pipeline::product` of `crate::pipeline::product::Product`.
fn crate_paths(line: &str) -> Vec<&str> {
    line.match_indices("crate::")
        .map(|(at, name)| &line[at + name.len()..])
        .map(|rest| rest.split(|c: char| !(c.is_alphanumeric() || c == '_' || c == ':')).next().unwrap_or(""))
        .filter(|path| !path.is_empty())
        .collect()
}

#[test]
fn rooms_use_only_rooms_before_them_and_pure_rooms_touch_nothing_outside() {
    let root = Path::new(env!("CARGO_MANIFEST_DIR")).join("src");
    let mut files = Vec::new();
    sources(&root, &mut files);
    assert!(files.len() > 20, "the sources were not found");
    let mut faults = Vec::new();
    for file in files {
        let name = file.strip_prefix(&root).unwrap().to_string_lossy().replace('\\', "/");
        if name == "lib.rs" || name == "ingest/mod.rs" || name.ends_with("/tests.rs") {
            continue;
        }
        let room = room_of(&name);
        let text = fs::read_to_string(&file).unwrap();
        for (number, line) in code(&text) {
            if line.contains("crate::{") {
                faults.push(format!("{name}:{number} names several rooms at once, which nobody can check"));
            }
            for path in crate_paths(line) {
                if room_of(path) > room {
                    faults.push(format!("{name}:{number} uses {path}"));
                }
            }
            let impure = IMPURE.iter().find(|word| ROOMS[room].1 && line.contains(*word) && !shares_work(&name, word));
            if let Some(word) = impure {
                faults.push(format!("{name}:{number} is pure and names {word}"));
            }
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}

#[test]
fn a_file_is_read_to_its_own_tests_whatever_is_declared_before() {
    let text = "use a;\n#[cfg(test)]\nmod tests;\n#[cfg(test)]\nfn made() {}\nuse crate::api; // tokio\n#[cfg(test)]\nmod tests {\n    x\n}\n";
    let read: Vec<_> = code(text).collect();
    assert_eq!(read.len(), 6);
    assert_eq!(read[5], (6, "use crate::api; "));
    assert_eq!(crate_paths(read[5].1), ["api"]);
}
