//! Directions that cover the sphere evenly without random clumps.

use glam::{Quat, Vec3};
use std::f32::consts::TAU;

/// `n` directions on a spiral from pole to pole, turned as a whole.
///
/// zᵢ = 1 − (2i + 1)/n,  φᵢ = 2π i/Φ,  Φ = (1 + √5)/2.
///
/// Each direction stands for 4π/n steradians. With a random rotation, sums over the set are unbiased.
/// Swinbank and Purser 2006, "Fibonacci grids: A novel approach to global modelling", with half-step offsets.
#[derive(Clone, Copy, Debug)]
pub struct SphericalFibonacci {
    n: u32,
    rotation: Quat,
}

impl SphericalFibonacci {
    /// `n` directions, turned by the rotation that three uniform numbers `u` choose evenly among all.
    pub fn new(n: u32, u: [f32; 3]) -> Self {
        // Shoemake 1992, "Uniform Random Rotations", Graphics Gems III.
        let (s1, c1) = (TAU * u[1]).sin_cos();
        let (s2, c2) = (TAU * u[2]).sin_cos();
        let (a, b) = ((1.0 - u[0]).sqrt(), u[0].sqrt());
        Self {
            n,
            rotation: Quat::from_xyzw(a * s1, a * c1, b * s2, b * c2).normalize(),
        }
    }

    /// The rotation of the set as a whole.
    pub fn rotation(&self) -> Quat {
        self.rotation
    }

    /// The directions, in order of the spiral.
    pub fn iter(self) -> impl ExactSizeIterator<Item = Vec3> {
        (0..self.n).map(move |i| self.direction(i))
    }

    /// Direction number `i` < n.
    pub fn direction(&self, i: u32) -> Vec3 {
        debug_assert!(i < self.n);
        let x = (2.0 * i as f32 + 1.0) / self.n as f32;
        // √(1 − z²) of z = 1 − x, without cancellation at the poles.
        let r = (x * (2.0 - x)).max(0.0).sqrt();
        // f64: i/Φ loses its fraction to f32 after some ten thousand turns.
        let turn = (f64::from(i) * INVERSE_GOLDEN_RATIO).fract() as f32;
        let (sin, cos) = (TAU * turn).sin_cos();
        (self.rotation * Vec3::new(r * cos, r * sin, 1.0 - x)).normalize()
    }
}

/// 1/Φ = (√5 − 1)/2, whose multiples are spread most evenly over [0, 1) when only their fractions count.
pub const INVERSE_GOLDEN_RATIO: f64 = 0.618_033_988_749_894_9;

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Directions, assert_conforms};

    #[test]
    fn moments_of_the_set_are_those_of_the_sphere() {
        for n in [64, 1000] {
            let set = SphericalFibonacci::new(n, [0.3, 0.8, 0.1]);
            let mut first = Vec3::ZERO;
            let mut second = Vec3::ZERO;
            for d in set.iter() {
                first += d / n as f32;
                second += d * d / n as f32;
            }
            // The rule converges faster than 1/n; 1/n already shows a wrong spiral.
            assert!(first.length() < 1.0 / n as f32);
            assert!((second - 1.0 / 3.0).length() < 1.0 / n as f32);
            assert_eq!(set.iter().len(), n as usize);
        }
    }

    #[test]
    fn neighbours_keep_the_distance_of_an_even_cover() {
        let set: Vec<Vec3> = SphericalFibonacci::new(500, [0.6, 0.2, 0.9])
            .iter()
            .collect();
        // n disks of hexagonal packing have centres √(8π/(√3 n)) apart; the spiral keeps 0.8 of it.
        let packed = (8.0 * std::f32::consts::PI / (3.0_f32.sqrt() * 500.0)).sqrt();
        for (i, a) in set.iter().enumerate() {
            for b in &set[..i] {
                assert!(a.distance(*b) > 0.8 * packed);
            }
        }
    }

    #[test]
    fn a_random_rotation_takes_a_member_evenly_over_the_sphere() {
        let mut third = 0.0;
        assert_conforms(
            &Directions::sphere(),
            11,
            |u| {
                third = (third + 0.618_034_f32).fract();
                let d = SphericalFibonacci::new(50, [u[0], u[1], third]).direction(7);
                Some((d, 0.25 / std::f32::consts::PI))
            },
            |_| 0.25 / std::f32::consts::PI,
        );
    }
}
