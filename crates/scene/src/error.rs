//! What can be wrong with a scene, and what was put right or deserves a word.
//!
//! Every error is one readable paragraph: what, where, what is allowed and what would mend it, the path last.

use crate::gltf::GltfError;
use crate::scene_file::{Place, SceneFileError};
use std::path::PathBuf;

/// Why a scene could not be loaded. Everything here is for the person who wrote or named the file.
#[derive(Debug, thiserror::Error)]
#[non_exhaustive]
pub enum SceneError {
    /// A file could not be read.
    #[error("cannot read the {what}: {source} ({})", path.display())]
    Read {
        /// What the file was wanted for, as in "scene file".
        what: &'static str,
        /// What the operating system said.
        source: std::io::Error,
        /// The file.
        path: PathBuf,
    },

    /// A file is larger than any sound one of its kind.
    #[error(
        "the {what} holds {bytes} bytes, more than the {limit} allowed for one; is it another kind of file? ({})",
        path.display()
    )]
    TooLarge {
        /// What the file was wanted for.
        what: &'static str,
        /// Its size.
        bytes: u64,
        /// The largest size that is read.
        limit: u64,
        /// The file.
        path: PathBuf,
    },

    /// The file's name does not say that it is a scene.
    #[error(
        "a scene is a .ron file or, together with --fog, a .glb or .gltf file; this name ends in {} ({})",
        path.extension().map_or("nothing".into(), |end| format!("\"{}\"", end.display())),
        path.display()
    )]
    UnknownKind {
        /// The file.
        path: PathBuf,
    },

    /// A bare glTF file holds no media, and none were asked for.
    #[error(
        "a bare glTF file holds no fog: add some with --fog SIGMA_T[,ALBEDO[,G]], for example --fog 0.1,0.95, or name a .ron \
         scene file that refers to it ({})",
        path.display()
    )]
    FogMissing {
        /// The file.
        path: PathBuf,
    },

    /// The scene file itself is at fault, at a known place.
    #[error(transparent)]
    SceneFile(#[from] Box<SceneFileError>),

    /// A glTF file is at fault.
    #[error("{error} ({})", path.display())]
    Gltf {
        /// What is wrong, and where in the file.
        error: Box<GltfError>,
        /// The file.
        path: PathBuf,
    },

    /// Something a field refers to or asks for is wrong, seen when the scene was put together.
    #[error("{problem} (at `{field}`, {place})")]
    Field {
        /// What is wrong, what is allowed, what would mend it.
        problem: String,
        /// Path of the field, as in `lights[2].file`.
        field: String,
        /// Where it stands.
        place: Place,
    },

    /// Something that no field says is wrong: the size of the image or the fog asked for, or a glTF's camera.
    #[error("{problem} ({})", path.display())]
    Whole {
        /// What is wrong, what is allowed, what would mend it.
        problem: String,
        /// The scene.
        path: PathBuf,
    },

    /// No camera is named and there is nothing to frame.
    #[error(
        "there is no camera, and neither surfaces nor bounded media that a view could frame; add a camera to the scene file, \
         for example camera: LookAt(eye: (0.0, 1.0, 5.0), target: (0.0, 1.0, 0.0), vfov: 40.0) ({})",
        path.display()
    )]
    NoCamera {
        /// The scene.
        path: PathBuf,
    },
}

/// Something about a scene that was repaired or ignored, or that will look odd; the image is still made.
#[derive(Clone, Debug, PartialEq, thiserror::Error)]
#[non_exhaustive]
pub enum Warning {
    /// Light from infinitely far away must cross unbounded fog.
    #[error(
        "{light} shines through medium \"{medium}\", which has no bounds: nothing of it arrives; give the medium a Box or Sphere \
         region"
    )]
    NothingArrives {
        /// Which light, as in "the directional light".
        light: String,
        /// Name of the first unbounded medium.
        medium: String,
    },

    /// Nothing shines.
    #[error("the scene has no light source: the image is black")]
    NoLights,

    /// Negative values of an environment image.
    #[error("{count} negative texels of the environment image became 0 ({})", file.display())]
    NegativeTexels {
        /// The image.
        file: PathBuf,
        /// How many.
        count: usize,
    },

    /// Negative values of a volume file.
    #[error("{count} negative voxels of grid \"{grid}\" became 0 ({})", file.display())]
    NegativeVoxels {
        /// Name of the grid.
        grid: String,
        /// How many.
        count: u64,
        /// The volume file.
        file: PathBuf,
    },

    /// A medium's grid and its region have no point in common.
    #[error(
        "the grid of medium \"{medium}\" lies outside its region: there is nothing of it; move the region or the grid"
    )]
    GridOutsideRegion {
        /// Name of the medium.
        medium: String,
    },

    /// A light that sends out nothing.
    #[error("{light} has no power and is ignored")]
    DarkLight {
        /// Which light.
        light: String,
    },

    /// Blended transparency is not rendered.
    #[error("{}: alpha mode BLEND is drawn opaque", listed("material", materials))]
    BlendDrawnOpaque {
        /// Names of the materials.
        materials: Vec<String>,
    },

    /// A light's `range` has no physical meaning.
    #[error(
        "{}: range is ignored, because it is not physical",
        listed("light", lights)
    )]
    RangeIgnored {
        /// Names of the lights.
        lights: Vec<String>,
    },

    /// Triangles without area were left out.
    #[error("{count} degenerate triangles dropped in {}", listed("mesh", meshes))]
    DegenerateTriangles {
        /// Names of the meshes.
        meshes: Vec<String>,
        /// How many.
        count: usize,
    },

    /// Normals that are not finite or have no length were replaced by the geometric normal.
    #[error("{count} unusable normals replaced in {}", listed("mesh", meshes))]
    UnusableNormals {
        /// Names of the meshes.
        meshes: Vec<String>,
        /// How many.
        count: usize,
    },

    /// Something else in a glTF file was put right or left out.
    #[error("{problem} (at {pointer})")]
    Gltf {
        /// What, and what is drawn instead.
        problem: String,
        /// Where, as a JSON pointer.
        pointer: String,
    },

    /// An image could not be used; white stands in for it.
    #[error("texture \"{texture}\" is drawn white: {problem}")]
    TextureMissing {
        /// Name or path of the texture.
        texture: String,
        /// Why it could not be used.
        problem: String,
    },
}

/// `material "a"`, `materials "a", "b"`, or the first three and how many more.
fn listed(kind: &str, names: &[String]) -> String {
    const SHOWN: usize = 3;
    let quoted: Vec<_> = names
        .iter()
        .take(SHOWN)
        .map(|n| format!("\"{n}\""))
        .collect();
    let plural = match names.len() {
        1 => "",
        _ if kind.ends_with("sh") => "es",
        _ => "s",
    };
    let more = match names.len().saturating_sub(SHOWN) {
        0 => String::new(),
        n => format!(" and {n} more"),
    };
    format!("{kind}{plural} {}{more}", quoted.join(", "))
}
