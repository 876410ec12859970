//! Evaluation of the basis, projection onto it and reconstruction from it.

use super::n_coefficients;
use crate::quadrature::sphere;
use glam::{DVec3, Vec3};
use std::f64::consts::{PI, SQRT_2};

/// Spherical harmonics of bands 0 to an order.
///
/// With Cₘ + iSₘ = (x + iy)ᵐ and the normalised associated Legendre function over sinᵐθ, p(l, m), it needs no
/// trigonometry and is exact at the poles:
///
/// ```text
/// Y(l, 0) = p(l, 0),  Y(l, m) = √2 p(l, m) Cₘ  and  Y(l, −m) = √2 p(l, m) Sₘ  for m > 0
/// p(0, 0)     = 1/√(4π)
/// p(m, m)     = p(m − 1, m − 1) √((2m + 1)/(2m))
/// p(m + 1, m) = z p(m, m) √(2m + 3)
/// p(l, m)     = a (z p(l − 1, m) − b p(l − 2, m))
/// a = √((4l² − 1)/(l² − m²)),  b = √(((l − 1)² − m²)/(4 (l − 1)² − 1))
/// ```
///
/// Limpanuparb and Milthorpe 2014, "Associated Legendre Polynomials and Spherical Harmonics Computation for Chemistry
/// Applications", for these normalised recurrences; Sloan 2013, "Efficient Spherical Harmonic Evaluation", for the factors of
/// sinᵐθ. The square roots are a table made once.
#[derive(Clone, Debug)]
pub struct Basis {
    order: usize,
    /// √2 p(m, m) for m > 0, p(0, 0) first.
    diagonal: Vec<f32>,
    /// (a, b) for l = m + 1 … order, for each m in turn; b = 0 at l = m + 1.
    steps: Vec<(f32, f32)>,
}

impl Basis {
    /// Bands 0 to `order`.
    pub fn new(order: usize) -> Self {
        // f64 for the table: each p(m, m) is a product of m factors.
        let mut diagonal = Vec::with_capacity(order + 1);
        let mut steps = Vec::with_capacity(order * (order + 1) / 2);
        let mut p_mm = (0.25 / PI).sqrt();
        for m in 0..=order {
            if m > 0 {
                let m = m as f64;
                p_mm *= ((2.0 * m + 1.0) / (2.0 * m)).sqrt();
            }
            let root_2 = if m > 0 { SQRT_2 } else { 1.0 };
            diagonal.push((p_mm * root_2) as f32);
            for l in m + 1..=order {
                let (l, m) = (l as f64, m as f64);
                let below = l - 1.0;
                let a = ((4.0 * l * l - 1.0) / (l * l - m * m)).sqrt();
                let b = ((below * below - m * m) / (4.0 * below * below - 1.0)).sqrt();
                steps.push((a as f32, b as f32));
            }
        }
        Self {
            order,
            diagonal,
            steps,
        }
    }

    /// The highest band.
    pub fn order(&self) -> usize {
        self.order
    }

    /// Number of functions.
    pub fn n_coefficients(&self) -> usize {
        n_coefficients(self.order)
    }

    /// Writes Yₗₘ at the unit vector `w` into `out`, which holds [`Basis::n_coefficients`] numbers.
    pub fn eval(&self, w: Vec3, out: &mut [f32]) {
        debug_assert_eq!(out.len(), self.n_coefficients());
        self.for_each(w, |i, y| out[i] = y);
    }

    /// Adds to `coefficients` those of radiance `value` (times a solid angle) from the direction `w` alone: value Yₗₘ(w).
    pub fn add(&self, w: Vec3, value: Vec3, coefficients: &mut [Vec3]) {
        debug_assert_eq!(coefficients.len(), self.n_coefficients());
        self.for_each(w, |i, y| coefficients[i] += value * y);
    }

    /// Σ cₗₘ Yₗₘ(w).
    pub fn reconstruct(&self, w: Vec3, coefficients: &[Vec3]) -> Vec3 {
        debug_assert_eq!(coefficients.len(), self.n_coefficients());
        let mut sum = Vec3::ZERO;
        self.for_each(w, |i, y| sum += coefficients[i] * y);
        sum
    }

    /// Coefficients cₗₘ = ∫ f Yₗₘ dω, by a rule of `n` × 2n directions that is exact where f has no band above 2n − 1 − order.
    pub fn project(&self, n: usize, f: impl Fn(Vec3) -> Vec3) -> Vec<Vec3> {
        // f64: the sums have 2n² terms of either sign.
        let mut sums = vec![DVec3::ZERO; self.n_coefficients()];
        for (w, weight) in sphere(n) {
            let w = w.as_vec3();
            let value = f(w).as_dvec3() * weight;
            self.for_each(w, |i, y| sums[i] += value * f64::from(y));
        }
        sums.iter().map(|c| c.as_vec3()).collect()
    }

    /// Calls `f` with index and value of every function, column by column of equal |m|.
    #[inline]
    fn for_each(&self, w: Vec3, mut f: impl FnMut(usize, f32)) {
        let (mut cos_m, mut sin_m) = (1.0_f32, 0.0_f32);
        let mut steps = self.steps.iter();
        for (m, &p_mm) in self.diagonal.iter().enumerate() {
            if m > 0 {
                (cos_m, sin_m) = (cos_m * w.x - sin_m * w.y, cos_m * w.y + sin_m * w.x);
            }
            let mut emit = |l: usize, p: f32| {
                f(l * l + l + m, p * cos_m);
                if m > 0 {
                    f(l * l + l - m, p * sin_m);
                }
            };
            let (mut before, mut p) = (0.0, p_mm);
            emit(m, p);
            for (l, &(a, b)) in (m + 1..=self.order).zip(&mut steps) {
                (before, p) = (p, a * (w.z * p - b * before));
                emit(l, p);
            }
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;
    use proptest::prelude::*;

    fn eval(order: usize, w: Vec3) -> Vec<f32> {
        let basis = Basis::new(order);
        let mut y = vec![0.0; basis.n_coefficients()];
        basis.eval(w, &mut y);
        y
    }

    /// Pₗ by Bonnet's recurrence, in f64.
    fn legendre(l: usize, x: f64) -> f64 {
        let (mut before, mut p) = (0.0, 1.0);
        for k in 0..l {
            let k = k as f64;
            (before, p) = (p, ((2.0 * k + 1.0) * x * p - k * before) / (k + 1.0));
        }
        p
    }

    #[test]
    fn band_1_is_y_z_x() {
        let w = Vec3::new(0.48, -0.6, 0.64);
        let y = eval(1, w);
        let k = (0.75 / std::f32::consts::PI).sqrt();
        assert!((y[0] - (0.25 / std::f32::consts::PI).sqrt()).abs() < 1e-7);
        assert!((Vec3::new(y[3], y[1], y[2]) - w * k).length() < 1e-7);
    }

    #[test]
    fn the_basis_is_orthonormal_up_to_order_10() {
        let basis = Basis::new(10);
        let n = basis.n_coefficients();
        let mut gram = vec![0.0_f64; n * n];
        let mut y = vec![0.0; n];
        for (w, weight) in sphere(11) {
            basis.eval(w.as_vec3(), &mut y);
            for i in 0..n {
                for j in 0..n {
                    gram[i * n + j] += weight * f64::from(y[i]) * f64::from(y[j]);
                }
            }
        }
        for i in 0..n {
            for j in 0..n {
                let exact = f64::from(u8::from(i == j));
                // The rule is exact; f32 recurrences of ten steps are left.
                assert!((gram[i * n + j] - exact).abs() < 1e-5, "{i} {j}");
            }
        }
    }

    proptest! {
        #[test]
        fn products_of_a_band_add_up_to_a_legendre_polynomial(
            a in prop::array::uniform3(-1.0f32..1.0), b in prop::array::uniform3(-1.0f32..1.0)
        ) {
            let (a, b) = (Vec3::from(a), Vec3::from(b));
            prop_assume!(a.length() > 0.1 && b.length() > 0.1);
            let (a, b) = (a.normalize(), b.normalize());
            let (y_a, y_b) = (eval(12, a), eval(12, b));
            for l in 0..=12 {
                let band = l * l..(l + 1) * (l + 1);
                let sum: f64 = band.map(|i| f64::from(y_a[i]) * f64::from(y_b[i])).sum();
                let exact = (2 * l + 1) as f64 / (4.0 * PI) * legendre(l, f64::from(a.dot(b)));
                // Pₗ' is up to l²/2, so the rounding of a·b alone gives 2·10⁻⁵ at l = 12.
                prop_assert!((sum - exact).abs() < 5e-5, "band {l}: {sum} {exact}");
            }
        }

        #[test]
        fn a_function_of_low_bands_is_found_again(
            c in prop::collection::vec(-1.0f32..1.0, 16), w in prop::array::uniform3(-1.0f32..1.0)
        ) {
            prop_assume!(Vec3::from(w).length() > 0.1);
            let basis = Basis::new(3);
            let c: Vec<Vec3> = c.into_iter().map(|c| Vec3::new(c, 1.0, -2.0 * c)).collect();
            let found = basis.project(4, |w| basis.reconstruct(w, &c));
            for (a, b) in c.iter().zip(found) {
                prop_assert!((*a - b).length() < 1e-5);
            }
        }
    }
}
