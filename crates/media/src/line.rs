//! Rays in double precision, for closed forms that subtract.
//!
//! Distances to boundaries and heights above a base are differences of large coordinates; taken in f64 from f32 input
//! they are exact to f32, wherever the scene lies and however grazing the ray.

use glam::DVec3;
use tyndall_math::Ray;

/// A [`Ray`] in f64; distances are in units of `direction`, which has the length 1 of its f32 original, to rounding.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Line {
    pub(crate) origin: DVec3,
    pub(crate) direction: DVec3,
}

impl Line {
    pub(crate) fn at(&self, t: f64) -> DVec3 {
        self.origin + self.direction * t
    }

    /// The line from `a` towards `b` and their distance; `None` where they coincide.
    pub(crate) fn between(a: DVec3, b: DVec3) -> Option<(Self, f64)> {
        let length = (b - a).length();
        (length > 0.0).then(|| {
            let direction = (b - a) / length;
            (
                Self {
                    origin: a,
                    direction,
                },
                length,
            )
        })
    }
}

impl From<&Ray> for Line {
    #[inline]
    fn from(ray: &Ray) -> Self {
        Self {
            origin: ray.origin.as_dvec3(),
            direction: ray.direction.as_dvec3(),
        }
    }
}
