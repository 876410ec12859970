//! A stretch of a straight line, and where it crosses boxes and balls.
//! Each answer is widened by more than the rounding of a point's coordinates, so that no ball that holds a computed point is missed.

use crate::grid::Ball;
use glam::{DVec3, Vec3, Vec4};

/// The points origin + t · direction with t in `range`.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Segment {
    /// The point at t = 0, in the units of your world.
    pub origin: Vec3,
    /// How the point moves with t; of any length.
    pub direction: Vec3,
    /// First and last t; may be infinite.
    pub range: [f32; 2],
}

/// Coordinates of a computed point are off by less than this share of what went into them: two roundings of 2⁻²⁴ along each axis.
const ROUNDING: f64 = 1.0 / (1 << 22) as f64;

impl Segment {
    /// The point at `t`.
    #[inline]
    pub fn at(&self, t: f32) -> Vec3 {
        self.origin + t * self.direction
    }

    /// [`Segment::at`] four times, by axis.
    #[inline]
    pub(crate) fn at_four(&self, t: Vec4) -> [Vec4; 3] {
        [0, 1, 2].map(|axis| self.origin[axis] + t * self.direction[axis])
    }

    /// How far off the line a computed point may be whose coordinates are at most `largest`.
    pub(crate) fn margin(&self, largest: f64) -> f64 {
        ROUNDING * (f64::from(self.origin.abs().max_element()) + largest)
    }

    /// Ends of the part within a box.
    pub(crate) fn clip(&self, [low, high]: [DVec3; 2]) -> Option<[DVec3; 2]> {
        let [origin, direction] = [self.origin.as_dvec3(), self.direction.as_dvec3()];
        // Finite, so that a direction of 0 moves nothing.
        let (mut first, mut last) = (
            f64::from(self.range[0]).max(-f64::MAX),
            f64::from(self.range[1]).min(f64::MAX),
        );
        for axis in 0..3 {
            let [to_low, to_high] = [low, high].map(|face| face[axis] - origin[axis]);
            if direction[axis] != 0.0 {
                let [a, b] = [to_low, to_high].map(|way| way / direction[axis]);
                first = first.max(a.min(b));
                last = last.min(a.max(b));
            } else if to_low > 0.0 || to_high < 0.0 {
                return None;
            }
        }
        (first <= last).then(|| [first, last].map(|t| origin + t * direction))
    }

    /// First and last t in a ball.
    pub(crate) fn crossing(&self, ball: &Ball) -> Option<[f32; 2]> {
        let direction = self.direction.as_dvec3();
        let from_centre = self.origin.as_dvec3() - ball.centre.as_dvec3();
        let largest = f64::from(ball.centre.abs().max_element()) + f64::from(ball.radius);
        let reach = f64::from(ball.radius) * (1.0 + 1e-6) + self.margin(largest);
        // A direction of 0 stays where it is for all t.
        let squared = direction.length_squared().max(f64::MIN_POSITIVE);
        let middle = -from_centre.dot(direction) / squared;
        let height = from_centre + middle * direction;
        let half = ((reach * reach - height.length_squared()) / squared).sqrt();
        let [first, last] = self.range;
        let enter = ((middle - half) as f32).next_down().max(first);
        let exit = ((middle + half) as f32).next_up().min(last);
        // A ball that is passed by has no root.
        (half >= 0.0 && enter <= exit).then_some([enter, exit])
    }
}
