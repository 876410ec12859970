//! Maps from uniform random numbers to directions, points and distances with a wanted density.
//!
//! Every map takes numbers in [0, 1) and keeps neighbours together, so that stratified numbers give stratified samples.

mod equiangular;
mod exponential;

pub use equiangular::Equiangular;
pub use exponential::TruncatedExponential;

use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, FRAC_PI_4, PI, TAU};

/// A direction spread evenly over the sphere; density 1/4π per steradian.
pub fn uniform_sphere(u: [f32; 2]) -> Vec3 {
    // z = 1 − 2u and sinθ = √(1 − z²) = 2 √(u (1 − u)), without the cancellation at the poles.
    let r = 2.0 * (u[0] * (1.0 - u[0])).sqrt();
    let (sin, cos) = (TAU * u[1]).sin_cos();
    Vec3::new(r * cos, r * sin, 1.0 - 2.0 * u[0])
}

/// A direction around +z with density cosθ/π per steradian; its z is never 0, so the density never is either.
pub fn cosine_hemisphere(u: [f32; 2]) -> Vec3 {
    let [x, y] = concentric_disk(u);
    // On the rim z is that of half a rounding inside it: the vector stays of unit length to f32.
    let z = (1.0 - x * x - y * y).max(0.5 * f32::EPSILON).sqrt();
    Vec3::new(x, y, z)
}

/// A point spread evenly over the unit disk; density 1/π.
///
/// Shirley and Chiu 1997, "A Low Distortion Map Between Disk and Square".
pub fn concentric_disk(u: [f32; 2]) -> [f32; 2] {
    let (a, b) = (2.0 * u[0] - 1.0, 2.0 * u[1] - 1.0);
    if a == 0.0 && b == 0.0 {
        return [0.0, 0.0];
    }
    let (r, phi) = if a.abs() > b.abs() {
        (a, FRAC_PI_4 * (b / a))
    } else {
        (b, FRAC_PI_2 - FRAC_PI_4 * (a / b))
    };
    let (sin, cos) = phi.sin_cos();
    [r * cos, r * sin]
}

/// Barycentric coordinates spread evenly over a triangle; density 1/area.
///
/// Heitz 2019, "A Low-Distortion Map Between Triangle and Square".
pub fn uniform_triangle(u: [f32; 2]) -> [f32; 3] {
    let (b0, b1) = if u[0] < u[1] {
        let b0 = 0.5 * u[0];
        (b0, u[1] - b0)
    } else {
        let b1 = 0.5 * u[1];
        (u[0] - b1, b1)
    };
    [b0, b1, 1.0 - b0 - b1]
}

/// Density of [`cosine_hemisphere`] at a direction with cosine `cos_theta` to +z, per steradian; 0 below the plane.
pub fn cosine_hemisphere_pdf(cos_theta: f32) -> f32 {
    cos_theta.max(0.0) / PI
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Directions, UnitSquare, assert_conforms};

    #[test]
    fn directions_follow_their_density_and_are_of_unit_length() {
        let unit = |w: Vec3| {
            assert!((w.length() - 1.0).abs() < 3e-7, "{w}");
            w
        };
        assert_conforms(
            &Directions::sphere(),
            61,
            |u| Some((unit(uniform_sphere(u)), 0.25 / PI)),
            |_| 0.25 / PI,
        );
        assert_conforms(
            &Directions::cap(Vec3::Z, 0.0),
            62,
            |u| {
                let w = unit(cosine_hemisphere(u));
                Some((w, cosine_hemisphere_pdf(w.z)))
            },
            |w| cosine_hemisphere_pdf(w.z),
        );
    }

    #[test]
    fn corners_and_centre_of_the_square_map_to_valid_directions() {
        let last = 1.0_f32.next_down();
        for u in [
            [0.0, 0.0],
            [0.5, 0.5],
            [0.0, last],
            [last, 0.0],
            [last, last],
            [0.0, 0.5],
        ] {
            assert!(cosine_hemisphere(u).z > 0.0);
            assert!(cosine_hemisphere(u).is_normalized());
            assert!(uniform_sphere(u).is_normalized());
            assert!(uniform_triangle(u).iter().all(|b| (0.0..=1.0).contains(b)));
        }
    }

    #[test]
    fn points_of_disk_and_triangle_are_even() {
        // The square around the disk; the triangle as the lower left half of a square.
        assert_conforms(
            &UnitSquare { n: [20, 20] },
            63,
            |u| Some((concentric_disk(u).map(|x| 0.5 + 0.5 * x), 4.0 / PI)),
            |[x, y]| {
                if (x - 0.5).hypot(y - 0.5) <= 0.5 {
                    4.0 / PI
                } else {
                    0.0
                }
            },
        );
        assert_conforms(
            &UnitSquare { n: [20, 20] },
            64,
            |u| {
                let [b_0, b_1, _] = uniform_triangle(u);
                Some(([b_0, b_1], 2.0))
            },
            |[x, y]| if x + y <= 1.0 { 2.0 } else { 0.0 },
        );
    }
}
