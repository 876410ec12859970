//! Lights without extent, as `KHR_lights_punctual` and the scene file know them, placed in the world.

use super::error::{GltfError, get};
use super::nodes::Placed;
use crate::scene_file::numbers::MAX_POWER;
use ::gltf::json::Root;
use ::gltf::json::extensions::scene::khr_lights_punctual::{Light, Spot, Type};
use ::gltf::json::validation::Checked;
use glam::Vec3;
use std::f32::consts::FRAC_PI_2;

/// A light without extent, in world space; quantities are linear RGB and radiant.
#[derive(Clone, Copy, Debug, PartialEq)]
pub enum PunctualLight {
    /// Shines from a point equally into all directions.
    Point {
        /// Position in metres.
        position: Vec3,
        /// Radiant intensity, W/sr.
        intensity: Vec3,
    },
    /// Shines from a point into a cone.
    Spot {
        /// Position in metres.
        position: Vec3,
        /// Unit direction in which the light travels along the axis.
        direction: Vec3,
        /// Radiant intensity on the axis, W/sr.
        intensity: Vec3,
        /// Half-angle within which the intensity is full, in radians, at most `outer_cone`.
        inner_cone: f32,
        /// Half-angle beyond which it is zero, in radians, at most π/2.
        outer_cone: f32,
    },
    /// Shines from infinitely far away.
    Directional {
        /// Unit direction in which the light travels.
        direction: Vec3,
        /// Irradiance on a plane perpendicular to the direction, W/m².
        irradiance: Vec3,
    },
}

/// The light on a node, if it has one; adds the name of a light with a `range` to `ranged`.
///
/// Candela and lux are taken as radiant intensity and irradiance as they stand.
pub(super) fn on_node(
    json: &Root,
    placed: &Placed<'_>,
    ranged: &mut Vec<String>,
) -> Result<Option<PunctualLight>, GltfError> {
    let extensions = placed.node.extensions.as_ref();
    let Some(named) = extensions.and_then(|e| e.khr_lights_punctual.as_ref()) else {
        return Ok(None);
    };
    let index = named.light.value();
    let lights: &[Light] = json.as_ref();
    let light = get(lights, index, "lights", || {
        format!("{}/extensions/KHR_lights_punctual/light", placed.pointer())
    })?;
    let pointer = format!("/extensions/KHR_lights_punctual/lights/{index}");
    let color = Vec3::from(light.color);
    let power = color * light.intensity;
    let bounded = power.is_finite() && power.max_element() <= MAX_POWER;
    if !bounded || color.min_element() < 0.0 || light.intensity < 0.0 {
        return Err(GltfError::value(
            pointer,
            format!("color {:?} with intensity {}", light.color, light.intensity),
            "both must be finite and not negative, and their product at most 1e30",
        ));
    }
    if light.range.is_some() {
        ranged.push(light.name.clone().unwrap_or_else(|| index.to_string()));
    }
    let Checked::Valid(kind) = light.type_ else {
        return Err(GltfError::value(
            format!("{pointer}/type"),
            "an unknown name",
            "allowed are \"point\", \"spot\" and \"directional\"",
        ));
    };
    Ok(Some(match kind {
        Type::Point => PunctualLight::Point {
            position: placed.position()?,
            intensity: power,
        },
        Type::Spot => {
            let (inner_cone, outer_cone) = cone(light.spot.as_ref(), &pointer)?;
            PunctualLight::Spot {
                position: placed.position()?,
                direction: placed.forward()?.as_vec3(),
                intensity: power,
                inner_cone,
                outer_cone,
            }
        }
        Type::Directional => PunctualLight::Directional {
            direction: placed.forward()?.as_vec3(),
            irradiance: power,
        },
    }))
}

/// Half-angles of a spot's inner and outer cone; without `spot`, glTF's defaults 0 and π/4.
fn cone(spot: Option<&Spot>, pointer: &str) -> Result<(f32, f32), GltfError> {
    let (inner, outer) = spot.map_or((0.0, std::f32::consts::FRAC_PI_4), |spot| {
        (spot.inner_cone_angle, spot.outer_cone_angle)
    });
    // Exporters write π/2 rounded either way.
    const ROUNDING: f32 = 1e-6;
    let sound = inner >= 0.0 && inner <= outer && outer > 0.0 && outer <= FRAC_PI_2 + ROUNDING;
    if !sound {
        return Err(GltfError::value(
            format!("{pointer}/spot"),
            format!("innerConeAngle {inner} with outerConeAngle {outer}"),
            "0 ≤ inner ≤ outer ≤ π/2 and outer > 0 are needed",
        ));
    }
    Ok((inner.min(FRAC_PI_2), outer.min(FRAC_PI_2)))
}
