//! Several phase functions at once, as of droplets of several sizes.

use super::{Asymmetry, HenyeyGreenstein, PhaseFunction};
use crate::point::BELOW_ONE;
use glam::Vec3;
use smallvec::SmallVec;
use thiserror::Error;

/// Most different lobes of a mixture; fits in print use two or three (Hong 1985, of zodiacal dust).
pub const MAX_LOBES: usize = 8;

/// A weighted sum of different phase functions.
///
/// `p(μ) = Σ wᵢ pᵢ(μ),  Σ wᵢ = 1`
///
/// Two Henyey–Greenstein lobes, one forward and one backward, are the "double Henyey–Greenstein" of Irvine 1965, "Multiple
/// scattering by large particles", and Kattawar 1975, "A three-parameter analytic phase function for multiple scattering
/// calculations".
///
/// Lobes stand in the struct itself, not behind a pointer: [`PhaseFunction`] so stays `Copy`, and evaluating a mixture
/// touches no memory but the medium's own. The 100 bytes lie idle in media of one lobe and are never read there. Its loops are
/// kept out of line, so that the functions that choose among phase functions stay small enough to be inlined.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Mixture {
    /// Those in use first; a weight of 0 marks the rest.
    lobes: [Lobe; MAX_LOBES],
}

#[derive(Clone, Copy, Debug, Default, PartialEq)]
struct Lobe {
    weight: f32,
    shape: Shape,
}

/// A phase function that is no mixture.
#[derive(Clone, Copy, Debug, Default, PartialEq)]
enum Shape {
    #[default]
    Isotropic,
    HenyeyGreenstein(HenyeyGreenstein),
    Rayleigh,
}

impl From<Shape> for PhaseFunction {
    fn from(shape: Shape) -> Self {
        match shape {
            Shape::Isotropic => Self::Isotropic,
            Shape::HenyeyGreenstein(hg) => Self::HenyeyGreenstein(hg),
            Shape::Rayleigh => Self::Rayleigh,
        }
    }
}

/// Why phase functions do not mix.
#[derive(Clone, Debug, Error, PartialEq)]
pub enum MixtureError {
    /// A weight out of range.
    #[error("weight {found} in a mixture of phase functions must be finite and not negative")]
    Weight {
        /// The weight given.
        found: f32,
    },
    /// Nothing to mix.
    #[error("a mixture of phase functions needs one with a weight above 0")]
    Empty,
    /// More different phase functions than a mixture holds.
    #[error(
        "a mixture has more than {MAX_LOBES} different phase functions, counted after mixtures inside it are taken apart and \
         equal ones added up; leave out those of least weight"
    )]
    TooManyLobes,
}

/// The phase function that scatters as each of `parts` does in proportion to its weight; weights are scaled to add up to 1.
///
/// Mixtures among the parts are taken apart and equal lobes added up: what stays are two or more that differ, and so are not
/// isotropic. One alone is no mixture.
pub(super) fn mix(parts: &[(f32, PhaseFunction)]) -> Result<PhaseFunction, MixtureError> {
    // f64: shares of shares, so that 0.8 of 1 stays 0.8.
    let mut shares: SmallVec<[(f64, Shape); MAX_LOBES]> = SmallVec::new();
    for &(weight, phase) in parts {
        if !(weight.is_finite() && weight >= 0.0) {
            return Err(MixtureError::Weight { found: weight });
        }
        for lobe in Mixture::of(phase).lobes().filter(|_| weight > 0.0) {
            let share = f64::from(weight) * f64::from(lobe.weight);
            match shares.iter().position(|(_, shape)| *shape == lobe.shape) {
                Some(same) => shares[same].0 += share,
                None if shares.len() == MAX_LOBES => return Err(MixtureError::TooManyLobes),
                None => shares.push((share, lobe.shape)),
            }
        }
    }
    let total: f64 = shares.iter().map(|(share, _)| share).sum();
    let mut mixture = Mixture {
        lobes: [Lobe::default(); MAX_LOBES],
    };
    let mut n_lobes = 0;
    for (share, shape) in shares {
        let weight = (share / total) as f32;
        // A share below f32's range is none.
        if weight > 0.0 {
            mixture.lobes[n_lobes] = Lobe { weight, shape };
            n_lobes += 1;
        }
    }
    match n_lobes {
        0 => Err(MixtureError::Empty),
        1 => Ok(mixture.lobes[0].shape.into()),
        _ => Ok(PhaseFunction::Mixture(mixture)),
    }
}

impl Mixture {
    /// The lobes and their weights, which add up to 1.
    pub fn parts(&self) -> impl Iterator<Item = (f32, PhaseFunction)> + '_ {
        self.lobes().map(|lobe| (lobe.weight, lobe.shape.into()))
    }

    /// `phase` as a mixture, of one lobe where it is none.
    fn of(phase: PhaseFunction) -> Self {
        let shape = match phase {
            PhaseFunction::Mixture(mixture) => return mixture,
            PhaseFunction::HenyeyGreenstein(hg) if hg.asymmetry() != Asymmetry::default() => {
                Shape::HenyeyGreenstein(hg)
            }
            PhaseFunction::Isotropic | PhaseFunction::HenyeyGreenstein(_) => Shape::Isotropic,
            PhaseFunction::Rayleigh => Shape::Rayleigh,
        };
        let mut lobes = [Lobe::default(); MAX_LOBES];
        lobes[0] = Lobe { weight: 1.0, shape };
        Self { lobes }
    }

    fn lobes(&self) -> impl Iterator<Item = &Lobe> {
        self.lobes.iter().take_while(|lobe| lobe.weight > 0.0)
    }

    /// Fraction of light scattered from `w_i` into `w_o`, per steradian.
    #[inline(never)]
    pub(super) fn eval(&self, w_o: Vec3, w_i: Vec3) -> f32 {
        self.parts()
            .map(|(weight, phase)| weight * phase.eval(w_o, w_i))
            .sum()
    }

    /// p, dp/dμ and d²p/dμ², per steradian.
    #[inline(never)]
    pub(super) fn derivatives(&self, w_o: Vec3, w_i: Vec3) -> [f32; 3] {
        self.parts().fold([0.0; 3], |sum, (weight, phase)| {
            let of_lobe = phase.derivatives(w_o, w_i);
            std::array::from_fn(|k| sum[k] + weight * of_lobe[k])
        })
    }

    /// A direction `w_i` drawn in proportion to [`Mixture::eval`], and that value.
    ///
    /// The first number chooses the lobe; what is left of it is uniform again and chooses the angle. The last lobe also takes what
    /// rounding leaves over.
    #[inline(never)]
    pub(super) fn sample(&self, w_o: Vec3, [u, v]: [f32; 2]) -> (Vec3, f32) {
        let mut rest = u;
        let mut chosen = self.lobes[0];
        for lobe in self.lobes().skip(1) {
            if rest < chosen.weight {
                break;
            }
            rest -= chosen.weight;
            chosen = *lobe;
        }
        let u = (rest / chosen.weight).min(BELOW_ONE);
        let (w_i, _) = PhaseFunction::from(chosen.shape).sample(w_o, [u, v]);
        (w_i, self.eval(w_o, w_i))
    }

    /// Legendre moment l: `Σ wᵢ χᵢ`.
    pub(super) fn moments(&self, l: usize) -> f32 {
        if l == 0 {
            // By definition; the rounded weights may miss it by their last digit.
            return 1.0;
        }
        self.parts()
            .map(|(weight, phase)| weight * phase.moments(l))
            .sum()
    }
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    fn hg(g: f32) -> PhaseFunction {
        PhaseFunction::henyey_greenstein(g).unwrap()
    }

    fn parts(phase: PhaseFunction) -> Vec<(f32, PhaseFunction)> {
        match phase {
            PhaseFunction::Mixture(mixture) => mixture.parts().collect(),
            alone => vec![(1.0, alone)],
        }
    }

    #[test]
    fn weights_are_shares_and_nested_mixtures_come_apart() {
        let inner = mix(&[(1.0, hg(0.8)), (3.0, PhaseFunction::Rayleigh)]).unwrap();
        let outer = mix(&[
            (0.4, inner),
            (0.2, hg(0.8)),
            (0.3, hg(0.0)),
            (0.1, PhaseFunction::Isotropic),
            (0.0, hg(-0.5)),
        ])
        .unwrap();
        let found = parts(outer);
        let expected = [
            (0.3, hg(0.8)),
            (0.3, PhaseFunction::Rayleigh),
            (0.4, PhaseFunction::Isotropic),
        ];
        assert_eq!(found.len(), expected.len());
        for (found, expected) in found.into_iter().zip(expected) {
            assert_eq!(found.1, expected.1);
            // One rounding in each of weight, share and total.
            assert!((found.0 - expected.0).abs() < 1e-7, "{found:?}");
        }
    }

    #[test]
    fn one_phase_function_alone_is_no_mixture() {
        let twice = mix(&[(0.5, hg(0.7)), (0.5, hg(0.7))]).unwrap();
        assert_eq!(twice, hg(0.7));
        assert_eq!(
            mix(&[(2.0, PhaseFunction::Rayleigh), (0.0, hg(0.1))]).unwrap(),
            PhaseFunction::Rayleigh
        );
        assert!(
            mix(&[(1.0, hg(0.0)), (1.0, PhaseFunction::Isotropic)])
                .unwrap()
                .is_isotropic()
        );
    }

    #[test]
    fn every_random_number_chooses_a_direction() {
        // The f32 sum of these weights is 1.0000001.
        let mixture = mix(&[
            (0.1, hg(0.9)),
            (0.2, hg(-0.9)),
            (0.7, PhaseFunction::Rayleigh),
        ])
        .unwrap();
        for u in [0.0, 0.1, 0.2, 0.3, 0.5, 0.9, BELOW_ONE] {
            let (w_i, pdf) = mixture.sample(Vec3::Y, [u, 0.5]);
            assert!(
                (w_i.length() - 1.0).abs() < 1e-6 && pdf > 0.0,
                "{u}: {w_i} {pdf}"
            );
        }
    }

    #[test]
    fn what_does_not_mix_is_refused_with_what_is_allowed() {
        let message = |parts: &[(f32, PhaseFunction)]| mix(parts).unwrap_err().to_string();
        for weight in [-0.1, f32::NAN, f32::INFINITY] {
            let message = message(&[(weight, hg(0.5)), (1.0, hg(0.1))]);
            assert!(message.contains(&format!("weight {weight}")), "{message}");
        }
        for parts in [&[][..], &[(0.0, hg(0.5))]] {
            assert!(message(parts).contains("above 0"));
        }
        let many: Vec<_> = (1..=9_i8).map(|i| (1.0, hg(0.1 * f32::from(i)))).collect();
        assert!(message(&many).contains("more than 8 different"));
        assert!(mix(&many[1..]).is_ok());
    }
}
