//! The way of a line through voxels: cell by cell where values vary, block by block where they do not.
//!
//! A cell is the cube between eight voxels, named by the one with the smallest coordinates. Amanatides and Woo 1987 step from cell to
//! cell; here distances are computed from the integers anew in each step, so that errors do not add up, and blocks of one value
//! are crossed in one step. The cells on the upper faces of a block lie between it and its neighbours, and are empty with it only
//! if these are.

use super::cell::Cell;
use super::voxels::{BRICK_LOG2, BRICK_SIDE, Block, BrickRef, Voxels};
use crate::line::Line;
use crate::region::clip_box;
use glam::{DVec3, IVec3};
use std::ops::ControlFlow;

/// One step of a line.
#[derive(Clone, Copy, Debug)]
pub(super) struct Step {
    /// Distance in metres at which it begins.
    pub(super) t0: f64,
    /// Distance at which it ends, not before it begins; may be infinite.
    pub(super) t1: f64,
    /// What is there.
    pub(super) run: Run,
    /// The axis on whose face it ends, unless it ends where the line does.
    pub(super) axis: usize,
}

/// The values on a step.
#[derive(Clone, Copy, Debug)]
pub(super) enum Run {
    /// One value.
    Uniform(f64),
    /// Those of a cell.
    Cell(Cell),
}

impl Step {
    /// ∫ value dt.
    #[inline]
    pub(super) fn column(&self) -> f64 {
        match &self.run {
            // Never 0 · ∞.
            Run::Uniform(0.0) => 0.0,
            Run::Uniform(value) => value * (self.t1 - self.t0),
            Run::Cell(cell) => cell.column(),
        }
    }
}

/// The values at the corners of a cell.
#[inline]
pub(super) fn corners(voxels: &Voxels, cell: IVec3) -> [f32; 8] {
    match voxels.block(cell) {
        Block::Brick(brick) => brick.corners(cell),
        Block::Tile { .. } => corners_at_tile(voxels, cell),
    }
}

/// The same for a cell whose first corner lies in a tile, and others perhaps in blocks above it: each of these is looked up once.
fn corners_at_tile(voxels: &Voxels, cell: IVec3) -> [f32; 8] {
    // The axes on which the cell lies between blocks of 8³.
    let across = (cell & (BRICK_SIDE - 1)).cmpeq(IVec3::splat(BRICK_SIDE - 1));
    let across = across.bitmask() as i32;
    let mut corners = [0.0; 8];
    let mut side = 0;
    loop {
        let block = voxels.block(cell + offset(side));
        for (corner, value) in (0..).zip(&mut corners) {
            if corner & across == side {
                *value = match block {
                    Block::Tile { value, .. } => value,
                    Block::Brick(brick) => brick.value(cell + offset(corner)),
                };
            }
        }
        if side == across {
            return corners;
        }
        // The next subset of the axes.
        side = (side - across) & across;
    }
}

/// The offset of a corner from the first.
#[inline]
fn offset(corner: i32) -> IVec3 {
    IVec3::new(corner & 1, corner >> 1 & 1, corner >> 2)
}

/// The box of cells around `cell`, second end not included, that all lie between voxels of one value; `None` where there is
/// none that can be told quickly.
fn uniform_cells(voxels: &Voxels, cell: IVec3, value: f32, log2: u32) -> Option<[IVec3; 2]> {
    let side = 1 << log2;
    let low = cell >> log2 << log2;
    let last = low + (side - 1);
    let on_face = cell.cmpeq(last);
    if !on_face.any() {
        return Some([low, last]);
    }
    // On a face: a layer of cells, between this block and the neighbours on the side of that face.
    let mut low = IVec3::select(on_face, cell, low);
    let mut high = IVec3::select(on_face, cell + 1, last);
    let faces = on_face.bitmask() as i32;
    for corner in (1..8).filter(|corner| corner & !faces == 0) {
        let voxel = cell + offset(corner);
        match voxels.block(voxel) {
            Block::Tile { value: other, log2 } if other == value => {
                let first = voxel >> log2 << log2;
                let last = first + ((1 << log2) - 1);
                // A cell in the layer next to the neighbour's own upper face has another neighbour.
                if voxel.cmpeq(last).bitmask() as i32 & !faces != 0 {
                    return None;
                }
                low = IVec3::select(on_face, low, low.max(first));
                high = IVec3::select(on_face, high, high.min(last));
            }
            _ => return None,
        }
    }
    Some([low, high])
}

/// Visits the steps of `line`, in voxels per metre, from `t0` to `t1 > t0` in order.
///
/// Cells are kept within `cells`, both ends included, where the line stays in their box: on its faces rounding cannot lead out.
#[inline]
pub(super) fn walk<B>(
    voxels: &Voxels,
    line: &Line,
    cells: Option<[IVec3; 2]>,
    (t0, t1): (f64, f64),
    mut visit: impl FnMut(&Step) -> ControlFlow<B>,
) -> ControlFlow<B> {
    let table = voxels.table_box().map(|corner| corner.as_dvec3());
    // One cell more: those below the table have voxels in it.
    let inside = clip_box(line, table[0] - 1.0, table[1]);
    let inside = inside.map_or((t1, t1), |(a, b)| {
        let a = a.max(t0).min(t1);
        (a, b.min(t1).max(a))
    });
    let outside = |(t0, t1): (f64, f64)| Step {
        t0,
        t1,
        run: Run::Uniform(voxels.background().into()),
        // Nothing has a kink there.
        axis: 0,
    };
    if t0 < inside.0 {
        visit(&outside((t0, inside.0)))?;
    }
    if inside.0 < inside.1 {
        let cells = cells.unwrap_or_else(|| {
            let [low, high] = voxels.table_box();
            [low - 1, high - 1]
        });
        Walker::new(voxels, line, cells).steps(inside, &mut visit)?;
    }
    if inside.1 < t1 {
        visit(&outside((inside.1, t1)))?;
    }
    ControlFlow::Continue(())
}

/// A line among the cells of a box.
struct Walker<'a> {
    voxels: &'a Voxels,
    line: &'a Line,
    /// Metres per voxel on each axis, with the sign of the direction.
    per_voxel: DVec3,
    cells: [IVec3; 2],
}

impl<'a> Walker<'a> {
    fn new(voxels: &'a Voxels, line: &'a Line, cells: [IVec3; 2]) -> Self {
        Self {
            voxels,
            line,
            per_voxel: line.direction.recip(),
            cells,
        }
    }

    /// The cell at distance `t`.
    fn cell(&self, t: f64) -> IVec3 {
        let [low, high] = self.cells;
        self.line.at(t).floor().as_ivec3().clamp(low, high)
    }

    /// The distance and the axis at which the line leaves the cells from `low` to below `high`.
    #[inline]
    fn exit(&self, low: IVec3, high: IVec3) -> (f64, usize) {
        let d = self.line.direction;
        let face = DVec3::select(d.cmpgt(DVec3::ZERO), high.as_dvec3(), low.as_dvec3());
        let t = (face - self.line.origin) * self.per_voxel;
        // Along a face the line never leaves through it.
        let t = DVec3::select(d.cmpeq(DVec3::ZERO), DVec3::INFINITY, t);
        if t.x <= t.y && t.x <= t.z {
            (t.x, 0)
        } else if t.y <= t.z {
            (t.y, 1)
        } else {
            (t.z, 2)
        }
    }

    #[inline]
    fn steps<B>(
        &self,
        (t0, t1): (f64, f64),
        visit: &mut impl FnMut(&Step) -> ControlFlow<B>,
    ) -> ControlFlow<B> {
        let forward = self.line.direction.cmpgt(DVec3::ZERO);
        let mut cell = self.cell(t0);
        let mut t = t0;
        loop {
            let (value, log2) = match self.voxels.block(cell) {
                Block::Tile { value, log2 } => (value, log2),
                Block::Brick(brick) => {
                    if !self.through_brick(brick, (&mut cell, &mut t), t1, visit)? {
                        return ControlFlow::Continue(());
                    }
                    continue;
                }
            };
            let uniform = uniform_cells(self.voxels, cell, value, log2);
            let [low, high] = uniform.unwrap_or([cell, cell + 1]);
            let (exit, axis) = self.exit(low, high);
            let end = exit.min(t1).max(t);
            let run = if uniform.is_some() {
                Run::Uniform(value.into())
            } else {
                self.run(corners_at_tile(self.voxels, cell), cell, (t, end))
            };
            visit(&Step {
                t0: t,
                t1: end,
                run,
                axis,
            })?;
            if exit >= t1 {
                return ControlFlow::Continue(());
            }
            t = end;
            if uniform.is_some() {
                // Where on the face; rounding neither leads out of the block nor back.
                let now = self.line.at(t).floor().as_ivec3().clamp(low, high - 1);
                cell = IVec3::select(forward, now.max(cell), now.min(cell));
            }
            cell[axis] = if forward.test(axis) {
                high[axis]
            } else {
                low[axis] - 1
            };
        }
    }

    #[inline]
    fn run(&self, corners: [f32; 8], cell: IVec3, (t, end): (f64, f64)) -> Run {
        Run::Cell(Cell {
            corners,
            start: self.line.at(t) - cell.as_dvec3(),
            direction: self.line.direction,
            length: end - t,
        })
    }

    /// The cells of one brick, from `cell` at distance `t` on, which are moved to what comes behind it; false where the line ends in it.
    ///
    /// The brick is looked up once, and a step computes the distance to one face anew instead of three.
    #[inline]
    fn through_brick<B>(
        &self,
        brick: BrickRef<'_>,
        (cell, t): (&mut IVec3, &mut f64),
        t1: f64,
        visit: &mut impl FnMut(&Step) -> ControlFlow<B>,
    ) -> ControlFlow<B, bool> {
        let d = self.line.direction;
        let (origin, per_voxel) = (self.line.origin.to_array(), self.per_voxel.to_array());
        let forward = d.cmpgt(DVec3::ZERO);
        let step = IVec3::select(forward, IVec3::ONE, IVec3::NEG_ONE).to_array();
        let ahead = IVec3::select(forward, IVec3::ONE, IVec3::ZERO).to_array();
        let runs = d.cmpne(DVec3::ZERO);
        let mut at = cell.to_array();
        // The index within the brick's block changes its upper bits where the line leaves it.
        let home = at.map(|c| c >> BRICK_LOG2);
        let exit = |axis: usize, c: i32| f64::from(c + ahead[axis]) - origin[axis];
        let mut exits: [f64; 3] = std::array::from_fn(|axis| {
            if runs.test(axis) {
                exit(axis, at[axis]) * per_voxel[axis]
            } else {
                // Along a face the line never leaves through it.
                f64::INFINITY
            }
        });
        let mut now = *t;
        loop {
            let mut axis = usize::from(exits[1] < exits[0]);
            if exits[2] < exits[axis] {
                axis = 2;
            }
            let leaves = exits[axis];
            let end = leaves.min(t1).max(now);
            let here = IVec3::from_array(at);
            visit(&Step {
                t0: now,
                t1: end,
                run: self.run(brick.corners(here), here, (now, end)),
                axis,
            })?;
            if leaves >= t1 {
                return ControlFlow::Continue(false);
            }
            now = end;
            at[axis] += step[axis];
            if at[axis] >> BRICK_LOG2 != home[axis] {
                (*cell, *t) = (IVec3::from_array(at), now);
                return ControlFlow::Continue(true);
            }
            exits[axis] = exit(axis, at[axis]) * per_voxel[axis];
        }
    }
}
