//! Phase functions: in which directions a medium scatters.
//!
//! A new one is a file beside `henyey_greenstein.rs` and a variant of [`PhaseFunction`]; the conformance suite then tests
//! it with one line.

mod henyey_greenstein;

pub use henyey_greenstein::{Asymmetry, AsymmetryError, HenyeyGreenstein};

use glam::Vec3;
use std::f32::consts::PI;
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

    /// Fraction of light scattered from `w_i` into `w_o`, per steradian.
    pub fn eval(&self, w_o: Vec3, w_i: Vec3) -> f32 {
        match self {
            Self::Isotropic => ISOTROPIC,
            Self::HenyeyGreenstein(hg) => hg.eval(w_o, w_i),
        }
    }

    /// The value and how it changes with the cosine of scattering: p, dp/dμ and d²p/dμ², per steradian.
    #[inline]
    pub fn derivatives(&self, w_o: Vec3, w_i: Vec3) -> [f32; 3] {
        match self {
            Self::Isotropic => [ISOTROPIC, 0.0, 0.0],
            Self::HenyeyGreenstein(hg) => hg.derivatives(w_o, w_i),
        }
    }

    /// A direction `w_i` drawn in proportion to [`PhaseFunction::eval`], and its density per steradian, which is that very value.
    ///
    /// `u` holds two numbers in [0, 1).
    pub fn sample(&self, w_o: Vec3, u: [f32; 2]) -> (Vec3, f32) {
        match self {
            Self::Isotropic => (uniform_sphere(u), ISOTROPIC),
            Self::HenyeyGreenstein(hg) => hg.sample(w_o, u),
        }
    }

    /// Density per steradian with which [`PhaseFunction::sample`] picks `w_i`.
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
        }
    }

    /// Whether all directions are equal.
    pub fn is_isotropic(&self) -> bool {
        match self {
            Self::Isotropic => true,
            Self::HenyeyGreenstein(hg) => hg.asymmetry().get() == 0.0,
        }
    }
}

#[cfg(test)]
mod conformance;

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn phase_functions_conform() {
        conformance::check(&PhaseFunction::Isotropic);
        for g in [
            0.0, 1e-7, -1e-3, 0.3, -0.5, 0.75, 0.9, -0.9, 0.99, 0.999, -0.999, 0.9999,
        ] {
            conformance::check(&PhaseFunction::henyey_greenstein(g).unwrap());
        }
    }

    #[test]
    fn only_equal_directions_count_as_isotropic() {
        assert!(PhaseFunction::default().is_isotropic());
        assert!(
            PhaseFunction::henyey_greenstein(0.0)
                .unwrap()
                .is_isotropic()
        );
        assert!(
            !PhaseFunction::henyey_greenstein(1e-3)
                .unwrap()
                .is_isotropic()
        );
    }

    #[test]
    fn slope_and_curvature_are_those_of_the_value() {
        let h = 1e-3_f32;
        for g in [-0.7, 0.0, 0.3, 0.8] {
            let phase = PhaseFunction::henyey_greenstein(g).unwrap();
            for angle in [0.3_f32, 1.0, 2.0, 3.0] {
                let w = |angle: f32| -Vec3::new(angle.sin(), 0.0, angle.cos());
                let [below, here, above] =
                    [h, 0.0, -h].map(|h| phase.derivatives(Vec3::Z, w(angle + h)));
                assert_eq!(here[0], phase.eval(Vec3::Z, w(angle)));
                for k in [0, 1] {
                    let slope = (above[k] - below[k]) / ((angle - h).cos() - (angle + h).cos());
                    // Rounding of the difference: 1e-7 of the function over a step of 2h sin(angle).
                    let rounding = 5e-4 / angle.sin() * here[k].abs();
                    let found = here[k + 1];
                    assert!(
                        (found - slope).abs() <= 1e-3 * slope.abs() + rounding,
                        "{g} {angle}: {found} {slope}"
                    );
                }
            }
        }
    }

    #[test]
    fn light_goes_on_forward_for_positive_g() {
        // The sign, in the words of the conventions: looking along w_o's reverse at light that comes straight on.
        let forward = PhaseFunction::henyey_greenstein(0.5).unwrap();
        assert!(forward.eval(Vec3::Z, Vec3::NEG_Z) > 25.0 * forward.eval(Vec3::Z, Vec3::Z));
    }
}
