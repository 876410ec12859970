//! Four balls side by side, so that one instruction tests all of them.
//! Cell lists are made of blocks: a lookup reads the balls of its cell in one piece.

use crate::grid::Ball;
use glam::{DVec3, Vec3, Vec4};

/// Balls in a block.
pub(crate) const WIDTH: usize = 4;

/// Up to four balls, as coordinates of their centres, 1/R and slots.
///
/// Arrays, not vectors: choosing a lane of a vector that cannot be foretold is a jump that cannot be foretold.
#[derive(Clone, Copy, Debug)]
#[repr(align(16))]
pub(crate) struct Block {
    x: [f32; WIDTH],
    y: [f32; WIDTH],
    z: [f32; WIDTH],
    inv_radius: [f32; WIDTH],
    slots: [u32; WIDTH],
}

/// A straight way between two points, measured in units that keep its squares from overflow.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Span {
    start: Vec3,
    unit: f32,
    inv_unit: f32,
    /// Way from start to end, in units.
    way: Vec3,
    /// way/way²; 0 for a way of 0.
    inverse: Vec3,
    margin: f32,
}

impl Span {
    pub(crate) fn new([start, end]: [DVec3; 2], unit: f64, margin: f64) -> Self {
        let way = ((end - start) / unit).as_vec3();
        let squared = way.length_squared();
        Self {
            start: start.as_vec3(),
            unit: unit as f32,
            inv_unit: (1.0 / unit) as f32,
            way,
            inverse: if squared > 0.0 {
                way / squared
            } else {
                Vec3::ZERO
            },
            margin: margin as f32,
        }
    }
}

impl Block {
    /// Four missing balls: 1/R = ∞, so that they hold no point.
    pub(crate) const EMPTY: Self = Self {
        x: [0.0; WIDTH],
        y: [0.0; WIDTH],
        z: [0.0; WIDTH],
        inv_radius: [f32::INFINITY; WIDTH],
        slots: [0; WIDTH],
    };

    /// Puts a ball into a lane.
    pub(crate) fn set(&mut self, lane: usize, ball: &Ball, slot: u32) {
        self.x[lane] = ball.centre.x;
        self.y[lane] = ball.centre.y;
        self.z[lane] = ball.centre.z;
        self.inv_radius[lane] = 1.0 / ball.radius;
        self.slots[lane] = slot;
    }

    /// The slot of a ball.
    #[inline]
    pub(crate) fn slot(&self, lane: usize) -> usize {
        self.slots[lane] as usize
    }

    /// Bit `lane` tells whether that ball holds `p`: |p − x|²/R² < 1.
    ///
    /// Divided before it is squared, so that neither huge nor tiny worlds overflow. The operations are those of
    /// [`Block::offset`] and `Vec3::length_squared`, in their order: both agree to the bit.
    #[inline]
    pub(crate) fn holding(&self, p: Vec3) -> u32 {
        let inv_radius = Vec4::from(self.inv_radius);
        let x = (p.x - Vec4::from(self.x)) * inv_radius;
        let y = (p.y - Vec4::from(self.y)) * inv_radius;
        let z = (p.z - Vec4::from(self.z)) * inv_radius;
        (x * x + y * y + z * z).cmplt(Vec4::ONE).bitmask()
    }

    /// Bit `lane` tells whether that ball may come within a margin of a span.
    #[inline]
    pub(crate) fn near(&self, span: &Span) -> u32 {
        let inv_radius = Vec4::from(self.inv_radius);
        let x = (span.start.x - Vec4::from(self.x)) * span.inv_unit;
        let y = (span.start.y - Vec4::from(self.y)) * span.inv_unit;
        let z = (span.start.z - Vec4::from(self.z)) * span.inv_unit;
        let nearest = -(x * span.inverse.x + y * span.inverse.y + z * span.inverse.z);
        let nearest = nearest.max(Vec4::ZERO).min(Vec4::ONE);
        let x = x + nearest * span.way.x;
        let y = y + nearest * span.way.y;
        let z = z + nearest * span.way.z;
        let squared = inv_radius * span.unit;
        let squared = (x * x + y * y + z * z) * (squared * squared);
        let reach = 1.0 + inv_radius * span.margin;
        // Where a product overflows nothing is known, and the ball stays in.
        let is_far = squared.cmpgt(reach * reach);
        (!is_far & inv_radius.cmplt(Vec4::INFINITY)).bitmask()
    }

    /// The ball in a lane.
    pub(crate) fn ball(&self, lane: usize) -> Ball {
        Ball {
            centre: Vec3::new(self.x[lane], self.y[lane], self.z[lane]),
            radius: 1.0 / self.inv_radius[lane],
        }
    }

    /// (p − x)/R for one ball.
    #[inline]
    pub(crate) fn offset(&self, lane: usize, p: Vec3) -> Vec3 {
        (p - Vec3::new(self.x[lane], self.y[lane], self.z[lane])) * self.inv_radius[lane]
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn a_missing_ball_holds_no_point_and_a_present_one_its_own_points() {
        let ball = |x| Ball {
            centre: Vec3::new(x, 0.0, 0.0),
            radius: 2.0,
        };
        let mut block = Block::EMPTY;
        for (lane, x) in [0.0, 1.0, 5.0].into_iter().enumerate() {
            block.set(lane, &ball(x), 70 + lane as u32);
        }
        assert_eq!(block.slot(1), 71);
        assert_eq!(block.holding(Vec3::ZERO), 0b011);
        assert_eq!(block.holding(Vec3::new(4.0, 0.0, 0.0)), 0b100);
        assert_eq!(block.holding(Vec3::new(0.0, 2.0, 0.0)), 0b000, "the rim");
        assert_eq!(block.holding(Vec3::MAX), 0);
        assert_eq!(block.holding(Vec3::NAN), 0);
        assert_eq!(block.offset(1, Vec3::ZERO), Vec3::new(-0.5, 0.0, 0.0));
    }
}
