//! Scene files and glTF in; triangles, lights, media and a camera out, placed in space and ready for light transport.
//!
//! Files are distrusted here and nowhere after: a [`Scene`] that exists can be rendered, and a [`SceneError`] is one readable
//! paragraph that says what is wrong, where, and what would mend it. What was repaired on the way is a [`Warning`].
//!
//! Three things to know:
//! * [`load()`] turns a `.ron` scene file, or a bare `.glb` or `.gltf` together with fog, into a scene; [`load_str`] takes text.
//! * [`Scene`] holds camera, film, surfaces, lights and media; [`Scene::world`] is how `tyndall-transport` sees it.
//! * [`SceneFile`] is what a scene file may say, as checked types: a number out of range cannot exist in it.
//!
//! ```
//! use tyndall_scene::{LoadOptions, load_str};
//!
//! let text = r#"Scene(
//!     camera: LookAt(eye: (0, 1, 5), target: (0, 1, 0), vfov: 40),
//!     film: Film(width: 320, height: 240),
//!     lights: [Point(position: (0, 2, 0), intensity: (8, 8, 8))],
//!     media: [Medium(sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9))],
//! )"#;
//! let scene = load_str(text, ".".as_ref(), &LoadOptions::default())?;
//! assert_eq!(scene.summary(), "media: 1 homogeneous; phase: isotropic");
//!
//! // The ray through the middle of the image meets two metres of fog.
//! let ray = scene.camera.ray(160.0, 120.0, 320, 240);
//! let depth = scene.media.optical_depth(&ray, 2.0);
//! assert!((depth.x - 1.0).abs() < 1e-6);
//!
//! // A misspelt field is an error with its place.
//! let error = load_str("Scene(camra: None)", ".".as_ref(), &LoadOptions::default()).unwrap_err();
//! assert!(error.to_string().contains("did you mean `camera`?"));
//! # Ok::<(), tyndall_scene::SceneError>(())
//! ```
//!
//! # Units and signs
//!
//! Right-handed, Y up, metres; angles are degrees in scene files and radians everywhere else. Colours are linear RGB (Rec. 709).
//! Point and spot lights are given in W/sr, directional ones in W/m², skies and emissive surfaces in W/(m² sr), each per
//! channel. Extinction is per metre. Row 0 of an image is its top.

mod assemble;
pub mod camera;
pub mod camera_path;
mod digest;
pub mod error;
pub mod film;
pub mod gltf;
mod grids;
mod hermite;
pub mod hierarchy;
pub mod lights;
pub mod load;
pub mod material;
pub mod mesh;
pub mod motion;
pub mod numbered;
pub mod paths;
pub mod scene;
pub mod scene_file;
pub mod texture;
pub mod triangles;
pub mod volume_file;
pub mod watertight;

pub use camera::{Camera, CameraError};
pub use camera_path::{CameraKey, CameraPath, CameraPathError};
pub use error::{SceneError, Warning};
pub use film::{FilmSize, FilmSizeError};
pub use lights::LightSet;
pub use load::{Fog, LoadOptions, load, load_str};
pub use motion::{CameraMotion, FrameError};
pub use scene::{RenderSettings, Scene};
pub use scene_file::SceneFile;
pub use triangles::Triangles;
