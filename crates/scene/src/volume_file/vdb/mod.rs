//! OpenVDB files: fog volumes of 32-bit and 16-bit floats.
//!
//! A file has a header, metadata, and grids; each grid has a descriptor that says where it lies, metadata, a map from index coordinates
//! to space, a tree that says which voxels are active, and the voxels' values. Versions 222 to 224 are read: what `OpenVDB` 3 and later
//! write.

mod blosc;
mod header;
mod metadata;
mod transform;
mod tree;
mod values;

use super::error::VolumeError;
use super::source::Source;
use super::tally::Tally;
use glam::DAffine3;
use header::{Descriptor, Header};
use std::io::{Read, Seek};
use tyndall_media::grid::BuiltVoxels;

/// The first bytes of every file.
pub(super) const MAGIC: [u8; 8] = [0x20, 0x42, 0x44, 0x56, 0, 0, 0, 0];

/// A file whose header has been read.
#[derive(Debug)]
pub(super) struct Vdb<R> {
    source: Source<R>,
    header: Header,
}

/// A grid as the file has it.
#[derive(Debug)]
pub(super) struct VdbGrid {
    pub(super) built: BuiltVoxels,
    pub(super) world_from_index: DAffine3,
    pub(super) tally: Tally,
}

/// What a grid says about itself before its voxels.
#[derive(Clone, Debug)]
pub(super) struct Summary {
    /// As in `float, half precision`.
    pub(super) value_type: String,
    /// As in `fog volume`.
    pub(super) class: String,
}

impl<R: Read + Seek> Vdb<R> {
    pub(super) fn open(mut source: Source<R>) -> Result<Self, VolumeError> {
        let header = header::read(&mut source)?;
        Ok(Self { source, header })
    }

    /// The names of all grids; grids of one name have a number in brackets behind it.
    pub(super) fn names(&self) -> Vec<String> {
        self.header
            .grids
            .iter()
            .map(|grid| grid.name.clone())
            .collect()
    }

    /// What the grid at this place in the list is, as far as can be told.
    pub(super) fn summary(&mut self, index: usize) -> Summary {
        let Some(grid) = self.header.grids.get(index).cloned() else {
            return Summary {
                value_type: String::new(),
                class: String::new(),
            };
        };
        let class = self.before_map(&grid).map(|before| before.class);
        Summary {
            value_type: grid.value_type(),
            class: class.unwrap_or_default(),
        }
    }

    /// The voxels of the grid at this place in the list, in no more than `limit` bytes.
    pub(super) fn grid(&mut self, index: usize, limit: u64) -> Result<VdbGrid, VolumeError> {
        let Some(grid) = self.header.grids.get(index).cloned() else {
            return Err(self.source.malformed(format!("there is no grid {index}")));
        };
        grid.check_readable()?;
        let before = self.before_map(&grid)?;
        before.check_is_fog(&grid)?;
        let world_from_index = transform::read(&mut self.source, &grid.name)?;
        let format = values::Format {
            compression: before.compression,
            half: grid.half || before.half,
            background: 0.0,
        };
        let (built, tally) = tree::read(&mut self.source, format, &grid.name, limit)?;
        if let Some(stated) = before.voxel_count
            && u64::try_from(stated) != Ok(tally.count)
        {
            return Err(VolumeError::Count {
                grid: grid.name,
                found: tally.count,
                stated,
            });
        }
        Ok(VdbGrid {
            built,
            world_from_index,
            tally,
        })
    }

    /// What stands before the map of a grid.
    fn before_map(&mut self, grid: &Descriptor) -> Result<BeforeMap, VolumeError> {
        self.source.seek(grid.position, "a grid")?;
        let compression = self.source.u32("the compression of a grid")?;
        let metadata = metadata::read(&mut self.source)?;
        Ok(BeforeMap {
            compression: values::Compression::from_flags(compression)?,
            class: metadata.text("class").unwrap_or("unknown").to_owned(),
            half: metadata.flag("is_saved_as_half_float"),
            voxel_count: metadata.long("file_voxel_count"),
        })
    }
}

struct BeforeMap {
    compression: values::Compression,
    class: String,
    half: bool,
    voxel_count: Option<i64>,
}

impl BeforeMap {
    fn check_is_fog(&self, grid: &Descriptor) -> Result<(), VolumeError> {
        if self.class == "level set" {
            return Err(VolumeError::Unsupported {
                what: format!(
                    "grid \"{}\" is a level set: its values are distances from a surface, not a density",
                    grid.name
                ),
                mend: "convert it to a fog volume (in Houdini by VDB Convert, in Python by openvdb.tools)"
                    .into(),
            });
        }
        Ok(())
    }
}
