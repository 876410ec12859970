//! Participating media: what fog is like at a point, and what it does to light along a ray.
//!
//! A [`Medium`] has a [`Region`] of space, a [`Density`] in it, coefficients per colour channel, and a [`PhaseFunction`].
//! A scene's [`Media`] are a list of them that overlap freely and add up. They answer three kinds of questions, all in
//! closed form, without marching:
//!
//! * [`Media::at`] gives a [`MediumPoint`]: extinction, scattering and emission at a point, and how to sample a scattering
//!   direction there;
//! * [`Media::segment`] gives a [`Segment`]: optical depth as a function of distance along a ray, and its inverse, the
//!   distance at which a given optical depth is reached; [`Media::optical_depth`] is the short way for a shadow ray;
//! * [`Media::optical_depth_gradient`] says how optical depth changes when either end of a segment moves, and
//!   [`Media::optical_depth_jet`] how that gradient changes.
//!
//! Extinction of any other kind is an [`ExtinctionField`], and [`march`] integrates it with the same derivatives.
//!
//! ```
//! use glam::Vec3;
//! use tyndall_math::Ray;
//! use tyndall_media::{Density, Media, Medium, MediumParams, PhaseFunction};
//!
//! // Fog that scatters forward, a mean free path of 5 m at the ground, thinning out to 1/e every 2 m of height.
//! let fog = Medium::new(MediumParams {
//!     density: Density::Height { base: 0.0, scale_height: 2.0 },
//!     phase: PhaseFunction::henyey_greenstein(0.7)?,
//!     ..MediumParams::new(Vec3::splat(0.2), Vec3::splat(0.95))
//! })?;
//! let media = Media::new(vec![fog]);
//!
//! // All of the fog above a point on the ground: 0.2/m over 2 m.
//! let up = Ray::new(Vec3::ZERO, Vec3::Y);
//! let transmittance = (-media.optical_depth(&up, f32::INFINITY)).exp();
//! assert!((transmittance.x - (-0.4_f32).exp()).abs() < 1e-6);
//!
//! // Half of that optical depth lies below 2 ln 2 metres.
//! let half_way = media.segment(&up, f32::INFINITY).distance_at(0, 0.2);
//! assert!((half_way.unwrap_or_default() - 2.0 * 2.0_f32.ln()).abs() < 1e-5);
//! # Ok::<(), Box<dyn std::error::Error>>(())
//! ```
//!
//! # Units and signs
//! Metres; coefficients per metre; y is up. Colours are linear RGB in a [`glam::Vec3`], and optical depths too, one per
//! channel. Directions are of unit length; `w_o` leaves a point towards the eye, `w_i` points to where light comes from,
//! and the cosine of scattering is `−w_i · w_o`, so that g > 0 scatters forward. Gradients are with respect to moving a
//! point. Optical depth may be infinite (transmittance 0) and is never NaN.
//!
//! # Precision
//! The interface is f32. Heights above a base and distances to boundaries are differences of coordinates; they, and all
//! that follows from them up to the column, are f64 inside, so that results are good to f32 rounding however far away,
//! level or grazing a ray is. Media of constant density need no transcendental function for it.

mod density;
mod edges;
mod gradient;
mod hessian;
mod line;
pub mod march;
mod media;
mod medium;
mod newton;
pub mod phase;
mod point;
mod region;
mod segment;

pub use density::{Density, grid};
pub use edges::{EdgePoint, Edges};
pub use gradient::EndGradients;
pub use march::{ExtinctionField, MovingSegment, SmoothExtinctionField};
pub use media::Media;
pub use medium::{MAX_SIGMA_T, MIN_SCALE_HEIGHT, Medium, MediumError, MediumParams};
pub use phase::{
    Asymmetry, AsymmetryError, HenyeyGreenstein, Mixture, MixtureError, PhaseFunction,
};
pub use point::{MediumPoint, PhaseValue};
pub use region::Region;
pub use segment::{Segment, absorptance, transmittance};

/// Compiles and runs the example of the README.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
