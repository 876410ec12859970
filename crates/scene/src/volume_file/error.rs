//! What can be wrong with a volume file.

use std::path::PathBuf;
use tyndall_media::grid::VoxelsError;

/// Why a volume file could not be read, and which.
#[derive(Debug, thiserror::Error)]
#[error("{error} ({})", path.display())]
pub struct VolumeFileError {
    /// What is wrong.
    pub error: VolumeError,
    /// The file.
    pub path: PathBuf,
}

/// What is wrong with a volume file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum VolumeError {
    /// The operating system could not read it.
    #[error("cannot read the volume file: {0}")]
    Read(#[from] std::io::Error),

    /// It ends too early.
    #[error(
        "the volume file is cut off: {what} at byte {at} needs {needed} bytes, and {left} are left"
    )]
    Truncated {
        /// What was to be read.
        what: &'static str,
        /// Where.
        at: u64,
        /// How many bytes it takes.
        needed: u64,
        /// How many bytes there are.
        left: u64,
    },

    /// It is of no kind that is read.
    #[error("{0}; volume files are OpenVDB (.vdb) and Mitsuba .vol version 3")]
    UnknownKind(String),

    /// Something in it contradicts the format.
    #[error("the volume file is broken: {problem} (at byte {at})")]
    Malformed {
        /// What, and what it should be.
        problem: String,
        /// Near where.
        at: u64,
    },

    /// It is sound and uses something that is not read.
    #[error("{what}; {mend}")]
    Unsupported {
        /// What.
        what: String,
        /// What would do instead.
        mend: String,
    },

    /// There is no such grid, or more than one to choose from.
    #[error("{}; the file holds {}", asked(wanted.as_deref()), listed(names))]
    NoSuchGrid {
        /// The name asked for, if one was.
        wanted: Option<String>,
        /// The names that there are.
        names: Vec<String>,
    },

    /// A grid holds nothing.
    #[error("grid \"{grid}\" holds no voxels; a density needs at least one")]
    Empty {
        /// Its name.
        grid: String,
    },

    /// The number of active voxels is not the one that the file states.
    #[error(
        "grid \"{grid}\" holds {found} active voxels, and the file says that they are {stated}: it is damaged"
    )]
    Count {
        /// Its name.
        grid: String,
        /// How many were found.
        found: u64,
        /// How many the file states.
        stated: i64,
    },

    /// Its voxels cannot be stored.
    #[error("grid \"{grid}\": {error}{}", remedy(error))]
    Voxels {
        /// Its name.
        grid: String,
        /// Why not.
        error: VoxelsError,
    },
}

fn asked(wanted: Option<&str>) -> String {
    match wanted {
        Some(name) => format!("there is no one grid \"{name}\""),
        None => "it is not clear which grid to take: name it by `grid`".into(),
    }
}

fn listed(names: &[String]) -> String {
    const SHOWN: usize = 12;
    if names.is_empty() {
        return "none".into();
    }
    let quoted: Vec<_> = names
        .iter()
        .take(SHOWN)
        .map(|n| format!("\"{n}\""))
        .collect();
    let more = match names.len().saturating_sub(SHOWN) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    quoted.join(", ") + &more
}

fn remedy(error: &VoxelsError) -> &'static str {
    match error {
        VoxelsError::Memory { .. } => "; --max-grid-memory sets it",
        VoxelsError::Extent { .. } => "",
        VoxelsError::NonFinite { .. } => "; a density must be a finite number everywhere",
    }
}
