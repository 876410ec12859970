//! A cache for fields that are smooth, positive and dear to sample: light in fog, irradiance, a solver's answer.
//!
//! Sample such a field at a few points and keep *records*: the value, its gradient, and the radius of the ball in which
//! the two say enough about the field. Everywhere else a lookup blends the records whose balls hold the point, in
//! logarithms, so that falloff by absorption comes out right and nothing turns negative. It is the interpolation of
//! Ward et al. 1988 ("A ray tracing solution for diffuse interreflection") with the log-space gradients of Jarosz et al.
//! 2008 ("Radiance caching for participating media"), over a flat octree.
//!
//! Three types to know:
//! * [`Record`]: the field at one point, in `N` channels;
//! * [`Cache`]: records in batches in, values out;
//! * [`Crossings`]: all records along a [`Segment`], for the field at many of its points.
//!
//! ```
//! use glam::Vec3;
//! use tyndall_cache::{Cache, Record};
//!
//! // A dear field: the light of a lamp at (0, 0, 2), L = 1/r². Its gradient is -2 L (p - lamp)/r².
//! let lamp = Vec3::new(0.0, 0.0, 2.0);
//! let sample = |position: Vec3| {
//!     let (d, r2) = (position - lamp, position.distance_squared(lamp));
//!     // Trust the record where the field changes by less than half of itself.
//!     Record { position, radius: 0.25 * r2.sqrt(), value: [1.0 / r2], gradient: [-2.0 * d / (r2 * r2)],
//!         variance: [0.0] }
//! };
//!
//! let mut cache = Cache::new();
//! let points = (0..20).map(|i| Vec3::new(0.2 * i as f32 - 2.0, 0.0, 0.0));
//! cache.insert(points.map(sample).collect())?;
//!
//! let p = Vec3::new(0.33, 0.05, 0.1);
//! let [light] = cache.lookup(p).expect("records are valid around p");
//! assert!((light / sample(p).value[0] - 1.0).abs() < 0.02, "within 2 %");
//! assert_eq!(cache.lookup(Vec3::splat(50.0)), None, "sample there and insert what you find");
//! # Ok::<(), tyndall_cache::CacheError>(())
//! ```
//!
//! # Filling a cache
//! Ask [`Cache::covers`] at the points you need, sample where it says no (in parallel, if you like: reading takes
//! `&self`), [`Cache::insert`] the batch, and repeat. A good radius is ε ΣLⱼ/Σ|∇Lⱼ| over the sources j of the field;
//! [`Cache::clamp_radii`] then warns records of edges that only their neighbours have seen. `examples/scalar_field.rs` does
//! all of it. Where values are noisy, say how much ([`Record::variance`]): the mean of their logarithms would be too low.
//!
//! # Tags
//! A ball does not always say where a record is valid: walls and edges cut it. Give such records a tag ([`Cache::tagged`],
//! [`Cache::insert_tagged`]) and ask [`Cache::covers_where`] and [`Cache::lookup_where`] with a function that judges it. The other questions,
//! [`Cache::coverage`] among them, look at balls alone.
//!
//! # Units and signs
//! Lengths are in your world's unit, the same for positions and radii. Values are 0 or above, in any unit; a gradient is
//! with respect to moving the point, in units of value per unit of length. Signed quantities have
//! no logarithm and do not fit.
//!
//! # Keeping records
//! With the feature `serde`, records can be stored and sent; [`Cache::insert_tagged`] checks them and builds the index anew.
//!
//! # Sameness
//! A lookup's bits depend on the records and their order alone, not on batches, threads or earlier lookups.

mod blend;
mod block;
mod cache;
mod cell_table;
mod crossings;
mod error;
mod exp;
mod grid;
mod lipschitz;
mod march;
mod octree;
mod record;
mod segment;
mod shape;

pub use blend::weight;
pub use cache::Cache;
pub use crossings::{Crossing, Crossings};
pub use error::{CacheError, Field};
pub use record::Record;
pub use segment::Segment;

/// Compiles the README's example.
#[cfg(doctest)]
#[doc = include_str!("../README.md")]
struct Readme;
