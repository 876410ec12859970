//! Records as they were published first: W. Jarosz, C. Donner, M. Zwicker and H. W. Jensen 2008, "Radiance caching for participating
//! media", ACM TOG 27(1), with irradiance on surfaces beside them. The baseline that the records of the default method are compared with.
//!
//! Radii follow the light that was found and nothing else, and gradients do not know of occlusion. Ours are the sets of directions, which
//! are better spread, and the gradients of multiple scattering, by warped translation: the paper's have no finite variance near lamps. Values
//! are blended as `tyndall-cache` does it.

use super::surfaces::{Side, SurfaceCache, Surfaces};
use super::{Candidate, Counted, Kind, Light, View, media, record, surfaces};
use glam::Vec3;
use tyndall_cache::Record;
use tyndall_math::Ray;
use tyndall_scene::Scene;
use tyndall_transport::gather::{self, Derivatives, GatherPattern};
use tyndall_transport::inscatter;
use tyndall_transport::irradiance::irradiance;
use tyndall_transport::path::Reach;
use tyndall_transport::walls::Walls;

/// ε of each cache at an error of 1; it goes with the root of the error, as what is left of an interpolant of first order goes with the
/// square of the radius. The paper's images have 0.05 to 0.25 for single and 0.75 to 1 for multiple scattering. All numbers here were
/// chosen on the Cornell box at 96 × 96 and an error of 0.05, where they give 0.058 (2026-11-22).
const SINGLE_TOLERANCE: f32 = 1.0;
const MULTIPLE_TOLERANCE: f32 = 3.0;
const SURFACE_TOLERANCE: f32 = 4.0;
/// Samples of a record at an error of 1 go with the square of these.
const LIGHT_SAMPLES_GAIN: f32 = 0.3;
const PATHS_GAIN: f32 = 0.5;
const SURFACE_PATHS_GAIN: f32 = 0.8;
/// Fewest and most samples of a record; the paper has 2 000 to 4 000 paths.
const SAMPLES: [f32; 2] = [32.0, 4096.0];
/// Smallest radius in pixels. That the radii are bounded by pixels is the paper's, the numbers are ours.
const LEAST_FOOTPRINT: f32 = 1.5;
/// Largest radius as a share of the height that the camera sees there. Alone it bounds records in even light, which reach into shadows: with
/// 0.25 the hall at 0.05 was 32 % off, with 0.1 22 % (2026-11-22).
const MOST_HEIGHT: f32 = 0.125;

/// Samples of a record at a target `error` of the image.
fn samples(gain: f32, error: f32) -> usize {
    let [fewest, most] = SAMPLES;
    (gain / error).powi(2).clamp(fewest, most) as usize
}

/// The record of what samples at a point found, valid within the paper's radius in metres:
///
/// R = ε Σ L / Σ ‖∇L‖
///
/// * ε – `tolerance`;
/// * Σ – sums over the samples and channels; gradients that point against each other do not cancel.
///
/// Where no light was found there is no telling where light begins: the radius is the smallest. `height` is that of the frame in pixels.
fn record_as_published(
    candidate: &Candidate,
    (height, tolerance): (u32, f32),
    value: (Vec3, Vec3),
    gradient: [Vec3; 3],
    gradient_norm: f32,
) -> Option<Record<3>> {
    let light = value.0.element_sum();
    let radius = if light > 0.0 {
        tolerance * light / gradient_norm
    } else {
        0.0
    };
    let radius = radius.clamp(
        LEAST_FOOTPRINT * candidate.footprint,
        most_radius(candidate, height),
    );
    record(candidate.position, radius, value, gradient)
}

/// Largest radius of records at a point, in a frame `height` pixels high.
fn most_radius(candidate: &Candidate, height: u32) -> f32 {
    candidate.footprint * (MOST_HEIGHT * height as f32).max(LEAST_FOOTPRINT)
}

/// Light scattered in media along the camera's rays.
pub(in crate::integrator) struct Volume<'s> {
    scene: &'s Scene,
    /// Of the frame, in pixels.
    height: u32,
    seed: u64,
    tolerance: f32,
    samples: Samples,
}

/// What light in media is made from.
enum Samples {
    /// Single scattering, from so many samples of the lights.
    Lights(usize),
    /// Multiple scattering, from paths of at most so many scattering events.
    Paths(Box<GatherPattern>, Option<u32>),
}

impl<'s> Volume<'s> {
    /// Single scattering of all lights, at a target `error` of the image.
    pub(in crate::integrator) fn single(
        scene: &'s Scene,
        height: u32,
        seed: u64,
        error: f32,
    ) -> Self {
        Self {
            scene,
            height,
            seed,
            tolerance: SINGLE_TOLERANCE * error.sqrt(),
            samples: Samples::Lights(samples(LIGHT_SAMPLES_GAIN, error)),
        }
    }

    /// Multiple scattering of up to `max_depth` events, at a target `error` of the image.
    pub(in crate::integrator) fn multiple(
        scene: &'s Scene,
        height: u32,
        max_depth: Option<u32>,
        seed: u64,
        error: f32,
    ) -> Self {
        let pattern = Box::new(GatherPattern::new(samples(PATHS_GAIN, error)));
        Self {
            scene,
            height,
            seed,
            tolerance: MULTIPLE_TOLERANCE * error.sqrt(),
            samples: Samples::Paths(pattern, max_depth),
        }
    }
}

impl Kind for Volume<'_> {
    type Tag = media::Known;

    const RADIUS_SLOPE: f32 = f32::INFINITY;

    fn most_radius(&self, candidate: &Candidate) -> f32 {
        most_radius(candidate, self.height)
    }

    fn points_on(&self, view: &View, ray: &Ray, offset: f32, visit: impl FnMut(Candidate)) {
        media::points_on(self.scene, (view, ray), offset, visit);
    }

    fn covers(&self, cache: &media::MediaCache, candidate: &Candidate) -> bool {
        media::covers(cache, candidate)
    }

    fn record(
        &self,
        geometry: &Counted<'_>,
        candidate: &Candidate,
        index: u64,
        _round: usize,
    ) -> Option<(Record<3>, media::Known)> {
        let world = geometry.world(self.scene);
        let x = candidate.position;
        let blind = Derivatives::Blind;
        let (value, gradient, norm) = match &self.samples {
            Samples::Lights(n) => {
                let derivatives = (inscatter::Order::Gradient, blind);
                let key = Light::Single.key(self.seed, index);
                let s = inscatter::single(&world, x, None, *n, derivatives, key);
                ((s.value, s.value_error), s.gradient, s.gradient_norm)
            }
            Samples::Paths(pattern, max_depth) => {
                let reach = Reach::depth(*max_depth);
                let key = Light::Multiple.key(self.seed, index);
                let g = gather::multiple_towards(&world, x, None, pattern, blind, reach, key);
                ((g.value, g.value_error), g.gradient, g.gradient_norm)
            }
        };
        let limits = (self.height, self.tolerance);
        let record = record_as_published(candidate, limits, value, gradient, norm)?;
        Some((record, media::Known::within(Walls::NONE)))
    }
}

/// Indirect light on the surfaces that the camera sees.
pub(in crate::integrator) struct Irradiance<'s> {
    pub(in crate::integrator) scene: &'s Scene,
    /// Of the frame, in pixels.
    pub(in crate::integrator) height: u32,
    pub(in crate::integrator) max_depth: Option<u32>,
    pub(in crate::integrator) seed: u64,
    /// Target error of the image.
    pub(in crate::integrator) error: f32,
}

impl Kind for Irradiance<'_> {
    type Tag = Side;

    const RADIUS_SLOPE: f32 = f32::INFINITY;

    fn most_radius(&self, candidate: &Candidate) -> f32 {
        most_radius(candidate, self.height)
    }

    fn points_on(&self, view: &View, ray: &Ray, _: f32, visit: impl FnMut(Candidate)) {
        surfaces::point_on(self.scene, view, ray).map(visit);
    }

    fn covers(&self, cache: &SurfaceCache, candidate: &Candidate) -> bool {
        surfaces::covers(cache, candidate)
    }

    fn record(
        &self,
        geometry: &Counted<'_>,
        candidate: &Candidate,
        index: u64,
        _round: usize,
    ) -> Option<(Record<3>, Side)> {
        let world = geometry.world(self.scene);
        let hit = Surfaces::hit(geometry, &candidate.ray)?;
        let key = Light::Surface.key(self.seed, index);
        let n_rays = samples(SURFACE_PATHS_GAIN, self.error);
        let reach = Reach::depth(self.max_depth);
        let g = irradiance(&world, &hit, n_rays, false, reach, key);
        let limits = (self.height, SURFACE_TOLERANCE * self.error.sqrt());
        let value = (g.value, g.value_error);
        let record = record_as_published(candidate, limits, value, g.gradient, g.gradient_norm)?;
        Some((record, Side::open(candidate.normal)))
    }
}
