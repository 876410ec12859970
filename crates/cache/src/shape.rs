//! What a record adds to a blend: logarithms and scaled gradients, computed once when the index is built.
//! Channels lie side by side in groups of four, so that one instruction works on all of a group.

use crate::record::Record;
use glam::{DVec3, Vec3};

/// Channels in a group.
pub(crate) const WIDTH: usize = 4;

/// Bound on |∇ln L|·R; far above what a blend believes and far below overflow.
const MAX_SLOPE: f64 = 1e6;

/// One group of a record's channels; those that the record does not have are 0.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Shape {
    /// ln L, −∞ where L = 0.
    pub(crate) ln_value: [f32; WIDTH],
    /// R ∇ln L by axis, 0 where L = 0.
    pub(crate) slope: [[f32; WIDTH]; 3],
    /// How far noise lowers the mean of ln L: ½v/(1 + 1.5v) with v = Var L/L². 0 where L = 0.
    ///
    /// For a true value of 1 and normal noise of variance s², E ln L = −s²/2 − 3s⁴/4 + …, and as v divides by the noisy value
    /// E v = s² + 3s⁴ + …: of the two second-order terms −1.5 · ½v² is left. Never above ⅓.
    pub(crate) lowered: [f32; WIDTH],
    pub(crate) radius: f32,
}

/// One channel of a record.
#[derive(Clone, Copy, Debug)]
pub(crate) struct Channel {
    pub(crate) ln_value: f32,
    pub(crate) slope: Vec3,
    pub(crate) lowered: f32,
}

impl Shape {
    /// Groups that `n` channels need.
    pub(crate) const fn groups(n: usize) -> usize {
        n.div_ceil(WIDTH)
    }

    /// The group of a record's channels that begins with `first`.
    pub(crate) fn new<const N: usize>(record: &Record<N>, first: usize) -> Self {
        let channel = |lane: usize| (first + lane < N).then_some(first + lane);
        let value = |lane| channel(lane).map_or(0.0, |c| record.value[c]);
        // In f64: the quotient of f32 numbers may overflow.
        let relative = |lane: usize, x: f64| match f64::from(value(lane)) {
            0.0 => 0.0,
            value => x / value,
        };
        let slope = |lane: usize| {
            let gradient = channel(lane).map_or(DVec3::ZERO, |c| record.gradient[c].as_dvec3());
            let slope = gradient * f64::from(record.radius) * relative(lane, 1.0);
            slope.clamp_length_max(MAX_SLOPE).as_vec3()
        };
        Self {
            ln_value: std::array::from_fn(|lane| value(lane).ln()),
            slope: std::array::from_fn(|axis| std::array::from_fn(|lane| slope(lane)[axis])),
            lowered: std::array::from_fn(|lane| {
                let variance = channel(lane).map_or(0.0, |c| f64::from(record.variance[c]));
                let relative = relative(lane, relative(lane, variance));
                (0.5 * relative / (1.0 + 1.5 * relative)) as f32
            }),
            radius: record.radius,
        }
    }

    #[inline]
    pub(crate) fn channel(&self, lane: usize) -> Channel {
        Channel {
            ln_value: self.ln_value[lane],
            slope: Vec3::from(self.slope.map(|axis| axis[lane])),
            lowered: self.lowered[lane],
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_steepest_gradient_of_the_smallest_value_stays_finite() {
        let record = Record {
            position: Vec3::ZERO,
            radius: 1.0,
            value: [1e-45],
            gradient: [Vec3::new(f32::MAX, -f32::MAX, 1.0)],
            variance: [f32::MAX],
        };
        let Channel { slope, lowered, .. } = Shape::new(&record, 0).channel(0);
        assert!(slope.is_finite(), "{slope}");
        assert!(lowered <= 1.0 / 3.0, "{lowered}");
    }
}
