//! Ray origins that clear the surface they leave.
//!
//! A hit point is rounded to either side of its surface; a ray from it must neither meet that surface again nor skip the next one.

use glam::Vec3;

/// Length of the step in units of the coordinates that were rounded: 32 roundings of f32, 2⁻¹⁹. Of a million hits on triangles of
/// all shapes with rays leaving at down to 10⁻⁴ above the surface, 6 needed 16 roundings and none 32 (2026-11-22; a test of
/// `tyndall-scene` repeats it with fewer).
const STEP: f32 = 16.0 * f32::EPSILON;

/// The point `p` of a flat surface moved along the unit vector `n`, far enough that a ray from it does not meet the surface again.
///
/// `n` points to the side the new ray leaves to; `size` is the extent of the flat piece of surface in metres, for
/// needles more. Hits are rounded in proportion to the coordinates of `p` and to the distance of the piece's corners, so the step
/// is 2⁻¹⁹ of their sum: no fixed length, and a scene looks the same in millimetres and in kilometres.
pub fn offset_origin(p: Vec3, n: Vec3, size: f32) -> Vec3 {
    p + n * (STEP * (p.abs().max_element() + size))
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    proptest! {
        #[test]
        fn the_origin_moves_to_the_side_of_the_normal_by_some_roundings(
            p in prop::array::uniform3(-1e4f32..1e4), scale in 1e-6f32..1e6, size in 0.0f32..1e3,
            z in -1.0f32..=1.0, phi in 0.0f32..6.3
        ) {
            let (p, size) = (Vec3::from(p) * scale, size * scale);
            let r = (1.0 - z * z).sqrt();
            let n = Vec3::new(r * phi.cos(), r * phi.sin(), z).normalize();
            let moved = (offset_origin(p, n, size) - p).as_dvec3().dot(n.as_dvec3());
            let step = f64::from(STEP * (p.abs().max_element() + size));
            // Each coordinate is rounded once.
            prop_assert!((moved / step - 1.0).abs() < 0.1);
        }
    }
}
