//! An emitting rectangle.
//!
//! Spherical rectangles are the cheapest shape to sample by solid angle, and most lamps are rectangles.

use super::{Emission, FlatEmitter};
use glam::Vec3;
use tyndall_math::{Ray, SphericalRectangle};
use tyndall_transport::LightSample;

/// A rectangle of one radiance that emits on its front side, or on both.
///
/// Directions are uniform over the spherical rectangle it covers (Ureña, Fajardo and King 2013, "An Area-Preserving
/// Parametrization for Spherical Rectangles"), with density 1/Ω. Where it is seen edge-on, or fills no solid angle that f32
/// could hold, there is no sample and the density is 0.
#[derive(Clone, Debug)]
pub struct QuadLight {
    corner: Vec3,
    edges: [Vec3; 2],
    radiance: Vec3,
    flat: FlatEmitter,
}

impl QuadLight {
    /// The rectangle with a `corner` (metres) and two perpendicular `edges` from it, whose cross product points to
    /// the front. It emits `radiance`, W/(m² sr).
    pub fn new(corner: Vec3, edges: [Vec3; 2], radiance: Vec3, double_sided: bool) -> Self {
        let [x, y] = edges;
        let normal = x.as_dvec3().cross(y.as_dvec3());
        let area = normal.length() as f32;
        let normal = normal.normalize_or_zero().as_vec3();
        let corners = [corner, corner + x, corner + x + y, corner + y];
        Self {
            corner,
            edges,
            radiance,
            flat: FlatEmitter::new(
                &corners,
                normal,
                area,
                Emission::Constant(radiance),
                double_sided,
            ),
        }
    }

    /// Side, area and emission.
    pub fn flat(&self) -> &FlatEmitter {
        &self.flat
    }

    pub(super) fn importance(&self, p: Vec3, normal: Option<Vec3>) -> f32 {
        self.flat.importance(p, normal)
    }

    pub(super) fn importance_along(&self, ray: &Ray, t_max: f32) -> f32 {
        self.flat.importance_along(ray, t_max)
    }

    pub(super) fn sample(&self, p: Vec3, u: [f32; 2]) -> Option<LightSample> {
        let normal = self.flat.normal_towards(p)?;
        let seen = SphericalRectangle::new(p, self.corner, self.edges)?;
        let point = seen.sample(u);
        Some(LightSample {
            w_i: point.direction,
            distance: point.distance,
            radiance: self.radiance,
            pdf: 1.0 / seen.solid_angle(),
            delta: false,
            normal,
            size: self.flat.size(),
        })
    }

    pub(super) fn pdf(&self, p: Vec3, _w_i: Vec3) -> f32 {
        let seen = SphericalRectangle::new(p, self.corner, self.edges);
        match (self.flat.normal_towards(p), seen) {
            (Some(_), Some(seen)) => 1.0 / seen.solid_angle(),
            _ => 0.0,
        }
    }
}
