//! The directions drawn towards one light, as cells of what is seen of it.
//!
//! Where a cell that is hidden borders on one that shines runs a silhouette, whose motion [`occlusion::gradient`] knows. Cells of the
//! drawn directions reach beyond the light; what lies there must not count, so borders are cut at the light's outline.
//!
//! A silhouette within half a cell of the outline may go unseen: of N directions, that is about N^−½ of all places where it can be.
//! Lights too small to tell directions apart, emitters that are no lights, and skies and images infinitely far away, whose cells have no
//! outline to be cut at, are taken to have none.

use super::point::Draw;
use crate::occlusion::{self, Seen};
use glam::{DMat3, DVec3, Quat, Vec3};
use std::f32::consts::TAU;
use tyndall_math::spherical::{Border, SphericalVoronoi, solid_angle};

/// What is seen in a direction drawn towards a light.
#[derive(Clone, Debug)]
pub(super) struct SeenLight {
    pub(super) seen: Seen,
    /// Density of the direction, per steradian.
    pub(super) pdf: f32,
}

/// The cells of one light.
pub(super) struct LightCells {
    seen: Vec<Seen>,
    /// Estimate of the light's solid angle.
    solid_angle: f32,
}

impl LightCells {
    /// From all directions drawn towards one light.
    pub(super) fn new(draws: &[Draw]) -> Self {
        let lit = || draws.iter().filter_map(|draw| draw.seen.as_ref());
        let sum: f32 = lit().map(|light| 1.0 / light.pdf).sum();
        Self {
            seen: lit().map(|light| light.seen.clone()).collect(),
            solid_angle: sum / draws.len() as f32,
        }
    }

    /// The share of the gradient at `x` that silhouettes before the light bring; `phase` is p for light from a direction.
    pub(super) fn gradient(&self, x: Vec3, phase: impl Fn(Vec3) -> Vec3) -> [Vec3; 3] {
        let shining = self.seen.iter().filter(|s| s.shines()).count();
        if shining == 0 || shining == self.seen.len() {
            return [Vec3::ZERO; 3];
        }
        let directions: Vec<Vec3> = self.seen.iter().map(|s| s.direction).collect();
        let outlined = self.solid_angle < TAU;
        let arcs = arcs(&directions, outlined);
        let outline = outlined.then(|| Outline::new(&directions, &arcs, self.solid_angle));
        let silhouettes: Vec<Border> = arcs
            .iter()
            .filter(|arc| {
                let [i, j] = arc.cells.map(|c| self.seen[c as usize].shines());
                i != j
            })
            .filter_map(|arc| {
                let ends = match &outline {
                    Some(outline) => outline.clip(arc, &directions)?,
                    None => [arc.ends[0]?, arc.ends[1]?],
                };
                Some(Border {
                    cells: arc.cells,
                    ends: ends.map(|end| end.as_vec3()),
                })
            })
            .collect();
        let mut sum = [Vec3::ZERO; 3];
        let add = |_, moved: [Vec3; 3]| {
            for (sum, moved) in sum.iter_mut().zip(moved) {
                *sum += moved;
            }
        };
        occlusion::gradient(&silhouettes, Quat::IDENTITY, x, &self.seen, phase, add);
        sum
    }
}

/// The border of two cells, its unit vectors in the order of [`Border`]; `None` for an end on the other side of the sphere.
struct Arc {
    cells: [u32; 2],
    ends: [Option<DVec3>; 2],
}

/// The borders of the Voronoi cells of `directions`. Where they are those of a light with an outline, the cells are made where a linear
/// map has spread the directions equally in all directions: those of a light seen from the side are as long and narrow as it.
fn arcs(directions: &[Vec3], outlined: bool) -> Vec<Arc> {
    let spread = if outlined {
        root_of_second_moments(directions)
    } else {
        DMat3::IDENTITY
    };
    let narrow = spread.inverse();
    let seen: Vec<Vec3> = directions
        .iter()
        .map(|d| (narrow * d.as_dvec3()).normalize().as_vec3())
        .collect();
    let arc = |Border { cells, ends }: &Border| Arc {
        cells: *cells,
        // Of triangles of neighbours, that which covers the rest of the sphere has its centre more than 90° away.
        ends: ends.map(|end| {
            let here = !outlined || end.dot(seen[cells[0] as usize]) >= 0.0;
            here.then(|| (spread * end.as_dvec3()).normalize())
        }),
    };
    SphericalVoronoi::new(&seen)
        .borders()
        .iter()
        .map(arc)
        .collect()
}

/// The lower triangular root L of the mean of d dᵀ = L Lᵀ (Cholesky): L⁻¹ d has the second moments 1. The identity where all
/// directions lie in one plane.
fn root_of_second_moments(directions: &[Vec3]) -> DMat3 {
    let mut s = DMat3::ZERO;
    for d in directions.iter().map(|d| d.as_dvec3()) {
        s += DMat3::from_cols(d * d.x, d * d.y, d * d.z) * (1.0 / directions.len() as f64);
    }
    let mut l = DMat3::ZERO;
    for k in 0..3 {
        let mut column = s.col(k);
        for before in 0..k {
            column -= l.col(before) * l.col(before)[k];
        }
        for above in 0..k {
            column[above] = 0.0;
        }
        *l.col_mut(k) = column / column[k].sqrt();
    }
    if l.is_finite() && l.determinant() > 0.0 {
        l
    } else {
        DMat3::IDENTITY
    }
}

/// About where a light ends: the convex hull of the directions drawn, widened until it has the light's solid angle.
struct Outline {
    /// Unit vectors across the sides, pointing inside.
    sides: Vec<DVec3>,
    /// Sine of the angle by which the sides are moved outwards.
    gap: f64,
    center: DVec3,
}

impl Outline {
    fn new(directions: &[Vec3], arcs: &[Arc], of_light: f32) -> Self {
        let center: DVec3 = directions.iter().map(|d| d.as_dvec3()).sum();
        let mut outline = Self {
            sides: Vec::new(),
            gap: 0.0,
            center: center.normalize_or_zero(),
        };
        let (mut area, mut perimeter) = (0.0, 0.0);
        for Arc { cells, ends } in arcs {
            if ends[0].is_some() != ends[1].is_some() {
                let [a, b] = cells.map(|c| directions[c as usize].as_dvec3());
                outline.sides.extend(outline.side(a, b));
                area += solid_angle([outline.center, a, b]).abs();
                perimeter += a.distance(b);
            }
        }
        if perimeter > 0.0 {
            outline.gap = ((f64::from(of_light) - area) / perimeter).clamp(0.0, 1.0);
        }
        outline
    }

    /// The unit vector across the arc between two directions that points inside.
    fn side(&self, a: DVec3, b: DVec3) -> Option<DVec3> {
        let across = a.cross(b).try_normalize()?;
        let inside = across.dot(self.center) >= 0.0;
        Some(if inside { across } else { -across })
    }

    /// The ends of what lies within the outline.
    fn clip(&self, arc: &Arc, directions: &[Vec3]) -> Option<[DVec3; 2]> {
        let [i, j] = arc.cells.map(|c| directions[c as usize].as_dvec3());
        // An end on the other side of the sphere only says that the border leaves between its cells.
        let leaves = || Some(((i + j).normalize_or_zero() - self.side(i, j)?).normalize());
        let [a, b] = match arc.ends {
            [Some(a), Some(b)] => [a, b],
            [Some(a), None] => [a, leaves()?],
            [None, Some(b)] => [leaves()?, b],
            [None, None] => return None,
        };
        let (mut t0, mut t1) = (0.0f64, 1.0f64);
        for side in &self.sides {
            let [at_a, at_b] = [a, b].map(|end| side.dot(end) + self.gap);
            let crossing = at_a / (at_a - at_b);
            match [at_a < 0.0, at_b < 0.0] {
                [false, false] => {}
                [true, true] => return None,
                [true, false] => t0 = t0.max(crossing),
                [false, true] => t1 = t1.min(crossing),
            }
        }
        (t0 < t1).then(|| [t0, t1].map(|t| a.lerp(b, t).normalize_or_zero()))
    }
}
