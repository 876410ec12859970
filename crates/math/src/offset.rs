//! Ray origins that clear the surface they leave.
//!
//! A hit point is rounded to either side of its surface; a ray from it must neither meet that surface again nor skip the next one.

use glam::Vec3;

/// Below this coordinate (metres) a fixed distance is larger than one of 256 roundings.
const NEAR_ZERO: f32 = 1.0 / 32.0;
/// The fixed distance used there, metres per unit of normal.
const NEAR_ZERO_STEP: f32 = 1.0 / 65_536.0;
/// Roundings (units in the last place) per unit of normal everywhere else.
const ULPS: f32 = 256.0;

/// The point `p` of a surface moved along the unit vector `n`, far enough that a ray from it does not meet the surface again.
///
/// `n` points to the side the new ray leaves to. Each coordinate moves by 256 n units in its last place, so the step grows
/// with the rounding of `p` itself; near zero, where those units vanish, it moves by n/65536 metres.
///
/// Wächter and Binder 2019, "A Fast and Robust Method for Avoiding Self-Intersection", Ray Tracing Gems, listing 6-1.
pub fn offset_origin(p: Vec3, n: Vec3) -> Vec3 {
    let step = |p: f32, n: f32| {
        if p.abs() < NEAR_ZERO {
            p + NEAR_ZERO_STEP * n
        } else {
            // Neighbouring floats have neighbouring bit patterns, ordered by magnitude.
            let ulps = (ULPS * n) as i32;
            let towards_larger_magnitude = if p < 0.0 { -ulps } else { ulps };
            f32::from_bits(p.to_bits().wrapping_add_signed(towards_larger_magnitude))
        }
    };
    Vec3::new(step(p.x, n.x), step(p.y, n.y), step(p.z, n.z))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_origin_moves_to_the_side_of_the_normal_by_some_hundred_roundings(
            p in prop::array::uniform3(-1e4f32..1e4), z in -1.0f32..=1.0, phi in 0.0f32..6.3
        ) {
            let p = Vec3::from(p);
            let r = (1.0 - z * z).sqrt();
            let n = Vec3::new(r * phi.cos(), r * phi.sin(), z).normalize();
            let moved = (offset_origin(p, n) - p).dot(n);
            prop_assert!(moved > 0.0);
            // 256 units in the last place of the largest coordinate, times √3 for three of them.
            prop_assert!(moved <= 2.0 * (256.0 * f32::EPSILON * p.abs().max_element() + NEAR_ZERO_STEP));
        }
    }
}
