//! A scene, checked and ready to render.

use crate::camera::Camera;
use crate::error::Warning;
use crate::film::FilmSize;
use crate::lights::LightSet;
use crate::motion::{CameraMotion, FrameError};
use crate::triangles::Triangles;
use glam::Vec3;
use std::ops::RangeInclusive;
use std::path::PathBuf;
use tyndall_math::Aabb;
use tyndall_media::{Density, Media, Medium, PhaseFunction};
use tyndall_transport::World;

/// Everything that is needed to render an image. Made by [`load`](crate::load()) and [`load_str`](crate::load_str).
#[derive(Debug)]
pub struct Scene {
    /// Where it is seen from; where the camera moves, at frame 0.
    pub camera: Camera,
    /// How the camera moves; `None` where it stands still.
    pub motion: Option<CameraMotion>,
    /// Size of the image.
    pub film: FilmSize,
    /// What the scene file asks of the renderer.
    pub settings: RenderSettings,
    /// Opaque surfaces.
    pub geometry: Triangles,
    /// Light sources, emissive surfaces among them.
    pub lights: LightSet,
    /// Participating media.
    pub media: Media,
    /// Box around all surfaces and all media that have bounds; empty where there are none.
    pub bounds: Aabb,
    /// What was repaired, ignored, or will look odd.
    pub warnings: Vec<Warning>,
    /// The files that the scene was read from.
    pub files: Vec<PathBuf>,
    /// Whether its volume files are those of one frame, see [`LoadOptions::frame`](crate::LoadOptions::frame).
    pub is_sequence: bool,
    /// What the scene file says of lights and media; see [`Scene::digest`].
    pub(crate) definition: String,
    /// How many of the first files are the scene file itself: one, or none for a bare glTF file.
    pub(crate) own_files: usize,
}

/// What a scene file asks of the renderer; the command line may ask otherwise.
#[derive(Clone, Copy, Debug, PartialEq)]
pub struct RenderSettings {
    /// Error that the image may have: the root of its relative mean square error.
    pub error: f32,
    /// Most scattering events between light and eye; `None` for no limit.
    pub max_depth: Option<u32>,
    /// Exposure of PNG images, in stops.
    pub exposure: f32,
}

impl Scene {
    /// The scene as light transport sees it.
    pub fn world(&self) -> World<'_, Triangles, LightSet> {
        World {
            geometry: &self.geometry,
            lights: &self.lights,
            media: &self.media,
        }
    }

    /// The camera at `frame`, which need not be whole: as [`CameraMotion::at`] says, or [`camera`](Self::camera) where it
    /// stands still.
    ///
    /// # Errors
    /// Where the camera moves through something that is no view; the error names the frame.
    pub fn camera_at(&self, frame: f32) -> Result<Camera, FrameError> {
        match &self.motion {
            Some(motion) => motion.at(frame),
            None => Ok(self.camera),
        }
    }

    /// The frames over which the camera moves, first and last included; `None` where it stands still.
    pub fn frames(&self) -> Option<RangeInclusive<u32>> {
        self.motion.as_ref().map(CameraMotion::frames)
    }

    /// What kinds of media and phase functions there are, as in `media: 1 homogeneous; phase: isotropic`.
    pub fn summary(&self) -> String {
        let media = self.media.list();
        if media.is_empty() {
            return "media: none".into();
        }
        let count = |kind: &str, is: fn(&Density) -> bool| match media
            .iter()
            .filter(|medium| is(medium.density()))
            .count()
        {
            0 => None,
            n => Some(format!("{n} {kind}")),
        };
        let kinds: Vec<_> = [
            count("homogeneous", |density| {
                matches!(density, Density::Constant(_))
            }),
            count("height", |density| {
                matches!(density, Density::Height { .. })
            }),
            count("grid", |density| matches!(density, Density::Grid(_))),
        ]
        .into_iter()
        .flatten()
        .collect();
        format!("media: {}; phase: {}", kinds.join(", "), phases(media))
    }
}

/// The kinds of phase functions of all media that scatter.
fn phases(media: &[Medium]) -> String {
    let kind = |medium: &Medium| match medium.phase() {
        PhaseFunction::HenyeyGreenstein(lobe) if lobe.asymmetry().get() != 0.0 => {
            "Henyey-Greenstein"
        }
        PhaseFunction::Isotropic | PhaseFunction::HenyeyGreenstein(_) => "isotropic",
        PhaseFunction::Rayleigh => "Rayleigh",
        PhaseFunction::Mixture(_) => "mixture",
    };
    let there: Vec<_> = media
        .iter()
        .filter(|medium| medium.sigma_s() != Vec3::ZERO)
        .map(kind)
        .collect();
    let mut names = vec!["isotropic", "Henyey-Greenstein", "Rayleigh", "mixture"];
    names.retain(|name| there.contains(name));
    match names.as_slice() {
        [] => "none".into(),
        [one] => String::from(*one),
        [others @ .., last] => format!("{} and {last}", others.join(", ")),
    }
}
