//! What transport asks of a scene: closest hit, occlusion, lights and media.
//!
//! `tyndall-scene` implements these traits for files; a test implements them for a box and two lamps in ten lines.

use crate::bsdf::Bsdf;
use crate::light_tree::LightTree;
use glam::{DVec3, Vec3};
use tyndall_math::{Jet, Ray, offset_origin};
use tyndall_media::Media;

/// Opaque surfaces.
pub trait Geometry: Sync {
    /// The nearest surface met by `ray` before distance `t_max`.
    fn intersect(&self, ray: &Ray, t_max: f32) -> Option<SurfaceHit>;

    /// Whether any surface stands on `ray` before distance `t_max`.
    fn occluded(&self, ray: &Ray, t_max: f32) -> bool;
}

/// A surface as a ray sees it.
#[derive(Clone, Copy, Debug)]
pub struct SurfaceHit {
    /// Distance along the ray, in metres.
    pub t: f32,
    /// The point hit, closer to the surface than `ray.at(t)`.
    pub position: Vec3,
    /// Unit geometric normal on the side of the ray's origin.
    pub normal: Vec3,
    /// Reflection at this point; holds the shading frame.
    pub bsdf: Bsdf,
    /// Radiance emitted back along the ray, W/(m² sr).
    pub emission: Vec3,
    /// Index of the light this surface belongs to, where it emits.
    pub light: Option<usize>,
    /// Extent in metres of the flat piece of surface hit, or of a curved one, and more for needles: with the position it bounds the
    /// rounding of hits (see [`offset_origin`]).
    pub size: f32,
}

impl SurfaceHit {
    /// A ray that leaves the surface along `direction` without meeting it again.
    pub fn spawn(&self, direction: Vec3) -> Ray {
        let side = self.normal * self.normal.dot(direction).signum();
        Ray::new(offset_origin(self.position, side, self.size), direction)
    }
}

/// Light sources. An index names a light; all radiometry is linear RGB.
pub trait Lights: Sync {
    /// Number of lights; indices run from 0.
    fn count(&self) -> usize;

    /// Estimate, up to one common factor, of the unoccluded fluence that `light` brings to `p` (no transmittance).
    /// Positive wherever the light can arrive; with a `normal` it may use which side of the surface is lit.
    fn importance(&self, light: usize, p: Vec3, normal: Option<Vec3>) -> f32;

    /// Estimate, up to the same factor, of the integral of [`Lights::importance`] over `ray` from 0 to the finite `t_max`.
    fn importance_along(&self, light: usize, ray: &Ray, t_max: f32) -> f32;

    /// The point around which a finite light gathers; `None` for lights infinitely far away.
    fn pivot(&self, light: usize) -> Option<Vec3>;

    /// Whether `light` shines from more than one point or direction. Its samples are [`LightSample::delta`] where not, all of
    /// them alike; true is safe.
    fn has_extent(&self, _light: usize) -> bool {
        true
    }

    /// The lights as a tree, where they are too many to look at each; none unless told.
    fn tree(&self) -> Option<&LightTree> {
        None
    }

    /// Samples a direction from `p` towards `light`.
    fn sample(&self, light: usize, p: Vec3, u: [f32; 2]) -> Option<LightSample>;

    /// Density per steradian with which [`Lights::sample`] picks direction `w_i` at `p`, where `w_i` is known to meet the
    /// light; 0 for lights without extent.
    fn pdf(&self, light: usize, p: Vec3, w_i: Vec3) -> f32;

    /// The lights that rays which leave the scene meet: skies and environment images; none unless told.
    fn environment(&self) -> &[usize] {
        &[]
    }

    /// Radiance that arrives from direction `w_i` (pointing away from the scene) out of environment light `light`.
    fn environment_radiance(&self, _light: usize, _w_i: Vec3) -> Vec3 {
        Vec3::ZERO
    }

    /// ln I with its derivatives per metre, up to a constant, where the intensity that `light` sends to `p` depends on the
    /// direction it leaves in (a spot's falloff); zero for other lights.
    fn ln_intensity(&self, _light: usize, _p: DVec3) -> Jet {
        Jet::ZERO
    }

    /// Distance from `p` to the nearest point-like light (point or spot), infinite where there is none.
    fn distance_to_point_lights(&self, p: Vec3) -> f32;
}

/// One way from a point to a light.
#[derive(Clone, Copy, Debug)]
pub struct LightSample {
    /// Unit direction from the point to the light.
    pub w_i: Vec3,
    /// Distance in metres, infinite for directional and environment light.
    pub distance: f32,
    /// Radiance for lights with extent; intensity over squared distance, or irradiance, for lights without.
    pub radiance: Vec3,
    /// Density per steradian; exactly 1 for lights without extent.
    pub pdf: f32,
    /// Whether only this sampling can find the light (no extent).
    pub delta: bool,
    /// Unit normal of the emitter at the sample, towards the point; zero where it has none.
    pub normal: Vec3,
    /// Extent of the emitter in metres, as [`SurfaceHit::size`]; 0 where it has no surface.
    pub size: f32,
}

/// Everything light meets.
#[derive(Debug)]
pub struct World<'a, G, L> {
    /// Opaque surfaces.
    pub geometry: &'a G,
    /// Light sources.
    pub lights: &'a L,
    /// Participating media.
    pub media: &'a Media,
}

impl<G, L> Clone for World<'_, G, L> {
    fn clone(&self) -> Self {
        *self
    }
}

impl<G, L> Copy for World<'_, G, L> {}
