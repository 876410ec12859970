//! What the cache refuses, and in which words.
//! Every message names the place, what was found there, what is allowed and what would mend it.

use crate::record::{MAX_RADIUS, MIN_RADIUS};
use std::fmt;

/// Why the cache refused its input. The cache is unchanged after an error.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum CacheError {
    /// A record holds a number that no field can have.
    #[error("record {index} of the batch: {field} is {value}, but must be {}", field.allowed())]
    InvalidRecord {
        /// Index within the batch handed to [`Cache::insert`](crate::Cache::insert).
        index: usize,
        /// The part of the record at fault.
        field: Field,
        /// The number found there.
        value: f32,
    },

    /// A new radius is outside the range of radii.
    #[error("radius {index} is {value}, but must be {}", Field::Radius.allowed())]
    InvalidRadius {
        /// Index of the record whose radius it would be.
        index: usize,
        /// The number found there.
        value: f32,
    },

    /// The number of new radii is not the number of records.
    #[error(
        "{given} radii were given for {records} records; give one radius per record, in the records' order"
    )]
    RadiusCount {
        /// How many radii were given.
        given: usize,
        /// How many records the cache holds.
        records: usize,
    },

    /// A slope that bounds nothing.
    #[error("the slope of radii is {slope}, but must be finite and at least 0; 0.5 to 1 is usual")]
    InvalidSlope {
        /// The number given.
        slope: f32,
    },

    /// More records than the index can number.
    #[error(
        "{records} records are too many for one cache; it holds up to {allowed}, so use several caches"
    )]
    TooManyRecords {
        /// How many records there would be.
        records: usize,
        /// How many a cache can hold.
        allowed: usize,
    },
}

/// A part of a [`Record`](crate::Record).
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub enum Field {
    /// Where the record stands.
    Position,
    /// How far the record is valid.
    Radius,
    /// The field's value in one channel.
    Value {
        /// Index of the channel.
        channel: usize,
    },
    /// The gradient of the field's value in one channel.
    Gradient {
        /// Index of the channel.
        channel: usize,
    },
    /// The variance of the noise in one channel's value.
    Variance {
        /// Index of the channel.
        channel: usize,
    },
}

impl Field {
    /// What the field's numbers may be, as a part of a sentence.
    fn allowed(self) -> String {
        match self {
            Self::Position | Self::Gradient { .. } => "finite".to_owned(),
            Self::Radius => format!("from {MIN_RADIUS:e} to {MAX_RADIUS:e}"),
            Self::Variance { .. } => "finite and at least 0".to_owned(),
            Self::Value { .. } => {
                "finite and at least 0; leave out samples that are not before averaging".to_owned()
            }
        }
    }
}

impl fmt::Display for Field {
    fn fmt(&self, f: &mut fmt::Formatter<'_>) -> fmt::Result {
        match self {
            Self::Position => write!(f, "the position"),
            Self::Radius => write!(f, "the radius"),
            Self::Value { channel } => write!(f, "the value of channel {channel}"),
            Self::Gradient { channel } => write!(f, "the gradient of channel {channel}"),
            Self::Variance { channel } => write!(f, "the variance of channel {channel}"),
        }
    }
}

#[cfg(test)]
mod tests {
    use super::*;

    #[test]
    fn messages_name_the_place_the_number_and_the_range() {
        let invalid = |field, value| CacheError::InvalidRecord {
            index: 17,
            field,
            value,
        };
        let rows = [
            (
                invalid(Field::Value { channel: 2 }, -1.0),
                "record 17 of the batch: the value of channel 2 is -1, but must be finite and at least 0; \
                 leave out samples that are not before averaging",
            ),
            (
                invalid(Field::Radius, 0.0),
                "record 17 of the batch: the radius is 0, but must be from 1.1754944e-38 to 8.507059e37",
            ),
            (
                CacheError::InvalidSlope { slope: -1.0 },
                "the slope of radii is -1, but must be finite and at least 0; 0.5 to 1 is usual",
            ),
        ];
        for (error, text) in rows {
            assert_eq!(error.to_string(), text);
        }
    }
}
