//! Gauss–Legendre nodes, and a product rule on the sphere that integrates polynomials exactly.
//!
//! For tables, projections and tests; nothing here runs per ray.

use glam::DVec3;
use std::f64::consts::{PI, TAU};

/// Nodes in (−1, 1) and weights of the `n`-point Gauss–Legendre rule, exact for polynomials of degree 2n − 1.
///
/// Roots of Pₙ by Newton's method from cos(π (i + 3/4)/(n + 1/2)) (Abramowitz and Stegun 22.16.6); weights
/// 2/((1 − x²) Pₙ'(x)²) (25.4.29).
pub fn gauss_legendre(n: usize) -> Vec<(f64, f64)> {
    (0..n)
        .map(|i| {
            let mut x = (PI * (i as f64 + 0.75) / (n as f64 + 0.5)).cos();
            let mut slope = 1.0;
            // Convergence is quadratic from two digits on: six steps are more than f64 can hold.
            for _ in 0..6 {
                let (mut previous, mut p) = (1.0, x);
                for l in 2..=n {
                    let l = l as f64;
                    (previous, p) = (p, ((2.0 * l - 1.0) * x * p - (l - 1.0) * previous) / l);
                }
                slope = n as f64 * (x * p - previous) / (x * x - 1.0);
                x -= p / slope;
            }
            (x, 2.0 / ((1.0 - x * x) * slope * slope))
        })
        .collect()
}

/// Directions and weights (steradians) that integrate spherical harmonics up to order 2n − 1 exactly: `n` Gauss–Legendre
/// nodes in z, 2n even steps around it.
pub fn sphere(n: usize) -> impl Iterator<Item = (DVec3, f64)> {
    gauss_legendre(n).into_iter().flat_map(move |(z, weight)| {
        let r = (1.0 - z * z).sqrt();
        (0..2 * n).map(move |j| {
            let phi = (j as f64 + 0.5) * TAU / (2 * n) as f64;
            let direction = DVec3::new(r * phi.cos(), r * phi.sin(), z);
            (direction, weight * TAU / (2 * n) as f64)
        })
    })
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn powers_are_integrated_exactly_up_to_the_degree_promised() {
        for n in [1, 2, 5, 16, 64] {
            let rule = gauss_legendre(n);
            for k in 0..(2 * n) as i32 {
                let integral: f64 = rule.iter().map(|(x, w)| w * x.powi(k)).sum();
                let exact = if k % 2 == 0 {
                    2.0 / f64::from(k + 1)
                } else {
                    0.0
                };
                assert!((integral - exact).abs() < 1e-13, "n = {n}, power {k}");
            }
        }
    }

    #[test]
    fn the_sphere_has_its_area_and_second_moments() {
        let rule: Vec<_> = sphere(4).collect();
        let area: f64 = rule.iter().map(|(_, w)| w).sum();
        let xy_2: f64 = rule.iter().map(|(d, w)| w * d.x * d.x * d.y * d.y).sum();
        assert!((area - 4.0 * PI).abs() < 1e-13);
        assert!((xy_2 - 4.0 * PI / 15.0).abs() < 1e-13);
    }
}
