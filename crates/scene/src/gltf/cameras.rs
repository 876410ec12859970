//! Perspective cameras of a glTF file, placed in the world.

use super::animation::CameraAnimation;
use super::error::{GltfError, get};
use super::nodes::Placed;
use crate::error::Warning;
use ::gltf::json::Root;
use ::gltf::json::camera::Type;
use ::gltf::json::validation::Checked;
use glam::{Affine3A, DAffine3, Mat3A, Vec3, Vec3A};
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
    /// How animations move the camera; read for the one that [`ReadOptions::animated`](super::ReadOptions) names.
    pub animation: Option<CameraAnimation>,
}

/// Which camera's animation is read.
#[derive(Clone, Debug, Default, PartialEq, Eq)]
pub enum AnimatedCamera {
    /// That of the file's first camera.
    #[default]
    First,
    /// That of the first camera with this name.
    Named(String),
    /// That of none: the scene is seen otherwise.
    None,
}

impl AnimatedCamera {
    /// Which of `cameras` it is.
    pub(super) fn position(&self, cameras: &[GltfCamera]) -> Option<usize> {
        match self {
            Self::First => (!cameras.is_empty()).then_some(0),
            Self::Named(name) => cameras.iter().position(|camera| camera.is_called(name)),
            Self::None => None,
        }
    }
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
    placed.check_invertible()?;
    Ok(Some(GltfCamera {
        name: camera.name.clone(),
        node: placed.node.name.clone(),
        world_from_camera: pose(&placed.world, placed.position()?),
        yfov,
        aspect,
        animation: None,
    }))
}

/// The rigid placement of a camera at `eye` on a node whose transform is invertible: it looks along the node's −z axis, with
/// the node's y axis upward in the image, however that is scaled or sheared.
pub(super) fn pose(world: &DAffine3, eye: Vec3) -> Affine3A {
    let forward = -world.matrix3.z_axis.normalize();
    let right = forward.cross(world.matrix3.y_axis).normalize();
    let axes = [right, right.cross(forward), -forward].map(|axis| Vec3A::from(axis.as_vec3()));
    let [x, y, z] = axes;
    Affine3A {
        matrix3: Mat3A::from_cols(x, y, z),
        translation: eye.into(),
    }
}
