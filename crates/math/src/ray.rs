//! Rays: an origin, a unit direction, and nothing else.
//!
//! Limits on distance travel beside a ray, because callers narrow them far more often than they change the ray.

use glam::Vec3;

/// A half line in world space.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Ray {
    /// Where the ray starts, in metres.
    pub origin: Vec3,
    /// Unit direction of travel.
    pub direction: Vec3,
}

impl Ray {
    /// A ray from `origin` along the unit vector `direction`.
    pub fn new(origin: Vec3, direction: Vec3) -> Self {
        debug_assert!(
            (direction.length_squared() - 1.0).abs() < 1e-3,
            "ray direction {direction} is not of unit length"
        );
        Self { origin, direction }
    }

    /// The point at distance `t` (metres).
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + self.direction * t
    }
}
