//! The Rayleigh phase function: air, and all particles much smaller than the wavelength.

use glam::Vec3;
use std::f32::consts::PI;

/// The Rayleigh phase function, of light without polarisation.
///
/// `p(μ) = 3/(16π) (1 + μ²),  μ = −w_i · w_o`
///
/// Rayleigh 1871, "On the light from the sky, its polarization and colour"; Chandrasekhar 1960, *Radiative Transfer*, §16.
/// Checked by the conformance suite; the sampling against f64 and exact anchors.
#[derive(Clone, Copy, Debug, PartialEq)]
pub(super) struct Rayleigh;

/// 3/(16π), per steradian: the value across the light.
const ACROSS: f32 = 3.0 / (16.0 * PI);

impl Rayleigh {
    /// Fraction of light scattered from `w_i` into `w_o`, per steradian.
    pub(super) fn eval(self, w_o: Vec3, w_i: Vec3) -> f32 {
        let mu = w_i.dot(w_o);
        ACROSS * (1.0 + mu * mu)
    }

    /// p, dp/dμ and d²p/dμ², per steradian.
    #[inline]
    pub(super) fn derivatives(self, w_o: Vec3, w_i: Vec3) -> [f32; 3] {
        let mu = -w_i.dot(w_o);
        [ACROSS * (1.0 + mu * mu), 2.0 * ACROSS * mu, 2.0 * ACROSS]
    }

    /// A direction `w_i` drawn in proportion to [`Rayleigh::eval`], and that value.
    #[inline(never)]
    pub(super) fn sample(self, w_o: Vec3, [u, v]: [f32; 2]) -> (Vec3, f32) {
        let w_i = super::around(-w_o, sample_angle(u), v);
        (w_i, self.eval(w_o, w_i))
    }

    /// Legendre moment l.
    ///
    /// μ² = 1/3 + 2/3 P₂(μ) and ∫ P₂² dμ = 2/5, so that χ₀ = 1, χ₂ = 2π · 3/(16π) · 2/3 · 2/5 = 1/10 and all else is 0.
    pub(super) fn moments(self, l: usize) -> f32 {
        match l {
            0 => 1.0,
            2 => 0.1,
            _ => 0.0,
        }
    }
}

/// Sine and cosine of the angle of scattering, by inversion of its distribution at `u`.
///
/// F(c) = (c³ + 3c + 4)/8 = u is the cubic c³ + 3c = 2z with z = 2(2u − 1). Put c = t − 1/t: then t³ − t⁻³ = 2z and
/// t³ = z + √(z² + 1), Cardano's formula (Frisvad 2011, "Importance sampling the Rayleigh phase function"). For z < 0 that
/// root cancels, hence |z| and the sign apart. What is left of cancellation, in t − 1/t for small c and in 1 − c² near the
/// poles, the cubic itself mends: c (c² + 3) = 2z, and as (1 − c)(c² + c + 4) = 8(1 − u) and
/// (1 + c)(c² − c + 4) = 8u,
///
/// sin²θ = 64 u(1 − u)/((c² + 4)² − c²),
///
/// where an error of c hardly matters and only the last denominator, in [16, 24], subtracts.
fn sample_angle(u: f32) -> (f32, f32) {
    let z = 2.0 * (2.0 * u - 1.0);
    let t = (z.abs() + (z * z + 1.0).sqrt()).cbrt();
    let c = t - 1.0 / t;
    let c2 = c * c;
    let sin_squared = 64.0 * u * (1.0 - u) / ((c2 + 4.0) * (c2 + 4.0) - c2);
    (sin_squared.sqrt(), 2.0 * z / (c2 + 3.0))
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn sampled_angles_keep_six_digits_to_the_poles() {
        // Uneven numbers with all 24 bits in use, and those next to either pole and to the equator.
        let uneven =
            (0..20_000_u32).map(|i| ((i.wrapping_mul(2_654_435_769) >> 8) as f32) / 16_777_216.0);
        let ulp = f32::EPSILON / 2.0;
        for u in uneven.chain([
            0.0,
            ulp * ulp,
            ulp,
            0.5 - ulp,
            0.5,
            0.5 + 2.0 * ulp,
            1.0 - ulp,
        ]) {
            let x = f64::from(u);
            // c = 2 sinh(asinh(z)/3), and at the pole 1 = 2 sinh(asinh(2)/3): neither their difference nor that of the
            // hyperbolic areas cancels in this form.
            let z = (4.0 * x - 2.0).abs();
            let root = (z * z + 1.0).sqrt();
            let gap = 4.0 * x.min(1.0 - x) * (2.0 + z) / (2.0 * root + z * 5.0_f64.sqrt());
            let sum = z.asinh() + 2.0_f64.asinh();
            let to_pole = 4.0 * (sum / 6.0).cosh() * (gap.asinh() / 6.0).sinh();
            let sin = (to_pole * (2.0 - to_pole)).sqrt();
            let cos = (2.0 * (z.asinh() / 3.0).sinh()).copysign(x - 0.5);
            let (sin_theta, cos_theta) = sample_angle(u);
            // Eight roundings of 6e-8 at the most, half of them under the root.
            assert!(
                (f64::from(sin_theta) - sin).abs() <= 4e-7 * sin,
                "u = {u}: sin {sin_theta} not {sin}"
            );
            assert!(
                (f64::from(cos_theta) - cos).abs() <= 4e-7 * cos.abs(),
                "u = {u}: cos {cos_theta} not {cos}"
            );
        }
    }

    #[test]
    fn the_inverse_distribution_passes_through_exact_anchors() {
        // Computed with 30 digits; the first is that of exact-benchmarks.md E4.
        for (xi, exact) in [
            (0.9, 0.856918742691),
            (0.5, 0.0),
            (0.6, 0.2607566981844),
            (0.75, 0.5960716379833),
            (0.999, 0.998665776987),
            (1.0, 1.0),
        ] {
            for (xi, exact) in [(xi, exact), (1.0 - xi, -exact)] {
                let found = f64::from(sample_angle(xi).1);
                // Rounding of ξ moves the cosine by up to 1e-7.
                assert!((found - exact).abs() < 3e-7, "ξ = {xi}: {found}");
            }
        }
    }
}
