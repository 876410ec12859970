//! Light transport in participating media: an unbiased path tracer, single scattering along a ray, and what a record of
//! multiple scattering is made of, with its gradient.
//!
//! The crate sees a scene through two small traits, so that anything which can be hit and anything that shines will do; a
//! medium is one of `tyndall-media`. Eight things to know:
//!
//! * [`World`]: surfaces ([`Geometry`]), lights ([`Lights`]) and media, borrowed, together;
//! * [`path::trace`]: one path through a world; a [`path::Visitor`] hears of every vertex and of all light it finds.
//!   [`layers::LayerVisitor`] sorts that light into the layers of an image;
//! * [`single::SegmentLight`]: light scattered once on a ray, straight from the lights, also right beside a lamp;
//! * [`shafts::Shafts`]: the same from one light without extent, by the stretches of the ray that it shines on;
//! * [`inscatter::single`]: light scattered once at one point, with gradient and Hessian;
//! * [`gather::multiple`]: light scattered before that arrives at a point, its gradient, and the standard errors of both;
//! * [`irradiance::irradiance`]: the same on a surface;
//! * [`field::Field`]: a coarse field of light in which the paths of both may end, so that their cost is that of one scattering.
//!
//! # Example
//!
//! How much light, scattered twice or more, does fog send from a place one free path away from a lamp? The diffusion
//! of light in endless fog has a known answer (Davison 1947), which 4096 paths meet within a few percent:
//!
//! ```
//! use glam::Vec3;
//! use tyndall_math::{Equiangular, Key, Purpose, Ray};
//! use tyndall_media::{Media, Medium, MediumParams};
//! use tyndall_transport::{Geometry, LightSample, Lights, SurfaceHit, World, gather};
//!
//! /// No surfaces.
//! struct Empty;
//!
//! impl Geometry for Empty {
//!     fn intersect(&self, _: &Ray, _: f32) -> Option<SurfaceHit> { None }
//!     fn occluded(&self, _: &Ray, _: f32) -> bool { false }
//! }
//!
//! /// A lamp of 1 W/sr at the origin.
//! struct Lamp;
//!
//! impl Lights for Lamp {
//!     fn count(&self) -> usize { 1 }
//!     fn pivot(&self, _: usize) -> Option<Vec3> { Some(Vec3::ZERO) }
//!     fn sample(&self, _: usize, p: Vec3, _: [f32; 2]) -> Option<LightSample> {
//!         let distance = p.length();
//!         let radiance = Vec3::splat(1.0 / (distance * distance));
//!         Some(LightSample { w_i: -p / distance, distance, radiance, pdf: 1.0, delta: true, normal: Vec3::ZERO, size: 0.0 })
//!     }
//!     fn pdf(&self, _: usize, _: Vec3, _: Vec3) -> f32 { 0.0 }
//!     // Which of many lights to ask, and where on a ray: estimates that steer samples.
//!     fn importance(&self, _: usize, p: Vec3, _: Option<Vec3>) -> f32 { 1.0 / p.length_squared() }
//!     fn importance_along(&self, _: usize, ray: &Ray, t_max: f32) -> f32 {
//!         Equiangular::new(ray, Vec3::ZERO, 0.0, t_max).angle_over_distance()
//!     }
//!     fn distance_to_point_lights(&self, p: Vec3) -> f32 { p.length() }
//! }
//!
//! let fog = Medium::new(MediumParams::new(Vec3::ONE, Vec3::splat(0.8)))?;
//! let world = World { geometry: &Empty, lights: &Lamp, media: &Media::new(vec![fog]) };
//! let key = Key { seed: 1, purpose: Purpose::Probe, index: 0 };
//! let found = gather::multiple(&world, Vec3::X, &gather::GatherPattern::new(4096), Default::default(), key);
//! assert!((found.value.x / 0.07814 - 1.0).abs() < 0.05, "{found:?}");
//! // It falls with distance, here by 0.133 a metre.
//! assert!((found.gradient[0].x / -0.1328 - 1.0).abs() < 0.15, "{found:?}");
//! # Ok::<(), tyndall_media::MediumError>(())
//! ```
//!
//! # Units and signs
//!
//! Metres; radiance in W/(m² sr), linear RGB in a [`glam::Vec3`]. `w_o` leaves a point towards the eye, `w_i` points to
//! where light comes from; both are of unit length. A normal stands on the side from which its surface is seen. Densities
//! of directions are per steradian, of distances per metre. A gradient is with respect to moving the point, per metre.
//! Depth counts scattering events, in media and at surfaces, between light and eye.
//!
//! # Sameness
//!
//! A path draws its numbers from a [`Sampler`](tyndall_math::Sampler), that is from a key; nothing else is random. Nothing here
//! starts a thread, keeps state, or prints.

mod albedo;
pub mod batches;
pub mod bsdf;
pub mod direct;
pub mod emission;
pub mod field;
pub mod free_flight;
pub mod gather;
pub mod importance;
pub mod inscatter;
pub mod irradiance;
pub mod lamp_directions;
pub mod layers;
pub mod light_choice;
pub mod light_tree;
pub mod lobe;
mod occlusion;
pub mod path;
mod segment_warp;
pub mod shafts;
pub mod single;
pub mod walls;
mod warp_translation;
pub mod world;

pub use bsdf::Bsdf;
pub use world::{Geometry, LightSample, Lights, SurfaceHit, World};
