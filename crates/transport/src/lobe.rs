//! Directions of light in a medium as spherical harmonics, and what a phase function makes of them.
//!
//! Scattering scales band l by the Legendre moment χₗ, so that of light scattered before few bands count. Band 0 is kept apart, as the mean
//! over all directions.

use glam::Vec3;
use smallvec::SmallVec;
use std::f32::consts::PI;
use std::sync::LazyLock;
use tyndall_math::sh::{Basis, n_coefficients};
use tyndall_media::MediumPoint;

/// The highest band there may be.
pub const MOST_ORDER: usize = 8;

/// Coefficients of bands 1 to `order`.
pub const fn n_above(order: usize) -> usize {
    n_coefficients(order) - 1
}

static BASES: LazyLock<[Basis; MOST_ORDER + 1]> = LazyLock::new(|| std::array::from_fn(Basis::new));

/// Coefficients for the bands of few orders lie on the stack.
type Numbers<T> = SmallVec<[T; n_coefficients(3)]>;

/// All functions of bands 0 to `order` at the unit vector `w`.
fn basis(order: usize, w: Vec3) -> Numbers<f32> {
    let mut y = SmallVec::from_elem(0.0, n_coefficients(order));
    BASES[order].eval(w, &mut y);
    y
}

/// Adds `light` that comes from the unit direction `w_i`, as its mean over the sphere, to the coefficients above band 0 of radiance over
/// 4π: `light` Yₗₘ.
pub(crate) fn add(order: usize, coefficients: &mut [Vec3], w_i: Vec3, light: Vec3) {
    debug_assert_eq!(coefficients.len(), n_above(order));
    for (sum, y) in coefficients.iter_mut().zip(&basis(order, w_i)[1..]) {
        *sum += light * *y;
    }
}

/// What a point's phase function makes of coefficients, for light that leaves in one direction.
#[derive(Clone, Debug)]
pub struct Lobe(Numbers<Vec3>);

impl Lobe {
    /// For light with bands up to `order` (at most [`MOST_ORDER`]) that leaves a point of `medium` in the unit direction `w_o`.
    pub fn new(medium: &MediumPoint<'_>, w_o: Vec3, order: usize) -> Self {
        // Light that comes from w_i goes on as from −w_i.
        let y = basis(order, -w_o);
        let mut weights = SmallVec::new();
        for l in 1..=order {
            // The coefficients are shares of 4π.
            let moment = medium.moments(l) * (4.0 * PI);
            weights.extend(y[l * l..n_coefficients(l)].iter().map(|&y| moment * y));
        }
        Self(weights)
    }

    /// What bands above 0 add to the light that would be scattered alike in all directions; either sign.
    pub fn scatters(&self, coefficients: &[Vec3]) -> Vec3 {
        let terms = self.0.iter().zip(coefficients);
        terms.map(|(&weight, &c)| weight * c).sum()
    }
}
