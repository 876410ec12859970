//! Cones of directions: which way lights shine.

use glam::Vec3;
use std::f32::consts::PI;

/// All directions within an angle of an axis.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Cone {
    /// Of unit length.
    pub axis: Vec3,
    /// Radians, π for all directions.
    pub half_angle: f32,
}

impl Cone {
    /// All directions.
    pub const SPHERE: Self = Self {
        axis: Vec3::Z,
        half_angle: PI,
    };

    /// The solid angle 4π sin²(θ/2), in steradians.
    pub fn solid_angle(self) -> f32 {
        4.0 * PI * (0.5 * self.half_angle).sin().powi(2)
    }

    /// The smallest cone around both, to rounding.
    pub(super) fn union(self, other: Self) -> Self {
        let (wide, narrow) = if self.half_angle >= other.half_angle {
            (self, other)
        } else {
            (other, self)
        };
        let between = wide.axis.angle_between(narrow.axis);
        if between + narrow.half_angle <= wide.half_angle {
            return wide;
        }
        let half_angle = 0.5 * (between + wide.half_angle + narrow.half_angle);
        let across = narrow.axis - wide.axis * wide.axis.dot(narrow.axis);
        match across.try_normalize() {
            Some(across) if half_angle < PI => {
                let (sin, cos) = (half_angle - wide.half_angle).sin_cos();
                Self {
                    axis: (wide.axis * cos + across * sin).normalize(),
                    half_angle,
                }
            }
            _ => Self::SPHERE,
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use tyndall_math::{Key, Purpose, Sampler, warp};

    #[test]
    fn a_union_holds_both_cones_and_touches_them_on_opposite_sides() {
        for index in 0..1000 {
            let key = Key {
                seed: 1,
                purpose: Purpose::Probe,
                index,
            };
            let mut random = Sampler::new(key, 0);
            let [a, b] = [0, 1].map(|_| Cone {
                axis: warp::uniform_sphere(random.next_2d()),
                half_angle: PI * random.next_1d(),
            });
            let both = a.union(b);
            let reach = |cone: Cone| both.axis.angle_between(cone.axis) + cone.half_angle;
            // Rounding of an angle from f32 unit vectors: √ε near 0 and π.
            assert!(both.half_angle >= PI || reach(a).max(reach(b)) < both.half_angle + 1e-3);
            let needed = a.axis.angle_between(b.axis) + a.half_angle + b.half_angle;
            let least = (0.5 * needed).max(a.half_angle).max(b.half_angle);
            assert!(both.half_angle <= least.min(PI) + 1e-3);
        }
        assert_eq!(Cone::SPHERE.solid_angle(), 4.0 * PI);
    }
}
