//! Files that appear whole or not at all.
//!
//! The content goes to a hidden file in the same folder, which takes the place of the old one by a rename.

use crate::error::RenderError;
use std::fs::File;
use std::io::{BufWriter, Error, ErrorKind, Write};
use std::path::{Path, PathBuf};
use std::sync::atomic::{AtomicU64, Ordering};

/// Writes a file through `content`; until it has succeeded, whatever stood at `path` stays as it is.
pub fn replace_file(
    path: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> Result<(), String>,
) -> Result<(), RenderError> {
    let target = resolved(path);
    let written = create_beside(&target)
        .map_err(|error| error.to_string())
        .and_then(|(beside, file)| write_and_rename(file, &beside, &target, content));
    written.map_err(|reason| RenderError::Write {
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
    let written = File::create_new(beside)
        .map_err(|error| error.to_string())
        .and_then(|file| write_and_rename(file, beside, path, content));
    written.map_err(|reason| RenderError::Write {
        path: path.to_owned(),
        reason,
    })
}

/// Finds out whether a file could be written at `path`.
pub fn check_place(path: &Path) -> Result<(), RenderError> {
    let target = resolved(path);
    let probe = if target.is_dir() {
        Err(Error::new(
            ErrorKind::IsADirectory,
            "a folder of that name stands there",
        ))
    } else if target.exists() && !target.is_file() {
        Err(Error::new(
            ErrorKind::InvalidInput,
            "a device, pipe or socket stands there, which a finished file would replace",
        ))
    } else {
        create_beside(&target).and_then(|(beside, _)| std::fs::remove_file(beside))
    };
    probe.map_err(|source| RenderError::OutputPlace {
        path: path.to_owned(),
        source,
    })
}

/// Where a file will stand, links resolved.
fn resolved(path: &Path) -> PathBuf {
    std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned())
}

/// A new file beside `target`, in which it is written first.
fn create_beside(target: &Path) -> Result<(PathBuf, File), Error> {
    // Two writes of one process at one time must not meet; a counter does it without randomness.
    static NEXT: AtomicU64 = AtomicU64::new(0);
    loop {
        let id = (std::process::id(), NEXT.fetch_add(1, Ordering::Relaxed));
        let beside = target.with_file_name(format!(".tyndall-{}-{}.part", id.0, id.1));
        match File::create_new(&beside) {
            // A process of the same number was killed here: in containers the first processes always have the same.
            Err(error) if error.kind() == ErrorKind::AlreadyExists => {}
            created => return created.map(|file| (beside, file)),
        }
    }
}

fn write_and_rename(
    file: File,
    beside: &Path,
    target: &Path,
    content: impl FnOnce(&mut BufWriter<File>) -> Result<(), String>,
) -> Result<(), String> {
    let written = write_whole(file, content)
        .and_then(|()| std::fs::rename(beside, target).map_err(|e| e.to_string()));
    if written.is_err() {
        // The write has failed already; a remainder that cannot be removed changes nothing about that.
        let _ = std::fs::remove_file(beside);
    }
    written
}

fn write_whole(
    file: File,
    content: impl FnOnce(&mut BufWriter<File>) -> Result<(), String>,
) -> Result<(), String> {
    let mut file = BufWriter::new(file);
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
    #[test]
    fn what_killed_processes_left_is_not_in_the_way() {
        let folder = tempfile::tempdir().unwrap();
        let path = folder.path().join("stats.json");
        let left = |n| format!(".tyndall-{}-{n}.part", std::process::id());
        for n in 0..100 {
            std::fs::write(folder.path().join(left(n)), "half").unwrap();
        }
        check_place(&path).unwrap();
        replace_file(&path, |file| {
            file.write_all(b"whole").map_err(|e| e.to_string())
        })
        .unwrap();
        assert_eq!(std::fs::read_to_string(&path).unwrap(), "whole");
        assert_eq!(std::fs::read_dir(folder.path()).unwrap().count(), 101);
    }
}
