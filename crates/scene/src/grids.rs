//! Density grids of a scene: volume files read once each, and placed.

use crate::error::Warning;
use crate::scene_file::media;
use crate::volume_file::{self, DEFAULT_MEMORY, VolumeFileError};
use glam::DAffine3;
use std::path::{Path, PathBuf};
use std::sync::Arc;
use tyndall_media::grid::{Grid, GridEdge, GridError, Voxels};

/// The volume files that a scene has named so far.
#[derive(Debug, Default)]
pub(crate) struct GridFiles {
    read: Vec<GridFile>,
}

/// A grid of a file.
#[derive(Debug)]
struct GridFile {
    path: PathBuf,
    wanted: Option<String>,
    voxels: Arc<Voxels>,
    world_from_index: DAffine3,
    edge: GridEdge,
}

/// Why a grid cannot be used.
#[derive(Debug, thiserror::Error)]
pub(crate) enum GridFileError {
    #[error(transparent)]
    File(#[from] VolumeFileError),
    #[error("{error} ({})", path.display())]
    Placed {
        error: Box<GridError>,
        path: PathBuf,
    },
}

impl GridFiles {
    /// The grid that `written` asks for, from the file at `path`, in no more than `limit` bytes; with a warning the first time that
    /// negative voxels become 0.
    pub(crate) fn grid(
        &mut self,
        written: &media::Grid,
        path: &Path,
        limit: Option<u64>,
    ) -> Result<(Grid, Option<Warning>), GridFileError> {
        let known = self
            .read
            .iter()
            .position(|file| file.path == path && file.wanted == written.grid);
        let mut warning = None;
        let index = match known {
            Some(index) => index,
            None => {
                let limit = limit.unwrap_or(DEFAULT_MEMORY);
                let volume = volume_file::read(path, written.grid.as_deref(), limit)?;
                if volume.built.n_negative > 0 {
                    warning = Some(Warning::NegativeVoxels {
                        grid: volume.name,
                        count: volume.built.n_negative,
                        file: path.into(),
                    });
                }
                self.read.push(GridFile {
                    path: path.into(),
                    wanted: written.grid.clone(),
                    voxels: Arc::new(volume.built.voxels),
                    world_from_index: volume.world_from_index,
                    edge: volume.edge,
                });
                self.read.len() - 1
            }
        };
        let file = &self.read[index];
        let placed = written
            .transform
            .as_ref()
            .map_or(DAffine3::IDENTITY, |transform| {
                DAffine3::from_mat4(transform.0.as_dmat4())
            });
        let map = placed * file.world_from_index;
        let grid = Grid::new(file.voxels.clone(), map, written.scale.get(), file.edge);
        grid.map(|grid| (grid, warning))
            .map_err(|error| GridFileError::Placed {
                error: Box::new(error),
                path: path.into(),
            })
    }
}
