//! The surfaces that bound what can be said around a point: the planes of the nearest two, and how far the next one is.
//!
//! Light jumps from one side of a wall to the other; what is known at a point holds on its own side alone.

use crate::world::SurfaceHit;
use glam::Vec3;
use serde::{Deserialize, Serialize};

/// Hits count as on a plane within this share of their distance, where their normals differ by less than 2.6°.
const COPLANAR: f32 = 1e-3;
const SAME_NORMAL: f32 = 0.999;

/// The half-space in front of a surface.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Plane {
    normal: Vec3,
    offset: f32,
}

impl Plane {
    /// All space: no surface bounds it.
    const NONE: Self = Self {
        normal: Vec3::ZERO,
        offset: f32::NEG_INFINITY,
    };

    fn of(hit: &SurfaceHit) -> Self {
        Self {
            normal: hit.normal,
            offset: hit.normal.dot(hit.position),
        }
    }

    fn holds(&self, p: Vec3) -> bool {
        self.normal.dot(p) > self.offset
    }

    fn is_plane_of(&self, hit: &SurfaceHit) -> bool {
        self.normal.dot(hit.normal) > SAME_NORMAL
            && (self.normal.dot(hit.position) - self.offset).abs() < COPLANAR * hit.t
    }
}

/// The nearest surfaces around a point.
#[derive(Clone, Copy, Debug, PartialEq, Serialize, Deserialize)]
pub struct Walls {
    planes: [Plane; 2],
    /// Distance in metres to the nearest surface that is in neither plane; infinite where there is none.
    pub beyond: f32,
}

impl Walls {
    /// Nothing bounds what is known.
    pub const NONE: Self = Self {
        planes: [Plane::NONE; 2],
        beyond: f32::INFINITY,
    };

    /// The walls that rays from one point have hit.
    pub(crate) fn new<'h>(hits: impl Iterator<Item = &'h SurfaceHit> + Clone) -> Self {
        let mut planes = [Plane::NONE; 2];
        let nearest = |planes: &[Plane]| {
            (hits.clone())
                .filter(|hit| !planes.iter().any(|plane| plane.is_plane_of(hit)))
                .min_by(|a, b| a.t.total_cmp(&b.t))
        };
        for n in 0..planes.len() {
            if let Some(hit) = nearest(&planes[..n]) {
                planes[n] = Plane::of(hit);
            }
        }
        let beyond = nearest(&planes).map_or(f32::INFINITY, |hit| hit.t);
        Self { planes, beyond }
    }

    /// Whether `p` lies in front of both walls.
    pub fn hold(&self, p: Vec3) -> bool {
        self.planes.iter().all(|plane| plane.holds(p))
    }
}
