//! The files of a case, in a directory: the analyser itself opens none.

use std::path::Path;

use crate::diagnose::case::Case;
use crate::diagnose::error::CaseError;
use crate::diagnose::recorder;

/// Reads a case directory; `set` are `key=value` overrides of `case.toml`.
///
/// # Errors
/// [`CaseError`] with one sentence that names the file and the value.
pub fn case(directory: &Path, set: &[String]) -> Result<Case, CaseError> {
    let file = |name: &str| match octets(directory, name)? {
        None if name == "case.toml" => Err(CaseError::Toml(format!("there is none in {}", directory.display()))),
        octets => Ok(octets),
    };
    recorder::case(file, set)
}

/// The octets of a file, `None` where there is none.
///
/// # Errors
/// Where something is there and cannot be read: it is not missing.
pub fn octets(directory: &Path, name: &str) -> Result<Option<Vec<u8>>, CaseError> {
    let unreadable = |reason: String| CaseError::Unreadable { file: name.into(), reason };
    let path = directory.join(name);
    match std::fs::metadata(&path) {
        Err(error) if error.kind() == std::io::ErrorKind::NotFound => Ok(None),
        Err(error) if error.kind() == std::io::ErrorKind::NotADirectory => {
            Err(unreadable(format!("a case is a directory, and {} is none", directory.display())))
        }
        Err(error) => Err(unreadable(error.to_string())),
        Ok(metadata) if !metadata.is_file() => Err(unreadable("it is not a regular file".into())),
        Ok(_) => std::fs::read(&path).map(Some).map_err(|error| unreadable(error.to_string())),
    }
}
