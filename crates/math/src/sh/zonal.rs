//! Convolution with a function of the angle to an axis: scattering by a phase function.

use crate::quadrature::gauss_legendre;
use std::{f64::consts::TAU, ops::MulAssign};

/// Scatters: turns the coefficients of L(ω') into those of ∫ p(ω·ω') L(ω') dω', for a phase function with Legendre moments
/// `moment(l)` = χₗ = 2π ∫ p(μ) Pₗ(μ) dμ.
///
/// The theorem of Funk and Hecke: (p ∗ L)ₗₘ = χₗ Lₗₘ. Henyey–Greenstein has χₗ = gˡ, isotropic scattering χ₀ = 1 alone.
/// Coefficients may be numbers or colours, of any order.
pub fn convolve_zonal<T: MulAssign<f32>>(coefficients: &mut [T], moment: impl Fn(usize) -> f32) {
    let mut rest = coefficients;
    let mut l = 0;
    while !rest.is_empty() {
        let (band, above) = rest.split_at_mut((2 * l + 1).min(rest.len()));
        let factor = moment(l);
        for c in band {
            *c *= factor;
        }
        rest = above;
        l += 1;
    }
}

/// Legendre moments χₗ = 2π ∫ p(μ) Pₗ(μ) dμ for l = 0 to `order` of a function `p` of the cosine, by `n` Gauss–Legendre nodes.
///
/// Exact where p is a polynomial of degree 2n − 1 − order; a peak of width δ (radians) takes some 10/δ nodes.
pub fn legendre_moments(order: usize, n: usize, p: impl Fn(f64) -> f64) -> Vec<f64> {
    let mut moments = vec![0.0; order + 1];
    for (mu, weight) in gauss_legendre(n) {
        let value = TAU * weight * p(mu);
        let (mut before, mut legendre) = (0.0, 1.0);
        for (l, moment) in moments.iter_mut().enumerate() {
            *moment += value * legendre;
            let l = l as f64;
            (before, legendre) = (
                legendre,
                ((2.0 * l + 1.0) * mu * legendre - l * before) / (l + 1.0),
            );
        }
    }
    moments
}

#[cfg(test)]
mod tests {
    use super::*;
    use crate::{quadrature::sphere, sh::Basis};
    use glam::Vec3;

    fn henyey_greenstein(g: f64, mu: f64) -> f64 {
        (1.0 - g * g) / (2.0 * TAU * (1.0 + g * g - 2.0 * g * mu).powf(1.5))
    }

    #[test]
    fn moments_of_henyey_greenstein_are_powers_and_of_rayleigh_one_tenth() {
        for g in [-0.6, 0.0, 0.3, 0.85] {
            // (1 − 0.85)⁻¹ = 7: 100 nodes are exact to rounding.
            for (l, moment) in legendre_moments(12, 100, |mu| henyey_greenstein(g, mu))
                .iter()
                .enumerate()
            {
                assert!(
                    (moment - g.powi(l as i32)).abs() < 1e-9,
                    "g = {g}, l = {l}: {moment}"
                );
            }
        }
        let rayleigh = legendre_moments(4, 4, |mu| 3.0 / (8.0 * TAU) * (1.0 + mu * mu));
        for (moment, exact) in rayleigh.iter().zip([1.0, 0.0, 0.1, 0.0, 0.0]) {
            assert!((moment - exact).abs() < 1e-14);
        }
    }

    #[test]
    fn convolution_by_moments_is_the_scattering_integral() {
        let (g, lobe) = (0.6, Vec3::new(-0.36, 0.48, 0.8));
        let radiance = |w: Vec3| (4.0 * (w.dot(lobe) - 1.0)).exp() + 0.2 * w.x * w.y;
        let basis = Basis::new(14);
        let mut c = basis.project(40, |w| Vec3::splat(radiance(w)));
        convolve_zonal(&mut c, |l| (g as f32).powi(l as i32));
        for w in [lobe, -lobe, Vec3::X, Vec3::new(0.6, 0.0, -0.8)] {
            let direct: f64 = sphere(40)
                .map(|(w_in, weight)| {
                    weight
                        * henyey_greenstein(g, w_in.dot(w.as_dvec3()))
                        * f64::from(radiance(w_in.as_vec3()))
                })
                .sum();
            let scattered = f64::from(basis.reconstruct(w, &c).x);
            // Bands above 14 of e^(4μ) times 0.6¹⁵ are below 10⁻⁷; sums of f32 terms leave 10⁻⁶.
            assert!((scattered - direct).abs() < 5e-6, "{scattered} {direct}");
        }
    }
}
