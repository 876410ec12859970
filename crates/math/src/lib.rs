//! The mathematics that light transport in fog needs: directions, sampling, spherical harmonics and keyed random numbers.
//!
//! Everything here is a pure function or a small value. Nothing knows of light, scenes or threads, so the crate serves any
//! renderer or radiative-transfer code. Three types to know:
//!
//! * [`Sampler`]: random numbers that depend on a [`Key`] (seed, purpose, index) alone, never on the order of work;
//! * [`Equiangular`]: distances along a [`Ray`] that cancel the 1/r² of a lamp, even of a lamp on the ray;
//! * [`sh::Basis`]: spherical harmonics to any order, with [`sh::convolve_zonal`] for scattering.
//!
//! Around them: [`warp`] (directions, disks, free paths), [`spherical`] (lamps sampled by solid angle), [`distribution`] and
//! [`alias`] (tables), [`low_discrepancy`], [`quadrature`], [`jet`] (formulas that carry their second derivatives),
//! [`stats`], and [`testing`], the χ² test that every sampler of the workspace must pass.
//!
//! # Example
//!
//! How much light does a lamp of 1 W/sr send to a ray that passes it at 1 mm? The integral of 1/r² along the ray, by
//! sixteen samples, each of which is exact:
//!
//! ```
//! use glam::Vec3;
//! use tyndall_math::{Equiangular, Key, Purpose, Ray, Sampler};
//!
//! let ray = Ray::new(Vec3::ZERO, Vec3::Z);
//! let lamp = Vec3::new(0.001, 0.0, 2.0);
//! let distances = Equiangular::new(&ray, lamp, 0.0, f32::INFINITY);
//!
//! let key = Key { seed: 1, purpose: Purpose::Pixel, index: 0 };
//! let mut mean = 0.0;
//! for i in 0..16 {
//!     let (t, pdf) = distances.sample(Sampler::new(key, i).next_1d());
//!     mean += 1.0 / (ray.at(t).distance_squared(lamp) * pdf) / 16.0;
//! }
//! // (π/2 + atan(2/0.001))/0.001
//! assert!((mean / 3141.0927 - 1.0).abs() < 1e-4);
//! ```
//!
//! # Units and signs
//!
//! Lengths are metres, angles radians, solid angles steradians; densities are per metre, per steradian or per unit of the
//! square, as their function says. Directions are of unit length. Random numbers lie in [0, 1). f32 goes in and comes out;
//! where a difference of nearly equal numbers would lose it, the inside is f64 and says why.

pub mod aabb;
pub mod alias;
pub mod distribution;
pub mod exponential;
pub mod frame;
pub mod jet;
pub mod low_discrepancy;
pub mod offset;
pub mod quadrature;
pub mod ray;
pub mod sampler;
pub mod sh;
pub mod spherical;
pub mod stats;
pub mod testing;
pub mod warp;

pub use aabb::Aabb;
pub use alias::AliasTable;
pub use distribution::{Distribution1D, Distribution2D};
pub use exponential::{one_minus_exp_over_x, one_minus_exp_over_x_derivative};
pub use frame::Frame;
pub use jet::{Jet, JetVec3};
pub use low_discrepancy::SphericalFibonacci;
pub use offset::offset_origin;
pub use ray::Ray;
pub use sampler::{Key, Purpose, Sampler};
pub use spherical::{SphericalRectangle, SphericalTriangle};
pub use warp::{Equiangular, TruncatedExponential};
