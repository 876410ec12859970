//! An emitting triangle.
//!
//! It is sampled by the solid angle it fills, so that points in fog close to it see no 1/r².

use super::{Emission, FlatEmitter};
use crate::hierarchy::geometric_normal;
use glam::Vec3;
use tyndall_math::{Ray, SphericalTriangle};
use tyndall_transport::LightSample;

/// A triangle that emits on its front side, or on both.
///
/// Directions are uniform over the spherical triangle it covers, with density 1/Ω. Where it is seen edge-on, or fills no
/// solid angle that f32 could hold, there is no sample and the density is 0.
#[derive(Clone, Debug)]
pub struct TriangleLight {
    corners: [Vec3; 3],
    flat: FlatEmitter,
}

impl TriangleLight {
    /// The triangle of `corners` (metres), counter-clockwise seen from the front.
    pub fn new(corners: [Vec3; 3], emission: Emission, double_sided: bool) -> Self {
        let [a, b, c] = corners.map(|corner| corner.as_dvec3());
        let area = 0.5 * (b - a).cross(c - a).length();
        let normal = geometric_normal(corners);
        Self {
            corners,
            flat: FlatEmitter::new(&corners, normal, area as f32, emission, double_sided),
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
        let seen = SphericalTriangle::new(p, self.corners)?;
        let point = seen.sample(u);
        let radiance = self.flat.emission().radiance(point.barycentric.into());
        (radiance != Vec3::ZERO).then(|| LightSample {
            w_i: point.direction,
            distance: point.distance,
            radiance,
            pdf: 1.0 / seen.solid_angle(),
            delta: false,
            normal,
            size: self.flat.size(),
        })
    }

    pub(super) fn pdf(&self, p: Vec3, _w_i: Vec3) -> f32 {
        match (
            self.flat.normal_towards(p),
            SphericalTriangle::new(p, self.corners),
        ) {
            (Some(_), Some(seen)) => 1.0 / seen.solid_angle(),
            _ => 0.0,
        }
    }
}
