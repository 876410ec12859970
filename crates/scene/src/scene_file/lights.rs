//! The lights of a scene file.

use super::numbers::{ConeAngle, Degrees, Direction, Factor, Position, Radiant};
use crate::gltf::PunctualLight;
use serde::Deserialize;

/// A light as the scene file writes it.
#[derive(Clone, Debug, PartialEq, Deserialize)]
pub enum Light {
    /// Shines from a point equally into all directions.
    Point(Point),
    /// Shines from a point into a cone.
    Spot(Spot),
    /// Shines from infinitely far away, in one direction.
    Directional(Directional),
    /// Shines from everywhere, equally.
    Sky(Sky),
    /// Shines from everywhere, as an image tells.
    Environment(Environment),
}

/// `Point(position: (0, 2, 0), intensity: (8, 8, 8))`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Point {
    /// Where it is.
    pub position: Position,
    /// Radiant intensity, W/sr.
    pub intensity: Radiant,
}

impl Point {
    /// The same light placed in the world.
    pub fn placed(&self) -> PunctualLight {
        PunctualLight::Point {
            position: self.position.0,
            intensity: self.intensity.0,
        }
    }
}

/// A [`SpotFields`] whose inner cone lies within its outer one.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(try_from = "SpotFields")]
pub struct Spot(pub SpotFields);

impl Spot {
    /// The same light placed in the world.
    pub fn placed(&self) -> PunctualLight {
        let Self(spot) = self;
        PunctualLight::Spot {
            position: spot.position.0,
            direction: spot.direction.0,
            intensity: spot.intensity.0,
            inner_cone: spot.inner_cone.get().to_radians(),
            outer_cone: spot.outer_cone.get().to_radians(),
        }
    }
}

/// `Spot(position: …, direction: …, intensity: …, inner_cone: 10, outer_cone: 20)`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(rename = "Spot", deny_unknown_fields)]
pub struct SpotFields {
    /// Where it is.
    pub position: Position,
    /// Direction of travel along the axis.
    pub direction: Direction,
    /// Radiant intensity on the axis, W/sr.
    pub intensity: Radiant,
    /// Half-angle of full intensity.
    pub inner_cone: ConeAngle,
    /// Half-angle beyond which nothing shines.
    pub outer_cone: ConeAngle,
}

impl TryFrom<SpotFields> for Spot {
    type Error = String;

    fn try_from(spot: SpotFields) -> Result<Self, Self::Error> {
        let (inner, outer) = (spot.inner_cone.get(), spot.outer_cone.get());
        if outer == 0.0 {
            Err("a spot light of outer_cone 0 shines nowhere; outer_cone must be above 0".into())
        } else if inner > outer {
            Err(format!(
                "inner_cone {inner} is larger than outer_cone {outer}; it must be at most as large"
            ))
        } else {
            Ok(Self(spot))
        }
    }
}

/// `Directional(direction: (0, -1, 0), irradiance: (3, 3, 3))`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Directional {
    /// Direction in which the light travels.
    pub direction: Direction,
    /// Irradiance on a plane perpendicular to it, W/m².
    pub irradiance: Radiant,
}

impl Directional {
    /// The same light placed in the world.
    pub fn placed(&self) -> PunctualLight {
        PunctualLight::Directional {
            direction: self.direction.0,
            irradiance: self.irradiance.0,
        }
    }
}

/// `Sky(radiance: (1, 1, 1))`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Sky {
    /// Radiance from every direction, W/(m² sr).
    pub radiance: Radiant,
}

/// `Environment(file: "sky.exr", scale: 1.0, rotation: 0.0)`.
#[derive(Clone, Debug, PartialEq, Deserialize)]
#[serde(deny_unknown_fields)]
pub struct Environment {
    /// Equirectangular image, relative to the scene file.
    pub file: String,
    /// Multiplies the image's values.
    #[serde(default)]
    pub scale: Factor,
    /// Turn around the vertical, counter-clockwise seen from above, in degrees.
    #[serde(default)]
    pub rotation: Degrees,
}
