//! Distances along a ray in proportion to 1/r² from a lamp.
//!
//! The light a lamp sends to a ray peaks like 1/r² where the ray passes it; with these distances the peak cancels.

use crate::Ray;
use glam::Vec3;

/// Distances t with density ∝ 1/(h² + (t − t₀)²) on an interval, where h is the distance of a pivot from the line of the ray
/// and t₀ the distance along the ray at which it passes the pivot.
///
/// The usual form t = t₀ + h tan θ, with θ between atan(a/h) and atan(b/h) for the ends a and b of the interval as seen from
/// t₀, divides by h and subtracts nearly equal angles where the pivot is close to the line. Here the angle is measured from
/// the start of the interval:
///
/// ```text
/// φ = atan2(h (b − a), h² + a b)
/// t = t₀ + (a cos uφ + h sin uφ) / (cos uφ − a sin(uφ)/h)
/// ```
///
/// in which φ/h and sin(uφ)/h tend to 1/a − 1/b and u (1/a − 1/b) as h → 0.
///
/// All of it is f64: for a ray that passes 10⁻⁶ m from a lamp 2 m away, h² and (t − t₀)² are twelve orders of magnitude
/// below t². The distance handed out is f32, and its density is that of the rounded distance: 1/r² over the density
/// is then the same for every sample, however coarse the rounding is against h.
///
/// Kulla and Fajardo 2012, "Importance Sampling Techniques for Path Tracing in Participating Media", section 4.1. Checked
/// by χ², and against exact airlight (Sun, Ramamoorthi, Narasimhan and Nayar 2005) for lamps down to 10⁻⁶ m from the ray.
#[derive(Clone, Copy, Debug)]
pub struct Equiangular {
    t_min: f32,
    t_max: f32,
    /// Distance along the ray of the point nearest to the pivot.
    t_0: f64,
    /// Distance between pivot and line, at least [`resolution`].
    h: f64,
    /// φ/h = ∫ dt / (h² + (t − t₀)²) over the interval.
    angle_over_h: f64,
}

impl Equiangular {
    /// Distances between `t_min` and `t_max` (metres, `t_max` may be infinite) along `ray`, gathered around `pivot`.
    ///
    /// An h below what f32 coordinates resolve is replaced by that resolution: the integral of 1/r² through the pivot itself
    /// is infinite, and nothing nearer can be told apart.
    pub fn new(ray: &Ray, pivot: Vec3, t_min: f32, t_max: f32) -> Self {
        debug_assert!(t_min.is_finite() && t_min <= t_max);
        let d = ray.direction.as_dvec3();
        let to_pivot = pivot.as_dvec3() - ray.origin.as_dvec3();
        // Divided by |d|²: an f32 direction is of unit length only to 10⁻⁷, which at 2 m is more than an h of 10⁻⁷ m.
        let t_0 = to_pivot.dot(d) / d.length_squared();
        let h = (to_pivot - t_0 * d).length().max(resolution(pivot, t_0));
        let (a, b) = (f64::from(t_min) - t_0, f64::from(t_max) - t_0);
        let (opposite_over_h, adjacent) = if b.is_finite() {
            (b - a, h * h + a * b)
        } else {
            (1.0, a)
        };
        let angle_over_h = if adjacent > h * opposite_over_h {
            let ratio = opposite_over_h / adjacent;
            ratio * atan_over_x(h * ratio)
        } else {
            (h * opposite_over_h).atan2(adjacent) / h
        };
        Self {
            t_min,
            t_max,
            t_0,
            h,
            angle_over_h,
        }
    }

    /// A distance in metres and its density per metre.
    pub fn sample(&self, u: f32) -> (f32, f32) {
        let a = f64::from(self.t_min) - self.t_0;
        let along = f64::from(u) * self.angle_over_h;
        let (sin, cos) = (along * self.h).sin_cos();
        let sin_over_h = sin / self.h;
        let s = (a * cos + self.h * sin) / (cos - a * sin_over_h);
        let t = ((self.t_0 + s) as f32).max(self.t_min).min(self.t_max);
        (t, self.pdf(t))
    }

    /// Density per metre with which [`Equiangular::sample`] returns `t`; 0 outside the interval.
    pub fn pdf(&self, t: f32) -> f32 {
        if !(self.t_min..=self.t_max).contains(&t) || self.angle_over_h <= 0.0 {
            return 0.0;
        }
        let s = f64::from(t) - self.t_0;
        (1.0 / ((self.h * self.h + s * s) * self.angle_over_h)) as f32
    }

    /// ∫ dt / (h² + (t − t₀)²) over the interval, per metre: the fluence along the ray from a lamp of unit intensity at the pivot.
    pub fn angle_over_distance(&self) -> f32 {
        self.angle_over_h as f32
    }
}

/// The distance from the pivot below which f32 positions on the ray are rounded at random, in metres.
///
/// Half a rounding of the pivot's coordinates or of the distance to it; where all are zero, the least length whose square is
/// a normal f32.
fn resolution(pivot: Vec3, t_0: f64) -> f64 {
    let scale = f64::from(pivot.abs().max_element()).max(t_0.abs());
    (0.5 * f64::from(f32::EPSILON) * scale).max(f64::from(f32::MIN_POSITIVE).sqrt())
}

/// atan(x)/x for x ≥ 0, exact at 0.
fn atan_over_x(x: f64) -> f64 {
    // The next term of the series, x⁴/5, is below the rounding of f64.
    if x < 1e-4 {
        1.0 - x * x / 3.0
    } else {
        x.atan() / x
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::testing::{Distances, assert_conforms};
    use glam::DVec3;
    use proptest::prelude::*;
    use std::f64::consts::{FRAC_PI_2, PI};

    /// A ray along z from the origin, and a pivot at distance `h` from it beside z = `t_0`.
    fn passing(h: f32, t_0: f32, t_min: f32, t_max: f32) -> Equiangular {
        let ray = Ray::new(Vec3::ZERO, Vec3::Z);
        Equiangular::new(&ray, Vec3::new(h, 0.0, t_0), t_min, t_max)
    }

    #[test]
    fn distances_follow_their_density_beside_on_before_and_behind_the_lamp() {
        for (seed, h, t_0, t_min, t_max) in [
            (81, 1.0, 2.0, 0.0, 6.0),
            (82, 1.0, 2.0, 0.0, f32::INFINITY),
            (83, 0.05, 2.0, 0.5, 4.0),
            // In the lamp's own plane of approach, and the lamp on the ray but off the interval.
            (84, 1.0, 2.0, 2.0, 3.0),
            (85, 0.0, -1.0, 0.0, 5.0),
            (86, 0.0, -1.0, 0.0, f32::INFINITY),
            (87, 0.0, 9.0, 0.0, 8.0),
            (88, 1e-6, 9.0, 0.0, 8.0),
            (89, 1e-3, -0.01, 0.0, f32::INFINITY),
        ] {
            let d = passing(h, t_0, t_min, t_max);
            // Cells of equal mass, so that a peak is seen at its own scale.
            let mut edges: Vec<f32> = (1..40).map(|i| d.sample(i as f32 / 40.0).0).collect();
            edges.insert(0, t_min);
            edges.push(t_max);
            assert_conforms(
                &Distances::between(edges),
                seed,
                |u| Some(d.sample(u[0])),
                |t| d.pdf(t),
            );
        }
    }

    #[test]
    fn the_angle_over_the_distance_is_exact_even_on_the_line_of_the_lamp() {
        for (h, t_0, t_min, t_max, exact) in [
            (1.0, 2.0, 0.0, 6.0, 2.0_f64.atan() + 4.0_f64.atan()),
            (1.0, 2.0, 2.0, f32::INFINITY, FRAC_PI_2),
            (0.0, -1.0, 0.0, f32::INFINITY, 1.0),
            (0.0, -1.0, 0.0, 3.0, 1.0 - 1.0 / 4.0),
            (0.0, 9.0, 0.0, 8.0, 1.0 - 1.0 / 9.0),
            // 10⁶ (π − 10⁻⁶/2 − 10⁻⁶/4)
            (1e-6, 2.0, 0.0, 6.0, PI / f64::from(1e-6_f32) - 0.75),
        ] {
            let angle = f64::from(passing(h, t_0, t_min, t_max).angle_over_distance());
            // One rounding to f32, and h² against 1 in the fourth.
            assert!(
                (angle / exact - 1.0).abs() < 1.2e-7,
                "h = {h}: {angle} {exact}"
            );
        }
    }

    /// Airlight of an isotropic lamp by `n` stratified distances.
    fn airlight(h: f32, t_0: f32, length: f32, [sigma_s, sigma_t]: [f64; 2], n: u32) -> f64 {
        let d = passing(h, t_0, 0.0, length);
        let sum: f64 = (0..n)
            .map(|i| {
                let (t, pdf) = d.sample((i as f32 + 0.5) / n as f32);
                let to_lamp = DVec3::new(h.into(), 0.0, f64::from(t_0) - f64::from(t));
                let r = to_lamp.length();
                (-sigma_t * (r + f64::from(t))).exp() / (r * r * f64::from(pdf))
            })
            .sum();
        sigma_s / (4.0 * PI) * sum / f64::from(n)
    }

    #[test]
    fn airlight_of_a_lamp_beside_and_almost_on_the_ray_matches_exact_values() {
        // The closed form of Sun, Ramamoorthi, Narasimhan and Nayar 2005, evaluated to 20 digits. The tolerance is that of
        // the midpoint rule with 4096 samples and of f32 densities; the smallest h is four roundings of t.
        for (h, t_0, length, sigma, exact) in [
            (1.0, 2.0, 6.0, [0.5, 1.0], 0.004_466_541_909),
            (1.0, 2.0, f32::INFINITY, [0.5, 1.0], 0.004_466_580_927),
            (0.5, 5.0, 20.0, [0.01, 0.01], 0.004_494_942_113),
            (0.5, 2.0, 6.0, [4.0, 5.0], 1.341_239_479e-5),
            (1e-3, 2.0, 6.0, [0.5, 1.0], 16.835_262_24),
            (1e-6, 2.0, 6.0, [0.5, 1.0], 16_916.754_37),
            (0.75, -1.0, 6.0, [0.5, 1.0], 0.002_430_584_88),
            (2.0, 3.0, f32::INFINITY, [1.0, 1.0], 0.000_703_379_128_3),
        ] {
            let value = airlight(h, t_0, length, sigma, 4096);
            assert!(
                (value / exact - 1.0).abs() < 1e-5,
                "h = {h}: {value} {exact}"
            );
        }
    }

    #[test]
    fn a_lamp_on_the_ray_and_at_its_origin_gives_finite_samples() {
        for (t_0, t_max) in [(2.0, 6.0), (0.0, 6.0), (0.0, f32::INFINITY), (6.0, 6.0)] {
            let d = passing(0.0, t_0, 0.0, t_max);
            for u in [0.0, 1e-7, 0.25, 0.5, 0.75, 1.0_f32.next_down()] {
                let (t, pdf) = d.sample(u);
                assert!((0.0..=t_max).contains(&t) && t.is_finite(), "{t}");
                assert!(pdf > 0.0 && pdf.is_finite(), "t₀ = {t_0}, t = {t}: {pdf}");
            }
        }
        assert_eq!(passing(1.0, 2.0, 3.0, 3.0).sample(0.5), (3.0, 0.0));
    }

    proptest! {
        #[test]
        fn one_over_r_squared_over_the_density_is_the_same_for_every_sample(
            h in prop_oneof![Just(0.0f32), 1e-6f32..1e-3, 1e-3f32..10.0],
            t_0 in -20.0f32..20.0, t_min in 0.0f32..5.0, length in 0.01f32..50.0,
            endless: bool, u in 0.0f32..1.0
        ) {
            let t_max = if endless { f32::INFINITY } else { t_min + length };
            let d = passing(h, t_0, t_min, t_max);
            let (t, pdf) = d.sample(u);
            prop_assert!((t_min..=t_max).contains(&t));
            prop_assert!(pdf > 0.0 && pdf.is_finite());
            prop_assert_eq!(pdf, d.pdf(t));
            let s = f64::from(t) - f64::from(t_0);
            let h = f64::from(h);
            // Where the line passes closer than f32 resolves, the density is that of the resolution.
            prop_assume!(h > 3e-6 || s.abs() > 1e-2);
            let ratio = 1.0 / ((h * h + s * s) * f64::from(pdf));
            prop_assert!((ratio / f64::from(d.angle_over_distance()) - 1.0).abs() < 1e-6);
        }
    }
}
