//! Four balls side by side, so that one instruction tests all of them.
//! Cell lists are made of blocks: a lookup reads the balls of its cell in one piece.

use crate::grid::Ball;
use glam::{Vec3, Vec4};

/// Balls in a block.
pub(crate) const WIDTH: usize = 4;

/// Up to four balls, as coordinates of their centres, 1/R and slots.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Block {
    x: Vec4,
    y: Vec4,
    z: Vec4,
    inv_radius: Vec4,
    slots: [u32; WIDTH],
}

impl Block {
    /// Four missing balls: 1/R = ∞, so that they hold no point.
    pub(crate) const EMPTY: Self = Self {
        x: Vec4::ZERO,
        y: Vec4::ZERO,
        z: Vec4::ZERO,
        inv_radius: Vec4::INFINITY,
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
        let x = (Vec4::splat(p.x) - self.x) * self.inv_radius;
        let y = (Vec4::splat(p.y) - self.y) * self.inv_radius;
        let z = (Vec4::splat(p.z) - self.z) * self.inv_radius;
        (x * x + y * y + z * z).cmplt(Vec4::ONE).bitmask()
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
