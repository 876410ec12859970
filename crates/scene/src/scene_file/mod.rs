//! The scene file (`*.ron`): what it may hold, its defaults, and its checks.
//!
//! [`parse`] turns text into a [`SceneFile`] in which every number is in range, or into a [`SceneFileError`] that names line,
//! column and field. Nothing here opens another file.
//!
//! Variants that need a check across their fields are newtypes around a struct of `…Fields`; RON's `UNWRAP_VARIANT_NEWTYPES`
//! lets them be written with one pair of parentheses.

pub mod camera;
mod fault;
mod forms;
pub mod lights;
pub mod media;
pub mod numbers;
mod outline;

pub use camera::{Camera, LookAt};
pub use fault::{Fault, Place, SceneFileError};
pub(crate) use outline::place_of;

use crate::film::{FilmSize, FilmSizeError};
use lights::Light;
use media::Medium;
use numbers::{Depth, FrameRate, PixelCount, Stops, TargetError};
use ron::extensions::Extensions;
use serde::Deserialize;
use std::path::Path;

/// Everything a scene file says.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(rename = "Scene", default, deny_unknown_fields)]
pub struct SceneFile {
    /// glTF file with surfaces, lights and cameras, relative to the scene file.
    pub gltf: Option<String>,
    /// Which of the glTF's scenes to show; left out: its default one.
    pub gltf_scene: Option<String>,
    /// Where the scene is seen from; left out: the glTF's first camera.
    pub camera: Option<Camera>,
    /// Size of the image, and frames per second.
    pub film: Film,
    /// Lights, added to the glTF's own.
    pub lights: Vec<Light>,
    /// Participating media; where they overlap they add up.
    pub media: Vec<Medium>,
    /// How the scene is to be rendered.
    pub render: Render,
}

/// `Film(width: 1024, height: 768, fps: 24)`, known to be neither empty nor too large.
#[derive(Clone, Copy, Debug, Default, PartialEq, Deserialize)]
#[serde(try_from = "FilmFields")]
pub struct Film {
    /// Size of each image.
    pub size: FilmSize,
    /// Frames per second, by which the times of animations are told.
    pub fps: FrameRate,
}

#[derive(Default, Deserialize)]
#[serde(rename = "Film", default, deny_unknown_fields)]
struct FilmFields {
    width: Option<PixelCount>,
    height: Option<PixelCount>,
    fps: FrameRate,
}

impl TryFrom<FilmFields> for Film {
    type Error = FilmSizeError;

    fn try_from(fields: FilmFields) -> Result<Self, Self::Error> {
        let default = FilmSize::default();
        let width = fields.width.map_or(default.width, PixelCount::get);
        let height = fields.height.map_or(default.height, PixelCount::get);
        let fps = fields.fps;
        FilmSize::new(width, height).map(|size| Self { size, fps })
    }
}

/// `Render(error: 0.03, max_depth: None, exposure: 0.0)`.
#[derive(Clone, Debug, Default, PartialEq, Deserialize)]
#[serde(default, deny_unknown_fields)]
pub struct Render {
    /// Error the image may have.
    pub error: TargetError,
    /// Most scattering events between light and eye; `None` for no limit.
    pub max_depth: Option<Depth>,
    /// Exposure of the PNG, in stops.
    pub exposure: Stops,
}

/// Largest scene file that is read, in bytes; a light takes about a hundred.
pub const MAX_BYTES: u64 = 64 << 20;

/// Reads a scene file's bytes; `path` is only named in errors.
///
/// A byte order mark and Windows line ends are accepted.
///
/// # Errors
/// The first fault, with its line, column and field.
pub fn parse(bytes: &[u8], path: &Path) -> Result<SceneFile, Box<SceneFileError>> {
    let text = match std::str::from_utf8(bytes) {
        Ok(text) => text.strip_prefix('\u{feff}').unwrap_or(text),
        Err(error) => return Err(Box::new(SceneFileError::not_utf8(bytes, error, path))),
    };
    ron::Options::default()
        .with_default_extension(Extensions::IMPLICIT_SOME | Extensions::UNWRAP_VARIANT_NEWTYPES)
        .from_str(text)
        .map_err(|error| Box::new(SceneFileError::new(error, text, path)))
}
