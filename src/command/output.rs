//! Files that commands leave behind; what could not be written is told with its path.

use std::fs;
use std::path::{Path, PathBuf};

use anyhow::{Context, Result, anyhow};
use oare_ground::paper::{Report, bitmap};

/// Whether two paths lead to one file that is there.
pub fn is_one_file(a: &Path, b: &Path) -> bool {
    a.canonicalize().is_ok_and(|a| b.canonicalize().is_ok_and(|b| a == b))
}

/// Says which of the files to be written is one that was read.
pub fn over_an_input(outputs: impl IntoIterator<Item = PathBuf>, inputs: &[&Path]) -> Option<String> {
    let over = outputs.into_iter().find(|output| inputs.iter().any(|input| is_one_file(input, output)))?;
    Some(format!("{}: that is an input, and is not written over", over.display()))
}

/// Writes a file; its folder is made if need be.
pub fn write(path: &Path, content: impl AsRef<[u8]>) -> Result<()> {
    if let Some(folder) = path.parent().filter(|folder| !folder.as_os_str().is_empty()) {
        fs::create_dir_all(folder).with_context(|| format!("cannot make {}", folder.display()))?;
    }
    fs::write(path, content).with_context(|| format!("cannot write {}", path.display()))
}

/// Writes a report: `index.html`, its figures as SVG and PNG, and one JSON document beside them.
pub fn write_report(folder: &Path, report: &Report, (json_name, json): (&str, &str)) -> Result<()> {
    write(&folder.join("index.html"), &report.html)?;
    write(&folder.join(json_name), json)?;
    report.figures.iter().try_for_each(|(name, svg)| {
        let path = folder.join(name);
        write(&path, svg)?;
        let bitmap =
            bitmap::png(svg).map_err(|reason| anyhow!("cannot make a bitmap of {}: {reason}", path.display()))?;
        write(&path.with_extension("png"), bitmap)
    })
}
