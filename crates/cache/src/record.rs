//! What the cache stores: a record of the field at one point.
//! Here a record is checked; inside the cache every record is a valid one.

use crate::error::{CacheError, Field};
use glam::Vec3;

/// Smallest radius a record can have; 1/R of a smaller one would overflow.
pub(crate) const MIN_RADIUS: f32 = f32::MIN_POSITIVE;

/// Largest radius a record can have; 1/R of a larger one would lose digits.
pub(crate) const MAX_RADIUS: f32 = 1.0 / f32::MIN_POSITIVE;

/// The field as it was found at one point: `N` channels with their gradients.
#[derive(Clone, Copy, Debug, PartialEq)]
#[cfg_attr(feature = "serde", derive(serde::Serialize, serde::Deserialize))]
pub struct Record<const N: usize> {
    /// Where the field was sampled, in the units of your world.
    pub position: Vec3,
    /// How far from `position` the record is trusted, in the same units; above 0.
    pub radius: f32,
    /// The field's value per channel; 0 or above.
    #[cfg_attr(feature = "serde", serde(with = "serde_big_array::BigArray"))]
    pub value: [f32; N],
    /// How each channel's value changes as the point moves: units of value per unit of length.
    #[cfg_attr(feature = "serde", serde(with = "serde_big_array::BigArray"))]
    pub gradient: [Vec3; N],
    /// Variance of the noise in each channel's value, in units of value squared; 0 for exact values.
    #[cfg_attr(feature = "serde", serde(with = "serde_big_array::BigArray"))]
    pub variance: [f32; N],
}

impl<const N: usize> Record<N> {
    /// Refuses numbers that no field has; `index` is the record's place in its batch.
    pub(crate) fn check(&self, index: usize) -> Result<(), CacheError> {
        let refuse = |field, value| {
            Err(CacheError::InvalidRecord {
                index,
                field,
                value,
            })
        };
        if let Some(x) = not_finite(self.position) {
            return refuse(Field::Position, x);
        }
        if !is_radius(self.radius) {
            return refuse(Field::Radius, self.radius);
        }
        for (channel, &value) in self.value.iter().enumerate() {
            if !(value >= 0.0 && value.is_finite()) {
                return refuse(Field::Value { channel }, value);
            }
        }
        for (channel, &variance) in self.variance.iter().enumerate() {
            if !(variance >= 0.0 && variance.is_finite()) {
                return refuse(Field::Variance { channel }, variance);
            }
        }
        for (channel, &gradient) in self.gradient.iter().enumerate() {
            if let Some(x) = not_finite(gradient) {
                return refuse(Field::Gradient { channel }, x);
            }
        }
        Ok(())
    }
}

/// Whether a record may have this radius.
pub(crate) fn is_radius(radius: f32) -> bool {
    (MIN_RADIUS..=MAX_RADIUS).contains(&radius)
}

/// The first component that is not a finite number.
fn not_finite(v: Vec3) -> Option<f32> {
    v.to_array().into_iter().find(|x| !x.is_finite())
}
