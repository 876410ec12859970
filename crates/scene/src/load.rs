//! From files to a [`Scene`]: what may be loaded, and how the scene file's bytes are come by.

use crate::assemble::Assembly;
use crate::error::SceneError;
use crate::gltf;
use crate::scene::Scene;
use crate::scene_file::{self, SceneFile};
use std::fs::File;
use std::io::Read;
use std::path::Path;

/// What to load otherwise than the scene says.
#[derive(Clone, Debug, Default, PartialEq)]
pub struct LoadOptions {
    /// Whether files may lie outside the scene's folder.
    pub allow_external: bool,
    /// Fog to add in the scene's bounding box; a bare glTF file needs it.
    pub fog: Option<Fog>,
    /// Whether a glTF file may stand alone without fog, as when it is only looked into.
    pub bare_gltf: bool,
    /// Memory that one density grid may take, in bytes; where left out, [`DEFAULT_MEMORY`](crate::volume_file::DEFAULT_MEMORY).
    pub max_grid_bytes: Option<u64>,
    /// The frame whose volume files to read, where these are a sequence; where left out, frame 0.
    pub frame: Option<u32>,
    /// Pixels from left to right, instead of the scene's.
    pub width: Option<u32>,
    /// Pixels from top to bottom, instead of the scene's.
    pub height: Option<u32>,
}

/// Homogeneous fog.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct Fog {
    /// Extinction per metre, alike in all channels.
    pub sigma_t: f32,
    /// Single-scattering albedo, in [0, 1].
    pub albedo: f32,
    /// Mean cosine of the phase function, in (−1, 1); 0 is isotropic.
    pub g: f32,
}

impl Fog {
    /// Fog of this extinction per metre, with albedo 0.95 and isotropic.
    pub fn new(sigma_t: f32) -> Self {
        Self {
            sigma_t,
            albedo: 0.95,
            g: 0.0,
        }
    }
}

/// Loads a scene file (`.ron`), or a glTF file (`.glb`, `.gltf`) together with [`LoadOptions::fog`].
///
/// # Errors
/// The first thing that keeps the scene from being rendered: what, where, and what would mend it.
pub fn load(path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    let extension = path.extension().unwrap_or_default().to_string_lossy();
    match extension.to_lowercase().as_str() {
        "ron" => load_bytes(&read_scene_file(path)?, path, options),
        "glb" | "gltf" if options.fog.is_none() && !options.bare_gltf => {
            Err(SceneError::FogMissing { path: path.into() })
        }
        "glb" | "gltf" => {
            let gltf = gltf::read(
                path,
                &gltf::ReadOptions {
                    allow_external: options.allow_external,
                    ..Default::default()
                },
            )?;
            Assembly {
                text: "",
                path,
                options,
                warnings: Vec::new(),
                files: Vec::new(),
                is_sequence: false,
            }
            .assemble(&SceneFile::default(), gltf)
        }
        _ => Err(SceneError::UnknownKind { path: path.into() }),
    }
}

/// Loads the text of a scene file. Paths in it are relative to the folder `base`, and messages call it `scene.ron` there.
///
/// # Errors
/// As [`load`].
pub fn load_str(ron: &str, base: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    load_bytes(ron.as_bytes(), &base.join("scene.ron"), options)
}

fn load_bytes(bytes: &[u8], path: &Path, options: &LoadOptions) -> Result<Scene, SceneError> {
    let file = scene_file::parse(bytes, path)?;
    let mut assembly = Assembly {
        // What was parsed is text; only messages read it again.
        text: std::str::from_utf8(bytes).unwrap_or_default(),
        path,
        options,
        warnings: Vec::new(),
        files: vec![path.into()],
        is_sequence: false,
    };
    let gltf = assembly.read_gltf(&file)?;
    assembly.assemble(&file, gltf)
}

/// Reads a scene file unless it is too long to be one.
fn read_scene_file(path: &Path) -> Result<Vec<u8>, SceneError> {
    const WHAT: &str = "scene file";
    let limit = scene_file::MAX_BYTES;
    let read = || {
        let file = File::open(path)?;
        let size = file.metadata()?.len();
        let mut bytes = Vec::new();
        if size <= limit {
            // Limited once more: a device has no size.
            file.take(limit + 1).read_to_end(&mut bytes)?;
        }
        Ok((size.max(bytes.len() as u64), bytes))
    };
    match read() {
        Ok((size, bytes)) if size <= limit => Ok(bytes),
        Ok((size, _)) => Err(SceneError::TooLarge {
            what: WHAT,
            bytes: size,
            limit,
            path: path.into(),
        }),
        Err(source) => Err(SceneError::Read {
            what: WHAT,
            source,
            path: path.into(),
        }),
    }
}
