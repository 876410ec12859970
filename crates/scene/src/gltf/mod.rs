//! glTF 2.0 in: from a `.gltf` or `.glb` file to triangles, materials, textures, lights and cameras in world space.
//!
//! The file is distrusted here: the parsed JSON is read through checks of every index and length, and nothing after this
//! module has to check again.

mod accessor;
mod animation;
mod assemble;
mod buffers;
mod bystanders;
mod cameras;
mod container;
mod curve;
mod error;
mod images;
mod materials;
mod nodes;
mod primitives;
pub(crate) mod punctual;
mod tally;

pub use animation::CameraAnimation;
pub use cameras::{AnimatedCamera, GltfCamera};
pub use error::GltfError;
pub use punctual::PunctualLight;

use crate::error::{SceneError, Warning};
use crate::material::Material;
use crate::mesh::TriangleMesh;
use crate::paths::Folder;
use crate::texture::Texture;
use accessor::Accessors;
use assemble::MeshBuilder;
use buffers::Buffers;
use images::Images;
use materials::Materials;

use std::path::{Path, PathBuf};

/// What to read from a glTF file, and what it may read in turn.
#[derive(Clone, Debug, Default)]
pub struct ReadOptions {
    /// Whether buffers and images may lie outside `root`.
    pub allow_external: bool,
    /// The folder that files named in the glTF may not leave; the glTF's own folder where it is not given.
    pub root: Option<PathBuf>,
    /// Name of the scene to show; without it the file's default scene, or else its first.
    pub scene: Option<String>,
    /// The camera whose animation is read.
    pub animated: AnimatedCamera,
}

/// What a glTF file shows, in world space.
#[derive(Clone, Debug, Default)]
pub struct GltfScene {
    /// All triangles.
    pub mesh: TriangleMesh,
    /// The materials that the triangles name.
    pub materials: Vec<Material>,
    /// The images that the materials name.
    pub textures: Vec<Texture>,
    /// Lights without extent.
    pub lights: Vec<PunctualLight>,
    /// Perspective cameras, in the order of the node tree.
    pub cameras: Vec<GltfCamera>,
    /// What was repaired or left out.
    pub warnings: Vec<Warning>,
    /// The files that were read.
    pub files: Vec<PathBuf>,
}

/// Reads a `.gltf` or `.glb` file.
///
/// # Errors
/// Where the file, or a buffer it needs, cannot be read or is not sound: the error names the place as a JSON pointer.
pub fn read(path: &Path, options: &ReadOptions) -> Result<GltfScene, SceneError> {
    let io_error = |source| SceneError::Read {
        what: "glTF file",
        source,
        path: path.into(),
    };
    let bytes = std::fs::read(path).map_err(io_error)?;
    let mut folder = Folder::of(path, options.allow_external).map_err(io_error)?;
    if let Some(root) = &options.root {
        folder = folder.confined_to(root).map_err(io_error)?;
    }
    let converted = convert(&bytes, &folder, options);
    let mut scene = converted.map_err(|error| SceneError::Gltf {
        error: Box::new(error),
        path: path.into(),
    })?;
    scene.files = folder.into_found();
    scene.files.push(path.into());
    Ok(scene)
}

/// Turns the bytes of a file into a scene.
fn convert(bytes: &[u8], folder: &Folder, options: &ReadOptions) -> Result<GltfScene, GltfError> {
    let document = container::parse(bytes)?;
    let json = &document.json;
    let mut warnings = Vec::new();
    if !document.ignored_extensions.is_empty() {
        warnings.push(Warning::Gltf {
            problem: format!(
                "ignored extensions: {}",
                document.ignored_extensions.join(", ")
            ),
            pointer: "/extensionsUsed".into(),
        });
    }
    let placed = nodes::walk(json, options.scene.as_deref(), &mut warnings)?;
    let buffers = Buffers::new(json, document.binary, folder);
    let accessors = Accessors::new(json, &buffers);
    let materials = Materials::new(json, Images::new(json, &buffers));
    let mut builder = MeshBuilder::new(json, accessors, materials);
    let mut lights = Vec::new();
    let mut ranged = Vec::new();
    let mut cameras = Vec::new();
    let mut nodes_of_cameras = Vec::new();
    for (i, node) in placed.iter().enumerate() {
        builder.add_node(node, &mut warnings)?;
        lights.extend(punctual::on_node(json, node, &mut ranged)?);
        if let Some(camera) = cameras::on_node(json, node, &mut warnings)? {
            cameras.push(camera);
            nodes_of_cameras.push(i);
        }
    }
    bystanders::warn(json, &placed, &mut warnings)?;
    if let Some(i) = options.animated.position(&cameras) {
        cameras[i].animation =
            animation::of_camera(json, accessors, &placed, nodes_of_cameras[i], &mut warnings)?;
    }
    if !ranged.is_empty() {
        ranged.sort();
        ranged.dedup();
        warnings.push(Warning::RangeIgnored { lights: ranged });
    }
    let (mesh, materials, textures) = builder.finish(&mut warnings);
    Ok(GltfScene {
        mesh,
        materials,
        textures,
        lights,
        cameras,
        warnings,
        files: Vec::new(),
    })
}
