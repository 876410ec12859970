//! The tree of a grid: a root of blocks of 4096³ voxels, nodes of 32³ and of 16³ places below, and leaves of 8³ voxels.
//!
//! First comes its shape with the values of tiles, then, in the same order, the voxels of leaves.

use super::values::{Format, Mask, Values};
use crate::volume_file::error::VolumeError;
use crate::volume_file::source::Source;
use crate::volume_file::tally::Tally;
use glam::IVec3;
use std::collections::HashSet;
use std::io::{Read, Seek};
use tyndall_media::grid::{
    BRICK_SIDE, BRICK_VOXELS, Brick, BuiltVoxels, MAX_COORDINATE, VoxelsBuilder, VoxelsError,
};

/// Binary logarithms of the numbers of places on an axis of the nodes below the root, and the edges of a place in voxels.
const LEVELS: [(u32, i32); 2] = [(5, 128), (4, 8)];

/// Edge of a block of the root, in voxels.
const ROOT_SIDE: i32 = 4096;

/// The shape of a tree.
struct Shape<'a> {
    grid: &'a str,
    values: Values,
    tiles: Vec<Tile>,
    leaves: Vec<IVec3>,
    limit: u64,
}

/// An active tile.
struct Tile {
    min: IVec3,
    side: i32,
    value: f32,
}

/// Reads the tree of the grid called `grid` into no more than `limit` bytes.
pub(super) fn read<R: Read + Seek>(
    source: &mut Source<R>,
    format: Format,
    grid: &str,
    limit: u64,
) -> Result<(BuiltVoxels, Tally), VolumeError> {
    let voxels = |error| VolumeError::Voxels {
        grid: grid.to_owned(),
        error,
    };
    let buffers = source.u32("the number of buffers of a tree")?;
    if buffers != 1 {
        return Err(source.malformed(format!(
            "a tree has {buffers} values for each voxel instead of one"
        )));
    }
    let background = source.f32("the background")?;
    let mut shape = Shape {
        grid,
        values: Values::new(Format {
            background,
            ..format
        }),
        tiles: Vec::new(),
        leaves: Vec::new(),
        limit,
    };
    shape.root(source)?;

    let mut tally = Tally::new();
    let boxes = shape.tiles.iter().map(|tile| (tile.min, tile.side));
    let boxes = boxes.chain(shape.leaves.iter().map(|&min| (min, BRICK_SIDE)));
    let bounds = boxes.fold([IVec3::MAX, IVec3::MIN], |[low, high], (min, side)| {
        [low.min(min), high.max(min + (side - 1))]
    });
    if shape.tiles.is_empty() && shape.leaves.is_empty() {
        return Err(VolumeError::Empty { grid: grid.into() });
    }
    let mut builder =
        VoxelsBuilder::new(background, bounds, shape.leaves.len(), limit).map_err(voxels)?;
    for tile in &shape.tiles {
        builder.set_tile(tile.min, tile.side, tile.value);
        tally.cube(tile.min, tile.side, tile.value);
    }
    for min in shape.leaves {
        let active = Mask::read(source, BRICK_VOXELS)?;
        let values = shape.values.read(source, BRICK_VOXELS, &active)?;
        let mut brick: Brick = [background; BRICK_VOXELS];
        for i in active.on() {
            if let (Some(voxel), Some(&value)) = (brick.get_mut(i), values.get(i)) {
                *voxel = value;
                let place = i as i32;
                let offset = IVec3::new(place >> 6, place >> 3, place) & 7;
                tally.voxel(min + offset, value);
            }
        }
        builder.set_brick(min, &brick);
    }
    if tally.count == 0 {
        return Err(VolumeError::Empty { grid: grid.into() });
    }
    Ok((builder.finish().map_err(voxels)?, tally))
}

impl Shape<'_> {
    fn root<R: Read + Seek>(&mut self, source: &mut Source<R>) -> Result<(), VolumeError> {
        let n_tiles = u64::from(source.u32("the number of tiles")?);
        let n_children = u64::from(source.u32("the number of nodes")?);
        source.need(
            n_tiles * 17 + n_children * 12,
            "the list of tiles and nodes",
        )?;
        let mut seen = HashSet::new();
        for _ in 0..n_tiles {
            let min = root_block(source, &mut seen)?;
            let value = source.f32("a tile")?;
            if source.u8("a tile")? != 0 {
                self.tile(min, ROOT_SIDE, value)?;
            }
        }
        for _ in 0..n_children {
            let min = root_block(source, &mut seen)?;
            self.node(source, min, 0)?;
        }
        Ok(())
    }

    /// Reads a node and all below it.
    fn node<R: Read + Seek>(
        &mut self,
        source: &mut Source<R>,
        origin: IVec3,
        level: usize,
    ) -> Result<(), VolumeError> {
        let Some(&(log2, side)) = LEVELS.get(level) else {
            // The mask of a leaf comes again with its voxels.
            source.skip(BRICK_VOXELS as u64 / 8, "the mask of a leaf")?;
            self.leaves.push(origin);
            let bytes = size_of::<Brick>() + size_of::<IVec3>();
            return self.charge(self.leaves.len() as u64 * bytes as u64);
        };
        let n = 1_usize << (3 * log2);
        let children = Mask::read(source, n)?;
        let active = Mask::read(source, n)?;
        let values = self.values.read(source, n, &active)?;
        let place = |i: usize| {
            let (i, last) = (i as i32, (1 << log2) - 1);
            origin + (IVec3::new(i >> (2 * log2), i >> log2, i) & last) * side
        };
        let tiles = active.on().filter(|&i| !children.is_on(i));
        let tiles: Vec<_> = tiles
            .filter_map(|i| Some((place(i), *values.get(i)?)))
            .collect();
        for (min, value) in tiles {
            self.tile(min, side, value)?;
        }
        for i in children.on() {
            self.node(source, place(i), level + 1)?;
        }
        Ok(())
    }

    fn tile(&mut self, min: IVec3, side: i32, value: f32) -> Result<(), VolumeError> {
        self.tiles.push(Tile { min, side, value });
        self.charge(self.tiles.len() as u64 * size_of::<Tile>() as u64)
    }

    /// Refuses a tree that takes more memory than allowed, as soon as that is certain.
    fn charge(&self, needed: u64) -> Result<(), VolumeError> {
        if needed <= self.limit {
            return Ok(());
        }
        Err(VolumeError::Voxels {
            grid: self.grid.into(),
            error: VoxelsError::Memory {
                needed,
                limit: self.limit,
            },
        })
    }
}

/// The first voxel of a block of the root that has not been seen before.
fn root_block<R: Read + Seek>(
    source: &mut Source<R>,
    seen: &mut HashSet<IVec3>,
) -> Result<IVec3, VolumeError> {
    const WHAT: &str = "a block of the tree's root";
    let min = IVec3::new(source.i32(WHAT)?, source.i32(WHAT)?, source.i32(WHAT)?);
    let far = IVec3::splat(MAX_COORDINATE - ROOT_SIDE);
    if min & (ROOT_SIDE - 1) != IVec3::ZERO || min.clamp(-far, far) != min {
        return Err(source.malformed(format!(
            "{WHAT} begins at {min}: coordinates must be multiples of {ROOT_SIDE} within ±{MAX_COORDINATE}"
        )));
    }
    if !seen.insert(min) {
        return Err(source.malformed(format!("two blocks of the tree's root begin at {min}")));
    }
    Ok(min)
}
