//! A lamp without extent that shines equally into all directions.

use glam::Vec3;
use std::f32::consts::PI;
use tyndall_math::Ray;
use tyndall_transport::LightSample;
use tyndall_transport::importance::{bounded, facing, inverse_square_along, mean};
use tyndall_transport::light_tree::{Cone, LightBounds};

/// An isotropic lamp at a point.
#[derive(Clone, Copy, Debug)]
pub struct PointLight {
    position: Vec3,
    intensity: Vec3,
}

impl PointLight {
    /// A lamp at `position` (metres) of radiant `intensity` (W/sr).
    pub fn new(position: Vec3, intensity: Vec3) -> Self {
        Self {
            position,
            intensity,
        }
    }

    /// Where the lamp hangs, in metres.
    pub fn position(&self) -> Vec3 {
        self.position
    }

    /// Radiant intensity, W/sr.
    pub fn intensity(&self) -> Vec3 {
        self.intensity
    }

    /// Radiant power 4π I, in W.
    pub fn power(&self) -> Vec3 {
        self.intensity * (4.0 * PI)
    }

    /// Its place; it shines in all directions.
    pub(super) fn bounds(&self) -> LightBounds {
        LightBounds {
            center: self.position,
            radius: 0.0,
            cone: Cone::SPHERE,
            intensity: bounded(mean(self.intensity)),
        }
    }

    pub(super) fn importance(&self, p: Vec3, normal: Option<Vec3>) -> f32 {
        let fluence = mean(self.intensity) / self.position.distance_squared(p);
        fluence * facing(p, normal, self.position, 0.0)
    }

    pub(super) fn importance_along(&self, ray: &Ray, t_max: f32) -> f32 {
        mean(self.intensity) * inverse_square_along(ray, self.position, 0.0, [0.0, t_max])
    }

    pub(super) fn sample(&self, p: Vec3, _u: [f32; 2]) -> Option<LightSample> {
        towards_lamp(p, self.position, |_| self.intensity)
    }
}

/// The one way from `p` to a lamp without extent; `intensity` is given the direction from `p` to the lamp.
///
/// `None` where the lamp sends nothing there, or where `p` is so near that 1/r² is not a number.
pub(super) fn towards_lamp(
    p: Vec3,
    lamp: Vec3,
    intensity: impl FnOnce(Vec3) -> Vec3,
) -> Option<LightSample> {
    let to_lamp = lamp - p;
    let distance = to_lamp.length();
    let w_i = to_lamp / distance;
    let radiance = intensity(w_i) / (distance * distance);
    (w_i.is_finite() && radiance.is_finite() && radiance.max_element() > 0.0).then_some(
        LightSample {
            w_i,
            distance,
            radiance,
            pdf: 1.0,
            delta: true,
            normal: Vec3::ZERO,
            size: 0.0,
        },
    )
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    fn lamp() -> PointLight {
        PointLight::new(Vec3::new(1.0, 2.0, 3.0), Vec3::new(8.0, 4.0, 0.0))
    }

    #[test]
    fn radiance_falls_with_the_square_of_the_distance() {
        let s = lamp().sample(Vec3::new(1.0, 2.0, 1.0), [0.0; 2]).unwrap();
        assert_eq!((s.w_i, s.distance), (Vec3::Z, 2.0));
        assert_eq!(s.radiance, Vec3::new(2.0, 1.0, 0.0));
        assert!(s.delta && s.pdf == 1.0);
    }

    #[test]
    fn at_the_lamp_itself_there_is_no_sample_and_a_finite_or_infinite_importance() {
        let position = lamp().position();
        for offset in [0.0, 1e-30, 1e-25] {
            assert!(
                lamp()
                    .sample(position + Vec3::X * offset, [0.0; 2])
                    .is_none()
            );
            assert!(lamp().importance(position, None) > 0.0);
        }
        let through = Ray::new(position - Vec3::X, Vec3::X);
        let importance = lamp().importance_along(&through, 2.0);
        assert!(importance.is_finite() && importance > 0.0);
    }

    #[test]
    fn a_surface_that_faces_away_gets_nothing_and_a_facing_one_something() {
        let p = Vec3::new(1.0, 2.0, 1.0);
        assert_eq!(lamp().importance(p, Some(Vec3::NEG_Z)), 0.0);
        assert_eq!(
            lamp().importance(p, Some(Vec3::Z)),
            lamp().importance(p, None)
        );
    }

    #[test]
    fn importance_along_a_ray_is_the_integral_of_importance() {
        // ∫₀⁴ dt / (1 + (t − 1)²) = atan 3 + atan 1, with mean intensity 4.
        let ray = Ray::new(Vec3::new(0.0, 2.0, 2.0), Vec3::X);
        let expected = 4.0 * (3f32.atan() + 1f32.atan());
        let found = lamp().importance_along(&ray, 4.0);
        assert!(
            (found / expected - 1.0).abs() < 5e-5,
            "what the arctangent is good for: {found}"
        );
    }
}
