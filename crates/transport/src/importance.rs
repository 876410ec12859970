//! Estimates of how much light could arrive, by which one light of many is chosen.
//!
//! They steer the choice and never enter a result: rough and cheap will do, but 0 only where nothing can arrive.

use glam::Vec3;
use std::f32::consts::{FRAC_PI_2, PI};
use tyndall_math::Ray;

/// Keeps estimates such that thousands of them can be summed in f32: a point may lie on a lamp.
pub fn bounded(importance: f32) -> f32 {
    const LARGEST: f32 = 1e30;
    importance.min(LARGEST)
}

/// About ∫ dt / (r² + h² + (t − t₀)²) over `range`, where h is the distance of `pivot` from the line and t₀ where it is
/// nearest: the fluence along a ray from a lamp of radius r. In f32 and to 10⁻³, for choosing among many lights.
///
/// With H² = r² + h² and the range's ends at t₀ + a and t₀ + b it is atan2(H (b − a), H² + a b) / H, which never subtracts two
/// nearly equal angles.
pub fn inverse_square_along(ray: &Ray, pivot: Vec3, radius_squared: f32, range: [f32; 2]) -> f32 {
    let to_pivot = pivot - ray.origin;
    let nearest = to_pivot.dot(ray.direction);
    let h2 = (to_pivot - ray.direction * nearest).length_squared() + radius_squared;
    // Nearer than f32 can tell the line from the pivot there is nothing to compare.
    let h2 = h2
        .max(1e-12 * to_pivot.length_squared())
        .max(f32::MIN_POSITIVE);
    let h = h2.sqrt();
    let [a, b] = range.map(|t| t - nearest);
    angle(h * (b - a), h2 + a * b) / h
}

/// atan2(y, x) for y ≥ 0, to 4·10⁻⁵ of itself: a polynomial fitted to atan(r)/r in r² on [0, 1], and reflections.
fn angle(y: f32, x: f32) -> f32 {
    const FITTED: [f32; 5] = [
        0.023_372_15,
        -0.090_928_92,
        0.184_578_37,
        -0.331_568_97,
        0.999_965_65,
    ];
    let atan = |r: f32| r * FITTED.iter().fold(0.0, |sum, c| sum * (r * r) + c);
    if y > x.abs() {
        FRAC_PI_2 - atan(x / y)
    } else if x < 0.0 {
        PI - atan(y / -x)
    } else {
        atan(y / x.max(f32::MIN_POSITIVE))
    }
}

/// Mean of the three channels: the one number by which lights are compared.
pub fn mean(color: Vec3) -> f32 {
    color.element_sum() / 3.0
}

/// How much of what a light within `radius` of `center` sends to `p` meets the front of a surface with the geometric
/// `normal` there: a bound on the cosine, 0 only where the whole light stands behind the surface; 1 in a medium.
///
/// The floor keeps lights alive that graze: a shading normal may lean towards them.
pub fn facing(p: Vec3, normal: Option<Vec3>, center: Vec3, radius: f32) -> f32 {
    const LEAST: f32 = 0.1;
    let Some(normal) = normal else {
        return 1.0;
    };
    let to_light = center - p;
    let above = normal.dot(to_light) + radius;
    if above <= 0.0 {
        return 0.0;
    }
    (above / to_light.length().max(f32::MIN_POSITIVE)).clamp(LEAST, 1.0)
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn the_angle_is_that_of_the_library() {
        for i in 0..2000 {
            let y = 10_f32.powf(i as f32 / 100.0 - 10.0);
            for x in [-1e3, -1.0, -1e-3, 0.0, 1e-3, 1.0, 1e3] {
                let (found, exact) = (angle(y, x), y.atan2(x));
                assert!(
                    (found / exact - 1.0).abs() < 5e-5,
                    "{y} {x}: {found} {exact}"
                );
            }
        }
        assert_eq!(angle(0.0, 0.0), 0.0);
    }

    #[test]
    fn the_integral_along_a_ray_agrees_with_a_sum() {
        let ray = Ray::new(Vec3::new(-3.0, 0.4, 1.0), Vec3::new(0.8, 0.0, 0.6));
        let (pivot, radius_squared) = (Vec3::new(0.5, 0.0, 2.0), 0.3);
        let n = 10_000;
        let sum: f64 = (0..n)
            .map(|i| {
                let t = 0.5 + 4.5 * (i as f32 + 0.5) / n as f32;
                let d2 = ray.at(t).distance_squared(pivot) + radius_squared;
                4.5 / n as f64 / f64::from(d2)
            })
            .sum();
        let found = inverse_square_along(&ray, pivot, radius_squared, [0.5, 5.0]);
        // What the angle is good for; the midpoint rule's own error is 1e-8.
        assert!((f64::from(found) / sum - 1.0).abs() < 5e-5);
    }

    #[test]
    fn a_ray_through_the_lamp_itself_counts_much_and_stays_finite() {
        let ray = Ray::new(Vec3::NEG_Z, Vec3::Z);
        for pivot in [Vec3::ZERO, Vec3::NEG_Z, Vec3::new(1e-30, 0.0, 0.0)] {
            let found = inverse_square_along(&ray, pivot, 0.0, [0.0, 2.0]);
            assert!(found.is_finite() && found > 1e3, "{pivot}: {found}");
        }
    }
}
