//! Phase functions: in which directions a medium scatters.
//!
//! A new one is a file beside `henyey_greenstein.rs`, a variant of [`PhaseFunction`], and one of `Shape` so that it mixes; the
//! conformance suite then tests it with one line.

mod henyey_greenstein;
mod mixture;
mod rayleigh;

pub use henyey_greenstein::{Asymmetry, AsymmetryError, HenyeyGreenstein};
pub use mixture::{MAX_LOBES, Mixture, MixtureError};

use glam::Vec3;
use rayleigh::Rayleigh;
use std::f32::consts::{PI, TAU};
use tyndall_math::Frame;
use tyndall_math::warp::uniform_sphere;

/// A phase function: a density over directions, normalised to 1 over the sphere.
///
/// `w_o` leaves the point towards the eye, `w_i` points to where light comes from. All functions depend on the cosine
/// `μ = −w_i · w_o` alone, the cosine of the angle by which light is turned.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
pub enum PhaseFunction {
    /// Equal in all directions: 1/4π.
    #[default]
    Isotropic,
    /// One lobe, forward for g > 0.
    HenyeyGreenstein(HenyeyGreenstein),
    /// Forward as much as backward, half as much across: 3/(16π) (1 + μ²).
    Rayleigh,
    /// Several at once.
    Mixture(Mixture),
}

/// 1/4π, per steradian.
const ISOTROPIC: f32 = 1.0 / (4.0 * PI);

impl PhaseFunction {
    /// Henyey–Greenstein with mean cosine `g`.
    ///
    /// # Errors
    /// Unless −1 < g < 1.
    pub fn henyey_greenstein(g: f32) -> Result<Self, AsymmetryError> {
        Ok(Self::HenyeyGreenstein(HenyeyGreenstein::new(
            Asymmetry::new(g)?,
        )))
    }

    /// The phase function that scatters as each of `parts` does in proportion to its weight; weights are scaled to add up to 1.
    ///
    /// Mixtures among the parts are taken apart and equal parts added up; one phase function alone is itself, not a mixture.
    ///
    /// # Errors
    /// Where a weight is negative or not finite, none is above 0, or more than [`MAX_LOBES`] different phase functions are left.
    pub fn mixture(parts: &[(f32, Self)]) -> Result<Self, MixtureError> {
        mixture::mix(parts)
    }

    /// Fraction of light scattered from `w_i` into `w_o`, per steradian.
    #[inline]
    pub fn eval(&self, w_o: Vec3, w_i: Vec3) -> f32 {
        match self {
            Self::Isotropic => ISOTROPIC,
            Self::HenyeyGreenstein(hg) => hg.eval(w_o, w_i),
            Self::Rayleigh => Rayleigh.eval(w_o, w_i),
            Self::Mixture(mixture) => mixture.eval(w_o, w_i),
        }
    }

    /// The value and how it changes with the cosine of scattering: p, dp/dμ and d²p/dμ², per steradian.
    #[inline]
    pub fn derivatives(&self, w_o: Vec3, w_i: Vec3) -> [f32; 3] {
        match self {
            Self::Isotropic => [ISOTROPIC, 0.0, 0.0],
            Self::HenyeyGreenstein(hg) => hg.derivatives(w_o, w_i),
            Self::Rayleigh => Rayleigh.derivatives(w_o, w_i),
            Self::Mixture(mixture) => mixture.derivatives(w_o, w_i),
        }
    }

    /// A direction `w_i` drawn in proportion to [`PhaseFunction::eval`], and its density per steradian, which is that very value.
    ///
    /// `u` holds two numbers in [0, 1).
    #[inline]
    pub fn sample(&self, w_o: Vec3, u: [f32; 2]) -> (Vec3, f32) {
        match self {
            Self::Isotropic => (uniform_sphere(u), ISOTROPIC),
            Self::HenyeyGreenstein(hg) => hg.sample(w_o, u),
            Self::Rayleigh => Rayleigh.sample(w_o, u),
            Self::Mixture(mixture) => mixture.sample(w_o, u),
        }
    }

    /// Density per steradian with which [`PhaseFunction::sample`] picks `w_i`.
    #[inline]
    pub fn pdf(&self, w_o: Vec3, w_i: Vec3) -> f32 {
        self.eval(w_o, w_i)
    }

    /// The mean of μ, in (−1, 1).
    pub fn mean_cosine(&self) -> f32 {
        self.moments(1)
    }

    /// The Legendre moment `χ_l = 2π ∫ p(μ) P_l(μ) dμ`, the factor by which scattering scales band l of spherical harmonics.
    pub fn moments(&self, l: usize) -> f32 {
        match self {
            Self::Isotropic => {
                if l == 0 {
                    1.0
                } else {
                    0.0
                }
            }
            Self::HenyeyGreenstein(hg) => hg.moments(l),
            Self::Rayleigh => Rayleigh.moments(l),
            Self::Mixture(mixture) => mixture.moments(l),
        }
    }

    /// Whether all directions are equal.
    pub fn is_isotropic(&self) -> bool {
        match self {
            Self::Isotropic => true,
            Self::HenyeyGreenstein(hg) => hg.asymmetry().get() == 0.0,
            // Lobes of a mixture differ, and none of them is a sum of others.
            Self::Rayleigh | Self::Mixture(_) => false,
        }
    }
}

/// The direction at an angle of given sine and cosine from `axis`, turned around it by `v` of a circle.
#[inline]
fn around(axis: Vec3, (sin_theta, cos_theta): (f32, f32), v: f32) -> Vec3 {
    let (sin_phi, cos_phi) = (TAU * v).sin_cos();
    Frame::from_normal(axis).to_world(Vec3::new(
        sin_theta * cos_phi,
        sin_theta * sin_phi,
        cos_theta,
    ))
}

#[cfg(test)]
mod conformance;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    fn hg(g: f32) -> PhaseFunction {
        PhaseFunction::henyey_greenstein(g).unwrap()
    }

    fn mix(parts: &[(f32, PhaseFunction)]) -> PhaseFunction {
        PhaseFunction::mixture(parts).unwrap()
    }

    #[test]
    fn phase_functions_conform() {
        conformance::check(&PhaseFunction::Isotropic);
        for g in [
            0.0, 1e-7, -1e-7, -1e-3, 0.3, -0.5, 0.75, 0.9, -0.9, 0.99, 0.999, -0.999, 0.9999,
            -0.9999,
        ] {
            conformance::check(&hg(g));
        }
        conformance::check(&PhaseFunction::Rayleigh);
        conformance::check(&mix(&[(0.7, hg(0.8)), (0.3, hg(-0.3))]));
        conformance::check(&mix(&[
            (0.01, hg(0.9999)),
            (0.9, PhaseFunction::Rayleigh),
            (0.09, PhaseFunction::Isotropic),
        ]));
        let eight = [-0.9, -0.6, -0.3, -0.1, 0.2, 0.5, 0.8, 0.95].map(|g| (0.125, hg(g)));
        conformance::check(&mix(&eight));
    }

    #[test]
    fn moments_are_the_exact_ones() {
        // exact-benchmarks.md E4, by quadrature with 30 digits.
        for (phase, exact) in [
            (hg(0.3), [0.3, 0.09, 0.027, 0.0081, 0.00243, 0.000729]),
            (
                hg(0.85),
                [
                    0.85,
                    0.7225,
                    0.614125,
                    0.52200625,
                    0.4437053125,
                    0.377149515625,
                ],
            ),
            (hg(-0.6), [-0.6, 0.36, -0.216, 0.1296, -0.07776, 0.046656]),
            (
                hg(0.99),
                [
                    0.99,
                    0.9801,
                    0.970299,
                    0.96059601,
                    0.9509900499,
                    0.941480149401,
                ],
            ),
            (PhaseFunction::Rayleigh, [0.0, 0.1, 0.0, 0.0, 0.0, 0.0]),
            (
                mix(&[(0.7, hg(0.8)), (0.3, hg(-0.3))]),
                [0.47, 0.475, 0.3503, 0.28915, 0.228647, 0.1837195],
            ),
        ] {
            for (l, exact) in std::iter::once(1.0).chain(exact).enumerate() {
                let found = f64::from(phase.moments(l));
                // g is rounded to half an ulp, its l-th power l times and l more in multiplying.
                let rounding = (2 * l) as f64 * f64::from(f32::EPSILON) / 2.0;
                assert!(
                    (found - exact).abs() <= rounding,
                    "{phase:?}, moment {l}: {found}"
                );
            }
        }
    }

    #[test]
    fn slope_and_curvature_are_differences_of_the_formula() {
        let henyey_greenstein = |g: f64, mu: f64| {
            (1.0 - g * g) / (1.0 + g * g - 2.0 * g * mu).powf(1.5) * f64::from(ISOTROPIC)
        };
        // Each phase function beside its textbook form in f64.
        type Formula<'a> = Box<dyn Fn(f64) -> f64 + 'a>;
        let of_lobe =
            |g: f32| -> Formula<'_> { Box::new(move |mu| henyey_greenstein(f64::from(g), mu)) };
        let rayleigh = |mu: f64| 0.75 * (1.0 + mu * mu) * f64::from(ISOTROPIC);
        let mut rows: Vec<(PhaseFunction, Formula<'_>)> = [-0.9, -0.7, 0.3, 0.8, 0.95]
            .map(|g| (hg(g), of_lobe(g)))
            .into();
        rows.push((PhaseFunction::Isotropic, of_lobe(0.0)));
        rows.push((PhaseFunction::Rayleigh, Box::new(rayleigh)));
        rows.push((
            mix(&[
                (0.5, hg(0.75)),
                (0.25, hg(-0.5)),
                (0.25, PhaseFunction::Rayleigh),
            ]),
            Box::new(|mu| {
                0.5 * henyey_greenstein(0.75, mu)
                    + 0.25 * (henyey_greenstein(-0.5, mu) + rayleigh(mu))
            }),
        ));
        for (phase, formula) in &rows {
            for angle in [0.1_f32, 0.3, 1.0, 1.5, 2.0, 3.0] {
                let w_i = -Vec3::new(angle.sin(), 0.0, angle.cos());
                let [p, slope, curvature] = phase.derivatives(Vec3::Z, w_i).map(f64::from);
                assert_eq!(p as f32, phase.eval(Vec3::Z, w_i));
                // The angle of the rounded vector.
                let mu = -w_i.as_dvec3().normalize().z;
                let h = 1e-5;
                let [below, here, above] = [-h, 0.0, h].map(|h| formula(mu + h));
                let differences = [
                    (above - below) / (2.0 * h),
                    (above - 2.0 * here + below) / (h * h),
                ];
                for (found, difference) in [slope, curvature].into_iter().zip(differences) {
                    // The next derivatives add up to h²/12 · 63 g²/D² = 4e-6 in the narrowest peak, and rounding of the second
                    // difference 4 ε/h² = 4e-6 of p; f32 adds 1e-6.
                    let tolerance = 1e-5 * (difference.abs() + p);
                    assert!(
                        (found - difference).abs() <= tolerance,
                        "{phase:?} at {angle}: {found} not {difference}"
                    );
                }
            }
        }
    }

    #[test]
    fn only_equal_directions_count_as_isotropic() {
        assert!(PhaseFunction::default().is_isotropic());
        assert!(hg(0.0).is_isotropic() && hg(-0.0).is_isotropic());
        assert!(mix(&[(0.5, hg(0.0)), (0.5, PhaseFunction::Isotropic)]).is_isotropic());
        assert!(!hg(1e-3).is_isotropic());
        assert!(!PhaseFunction::Rayleigh.is_isotropic());
        assert!(!mix(&[(0.5, hg(0.5)), (0.5, hg(-0.5))]).is_isotropic());
    }

    #[test]
    fn light_goes_on_forward_for_positive_g() {
        // The sign, in the words of the conventions: looking along w_o's reverse at light that comes straight on.
        let forward = PhaseFunction::henyey_greenstein(0.5).unwrap();
        assert!(forward.eval(Vec3::Z, Vec3::NEG_Z) > 25.0 * forward.eval(Vec3::Z, Vec3::Z));
    }
}
