//! Perspective cameras of a glTF file, placed in the world.

use super::error::{GltfError, get};
use super::nodes::Placed;
use crate::error::Warning;
use ::gltf::json::Root;
use ::gltf::json::camera::Type;
use ::gltf::json::validation::Checked;
use glam::{Affine3A, Mat3A, Vec3A};
use std::f32::consts::PI;

/// A perspective camera.
#[derive(Clone, Debug, PartialEq)]
pub struct GltfCamera {
    /// Name of the camera, where it has one.
    pub name: Option<String>,
    /// Name of the node that carries it, where it has one; several nodes may carry one camera.
    pub node: Option<String>,
    /// From camera space (x right, y up, looking along −z) to the world; a rotation and a translation, whatever scale or
    /// mirroring the node has.
    pub world_from_camera: Affine3A,
    /// Vertical field of view in radians, in (0, π).
    pub yfov: f32,
    /// Width over height, where the file states it.
    pub aspect: Option<f32>,
}

impl GltfCamera {
    /// Whether the camera or its node is called `name`.
    pub fn is_called(&self, name: &str) -> bool {
        [&self.node, &self.name]
            .into_iter()
            .flatten()
            .any(|n| n == name)
    }
}

/// The camera on a node, if it has one that can be used.
pub(super) fn on_node(
    json: &Root,
    placed: &Placed<'_>,
    warnings: &mut Vec<Warning>,
) -> Result<Option<GltfCamera>, GltfError> {
    let Some(camera) = placed.node.camera else {
        return Ok(None);
    };
    let index = camera.value();
    let camera = get(&json.cameras, index, "cameras", || {
        format!("{}/camera", placed.pointer())
    })?;
    let pointer = format!("/cameras/{index}");
    let Some(perspective) = &camera.perspective else {
        if matches!(camera.type_, Checked::Valid(Type::Orthographic)) {
            warnings.push(Warning::Gltf {
                problem:
                    "an orthographic camera is left out; only perspective cameras are supported"
                        .into(),
                pointer,
            });
            return Ok(None);
        }
        return Err(GltfError::value(
            pointer,
            "a camera without \"perspective\"",
            "a perspective camera needs it, with yfov and znear",
        ));
    };
    let yfov = perspective.yfov;
    if !(yfov > 0.0 && yfov < PI) {
        return Err(GltfError::value(
            format!("{pointer}/perspective/yfov"),
            yfov,
            "it lies between 0 and π, in radians",
        ));
    }
    let aspect = perspective.aspect_ratio;
    if aspect.is_some_and(|aspect| !(aspect > 0.0 && aspect.is_finite())) {
        return Err(GltfError::value(
            format!("{pointer}/perspective/aspectRatio"),
            aspect.unwrap_or_default(),
            "it is finite and greater than 0",
        ));
    }
    let forward = placed.forward()?;
    let up = placed.world.matrix3.y_axis;
    let right = forward.cross(up).normalize();
    let axes = [right, right.cross(forward), -forward].map(|axis| Vec3A::from(axis.as_vec3()));
    let [x, y, z] = axes;
    Ok(Some(GltfCamera {
        name: camera.name.clone(),
        node: placed.node.name.clone(),
        world_from_camera: Affine3A {
            matrix3: Mat3A::from_cols(x, y, z),
            translation: placed.position()?.into(),
        },
        yfov,
        aspect,
    }))
}
