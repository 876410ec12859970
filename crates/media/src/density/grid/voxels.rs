//! Sparse voxels: bricks of 8³ values where values vary, tiles of one value where they do not, nothing where there is nothing.
//!
//! A tree of three levels over blocks of 512³, 64³ and 8³ voxels, all aligned to multiples of their size: a table of the
//! blocks of 512³ between the first and the last used one, and nodes of 8³ entries below. An entry is a tile, a node or a brick.
//! Beside the 2 KiB of a brick a node of 4 KiB for up to 512 bricks and 56 bytes about its neighbours weigh little.

use glam::IVec3;
use std::fmt;
use thiserror::Error;

/// Edge of a brick, in voxels.
pub const BRICK_SIDE: i32 = 8;

/// Voxels in a brick.
pub const BRICK_VOXELS: usize = 512;

/// Values of the voxels of a brick, z fastest and x slowest, as OpenVDB's leaves have them.
pub type Brick = [f32; BRICK_VOXELS];

/// Voxel coordinates lie within ± this, so that they can be added up and so that f64 knows fractions of them.
pub const MAX_COORDINATE: i32 = 1 << 30;

/// Most blocks of 512³ voxels in the box around all voxels: a table of 32 MiB. Voxels farther apart than that are two grids.
const MAX_ROOT_BLOCKS: i64 = 1 << 22;

/// Binary logarithms of the sizes of blocks at the three levels.
pub(super) const BRICK_LOG2: u32 = 3;
const NODE_LOG2: u32 = 6;
const ROOT_LOG2: u32 = 9;

/// What fills a block.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Entry {
    /// All voxels alike.
    Tile(f32),
    /// Blocks an eighth of the size.
    Node(u32),
    /// Voxels; only in blocks of 8³.
    Brick(u32),
}

/// Sparse non-negative finite values at integer coordinates, and one value at all others.
#[derive(Clone, PartialEq)]
pub struct Voxels {
    background: f32,
    /// Coordinates of the table's first block, in blocks of 512³.
    root_min: IVec3,
    /// Blocks on each axis of the table.
    root_size: IVec3,
    root: Vec<Entry>,
    nodes: Vec<[Entry; BRICK_VOXELS]>,
    bricks: Vec<Brick>,
    /// For each brick what lies above it on some of the axes: cells there are a third of all, and need no way through the tree.
    above: Vec<[Above; 7]>,
    max: f32,
    support: Option<[IVec3; 2]>,
}

/// The block of 8³ voxels that touches a brick on the side of larger coordinates.
#[derive(Clone, Copy, Debug, PartialEq)]
enum Above {
    /// All voxels alike.
    Tile(f32),
    /// A brick.
    Brick(u32),
}

/// The largest known block around a voxel.
#[derive(Clone, Copy, Debug)]
pub(super) enum Block<'a> {
    /// All voxels alike in an aligned block of 2^`log2` voxels on each axis.
    Tile { value: f32, log2: u32 },
    /// A brick.
    Brick(BrickRef<'a>),
}

/// A brick among its neighbours.
#[derive(Clone, Copy, Debug)]
pub(super) struct BrickRef<'a> {
    voxels: &'a Voxels,
    values: &'a Brick,
    index: u32,
}

impl BrickRef<'_> {
    /// The value of a voxel that the brick holds.
    #[inline]
    pub(super) fn value(&self, voxel: IVec3) -> f32 {
        self.values[in_brick(voxel)]
    }

    /// The values at the corners of a cell whose first corner the brick holds; the bits of the index are the offsets in x, y and z.
    #[inline]
    pub(super) fn corners(&self, cell: IVec3) -> [f32; 8] {
        let local = cell & (BRICK_SIDE - 1);
        if local.max_element() < BRICK_SIDE - 1 {
            let first = in_brick(cell);
            // The largest index, 73 above the first; the mask says that it is inside.
            let corner = |offset: usize| self.values[(first + offset) & (BRICK_VOXELS - 1)];
            [
                corner(0),
                corner(64),
                corner(8),
                corner(72),
                corner(1),
                corner(65),
                corner(9),
                corner(73),
            ]
        } else {
            self.corners_across(local)
        }
    }

    /// The same for a cell between this brick and those above it.
    fn corners_across(&self, local: IVec3) -> [f32; 8] {
        let above = &self.voxels.above[self.index as usize];
        let across = local.cmpeq(IVec3::splat(BRICK_SIDE - 1)).bitmask() as usize;
        let (first, next) = (local, (local + 1) & (BRICK_SIDE - 1));
        let x = [first.x << 6, next.x << 6];
        let y = [first.y << 3, next.y << 3];
        let z = [first.z, next.z];
        let mut corners = [0.0; 8];
        for (corner, value) in corners.iter_mut().enumerate() {
            let place = x[corner & 1] | y[corner >> 1 & 1] | z[corner >> 2];
            let place = place as usize & (BRICK_VOXELS - 1);
            *value = match corner & across {
                0 => self.values[place],
                side => match above[side - 1] {
                    Above::Tile(value) => value,
                    Above::Brick(index) => self.voxels.bricks[index as usize][place],
                },
            };
        }
        corners
    }
}

/// Why voxels cannot be stored.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum VoxelsError {
    /// They need more memory than allowed.
    #[error("its voxels need {} of memory, more than the limit of {}", Bytes(*needed), Bytes(*limit))]
    Memory {
        /// Bytes needed.
        needed: u64,
        /// Bytes allowed.
        limit: u64,
    },
    /// They are too far apart.
    #[error(
        "its voxels lie between {min} and {max}: coordinates must be within ±{MAX_COORDINATE}, and the box around all voxels may \
         hold {MAX_ROOT_BLOCKS} blocks of 512³"
    )]
    Extent {
        /// Smallest coordinates.
        min: IVec3,
        /// Largest coordinates.
        max: IVec3,
    },
    /// Some are infinite or not a number.
    #[error("{count} non-finite voxels, the first at ({}, {}, {})", first.x, first.y, first.z)]
    NonFinite {
        /// How many.
        count: u64,
        /// The first in the order in which they were given.
        first: IVec3,
    },
}

/// A size in memory, for messages.
struct Bytes(u64);

impl fmt::Display for Bytes {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        let mib = self.0 as f64 / f64::from(1 << 20);
        if mib < 1024.0 {
            write!(f, "{mib:.1} MiB")
        } else {
            write!(f, "{:.1} GiB", mib / 1024.0)
        }
    }
}

/// What [`VoxelsBuilder::finish`] gives.
#[derive(Clone, Debug, PartialEq)]
pub struct BuiltVoxels {
    /// The voxels.
    pub voxels: Voxels,
    /// How many of them were negative and became 0.
    pub n_negative: u64,
}

/// Voxels being put together.
#[derive(Clone, Debug)]
pub struct VoxelsBuilder {
    voxels: Voxels,
    /// Where each brick lies.
    places: Vec<IVec3>,
    n_negative: u64,
    non_finite: Option<(u64, IVec3)>,
}

impl VoxelsBuilder {
    /// For voxels with coordinates from `min` to `max`, both included, `n_bricks` bricks among them; all are `background` at first.
    ///
    /// # Errors
    /// Where voxels may be too far apart, or need more than `limit` bytes; nothing has been allocated then.
    pub fn new(
        background: f32,
        [min, max]: [IVec3; 2],
        n_bricks: usize,
        limit: u64,
    ) -> Result<Self, VoxelsError> {
        let allowed = IVec3::splat(MAX_COORDINATE);
        let within = min.cmpge(-allowed).all() && max.cmple(allowed).all();
        let extent = VoxelsError::Extent { min, max };
        if !(within && min.cmple(max).all()) {
            return Err(extent);
        }
        let root_min = min >> ROOT_LOG2;
        let root_size = (max >> ROOT_LOG2) - root_min + 1;
        // i128: up to 2²² blocks on each axis.
        let n_root: i128 = root_size.to_array().map(i128::from).iter().product();
        if n_root > i128::from(MAX_ROOT_BLOCKS) {
            return Err(extent);
        }
        let each = size_of::<Brick>() + size_of::<[Above; 7]>() + size_of::<IVec3>();
        let of_bricks = (n_bricks as u64).saturating_mul(each as u64);
        let needed = of_bricks.saturating_add(n_root as u64 * size_of::<Entry>() as u64);
        if needed > limit {
            return Err(VoxelsError::Memory { needed, limit });
        }
        let mut builder = Self {
            voxels: Voxels {
                background: 0.0,
                root_min,
                root_size,
                root: Vec::new(),
                nodes: Vec::new(),
                bricks: Vec::with_capacity(n_bricks),
                above: Vec::new(),
                max: 0.0,
                support: None,
            },
            places: Vec::with_capacity(n_bricks),
            n_negative: 0,
            non_finite: None,
        };
        let background = builder.checked(background, 1, min);
        builder.voxels.background = background;
        builder.voxels.max = background;
        builder.voxels.root = vec![Entry::Tile(background); n_root as usize];
        Ok(builder)
    }

    /// Sets the voxels of a cube of `side` voxels to one value; `side` and the coordinates of `min` are multiples of 8.
    ///
    /// Cubes outside the bounds given to [`VoxelsBuilder::new`] are cut to the blocks of 512³ there.
    pub fn set_tile(&mut self, min: IVec3, side: i32, value: f32) {
        debug_assert!(side % BRICK_SIDE == 0 && min % BRICK_SIDE == IVec3::ZERO);
        let value = self.checked(value, i64::from(side).pow(3) as u64, min);
        if value == self.voxels.background {
            return;
        }
        self.covers([min, min + (side - 1)], value);
        let log2 = [ROOT_LOG2, NODE_LOG2, BRICK_LOG2]
            .into_iter()
            .find(|&log2| {
                let size = 1 << log2;
                side % size == 0 && min % size == IVec3::ZERO
            })
            .unwrap_or(BRICK_LOG2);
        let n = side >> log2;
        for x in 0..n {
            for y in 0..n {
                for z in 0..n {
                    let block = min + (IVec3::new(x, y, z) << log2);
                    if let Some(entry) = self.entry(block, log2) {
                        *entry = Entry::Tile(value);
                    }
                }
            }
        }
    }

    /// Sets the voxels of a brick; the coordinates of `min` are multiples of 8.
    pub fn set_brick(&mut self, min: IVec3, values: &Brick) {
        debug_assert!(min % BRICK_SIDE == IVec3::ZERO);
        let mut brick = *values;
        if let [first, rest @ ..] = values
            && rest.iter().all(|value| value == first)
        {
            return self.set_tile(min, BRICK_SIDE, *first);
        }
        let background = self.voxels.background;
        let (mut low, mut high) = (IVec3::MAX, IVec3::MIN);
        for (i, value) in (0..).zip(&mut brick) {
            let voxel = min + (IVec3::new(i >> 6, i >> 3, i) & 7);
            // In one place only, because values that are neither are the rule.
            if !(*value >= 0.0 && *value < f32::INFINITY) {
                *value = self.checked(*value, 1, voxel);
            }
            if *value != background {
                low = low.min(voxel);
                high = high.max(voxel);
                self.voxels.max = self.voxels.max.max(*value);
            }
        }
        if low.x > high.x {
            return;
        }
        self.covers([low, high], background);
        let index = self.voxels.bricks.len() as u32;
        if let Some(entry) = self.entry(min, BRICK_LOG2) {
            *entry = Entry::Brick(index);
            self.voxels.bricks.push(brick);
            self.places.push(min);
        }
    }

    /// The voxels put together.
    ///
    /// # Errors
    /// Where values were not finite.
    pub fn finish(mut self) -> Result<BuiltVoxels, VoxelsError> {
        if let Some((count, first)) = self.non_finite {
            return Err(VoxelsError::NonFinite { count, first });
        }
        self.voxels.bricks.shrink_to_fit();
        self.voxels.nodes.shrink_to_fit();
        let voxels = &self.voxels;
        let above = |place: &IVec3| {
            std::array::from_fn(|side| {
                let side = side as i32 + 1;
                let step = IVec3::new(side & 1, side >> 1 & 1, side >> 2);
                match voxels.block(place + step * BRICK_SIDE) {
                    Block::Tile { value, .. } => Above::Tile(value),
                    Block::Brick(brick) => Above::Brick(brick.index),
                }
            })
        };
        self.voxels.above = self.places.iter().map(above).collect();
        Ok(BuiltVoxels {
            voxels: self.voxels,
            n_negative: self.n_negative,
        })
    }

    /// `value` unless it is negative or not finite, which is noted for `count` voxels from `first` on.
    fn checked(&mut self, value: f32, count: u64, first: IVec3) -> f32 {
        if !value.is_finite() {
            let (before, at) = self.non_finite.unwrap_or((0, first));
            self.non_finite = Some((before.saturating_add(count), at));
            0.0
        } else if value < 0.0 {
            self.n_negative = self.n_negative.saturating_add(count);
            0.0
        } else {
            // Of −0 too.
            value + 0.0
        }
    }

    /// Notes that voxels in a box differ from the background, and one of their values.
    fn covers(&mut self, [min, max]: [IVec3; 2], value: f32) {
        let voxels = &mut self.voxels;
        let [low, high] = voxels.support.unwrap_or([min, max]);
        voxels.support = Some([low.min(min), high.max(max)]);
        voxels.max = voxels.max.max(value);
    }

    /// The entry of the block of 2^`log2` voxels at `block`, with nodes made on the way; `None` outside the table.
    fn entry(&mut self, block: IVec3, log2: u32) -> Option<&mut Entry> {
        let index = self.voxels.root_index(block)?;
        if log2 == ROOT_LOG2 {
            return self.voxels.root.get_mut(index);
        }
        let mut node = self.child(index, None);
        if log2 == BRICK_LOG2 {
            node = self.child(slot(block, NODE_LOG2), Some(node));
        }
        self.voxels.nodes[node].get_mut(slot(block, log2))
    }

    /// The node behind an entry of the root or of a node, made where there is none.
    fn child(&mut self, index: usize, parent: Option<usize>) -> usize {
        let voxels = &mut self.voxels;
        let next = voxels.nodes.len();
        let entry = match parent {
            Some(node) => &mut voxels.nodes[node][index],
            None => &mut voxels.root[index],
        };
        match *entry {
            Entry::Node(node) => node as usize,
            Entry::Tile(value) => {
                *entry = Entry::Node(next as u32);
                voxels.nodes.push([Entry::Tile(value); BRICK_VOXELS]);
                next
            }
            Entry::Brick(_) => unreachable!("bricks have no children"),
        }
    }
}

/// Place among the 8³ blocks of 2^`log2` voxels in the next larger block.
fn slot(voxel: IVec3, log2: u32) -> usize {
    let [x, y, z] = ((voxel >> log2) & 7).to_array();
    (x << 6 | y << 3 | z) as usize
}

impl Voxels {
    /// The value of all voxels that are not stored.
    pub fn background(&self) -> f32 {
        self.background
    }

    /// The largest value.
    pub fn max(&self) -> f32 {
        self.max
    }

    /// The smallest box, both ends included, around all voxels that differ from the background; `None` where there are none.
    pub fn support(&self) -> Option<[IVec3; 2]> {
        self.support
    }

    /// Memory taken, in bytes.
    pub fn bytes(&self) -> usize {
        size_of::<Self>()
            + self.root.capacity() * size_of::<Entry>()
            + self.nodes.capacity() * size_of::<[Entry; BRICK_VOXELS]>()
            + self.bricks.capacity() * size_of::<Brick>()
            + self.above.capacity() * size_of::<[Above; 7]>()
    }

    /// The value of a voxel.
    #[inline]
    pub fn value(&self, voxel: IVec3) -> f32 {
        match self.block(voxel) {
            Block::Tile { value, .. } => value,
            Block::Brick(brick) => brick.value(voxel),
        }
    }

    /// The block that holds a voxel.
    #[inline]
    pub(super) fn block(&self, voxel: IVec3) -> Block<'_> {
        let Some(mut entry) = self.root_index(voxel).map(|index| self.root[index]) else {
            return Block::Tile {
                value: self.background,
                log2: ROOT_LOG2,
            };
        };
        let mut log2 = ROOT_LOG2;
        loop {
            match entry {
                Entry::Tile(value) => return Block::Tile { value, log2 },
                Entry::Brick(index) => {
                    return Block::Brick(BrickRef {
                        voxels: self,
                        values: &self.bricks[index as usize],
                        index,
                    });
                }
                Entry::Node(node) => {
                    log2 -= BRICK_LOG2;
                    entry = self.nodes[node as usize][slot(voxel, log2)];
                }
            }
        }
    }

    /// The box that the table covers, in voxels; the second end is not included.
    pub(super) fn table_box(&self) -> [IVec3; 2] {
        [self.root_min, self.root_min + self.root_size].map(|corner| corner << ROOT_LOG2)
    }

    fn root_index(&self, voxel: IVec3) -> Option<usize> {
        let block = (voxel >> ROOT_LOG2) - self.root_min;
        let inside = block.cmpge(IVec3::ZERO).all() && block.cmplt(self.root_size).all();
        inside
            .then(|| ((block.x * self.root_size.y + block.y) * self.root_size.z + block.z) as usize)
    }
}

/// Place of a voxel in its brick.
#[inline]
fn in_brick(voxel: IVec3) -> usize {
    let [x, y, z] = (voxel & 7).to_array();
    (x << 6 | y << 3 | z) as usize
}

impl fmt::Debug for Voxels {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        f.debug_struct("Voxels")
            .field("background", &self.background)
            .field("support", &self.support)
            .field("max", &self.max)
            .field("nodes", &self.nodes.len())
            .field("bricks", &self.bricks.len())
            .finish()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    const LIMIT: u64 = 1 << 30;

    fn builder(background: f32, bounds: [[i32; 3]; 2]) -> VoxelsBuilder {
        VoxelsBuilder::new(background, bounds.map(IVec3::from), 8, LIMIT).unwrap()
    }

    /// A brick with one value.
    fn single(at: [i32; 3], value: f32) -> Brick {
        let mut brick = [0.0; BRICK_VOXELS];
        brick[in_brick(at.into())] = value;
        brick
    }

    #[test]
    fn voxels_tiles_and_background_are_found_on_both_sides_of_zero() {
        let mut builder = builder(0.0, [[-4096, -8, -8], [4095, 4095, 4095]]);
        builder.set_brick(IVec3::splat(-8), &single([7, 6, 5], 2.0));
        builder.set_tile(IVec3::new(128, 0, 0), 128, 0.5);
        builder.set_tile(IVec3::new(-4096, 0, 0), 4096, 0.25);
        builder.set_tile(IVec3::new(0, 8, 0), 8, 4.0);
        let voxels = builder.finish().unwrap().voxels;
        for (at, value) in [
            ([-1, -2, -3], 2.0),
            ([-1, -2, -4], 0.0),
            ([127, 0, 0], 0.0),
            ([128, 0, 0], 0.5),
            ([255, 127, 127], 0.5),
            ([255, 127, 128], 0.0),
            ([-4096, 0, 0], 0.25),
            ([-1, 4095, 4095], 0.25),
            ([-1, 4096, 0], 0.0),
            ([0, 15, 7], 4.0),
            ([0, 16, 7], 0.0),
            ([MAX_COORDINATE; 3], 0.0),
            ([-MAX_COORDINATE; 3], 0.0),
        ] {
            assert_eq!(voxels.value(at.into()), value, "{at:?}");
        }
        assert_eq!(voxels.max(), 4.0);
        let support = [[-4096, -2, -3], [255, 4095, 4095]].map(IVec3::from);
        assert_eq!(voxels.support(), Some(support));
    }

    #[test]
    fn bricks_of_one_value_take_no_memory_of_their_own() {
        let mut builder = builder(0.0, [[0; 3], [63; 3]]);
        for x in 0..8 {
            for y in 0..8 {
                for z in 0..8 {
                    builder.set_brick(IVec3::new(x, y, z) * 8, &[0.5; BRICK_VOXELS]);
                }
            }
        }
        let voxels = builder.finish().unwrap().voxels;
        assert_eq!(voxels.value(IVec3::splat(63)), 0.5);
        // Two nodes instead of 1 MiB.
        assert!(voxels.bytes() < 10_000, "{}", voxels.bytes());
    }

    #[test]
    fn negative_values_become_zero_and_are_counted() {
        let mut builder = builder(0.0, [[0; 3], [63; 3]]);
        builder.set_brick(IVec3::ZERO, &single([1, 2, 3], -1.0));
        builder.set_tile(IVec3::splat(8), 8, -0.5);
        let built = builder.finish().unwrap();
        assert_eq!((built.n_negative, built.voxels.max()), (513, 0.0));
        assert_eq!(built.voxels.support(), None);
    }

    #[test]
    fn values_that_are_not_finite_are_counted_and_the_first_is_named() {
        let mut builder = builder(0.0, [[0; 3], [63; 3]]);
        let mut brick = single([1, 2, 3], f32::NAN);
        brick[in_brick(IVec3::new(4, 0, 0))] = f32::INFINITY;
        builder.set_brick(IVec3::new(8, 0, 0), &brick);
        let error = builder.finish().unwrap_err();
        let first = IVec3::new(9, 2, 3);
        assert_eq!(error, VoxelsError::NonFinite { count: 2, first });
        assert!(
            error
                .to_string()
                .contains("2 non-finite voxels, the first at (9, 2, 3)")
        );
    }

    #[test]
    fn what_needs_too_much_memory_is_refused_before_it_is_taken() {
        let new = |bounds: [[i32; 3]; 2], n| {
            VoxelsBuilder::new(0.0, bounds.map(IVec3::from), n, 1 << 20).map(|_| ())
        };
        assert_eq!(new([[0; 3], [511; 3]], 480), Ok(()));
        assert!(matches!(
            new([[0; 3], [511; 3]], 600),
            Err(VoxelsError::Memory { .. })
        ));
        assert!(matches!(
            new([[0; 3], [511; 3]], 1 << 40),
            Err(VoxelsError::Memory { .. })
        ));
        let far = MAX_COORDINATE;
        for bounds in [
            [[-far; 3], [far; 3]],
            [[i32::MIN; 3], [i32::MAX; 3]],
            [[1; 3], [0; 3]],
        ] {
            assert!(matches!(new(bounds, 0), Err(VoxelsError::Extent { .. })));
        }
    }
}
