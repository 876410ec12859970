//! What flat emitters have in common: a side, an area, and an estimate of the light they bring.

use super::Emission;
use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, PI};
use tyndall_math::Ray;
use tyndall_transport::importance::{bounded, facing, inverse_square_along};
use tyndall_transport::light_tree::{Cone, LightBounds};

/// A flat patch that emits on its front side, or on both.
#[derive(Clone, Debug)]
pub struct FlatEmitter {
    center: Vec3,
    normal: Vec3,
    area: f32,
    /// Square of the radius of a sphere around `center` that holds the patch.
    radius_squared: f32,
    emission: Emission,
    double_sided: bool,
}

impl FlatEmitter {
    /// A patch with `corners`, given its unit `normal` on the front side and its `area` in m².
    pub(super) fn new(
        corners: &[Vec3],
        normal: Vec3,
        area: f32,
        emission: Emission,
        double_sided: bool,
    ) -> Self {
        let center = corners.iter().sum::<Vec3>() / corners.len() as f32;
        let radius_squared = corners
            .iter()
            .map(|corner| corner.distance_squared(center))
            .fold(0.0, f32::max);
        Self {
            center,
            normal,
            area,
            radius_squared,
            emission,
            double_sided,
        }
    }

    /// Mean of the corners, in metres.
    pub fn center(&self) -> Vec3 {
        self.center
    }

    /// Unit normal of the front side.
    pub fn normal(&self) -> Vec3 {
        self.normal
    }

    /// Area of one side, in m².
    pub fn area(&self) -> f32 {
        self.area
    }

    /// A bound on the distance of two of its points, in metres.
    pub(super) fn size(&self) -> f32 {
        2.0 * self.radius_squared.sqrt()
    }

    /// What it emits.
    pub fn emission(&self) -> &Emission {
        &self.emission
    }

    /// Whether the back emits like the front.
    pub fn double_sided(&self) -> bool {
        self.double_sided
    }

    /// Radiant power π A L of all sides that emit, in W.
    pub fn power(&self) -> Vec3 {
        let sides = if self.double_sided { 2.0 } else { 1.0 };
        self.emission.mean() * (PI * self.area * sides)
    }

    /// A sphere around it and the directions it shines in, with a mean cosine of 1/2.
    pub(super) fn bounds(&self) -> LightBounds {
        let cone = if self.double_sided {
            Cone::SPHERE
        } else {
            Cone {
                axis: self.normal,
                half_angle: FRAC_PI_2,
            }
        };
        LightBounds {
            center: self.center,
            radius: self.radius_squared.sqrt(),
            cone,
            intensity: bounded(0.5 * self.emission.weight() * self.area),
        }
    }

    /// Distance of `p` from the plane, positive in front.
    fn height(&self, p: Vec3) -> f32 {
        (p - self.center).dot(self.normal)
    }

    /// The unit normal on the side of `p`; `None` where that side does not emit, or `p` lies in the plane.
    pub(super) fn normal_towards(&self, p: Vec3) -> Option<Vec3> {
        let height = self.height(p);
        if height > 0.0 {
            Some(self.normal)
        } else if height < 0.0 && self.double_sided {
            Some(-self.normal)
        } else {
            None
        }
    }

    /// L A cosθ / max(d², A), with the cosine at the emitter bounded over the patch: 0 only behind it.
    pub(super) fn importance(&self, p: Vec3, normal: Option<Vec3>) -> f32 {
        if self.normal_towards(p).is_none() {
            return 0.0;
        }
        let distance_squared = self.center.distance_squared(p);
        let radius = self.radius_squared.sqrt();
        let cosine =
            (self.height(p).abs() + radius) / (distance_squared + self.radius_squared).sqrt();
        let fluence =
            self.emission.weight() * self.area * cosine.min(1.0) / distance_squared.max(self.area);
        fluence * facing(p, normal, self.center, radius)
    }

    /// ∫ L A / (r² + h² + (t − t₀)²) dt over the part of the ray in front of the patch: h is the distance of the centre
    /// from the line, r the patch's radius.
    pub(super) fn importance_along(&self, ray: &Ray, t_max: f32) -> f32 {
        let (mut start, mut end) = (0.0, t_max);
        if !self.double_sided {
            let height = self.height(ray.origin);
            let rise = ray.direction.dot(self.normal);
            // Where the ray crosses the plane; ±∞ or NaN where it runs along it.
            let crossing = -height / rise;
            if rise > 0.0 {
                start = crossing.max(start);
            } else if rise < 0.0 {
                end = crossing.min(end);
            } else if height <= 0.0 {
                return 0.0;
            }
            if start >= end {
                return 0.0;
            }
        }
        let integral = inverse_square_along(ray, self.center, self.radius_squared, [start, end]);
        self.emission.weight() * self.area * integral
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    fn patch(double_sided: bool) -> FlatEmitter {
        let corners = [
            Vec3::new(-1.0, -0.5, 0.0),
            Vec3::new(1.0, -0.5, 0.0),
            Vec3::new(1.0, 0.5, 0.0),
            Vec3::new(-1.0, 0.5, 0.0),
        ];
        FlatEmitter::new(
            &corners,
            Vec3::Z,
            2.0,
            Emission::Constant(Vec3::splat(3.0)),
            double_sided,
        )
    }

    #[test]
    fn behind_a_one_sided_patch_nothing_arrives_and_in_front_something_does() {
        for p in [
            Vec3::Z,
            Vec3::new(9.0, 0.0, 1e-6),
            Vec3::new(0.2, 0.1, 1e-3),
        ] {
            let mirrored = p * Vec3::new(1.0, 1.0, -1.0);
            assert!(patch(false).importance(p, None) > 0.0);
            assert_eq!(patch(false).importance(mirrored, None), 0.0);
            assert!(patch(true).importance(mirrored, None) > 0.0);
        }
    }

    #[test]
    fn far_away_the_importance_is_the_fluence() {
        let p = Vec3::new(30.0, 0.0, 40.0);
        // L A cosθ / d²; the patch spans 2 % of the distance and the bound on the cosine adds r/d.
        let expected = 3.0 * 2.0 * 0.8 / 2500.0;
        let found = patch(false).importance(p, None);
        assert!((found / expected - 1.0).abs() < 0.05, "{found} {expected}");
    }

    #[test]
    fn a_ray_counts_only_where_it_runs_in_front() {
        let through = Ray::new(Vec3::new(0.0, 0.0, 2.0), Vec3::NEG_Z);
        let half = patch(false).importance_along(&through, 2.0);
        let whole = patch(false).importance_along(&through, 4.0);
        let both = patch(true).importance_along(&through, 4.0);
        // Twice what the estimate's arctangent is good for.
        assert!(half > 0.0 && (whole / half - 1.0).abs() < 1e-4);
        assert!((both / half - 2.0).abs() < 2e-4);
        let behind = Ray::new(Vec3::new(0.0, 0.0, -1.0), Vec3::NEG_Z);
        assert_eq!(patch(false).importance_along(&behind, 4.0), 0.0);
        let in_the_plane = Ray::new(Vec3::new(-5.0, 0.0, 0.0), Vec3::X);
        assert_eq!(patch(false).importance_along(&in_the_plane, 4.0), 0.0);
    }
}
