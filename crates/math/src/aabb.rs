//! Axis-aligned boxes: bounds of geometry, of media, and of what a cache covers.
//!
//! Boxes are closed sets; a box without points is written with `min` above `max`.

use crate::Ray;
use glam::Vec3;

/// All points p with min ≤ p ≤ max in every coordinate, in metres.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Aabb {
    /// Smallest coordinates.
    pub min: Vec3,
    /// Largest coordinates.
    pub max: Vec3,
}

impl Aabb {
    /// The box without points, neutral under [`Aabb::union`].
    pub const EMPTY: Self = Self {
        min: Vec3::INFINITY,
        max: Vec3::NEG_INFINITY,
    };

    /// The box with opposite corners `a` and `b`, in any order.
    pub fn from_corners(a: Vec3, b: Vec3) -> Self {
        Self {
            min: a.min(b),
            max: a.max(b),
        }
    }

    /// Whether the box has no point.
    pub fn is_empty(&self) -> bool {
        !self.min.cmple(self.max).all()
    }

    /// The smallest box around both.
    pub fn union(self, other: Self) -> Self {
        Self {
            min: self.min.min(other.min),
            max: self.max.max(other.max),
        }
    }

    /// The smallest box around this one and the point `p`.
    pub fn grow(self, p: Vec3) -> Self {
        Self {
            min: self.min.min(p),
            max: self.max.max(p),
        }
    }

    /// The middle. Meaningless for an empty box.
    pub fn center(&self) -> Vec3 {
        // Halved before the sum, which then cannot overflow.
        0.5 * self.min + 0.5 * self.max
    }

    /// Length from corner to opposite corner, in metres; 0 for an empty box.
    pub fn diagonal(&self) -> f32 {
        if self.is_empty() {
            0.0
        } else {
            (self.max - self.min).length()
        }
    }

    /// Whether `p` lies inside or on the boundary.
    pub fn contains(&self, p: Vec3) -> bool {
        self.min.cmple(p).all() && p.cmple(self.max).all()
    }

    /// The distances at which `ray` enters and leaves the box, cut to [0, `t_max`]; `None` where it misses.
    ///
    /// `t_max` may be infinite. A ray that runs inside a face counts as inside; one that only touches gives entry = exit.
    /// Kay and Kajiya 1986 (slabs), with directions parallel to a slab decided by the origin instead of by 0/0.
    pub fn clip(&self, ray: &Ray, t_max: f32) -> Option<(f32, f32)> {
        let (mut enter, mut leave) = (0.0_f32, t_max);
        for axis in 0..3 {
            let (o, d) = (ray.origin[axis], ray.direction[axis]);
            let (min, max) = (self.min[axis], self.max[axis]);
            if d == 0.0 {
                if o < min || o > max {
                    return None;
                }
                continue;
            }
            let (near, far) = if d > 0.0 { (min, max) } else { (max, min) };
            enter = enter.max((near - o) / d);
            leave = leave.min((far - o) / d);
        }
        (enter <= leave).then_some((enter, leave))
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    const UNIT: Aabb = Aabb {
        min: Vec3::ZERO,
        max: Vec3::ONE,
    };

    #[test]
    fn the_empty_box_holds_nothing_and_vanishes_in_a_union() {
        assert!(Aabb::EMPTY.is_empty());
        assert_eq!(Aabb::EMPTY.diagonal(), 0.0);
        assert_eq!(Aabb::EMPTY.union(UNIT), UNIT);
        assert_eq!(Aabb::EMPTY.grow(Vec3::ONE).grow(Vec3::ZERO), UNIT);
        for d in [Vec3::X, Vec3::NEG_Y, Vec3::new(0.6, 0.0, -0.8)] {
            let ray = Ray::new(Vec3::ZERO, d);
            assert_eq!(Aabb::EMPTY.clip(&ray, f32::INFINITY), None);
        }
    }

    #[test]
    fn rays_along_an_axis_are_clipped_even_inside_a_face() {
        let clip = |o: [f32; 3], d: Vec3| UNIT.clip(&Ray::new(o.into(), d), f32::INFINITY);
        assert_eq!(clip([-1.0, 0.5, 0.5], Vec3::X), Some((1.0, 2.0)));
        assert_eq!(clip([-1.0, 0.0, 1.0], Vec3::X), Some((1.0, 2.0)));
        assert_eq!(clip([-1.0, 1.1, 0.5], Vec3::X), None);
        assert_eq!(clip([0.25, 0.5, 0.5], Vec3::NEG_X), Some((0.0, 0.25)));
        assert_eq!(clip([2.0, 0.5, 0.5], Vec3::X), None);
        assert_eq!(
            UNIT.clip(&Ray::new(Vec3::new(0.5, 0.5, -1.0), Vec3::Z), 1.5),
            Some((1.0, 1.5))
        );
        assert_eq!(
            UNIT.clip(&Ray::new(Vec3::new(0.5, 0.5, -1.0), Vec3::Z), 0.5),
            None
        );
    }

    proptest! {
        #[test]
        fn ends_of_a_clip_lie_on_the_boundary_and_its_middle_inside(
            o in prop::array::uniform3(-3.0f32..3.0), target in prop::array::uniform3(0.01f32..0.99)
        ) {
            let o = Vec3::from(o);
            prop_assume!(o.distance(Vec3::from(target)) > 1e-3);
            let ray = Ray::new(o, (Vec3::from(target) - o).normalize());
            let (t0, t1) = UNIT.clip(&ray, f32::INFINITY).ok_or(TestCaseError::fail("a ray to a point inside must hit"))?;
            prop_assert!(UNIT.contains(ray.at(0.5 * (t0 + t1))));
            let end = ray.at(t1);
            // Rounding of coordinates up to 3 and distances up to 7.
            let to_boundary = (end - 0.5).abs().max_element() - 0.5;
            prop_assert!(to_boundary.abs() < 4e-6);
            prop_assert!(t0 > 0.0 || UNIT.contains(o));
        }
    }
}
