//! Density from a volume file: values at the corners of a lattice, interpolated between them, placed in space.

mod cell;
mod profile;
mod voxels;
mod walk;

pub use voxels::{
    BRICK_SIDE, BRICK_VOXELS, Brick, BuiltVoxels, MAX_COORDINATE, Voxels, VoxelsBuilder,
    VoxelsError,
};

pub(crate) use profile::GridProfile;

use crate::line::Line;
use crate::region::clip_box;
use cell::{trilinear, trilinear_gradient, trilinear_hessian};
use glam::{DAffine3, DMat3, DVec3, IVec3, Vec3};
use std::sync::Arc;
use thiserror::Error;
use tyndall_math::{Aabb, Jet};
use walk::corners;

/// Voxels placed in the world: their values are interpolated trilinearly and multiplied by a scale.
///
/// Voxel (i, j, k) has its value at the point with these index coordinates; an affine map, which may rotate, shear and mirror, takes
/// index coordinates to the world. Along a line the value is a cubic in each cell between eight voxels, so that optical depth and its
/// derivatives are sums over cells, exact to rounding.
///
/// ```
/// use glam::{DAffine3, IVec3, Vec3};
/// use std::sync::Arc;
/// use tyndall_media::grid::{Grid, GridEdge, VoxelsBuilder};
///
/// // Eight voxels a side, half a metre apart, all of density 2.
/// let mut builder = VoxelsBuilder::new(0.0, [IVec3::ZERO, IVec3::splat(7)], 0, 1 << 20)?;
/// builder.set_tile(IVec3::ZERO, 8, 2.0);
/// let voxels = Arc::new(builder.finish()?.voxels);
/// let grid = Grid::new(voxels, DAffine3::from_scale([0.5; 3].into()), 1.0, GridEdge::Background)?;
///
/// assert_eq!(grid.value(Vec3::splat(1.0)), 2.0);
/// // Half a voxel beyond the last one it is half of that.
/// assert_eq!(grid.value(Vec3::new(3.75, 1.0, 1.0)), 1.0);
/// # Ok::<(), Box<dyn std::error::Error>>(())
/// ```
#[derive(Clone, Debug, PartialEq)]
pub struct Grid {
    voxels: Arc<Voxels>,
    world_from_index: DAffine3,
    index_from_world: DAffine3,
    scale: f32,
    edge: GridEdge,
    /// Index coordinates outside of which there is nothing; `None` where the background is something.
    domain: Option<[DVec3; 2]>,
}

/// What is where no voxels are stored.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum GridEdge {
    /// Voxels of the background value, as in OpenVDB.
    Background,
    /// Nothing outside this box of index coordinates, in which all voxels that are interpolated between must be stored.
    Box([DVec3; 2]),
}

/// Why a grid cannot be placed.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
pub enum GridError {
    /// It would be flat, or cannot be computed with.
    #[error(
        "its voxels are placed by {matrix} and {translation}, which flattens space or leaves the range of numbers; a grid \
         needs three directions that span space"
    )]
    Transform {
        /// What index directions become.
        matrix: DMat3,
        /// Where the index origin lies.
        translation: DVec3,
    },
    /// The scale is negative or not finite.
    #[error("scale {0} of the grid must be finite and not negative")]
    Scale(f32),
}

/// The least volume of a voxel over that of a box with edges as long: below, f32 could not tell a direction from the others.
const MIN_RELATIVE_VOLUME: f64 = 1e-7;

impl Grid {
    /// `voxels` placed in the world and multiplied by `scale`.
    ///
    /// # Errors
    /// Where the map is not finite or flattens space, or the scale is negative or not finite.
    pub fn new(
        voxels: Arc<Voxels>,
        world_from_index: DAffine3,
        scale: f32,
        edge: GridEdge,
    ) -> Result<Self, GridError> {
        if !(scale >= 0.0 && scale.is_finite()) {
            return Err(GridError::Scale(scale));
        }
        let m = world_from_index.matrix3;
        let edges = m.x_axis.length() * m.y_axis.length() * m.z_axis.length();
        let index_from_world = world_from_index.inverse();
        // Compared so that NaN is refused.
        let spans = m.determinant().abs() > MIN_RELATIVE_VOLUME * edges;
        if !(spans && index_from_world.is_finite() && world_from_index.is_finite()) {
            return Err(GridError::Transform {
                matrix: m,
                translation: world_from_index.translation,
            });
        }
        let domain = match edge {
            GridEdge::Box(domain) => Some(domain),
            // Values fade to zero over the cells around the outermost voxels.
            GridEdge::Background if voxels.background() == 0.0 => {
                let around = |[low, high]: [IVec3; 2]| [low - 1, high + 1].map(|c| c.as_dvec3());
                Some(voxels.support().map_or([DVec3::ZERO; 2], around))
            }
            GridEdge::Background => None,
        };
        Ok(Self {
            voxels,
            world_from_index,
            index_from_world,
            scale,
            edge,
            domain,
        })
    }

    /// The voxels.
    pub fn voxels(&self) -> &Arc<Voxels> {
        &self.voxels
    }

    /// Factor on the voxels' values.
    pub fn scale(&self) -> f32 {
        self.scale
    }

    /// Edges of the box in which voxels differ from the background, or of that outside of which there is nothing, in voxels.
    pub fn size(&self) -> [u64; 3] {
        let size = match (self.edge, self.voxels.support()) {
            (GridEdge::Box([low, high]), _) => (high - low).round().as_i64vec3(),
            (GridEdge::Background, Some([low, high])) => high.as_i64vec3() - low.as_i64vec3() + 1,
            (GridEdge::Background, None) => return [0; 3],
        };
        size.to_array().map(i64::unsigned_abs)
    }

    /// The largest density anywhere.
    pub fn max(&self) -> f32 {
        self.voxels.max() * self.scale
    }

    /// The density at `p`.
    pub fn value(&self, p: Vec3) -> f32 {
        let p = self.to_index(p.as_dvec3());
        if self.is_outside(p) {
            return 0.0;
        }
        let (corners, p) = self.cell(p);
        trilinear(&corners, p) as f32 * self.scale
    }

    /// The gradient of the density at `p`, per metre; on the face of a cell that of the cell with the larger coordinates.
    pub fn gradient(&self, p: Vec3) -> Vec3 {
        let p = self.to_index(p.as_dvec3());
        if self.is_outside(p) {
            return Vec3::ZERO;
        }
        let (corners, p) = self.cell(p);
        self.gradient_to_world(trilinear_gradient(&corners, p))
            .as_vec3()
    }

    /// The density at `p` with the derivatives inside its cell.
    pub(crate) fn jet(&self, p: DVec3) -> Jet {
        let p = self.to_index(p);
        if self.is_outside(p) {
            return Jet::ZERO;
        }
        let (corners, p) = self.cell(p);
        Jet {
            value: trilinear(&corners, p) * f64::from(self.scale),
            gradient: self.gradient_to_world(trilinear_gradient(&corners, p)),
            hessian: self.hessian_to_world(trilinear_hessian(&corners, p)),
        }
    }

    /// A box around all that is not zero; `None` where nothing bounds it.
    pub fn bounds(&self) -> Option<Aabb> {
        let domain = self.domain?;
        if self.max() == 0.0 {
            return Some(Aabb::EMPTY);
        }
        let corners = (0..8).map(|corner| {
            let pick = |axis: usize| domain[corner >> axis & 1][axis];
            let index = DVec3::new(pick(0), pick(1), pick(2));
            let p = self.world_from_index.transform_point3(index).as_vec3();
            Aabb { min: p, max: p }
        });
        Some(corners.fold(Aabb::EMPTY, |all, corner| all.union(corner)))
    }

    /// Distance in metres from `p` to the faces where the density jumps to zero, infinite where it fades; outside of them a lower bound.
    pub fn distance_to_jump(&self, p: Vec3) -> f32 {
        let GridEdge::Box([low, high]) = self.edge else {
            return f32::INFINITY;
        };
        let p = self.to_index(p.as_dvec3());
        // Negative inside.
        let beyond = (low - p).max(p - high) / self.steepness();
        beyond.max_element().abs() as f32
    }

    /// The distances between which a line meets more than nothing; `None` where it does not.
    #[inline]
    pub(crate) fn clip(&self, line: &Line, t0: f64, t1: f64) -> Option<(f64, f64)> {
        let Some([low, high]) = self.domain else {
            return Some((t0, t1));
        };
        let (enter, leave) = clip_box(&self.line(line), low, high)?;
        let (t0, t1) = (enter.max(t0), leave.min(t1));
        (t0 < t1).then_some((t0, t1))
    }

    /// ∫ density dt along a line from `t0` to `t1`, or any part of it that exceeds `enough`.
    ///
    /// Not inlined, so that rays through other media need not make room for it.
    #[inline(never)]
    pub(crate) fn column_until(&self, line: &Line, t0: f64, t1: f64, enough: f64) -> f64 {
        self.clip(line, t0, t1).map_or(0.0, |(t0, t1)| {
            GridProfile::new(self, line).column_until(t0, t1, enough)
        })
    }

    /// How far, in metres, a point near the faces of the box around the grid is from the nearest, and that face's outward unit normal.
    pub(crate) fn nearest_face(&self, p: DVec3) -> Option<(f64, DVec3)> {
        let [low, high] = self.domain?;
        let p = self.to_index(p);
        let (below, above) = ((p - low).abs(), (p - high).abs());
        let steepness = self.steepness();
        let distance = below.min(above) / steepness;
        let axis = distance.min_position();
        let side = if below[axis] < above[axis] { -1.0 } else { 1.0 };
        let normal = self.index_from_world.matrix3.row(axis) * (side / steepness[axis]);
        Some((distance[axis], normal))
    }

    /// A line in index coordinates; distances along it stay metres.
    #[inline]
    fn line(&self, line: &Line) -> Line {
        Line {
            origin: self.to_index(line.origin),
            direction: self.index_from_world.transform_vector3(line.direction),
        }
    }

    #[inline]
    fn to_index(&self, p: DVec3) -> DVec3 {
        self.index_from_world.transform_point3(p)
    }

    #[inline]
    fn is_outside(&self, p: DVec3) -> bool {
        self.domain
            .is_some_and(|[low, high]| !(p.cmpge(low).all() && p.cmple(high).all()))
    }

    /// The cells of the box around the grid, both ends included.
    #[inline]
    fn cells(&self) -> Option<[IVec3; 2]> {
        self.domain
            .map(|[low, high]| [low.floor().as_ivec3(), high.ceil().as_ivec3() - 1])
    }

    /// The corners of the cell that holds `p`, and the place of `p` in it.
    #[inline]
    fn cell(&self, p: DVec3) -> ([f32; 8], DVec3) {
        let [low, high] = self
            .cells()
            .unwrap_or([-MAX_COORDINATE, MAX_COORDINATE].map(IVec3::splat));
        // A number too large for an integer becomes the nearest.
        let cell = p.floor().as_ivec3().clamp(low, high.max(low));
        let corners = corners(&self.voxels, cell);
        (
            corners,
            (p - cell.as_dvec3()).clamp(DVec3::ZERO, DVec3::ONE),
        )
    }

    /// Index units per metre straight away from the faces of cells, for each axis.
    #[inline]
    fn steepness(&self) -> DVec3 {
        let m = self.index_from_world.matrix3;
        DVec3::new(m.row(0).length(), m.row(1).length(), m.row(2).length())
    }

    #[inline]
    fn gradient_to_world(&self, gradient: DVec3) -> DVec3 {
        self.index_from_world.matrix3.transpose() * gradient * f64::from(self.scale)
    }

    #[inline]
    fn hessian_to_world(&self, hessian: DMat3) -> DMat3 {
        let m = self.index_from_world.matrix3;
        m.transpose() * hessian * m * f64::from(self.scale)
    }
}
