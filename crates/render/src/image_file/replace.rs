//! Files that appear whole or not at all.
//!
//! The content goes to a hidden file in the same folder, which takes the place of the old one by a rename.

use crate::error::RenderError;
use std::fs::File;
use std::io::{BufWriter, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Writes a file through `content`; until it has succeeded, whatever stood at `path` stays as it is.
pub fn replace_file(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> Result<(), String>,
) -> Result<(), RenderError> {
    let (target, beside) = places(path);
    write_and_rename(&beside, &target, content).map_err(|reason| RenderError::Write {
        path: path.to_owned(),
        reason,
    })
}

/// As [`replace_file`], by way of a file of a given name, where what an earlier process left half written gives way.
pub(crate) fn replace_file_through(
    beside: &Path,
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> Result<(), String>,
) -> Result<(), RenderError> {
    // Where it cannot be removed, it cannot be written anew either, and that is told.
    let _ = std::fs::remove_file(beside);
    write_and_rename(beside, path, content).map_err(|reason| RenderError::Write {
        path: path.to_owned(),
        reason,
    })
}

fn write_and_rename(
    beside: &Path,
    target: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> Result<(), String>,
) -> Result<(), String> {
    let written = write_whole(beside, content)
        .and_then(|()| std::fs::rename(beside, target).map_err(|e| e.to_string()));
    if written.is_err() {
        // The write has failed already; a remainder that cannot be removed changes nothing about that.
        let _ = std::fs::remove_file(beside);
    }
    written
}

/// Finds out whether a file could be written at `path`.
pub fn check_place(path: &Path) -> Result<(), RenderError> {
    let (target, beside) = places(path);
    let probe = if target.is_dir() {
        Err(std::io::Error::new(
            ErrorKind::IsADirectory,
            "a folder of that name stands there",
        ))
    } else if target.exists() && !target.is_file() {
        Err(std::io::Error::new(
            ErrorKind::InvalidInput,
            "a device, pipe or socket stands there, which a finished file would replace",
        ))
    } else {
        File::create_new(&beside).and_then(|_| std::fs::remove_file(&beside))
    };
    probe.map_err(|source| RenderError::OutputPlace {
        path: path.to_owned(),
        source,
    })
}

/// Where the file will stand (links resolved) and where it is written first.
fn places(path: &Path) -> (PathBuf, PathBuf) {
    // Two writes of one process at one time must not meet; a counter does it without randomness.
    static NEXT: AtomicU64 = AtomicU64::new(0);
    let target = std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let id = (std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
    let beside = target.with_file_name(format!(".tyndall-{}-{}.part", id.0, id.1));
    (target, beside)
}

fn write_whole(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> Result<(), String>,
) -> Result<(), String> {
    let mut file = BufWriter::new(File::create_new(path).map_err(|e| e.to_string())?);
    content(&mut file)?;
    file.flush().map_err(|e| e.to_string())?;
    // Without this a power cut after the rename can leave an empty file.
    file.get_ref().sync_all().map_err(|e| e.to_string())
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn a_failed_write_leaves_the_old_file_and_nothing_else() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stats.json");
        std::fs::write(&path, "old").unwrap();
        let failed = replace_file(&path, |file| {
            file.write_all(b"half").map_err(|e| e.to_string())?;
            Err("the disk is full".to_owned())
        });
        assert!(failed.unwrap_err().to_string().contains("the disk is full"));
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "old");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 1);
    }
}
