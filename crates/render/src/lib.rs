//! From a scene to an image: volumetric radiance caching and path tracing, the film, its layers, and image files.
//!
//! [`render`](render()) does it all: it starts the threads, fills the caches of multiple scattering and of indirect light on surfaces, takes
//! camera samples until the image is as good as was asked, and gives back the image with what it cost. Four types to know:
//!
//! * [`RenderOptions`](options::RenderOptions): what is asked; the default leaves each choice to the scene file;
//! * [`Renderer`]: as [`render`](render()) for frames that share what is computed ahead of them, and its cache files;
//! * [`Outcome`]: the [`Image`](image::Image), its [`Stats`](stats::Stats), and what the user should be told;
//! * [`RenderError`](error::RenderError): one readable paragraph about what is wrong.
//!
//! Beside it, [`image_file`] reads and writes EXR and PNG, [`compare`] tells how far an image is from a reference, and
//! [`info`] what a scene holds.
//!
//! # Example
//!
//! ```
//! use tyndall_render::options::RenderOptions;
//! use tyndall_render::render;
//! use tyndall_scene::{LoadOptions, load_str};
//!
//! let text = "Scene(
//!     camera: LookAt(eye: (0, 0, 4), target: (0, 0, 0), vfov: 40),
//!     film: Film(width: 16, height: 12),
//!     lights: [Point(position: (0, 0, 0), intensity: (8, 8, 8))],
//!     media: [Medium(sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9))],
//! )";
//! let scene = load_str(text, ".".as_ref(), &LoadOptions::default())?;
//! let options = RenderOptions { spp: Some(4), ..RenderOptions::default() };
//!
//! // `&()` listens to the progress and says nothing.
//! let outcome = render(&scene, &options, &())?;
//! assert!(outcome.stats.records["multiple"] > 0, "multiple scattering came from records");
//!
//! // The lamp's glow: the middle of the image is brighter than its corner.
//! let red = &outcome.image.channels["R"];
//! assert!(red[6 * 16 + 8] > 2.0 * red[0]);
//!
//! // All light reached the eye through the fog; there is no surface here.
//! let sum = outcome.image.channels["single.R"][0] + outcome.image.channels["multiple.R"][0];
//! assert!((red[0] - sum).abs() <= 1e-5 * red[0]);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Units and signs
//!
//! Images hold linear RGB (Rec. 709) radiance in W/(m² sr), row 0 on top; exposure, in stops, touches PNG files alone. An
//! error is the root of the relative mean square error, as [`compare`](mod@compare) defines it.
//!
//! # Sameness
//!
//! Scene, options and seed decide every bit of an image on one machine; the number of threads does not. Only a time limit
//! gives that up.

pub mod compare;
pub mod error;
pub mod film;
pub mod flip;
pub mod image;
pub mod image_file;
pub mod info;
pub mod integrator;
pub mod layers;
mod noise;
pub mod options;
pub mod probe;
pub mod relative;
mod sealed;
pub mod stats;
pub mod verify;

pub use sealed::SealFault;

pub use integrator::{CacheInfo, Outcome, Renderer, render};
