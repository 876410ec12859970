//! The index of records: a flat octree whose levels are radius classes.
//!
//! A record lives on the level whose cells are as wide as its radius, and is listed by every cell its ball touches (as in
//! Ward et al. 1988). A point therefore looks into one cell per occupied level, and that cell's list lies in one piece.
//! Records are renumbered along the cells they stand in; that number is called a slot.

use crate::block::{Block, Span, WIDTH};
use crate::cell_table::CellTable;
use crate::grid::{Ball, CellBox, Grid, SideExponent, key, side_exponent};
use crate::segment::Segment;
use glam::{DVec3, Vec3};
use std::ops::Range;

/// Most records an octree holds: places in lists are `u32`, and 27 cells with a block for each ball are 108 places.
pub(crate) const MAX_RECORDS: usize = (u32::MAX / 128) as usize;

/// Records by place.
#[derive(Clone, Debug, Default)]
pub(crate) struct Octree {
    /// From large cells to small ones.
    levels: Vec<Level>,
    /// The lists of all cells, one after another: balls by ascending slots, each list from a block of its own.
    lists: Vec<Block>,
    /// Key of the cell each slot's centre is in; ascending within a level.
    homes: Vec<u64>,
}

#[derive(Clone, Debug)]
struct Level {
    grid: Grid,
    slots: Range<usize>,
    cells: CellTable,
    /// The level's part of all lists.
    blocks: Range<usize>,
    /// Corners of the box around the level's balls.
    bounds: [DVec3; 2],
}

impl Level {
    /// Where the list of a cell is.
    #[inline]
    fn blocks_of(&self, key: u64) -> Range<usize> {
        let (start, len) = self.cells.list(key);
        let first = start as usize / WIDTH;
        first..first + (len as usize).div_ceil(WIDTH)
    }
}

/// Corners of the box around `balls`.
fn bounds(balls: &[Ball]) -> [DVec3; 2] {
    let none = [DVec3::INFINITY, DVec3::NEG_INFINITY];
    balls.iter().fold(none, |[low, high], ball| {
        let (centre, radius) = (ball.centre.as_dvec3(), f64::from(ball.radius));
        [low.min(centre - radius), high.max(centre + radius)]
    })
}

impl Octree {
    /// Indexes `balls`, and tells the order of slots: entry `s` is the index of the ball in slot `s`.
    ///
    /// Slots are sorted by level from large to small, then by the cell of the centre, then by index, so that they and
    /// all lists follow from the balls alone.
    pub(crate) fn build(balls: &[Ball]) -> (Self, Vec<u32>) {
        let mut sorted: Vec<(SideExponent, u64, u32)> = Vec::with_capacity(balls.len());
        for (index, ball) in balls.iter().enumerate() {
            let exponent = side_exponent(ball);
            let home = Grid::new(exponent).key(ball.centre);
            debug_assert!(home.is_some(), "{ball:?} stands outside its level's grid");
            sorted.push((-exponent, home.unwrap_or(0), index as u32));
        }
        sorted.sort_unstable();

        let mut octree = Self {
            homes: sorted.iter().map(|&(_, home, _)| home).collect(),
            ..Self::default()
        };
        let mut first_slot = 0;
        for class in sorted.chunk_by(|a, b| a.0 == b.0) {
            let slots = first_slot..first_slot + class.len();
            first_slot = slots.end;
            let class_balls: Vec<Ball> = (class.iter())
                .map(|&(_, _, index)| balls[index as usize])
                .collect();
            octree.push_level(-class[0].0, slots, &class_balls);
        }
        let order = sorted.iter().map(|&(_, _, index)| index).collect();
        (octree, order)
    }

    /// Counts how many balls each cell lists, then fills the lists: no sorting of all entries.
    fn push_level(&mut self, exponent: SideExponent, slots: Range<usize>, balls: &[Ball]) {
        let grid = Grid::new(exponent);
        let mut cells = CellTable::new();
        // Lists lie in the order in which their cells are first met, which is near to the order of slots.
        let mut met = Vec::new();
        for ball in balls {
            grid.for_each_touched(ball, |key| {
                if cells.count(key) {
                    met.push(key);
                }
            });
        }
        let first_block = self.lists.len();
        let mut start = first_block * WIDTH;
        for key in met {
            let end = cells.set_start(key, start as u32);
            start = (end as usize).next_multiple_of(WIDTH);
        }
        self.lists.resize(start / WIDTH, Block::EMPTY);
        for (ball, slot) in balls.iter().zip(slots.clone()) {
            grid.for_each_touched(ball, |key| {
                let next = cells.next_in_list(key) as usize;
                self.lists[next / WIDTH].set(next % WIDTH, ball, slot as u32);
            });
        }
        cells.end_filling();
        self.levels.push(Level {
            grid,
            slots,
            cells,
            blocks: first_block..self.lists.len(),
            bounds: bounds(balls),
        });
    }

    /// Calls `visit` with the slot and (p − x)/R of each ball that holds `p`, by ascending slots.
    #[inline]
    pub(crate) fn for_each_holding(&self, p: Vec3, mut visit: impl FnMut(usize, Vec3)) {
        /// Blocks whose answers fit in one word.
        const CHUNK: usize = u64::BITS as usize / WIDTH;
        for list in self.lists_at(p) {
            for chunk in list.chunks(CHUNK) {
                // First all tests, then all hits: a branch that cannot be foretold for each hit, not for each test.
                let mut holding = 0_u64;
                for (i, block) in chunk.iter().enumerate() {
                    holding |= u64::from(block.holding(p)) << (i * WIDTH);
                }
                while holding != 0 {
                    let bit = holding.trailing_zeros() as usize;
                    holding &= holding - 1;
                    let (block, lane) = (&chunk[bit / WIDTH], bit % WIDTH);
                    visit(block.slot(lane), block.offset(lane, p));
                }
            }
        }
    }

    /// Whether any ball holds `p`.
    #[inline]
    pub(crate) fn covers(&self, p: Vec3) -> bool {
        self.lists_at(p)
            .any(|list| list.iter().any(|block| block.holding(p) != 0))
    }

    /// Slots and balls of all balls that may hold a point of the segment, by ascending slots.
    pub(crate) fn along(&self, segment: &Segment) -> Vec<(usize, Ball)> {
        let mut found = Vec::new();
        for level in &self.levels {
            let [low, high] = level.bounds;
            let margin = 4.0 * segment.margin(low.abs().max(high.abs()).max_element());
            let Some(ends) = segment.clip([low - margin, high + margin]) else {
                continue;
            };
            let side = level.grid.side();
            let span = Span::new(ends, side, margin);
            let mut search = |blocks: Range<usize>| {
                for block in blocks {
                    let mut near = self.lists[block].near(&span);
                    while near != 0 {
                        let place = block * WIDTH + near.trailing_zeros() as usize;
                        near &= near - 1;
                        let slot = self.lists[block].slot(place % WIDTH);
                        // One number to sort by: a ball is in several cells.
                        found.push((slot as u64) << 32 | place as u64);
                    }
                }
            };
            let n_slabs = (ends[1] - ends[0]).abs().max_element() / side + 2.0;
            let n_cells = n_slabs * (3.0 + 2.0 * margin / side).powi(2);
            if n_cells > level.blocks.len() as f64 {
                search(level.blocks.clone());
            } else {
                (level.grid).for_each_along(ends, margin, |key| search(level.blocks_of(key)));
            }
        }
        found.sort_unstable();
        found.dedup_by_key(|found| *found >> 32);
        let ball = |found: u64| {
            let place = found as u32 as usize;
            let ball = self.lists[place / WIDTH].ball(place % WIDTH);
            ((found >> 32) as usize, ball)
        };
        found.into_iter().map(ball).collect()
    }

    /// Per level the list of balls that may hold `p`.
    #[inline]
    fn lists_at(&self, p: Vec3) -> impl Iterator<Item = &[Block]> {
        self.levels.iter().filter_map(move |level| {
            let blocks = level.blocks_of(level.grid.key(p)?);
            Some(&self.lists[blocks])
        })
    }

    /// Calls `visit` with ascending ranges of slots that hold all centres within a reach of `p`, and others.
    ///
    /// `reach` gives it for a level, from the side of the level's cells, which no radius on the level exceeds.
    pub(crate) fn for_each_near(
        &self,
        p: Vec3,
        reach: impl Fn(f64) -> f64,
        mut visit: impl FnMut(Range<usize>),
    ) {
        for level in &self.levels {
            let CellBox { low, high } = level.grid.cells_within(p, reach(level.grid.side()));
            let n_rows = (high[0] - low[0] + 1).saturating_mul(high[1] - low[1] + 1);
            if n_rows as usize >= level.slots.len() {
                visit(level.slots.clone());
                continue;
            }
            let homes = &self.homes[level.slots.clone()];
            for x in low[0]..=high[0] {
                for y in low[1]..=high[1] {
                    let first = homes.partition_point(|&home| home < key([x, y, low[2]]));
                    let row = &homes[first..];
                    let len = row.partition_point(|&home| home <= key([x, y, high[2]]));
                    let first_slot = level.slots.start + first;
                    visit(first_slot..first_slot + len);
                }
            }
        }
    }
}
