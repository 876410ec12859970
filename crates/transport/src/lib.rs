//! Light transport in participating media: path-traced ground truth, single and multiple scattering, gradients.

pub mod bsdf;
pub mod emission;
pub mod free_flight;
pub mod gather;
pub mod lamp_directions;
pub mod layers;
pub mod light_choice;
pub mod path;
pub mod single;
mod warp_translation;
pub mod world;

pub use bsdf::Bsdf;
pub use world::{Geometry, LightSample, Lights, SurfaceHit, World};
