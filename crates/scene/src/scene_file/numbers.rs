//! Checked numbers, vectors and colours: whatever has one of these types is within its range.
//!
//! The checks run while the file is read, so a wrong number is reported at its own line and column and cannot exist
//! afterwards. Numbers are read as f64 and checked once they are f32, because rounding can leave a range too.

use glam::{DVec3, Vec3};
use serde::Deserialize;
use tyndall_media::MAX_SIGMA_T;

/// Largest distance from the origin, radius or height in metres; its square is far from overflow.
pub(crate) const MAX_LENGTH: f32 = 1e12;

/// Largest factor on densities and images.
const MAX_FACTOR: f32 = 1e12;

/// Largest radiometric quantity, far enough below `f32::MAX` for sums over lights and pixels.
pub(crate) const MAX_POWER: f32 = 1e30;

/// Albedos up to this much above 1 are rounding of the program that wrote the file, and become 1.
const ALBEDO_ROUNDING: f32 = 1e-6;

/// A newtype around `f32` read from any number, with the sentence that says what is allowed.
macro_rules! checked_number {
    ($(#[$doc:meta])+ $name:ident, |$x:ident| $valid:expr, $rule:literal) => {
        $(#[$doc])+
        #[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
        #[serde(try_from = "f64")]
        pub struct $name(f32);

        impl $name {
            /// The number itself.
            pub fn get(self) -> f32 {
                self.0
            }
        }

        impl TryFrom<f64> for $name {
            type Error = &'static str;

            fn try_from(number: f64) -> Result<Self, Self::Error> {
                let $x = number as f32;
                if $valid { Ok(Self($x)) } else { Err($rule) }
            }
        }
    };
}

checked_number!(
    /// A coordinate in metres.
    Coordinate, |x| x.abs() <= MAX_LENGTH,
    "a coordinate is a finite number of metres between -1e12 and 1e12"
);
checked_number!(
    /// A radius or height in metres.
    Length, |x| x > 0.0 && x <= MAX_LENGTH,
    "a length is a number of metres above 0 and up to 1e12"
);
checked_number!(
    /// A component of a direction that need not have unit length.
    Component, |x| x.is_finite(),
    "a direction has three finite components"
);
checked_number!(
    /// One channel of radiance, intensity, irradiance or emission.
    Power, |x| (0.0..=MAX_POWER).contains(&x),
    "light is a finite number from 0 to 1e30 in each channel"
);
checked_number!(
    /// One channel of an extinction coefficient, per metre.
    Extinction, |x| (0.0..=MAX_SIGMA_T).contains(&x),
    "an extinction coefficient is a number from 0 to 1e9 per metre in each channel"
);
checked_number!(
    /// A multiplier of densities or of an image's values.
    Factor, |x| (0.0..=MAX_FACTOR).contains(&x),
    "a factor is a finite number from 0 to 1e12"
);
checked_number!(
    /// One channel of a single-scattering albedo; [`Fraction::get`] is at most 1.
    Fraction, |x| (0.0..=1.0 + ALBEDO_ROUNDING).contains(&x),
    "a fraction lies from 0 to 1; an albedo above 1 would create energy"
);
checked_number!(
    /// Mean cosine g of a phase function.
    Asymmetry, |x| x > -1.0 && x < 1.0,
    "g must lie in (-1, 1), both ends excluded: positive scatters forward, negative backward"
);
checked_number!(
    /// A field of view in degrees.
    FieldOfView, |x| x > 0.0 && x < 180.0,
    "a field of view lies in (0, 180) degrees, both ends excluded"
);
checked_number!(
    /// Number of a frame of a camera path; whole numbers are frames that are rendered.
    FrameNumber, |x| (0.0..=1e7).contains(&x),
    "a frame is a number from 0 to 1e7"
);
checked_number!(
    /// Frames per second.
    FrameRate, |x| x > 0.0 && x <= 1e4,
    "a frame rate is a number of frames per second above 0 and up to 10000"
);
checked_number!(
    /// Half-angle of a cone in degrees.
    ConeAngle, |x| (0.0..=90.0).contains(&x),
    "the half-angle of a cone lies from 0 to 90 degrees"
);
checked_number!(
    /// A rotation in degrees.
    Degrees, |x| x.is_finite(),
    "an angle is a finite number of degrees"
);
checked_number!(
    /// Exposure in stops.
    Stops, |x| (-100.0..=100.0).contains(&x),
    "exposure lies from -100 to 100 stops"
);
checked_number!(
    /// The error an image may have.
    TargetError, |x| x > 0.0 && x <= 100.0,
    "the target error is a number above 0 and up to 100; 0.03 is a good image, 0.1 a quick one"
);

macro_rules! default_number {
    ($name:ident, $value:literal) => {
        impl Default for $name {
            fn default() -> Self {
                Self($value)
            }
        }
    };
}

default_number!(Coordinate, 0.0);
default_number!(Factor, 1.0);
default_number!(FrameRate, 24.0);
default_number!(Degrees, 0.0);
default_number!(Stops, 0.0);
default_number!(TargetError, 0.03);

impl Length {
    /// The contract's height of a fog.
    pub const TWO_METRES: Self = Self(2.0);
}

impl Asymmetry {
    /// A haze: most light goes on nearly straight.
    pub const FORWARD: Self = Self(0.7);
}

/// Pixels along one side of an image.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "f64")]
pub struct PixelCount(u32);

impl PixelCount {
    /// The number itself.
    pub fn get(self) -> u32 {
        self.0
    }
}

impl TryFrom<f64> for PixelCount {
    type Error = &'static str;

    fn try_from(number: f64) -> Result<Self, Self::Error> {
        let limit = f64::from(crate::film::MAX_SIDE);
        if number.fract() == 0.0 && (1.0..=limit).contains(&number) {
            Ok(Self(number as u32))
        } else {
            Err("an image is 1 to 65536 pixels wide and high, a whole number")
        }
    }
}

/// Number of scattering events between light and eye.
#[derive(Clone, Copy, Debug, PartialEq, Eq, Deserialize)]
#[serde(try_from = "f64")]
pub struct Depth(u32);

impl Depth {
    /// The number itself.
    pub fn get(self) -> u32 {
        self.0
    }
}

impl TryFrom<f64> for Depth {
    type Error = &'static str;

    fn try_from(number: f64) -> Result<Self, Self::Error> {
        if number.fract() == 0.0 && (0.0..=f64::from(u32::MAX)).contains(&number) {
            Ok(Self(number as u32))
        } else {
            Err("a path depth is a whole number from 0 to 4294967295, or None for no limit")
        }
    }
}

/// A position in metres.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(from = "(Coordinate, Coordinate, Coordinate)")]
pub struct Position(pub Vec3);

impl From<(Coordinate, Coordinate, Coordinate)> for Position {
    fn from((x, y, z): (Coordinate, Coordinate, Coordinate)) -> Self {
        Self(Vec3::new(x.0, y.0, z.0))
    }
}

/// A direction, brought to unit length.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(try_from = "(Component, Component, Component)")]
pub struct Direction(pub Vec3);

impl TryFrom<(Component, Component, Component)> for Direction {
    type Error = &'static str;

    fn try_from((x, y, z): (Component, Component, Component)) -> Result<Self, Self::Error> {
        // f64: the squares of any finite f32 fit.
        let v = DVec3::new(x.0.into(), y.0.into(), z.0.into());
        v.try_normalize()
            .map(|unit| Self(unit.as_vec3()))
            .ok_or("a direction must not be zero in all three components")
    }
}

/// Radiance, intensity, irradiance or emission, linear RGB.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(from = "(Power, Power, Power)")]
pub struct Radiant(pub Vec3);

impl From<(Power, Power, Power)> for Radiant {
    fn from((r, g, b): (Power, Power, Power)) -> Self {
        Self(Vec3::new(r.0, g.0, b.0))
    }
}

/// Extinction per metre, linear RGB.
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(from = "(Extinction, Extinction, Extinction)")]
pub struct ExtinctionRgb(pub Vec3);

impl From<(Extinction, Extinction, Extinction)> for ExtinctionRgb {
    fn from((r, g, b): (Extinction, Extinction, Extinction)) -> Self {
        Self(Vec3::new(r.0, g.0, b.0))
    }
}

/// Single-scattering albedo, linear RGB, each channel in [0, 1].
#[derive(Clone, Copy, Debug, PartialEq, Deserialize)]
#[serde(from = "(Fraction, Fraction, Fraction)")]
pub struct Albedo(pub Vec3);

impl From<(Fraction, Fraction, Fraction)> for Albedo {
    fn from((r, g, b): (Fraction, Fraction, Fraction)) -> Self {
        Self(Vec3::new(r.0, g.0, b.0).min(Vec3::ONE))
    }
}
