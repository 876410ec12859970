//! The Henyey–Greenstein phase function for every g in (−1, 1), without cancellation in f32.
//!
//! Textbook forms lose all digits near the peak and around g = 0; those here are algebraically the same and keep seven.

use glam::Vec3;
use std::f32::consts::PI;
use thiserror::Error;

/// A mean cosine strictly between −1 and 1.
#[derive(Clone, Copy, Debug, Default, PartialEq, PartialOrd)]
pub struct Asymmetry(f32);

/// A mean cosine at which Henyey–Greenstein is not a function.
#[derive(Clone, Copy, Debug, Error, PartialEq)]
#[error(
    "asymmetry g = {found} must lie strictly between -1 and 1: g > 0 scatters forward, g = 0 in all directions, \
     and at 1 light would not be turned at all, which is the same as less scattering (lower the albedo and sigma_t)"
)]
pub struct AsymmetryError {
    /// The value refused.
    pub found: f32,
}

impl Asymmetry {
    /// Checks a mean cosine.
    ///
    /// # Errors
    /// Unless −1 < g < 1.
    pub fn new(g: f32) -> Result<Self, AsymmetryError> {
        if g > -1.0 && g < 1.0 {
            Ok(Self(g))
        } else {
            Err(AsymmetryError { found: g })
        }
    }

    /// The mean cosine.
    pub fn get(self) -> f32 {
        self.0
    }
}

/// The Henyey–Greenstein phase function.
///
/// `p(μ) = (1 − g²) / (4π (1 + g² − 2 g μ)^(3/2)),  μ = −w_i · w_o`
///
/// * `g` – mean cosine, in (−1, 1); positive scatters forward.
///
/// Henyey and Greenstein 1941, "Diffuse radiation in the Galaxy". At g = 0 this is 1/4π exactly.
/// Checked by the conformance suite: normalised, sampled = evaluated, mean cosine = g, χ²; and against exact values.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub struct HenyeyGreenstein {
    g: Asymmetry,
}

impl HenyeyGreenstein {
    /// The phase function with mean cosine `g`.
    pub fn new(g: Asymmetry) -> Self {
        Self { g }
    }

    /// The mean cosine.
    pub fn asymmetry(&self) -> Asymmetry {
        self.g
    }

    /// Fraction of light scattered from `w_i` into `w_o`, per steradian.
    ///
    /// With a = |g| and θ measured from the peak, 1 + a² − 2 a cosθ = (1 − a)² + 2a (1 − cosθ), and for unit vectors
    /// 1 − cosθ = |v|²/2 with v the difference of `w_i` and the peak's direction. Nothing cancels.
    pub fn eval(&self, w_o: Vec3, w_i: Vec3) -> f32 {
        let (a, peak) = self.peak(w_o);
        let h = 1.0 - a;
        let d = h * h + a * (w_i - peak).length_squared();
        h * (1.0 + a) / (4.0 * PI * d * d.sqrt())
    }

    /// p, dp/dμ and d²p/dμ², per steradian.
    ///
    /// p′ = 3 g p / D,  p″ = 15 g² p / D²,  D = 1 + g² − 2 g μ
    #[inline]
    pub fn derivatives(&self, w_o: Vec3, w_i: Vec3) -> [f32; 3] {
        let (a, peak) = self.peak(w_o);
        let h = 1.0 - a;
        let d = h * h + a * (w_i - peak).length_squared();
        let p = h * (1.0 + a) / (4.0 * PI * d * d.sqrt());
        let q = self.g.0 / d;
        [p, 3.0 * q * p, 15.0 * q * q * p]
    }

    /// A direction `w_i` drawn in proportion to [`HenyeyGreenstein::eval`], and that value.
    pub fn sample(&self, w_o: Vec3, [u, v]: [f32; 2]) -> (Vec3, f32) {
        let (a, peak) = self.peak(w_o);
        let w_i = super::around(peak, sample_lobe(a, u), v);
        (w_i, self.eval(w_o, w_i))
    }

    /// Legendre moment l: `g^l`.
    pub fn moments(&self, l: usize) -> f32 {
        self.g.0.powi(i32::try_from(l).unwrap_or(i32::MAX))
    }

    /// |g| and the `w_i` of the highest value.
    fn peak(&self, w_o: Vec3) -> (f32, Vec3) {
        (self.g.0.abs(), if self.g.0 < 0.0 { w_o } else { -w_o })
    }
}

/// Sine and cosine of the angle from the peak of a lobe with mean cosine `a` in [0, 1), by inversion of its distribution at `u`.
///
/// With h = 1 − a and d = h + 2 a u: 1 − cosθ = 2h²(1 − u)(1 + a u)/d² and 1 + cosθ = 2(1 + a)² u (h + a u)/d². Their
/// product is sin²θ, which so needs no 1 − cos²θ; nothing is divided by g, so that g = 0 needs no branch.
fn sample_lobe(a: f32, u: f32) -> (f32, f32) {
    let h = 1.0 - a;
    let d = h + 2.0 * a * u;
    let to_peak = 2.0 * h * h * (1.0 - u) * (1.0 + a * u) / (d * d);
    let to_back = 2.0 * (1.0 + a) * (1.0 + a) * u * (h + a * u) / (d * d);
    let cos_theta = if to_peak < 1.0 {
        1.0 - to_peak
    } else {
        to_back - 1.0
    };
    ((to_peak * to_back).sqrt(), cos_theta)
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    const ASYMMETRIES: [f32; 24] = [
        1e-8, 1e-7, 1e-5, 1e-4, 1e-3, 0.01, 0.1, 0.5, 0.9, 0.99, 0.999, 0.9999, -1e-8, -1e-7,
        -1e-5, -1e-4, -1e-3, -0.01, -0.1, -0.5, -0.9, -0.99, -0.999, -0.9999,
    ];

    fn hg(g: f32) -> HenyeyGreenstein {
        HenyeyGreenstein::new(Asymmetry::new(g).unwrap())
    }

    /// 1 + g² − 2gμ in f64 at angle `theta`, for the g that f32 holds.
    fn denominator(g: f64, theta: f64) -> f64 {
        let half = (0.5 * theta).sin();
        (1.0 - g) * (1.0 - g) + 4.0 * g * half * half
    }

    #[test]
    fn sampled_angles_keep_six_digits_for_every_g() {
        for g in ASYMMETRIES {
            let a = f64::from(g.abs());
            for i in 0..20_000_u32 {
                // Uneven numbers with all 24 bits in use.
                let u = ((i.wrapping_mul(2_654_435_769) >> 8) as f32) / 16_777_216.0;
                let x = f64::from(u);
                let (h, d) = (1.0 - a, 1.0 - a + 2.0 * a * x);
                let to_peak = 2.0 * h * h * (1.0 - x) * (1.0 + a * x) / (d * d);
                let sin =
                    (to_peak * (2.0 * (1.0 + a) * (1.0 + a) * x * (h + a * x) / (d * d))).sqrt();
                let (sin_theta, cos_theta) = sample_lobe(g.abs(), u);
                // The stable form's worst in f32 is 3.6e-7 and 2.7e-7; the textbook's is 200 and 1.1.
                assert!(
                    (f64::from(sin_theta) - sin).abs() <= 5e-7 * sin,
                    "g = {g}, u = {u}"
                );
                assert!(
                    (f64::from(cos_theta) - (1.0 - to_peak)).abs() < 3e-7,
                    "g = {g}, u = {u}"
                );
            }
        }
    }

    #[test]
    fn the_inverse_distribution_passes_through_exact_anchors() {
        // cosθ at ξ = 0, 1e-6, 0.1, 0.5, 0.9, 1 − 1e-6, 1, computed with 30 digits.
        let rows = [
            (0.0, [-1.0, -0.999998, -0.8, 0.0, 0.8, 0.999998, 1.0]),
            (
                1e-8,
                [
                    -1.0,
                    -0.999998,
                    -0.7999999946,
                    1.5e-8,
                    0.8000000054,
                    0.999998,
                    1.0,
                ],
            ),
            (
                1e-3,
                [
                    -1.0,
                    -0.999997993992,
                    -0.799459423604,
                    0.0014999995,
                    0.800539424396,
                    0.999998005992,
                    1.0,
                ],
            ),
            (
                0.5,
                [
                    -1.0,
                    -0.999991000027,
                    -0.3125,
                    0.6875,
                    0.963010204082,
                    0.999999666666,
                    1.0,
                ],
            ),
            (
                0.9,
                [
                    -1.0,
                    -0.999927801949,
                    0.749744897959,
                    0.9855,
                    0.998776365603,
                    0.999999989474,
                    1.0,
                ],
            ),
            (
                0.999,
                [
                    -1.0,
                    -0.992031886381,
                    0.999950898101,
                    0.9999985005,
                    0.999999882667,
                    1.0,
                    1.0,
                ],
            ),
            (
                -0.999,
                [
                    -1.0,
                    -1.0,
                    -0.999999882667,
                    -0.9999985005,
                    -0.999950898101,
                    0.992031886381,
                    1.0,
                ],
            ),
        ];
        for (g, cosines) in rows {
            for (xi, expected) in [0.0, 1e-6, 0.1, 0.5, 0.9, 1.0 - 1e-6, 1.0_f64]
                .into_iter()
                .zip(cosines)
            {
                let found = if g < 0.0 {
                    -sample_lobe(-g, (1.0 - xi) as f32).1
                } else {
                    sample_lobe(g, xi as f32).1
                };
                // Rounding of g = 0.999 and of ξ to f32 moves the steepest anchors by 3e-7.
                assert!(
                    (f64::from(found) - expected).abs() < 6e-7,
                    "g = {g}, ξ = {xi}: {found}"
                );
            }
        }
    }

    #[test]
    fn evaluation_keeps_six_digits_inside_the_peak() {
        for g in ASYMMETRIES {
            let phase = hg(g);
            let (a, w_o) = (f64::from(g.abs()), Vec3::Z);
            for i in 0..=2000 {
                let theta = 0.2 * f64::from(i) / 2000.0;
                let (sin, cos) = theta.sin_cos();
                let w_i = if g < 0.0 { 1.0 } else { -1.0 } * Vec3::new(sin as f32, 0.0, cos as f32);
                let exact =
                    (1.0 - a * a) / (4.0 * std::f64::consts::PI * denominator(a, theta).powf(1.5));
                let found = f64::from(phase.eval(w_o, w_i));
                // The stable form's worst in f32 is 4.8e-7; the textbook's is infinite at g = 0.9999.
                assert!(
                    (found - exact).abs() < 7e-7 * exact,
                    "g = {g}, θ = {theta}: {found} not {exact}"
                );
            }
        }
    }

    #[test]
    fn forward_and_backward_values_are_exact() {
        let rows = [
            (0.0, 0.07957747154594767, 0.07957747154594767, 1e-6),
            (0.5, 0.477464829275686, 0.017683882565766147, 1e-6),
            (0.9, 15.119719593730057, 0.0022043620926855308, 3e-6),
            // 1 − g of the f32 nearest to g differs by up to 3e-8, relative to the 1e-2 or 1e-3 that is left.
            (0.99, 1583.5916837643585, 0.00020094813652672322, 1e-5),
            (0.999, 159075.3656203494, 1.9914277185102724e-05, 1e-4),
            (-0.999, 1.9914277185102724e-05, 159075.3656203494, 1e-4),
        ];
        for (g, forward, backward, tolerance) in rows {
            let phase = hg(g);
            for (w_i, exact) in [(Vec3::NEG_X, forward), (Vec3::X, backward)] {
                let found = f64::from(phase.eval(Vec3::X, w_i));
                assert!(
                    (found / exact - 1.0).abs() < tolerance,
                    "g = {g}: {found} not {exact}"
                );
            }
        }
    }

    #[test]
    fn directions_a_rounding_off_unit_length_give_no_nan() {
        let off = Vec3::new(0.0, 0.0, -1.000_000_1);
        for g in ASYMMETRIES {
            assert!(hg(g).eval(Vec3::Z, off).is_finite());
            assert!(hg(g).eval(-off, off).is_finite());
        }
    }

    #[test]
    fn asymmetry_refuses_what_is_no_function() {
        for g in [1.0, -1.0, 1.5, f32::NAN, f32::INFINITY] {
            assert!(Asymmetry::new(g).is_err());
        }
        assert!(Asymmetry::new(1.0 - f32::EPSILON / 2.0).is_ok());
        let message = Asymmetry::new(1.5).unwrap_err().to_string();
        assert!(message.contains("g = 1.5") && message.contains("between -1 and 1"));
    }
}
