//! Volume files: `OpenVDB` fog volumes and Mitsuba's grid volumes.
//!
//! Files are distrusted: every length is compared with the bytes left before memory is taken for it, and what would take more than
//! the limit is refused before it is read.

mod error;
mod half;
mod source;
mod tally;
mod vdb;
mod vol;

pub use error::{VolumeError, VolumeFileError};

use glam::DAffine3;
use source::Source;
use std::fs::File;
use std::io::{BufReader, Read, Seek};
use std::path::Path;
use tally::Tally;
use tyndall_media::grid::{BuiltVoxels, GridEdge};
use vdb::Vdb;
use vol::Vol;

/// Memory that one grid may take where nothing else is said, in bytes: 8 GiB.
pub const DEFAULT_MEMORY: u64 = 8 << 30;

/// A grid from a volume file.
#[derive(Clone, Debug)]
pub struct Volume {
    /// Its name in the file.
    pub name: String,
    /// Its voxels, and how many of them were negative.
    pub built: BuiltVoxels,
    /// Where the file places them.
    pub world_from_index: DAffine3,
    /// What is where none are stored.
    pub edge: GridEdge,
}

/// What a volume file says about one of its grids.
#[derive(Debug)]
pub struct GridSummary {
    /// Its name.
    pub name: String,
    /// The type of its values.
    pub value_type: String,
    /// What it is used for, as in `fog volume`.
    pub class: String,
    /// What its voxels are, or why they cannot be read.
    pub voxels: Result<VoxelSummary, VolumeError>,
}

/// What the voxels of a grid are.
#[derive(Clone, Debug, PartialEq)]
pub struct VoxelSummary {
    /// Edges of the box around active voxels, in voxels.
    pub size: [u64; 3],
    /// Smallest index coordinates of active voxels.
    pub first: [i32; 3],
    /// Number of active voxels; of those that are not zero where the format knows no others.
    pub active: u64,
    /// Smallest value of active voxels.
    pub min: f32,
    /// Largest value of active voxels.
    pub max: f32,
    /// Mean value of active voxels; of all where the format knows no others.
    pub mean: f64,
    /// Value of all that is not stored.
    pub background: f32,
    /// Number of voxels that are negative.
    pub negative: u64,
    /// Memory taken, in bytes.
    pub bytes: usize,
    /// Where the file places voxels.
    pub world_from_index: DAffine3,
}

/// Reads the grid called `wanted`, or where no name is given the file's only one or `density`, into no more than `limit` bytes.
///
/// # Errors
/// Where the file is none of the kinds that are read, is broken, holds no such grid, or one that is no density.
pub fn read(path: &Path, wanted: Option<&str>, limit: u64) -> Result<Volume, VolumeFileError> {
    File::open(path)
        .map_err(VolumeError::from)
        .and_then(|file| read_from(BufReader::with_capacity(BUFFER, file), wanted, limit))
        .map_err(|error| VolumeFileError {
            error,
            path: path.into(),
        })
}

/// [`read`] from anything that has bytes.
///
/// # Errors
/// As [`read`].
pub fn read_from(
    bytes: impl Read + Seek,
    wanted: Option<&str>,
    limit: u64,
) -> Result<Volume, VolumeError> {
    let mut file = AnyFile::open(bytes)?;
    let names = file.names();
    let index = choose(&names, wanted)?;
    let (built, world_from_index, edge, _, _) = file.grid(index, limit)?;
    Ok(Volume {
        name: names.into_iter().nth(index).unwrap_or_default(),
        built,
        world_from_index,
        edge,
    })
}

/// Says what a volume file holds.
///
/// # Errors
/// Where the file as a whole cannot be read; what is wrong with single grids stands beside them.
pub fn inspect(path: &Path, limit: u64) -> Result<Vec<GridSummary>, VolumeFileError> {
    File::open(path)
        .map_err(VolumeError::from)
        .and_then(|file| inspect_from(BufReader::with_capacity(BUFFER, file), limit))
        .map_err(|error| VolumeFileError {
            error,
            path: path.into(),
        })
}

/// [`inspect`] of anything that has bytes.
///
/// # Errors
/// As [`inspect`].
pub fn inspect_from(bytes: impl Read + Seek, limit: u64) -> Result<Vec<GridSummary>, VolumeError> {
    let mut file = AnyFile::open(bytes)?;
    let names = file.names();
    let grids = names.into_iter().enumerate();
    Ok(grids
        .map(|(index, name)| {
            let (value_type, class) = file.summary(index);
            let voxels = file.grid(index, limit);
            GridSummary {
                name,
                value_type,
                class,
                voxels: voxels.map(|(built, world_from_index, _, tally, active)| VoxelSummary {
                    size: tally.size(),
                    first: tally.bounds[0].to_array(),
                    active,
                    min: tally.min,
                    max: tally.max,
                    mean: tally.mean(),
                    background: built.voxels.background(),
                    negative: built.n_negative,
                    bytes: built.voxels.bytes(),
                    world_from_index,
                }),
            }
        })
        .collect())
}

/// Bytes read at once.
const BUFFER: usize = 1 << 16;

/// A file of one of the kinds.
enum AnyFile<R> {
    Vdb(Vdb<R>),
    Vol(Vol<R>),
}

impl<R: Read + Seek> AnyFile<R> {
    fn open(bytes: R) -> Result<Self, VolumeError> {
        let mut source = Source::new(bytes)?;
        let mut magic = [0; 8];
        let known = source.left().min(8) as usize;
        source.fill(&mut magic[..known], "the first bytes")?;
        source.seek(0, "the file")?;
        if magic == vdb::MAGIC {
            Ok(Self::Vdb(Vdb::open(source)?))
        } else if magic.starts_with(&vol::MAGIC) {
            Ok(Self::Vol(Vol::open(source)?))
        } else if magic.starts_with(b"NanoVDB") {
            Err(VolumeError::Unsupported {
                what: "this is a NanoVDB file".into(),
                mend: "convert it to OpenVDB (.vdb)".into(),
            })
        } else if known == 0 {
            Err(VolumeError::UnknownKind("the file is empty".into()))
        } else {
            Err(VolumeError::UnknownKind(
                "this is no volume file that is read".into(),
            ))
        }
    }

    fn names(&self) -> Vec<String> {
        match self {
            Self::Vdb(vdb) => vdb.names(),
            Self::Vol(vol) => vol.names(),
        }
    }

    /// Type and class of a grid.
    fn summary(&mut self, index: usize) -> (String, String) {
        match self {
            Self::Vdb(vdb) => {
                let summary = vdb.summary(index);
                (summary.value_type, summary.class)
            }
            Self::Vol(vol) => (vol.value_type().into(), "grid volume".into()),
        }
    }

    fn grid(
        &mut self,
        index: usize,
        limit: u64,
    ) -> Result<(BuiltVoxels, DAffine3, GridEdge, Tally, u64), VolumeError> {
        match self {
            Self::Vdb(vdb) => {
                let grid = vdb.grid(index, limit)?;
                let edge = GridEdge::Background;
                let active = grid.tally.count;
                Ok((grid.built, grid.world_from_index, edge, grid.tally, active))
            }
            Self::Vol(vol) => {
                let grid = vol.grid(index, limit)?;
                let active = grid.non_zero;
                Ok((
                    grid.built,
                    grid.world_from_index,
                    grid.edge,
                    grid.tally,
                    active,
                ))
            }
        }
    }
}

/// The place of the grid that is meant.
fn choose(names: &[String], wanted: Option<&str>) -> Result<usize, VolumeError> {
    let place = |wanted: &str| names.iter().position(|name| name == wanted);
    let found = match wanted {
        Some(wanted) => place(wanted),
        None if names.len() == 1 => Some(0),
        None => place("density"),
    };
    found.ok_or_else(|| VolumeError::NoSuchGrid {
        wanted: wanted.map(Into::into),
        names: names.into(),
    })
}
