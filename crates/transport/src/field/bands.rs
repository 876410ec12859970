//! Directions of the light in a cell of media that do not scatter alike in all directions: a few bands of spherical harmonics.
//!
//! They hold light that was scattered before, in front of a phase function that scatters it again. Light straight from lights is not in
//! them.

use crate::lobe::{self, Lobe, n_above};
use glam::Vec3;
use serde::{Deserialize, Serialize};
use tyndall_media::MediumPoint;

/// The highest band held.
pub(super) const ORDER: usize = 3;

/// Sums of coefficients above band 0 of radiance over 4π that arrives from all directions, W/(m² sr).
///
/// In f32: bands are noisier than what is lost, and there are many.
#[derive(Clone, Copy, Debug, Default, Serialize, Deserialize)]
pub(super) struct Bands([Vec3; n_above(ORDER)]);

impl Bands {
    /// Adds `light` from the unit direction `w_i`, its mean over the sphere.
    pub(super) fn add(&mut self, w_i: Vec3, light: Vec3) {
        lobe::add(ORDER, &mut self.0, w_i, light);
    }

    pub(super) fn merge(&mut self, other: &Self) {
        for (sum, other) in self.0.iter_mut().zip(other.0) {
            *sum += other;
        }
    }

    pub(super) fn is_finite(&self) -> bool {
        self.0.iter().all(|c| c.is_finite())
    }

    /// What they add to light that leaves in the direction of `lobe`.
    pub(super) fn leaving(&self, lobe: &Lobe) -> Vec3 {
        lobe.scatters(&self.0)
    }
}

/// What a point of `medium` makes of bands for light that leaves in the unit direction `w_o`.
pub(super) fn lobe(medium: &MediumPoint<'_>, w_o: Vec3) -> Lobe {
    Lobe::new(medium, w_o, ORDER)
}
