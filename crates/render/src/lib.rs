//! Volumetric radiance caching: integrators, cache fill, film, layers and image files.

pub mod compare;
pub mod error;
pub mod film;
pub mod flip;
pub mod image;
pub mod image_file;
pub mod info;
pub mod integrator;
pub mod layers;
pub mod options;
pub mod relative;
pub mod stats;

pub use integrator::{Outcome, render};
