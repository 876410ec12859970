//! One camera sample: the layers of a pixel along one ray, by path tracing or from cache records.
//!
//! The cached way computes single scattering straight from the lights, reads multiple scattering and indirect light on
//! surfaces from records; each scene pays only for what it holds.

use super::counted::Counted;
use super::fill::media::{self, For, MediaCache};
use super::fill::surfaces::{self, SurfaceCache};
use super::view::View;
use crate::film::Pixel;
use glam::Vec3;
use std::cell::Cell;
use tyndall_math::{Ray, Sampler};
use tyndall_media::MediumPoint;
use tyndall_scene::{LightSet, Scene};
use tyndall_transport::field::Field;
use tyndall_transport::free_flight::FreeFlight;
use tyndall_transport::gather;
use tyndall_transport::layers::LayerVisitor;
use tyndall_transport::path::{FirstEvent, Reach, Start, trace};
use tyndall_transport::shafts::Shafts;
use tyndall_transport::single::SegmentLight;
use tyndall_transport::world::{Geometry, Lights, SurfaceHit, World};
use tyndall_transport::{direct, emission};

/// Probes along each camera ray for the shadows of lights without extent. Three times as many halve the noise of shafts, but samples that
/// other light asks for average it anyway: at 5 % the samples of Sponza took 4.8 s with 24 and 3.1 s with 8, those of the hall 2.7 and
/// 2.4 s, for the same error of the image (2026-11-23).
const SHAFT_PROBES: u32 = 8;
/// Single-scattering samples along each camera ray of the cached integrator, for all other light.
const SINGLE_SAMPLES: u32 = 2;
/// Places on each camera ray at which a cache of light in media is asked. With 4, samples of the hall took 2.6 s instead of 1.8 s for noise
/// of 5.09 instead of 5.13 %; with 1, the noise of the Cornell box rises from 5.1 to 5.8 % (2026-11-23).
const MEDIA_SAMPLES: u32 = 2;
/// Where no record is valid the nearest one stands in, within this share of the distance to the eye.
const MAKESHIFT: f32 = 0.05;
/// Gloss is followed with the chance of its share in what a surface reflects, and this at least: where little of the light is gloss, its
/// noise hides behind that of the rest. Sponza at 16 samples (2026-11-23): render 3.7 s always, 2.9 s with 0.4, noise 6.07 and 6.14 %.
const LEAST_GLOSS: f32 = 0.25;
/// Parts of a camera sample's work beside the path behind the first surface; each has numbers of its own.
const FOG_PART: u64 = 16;
const SKY_PART: u64 = 18;
const GLOSS_PART: u64 = 19;
const SINGLE_PART: u64 = 20;

/// Scattering events that light of the `multiple` layer has had at least: media's own emission needs only the last.
pub(crate) fn least_multiple_depth(scene: &Scene) -> u32 {
    if scene.media.emits() { 1 } else { 2 }
}

/// How multiple scattering is found along camera rays.
pub(crate) enum Multiple<'c> {
    /// There is none.
    None,
    /// Interpolated from records.
    Records(&'c MediaCache),
    /// Read from the coarse field.
    Field(&'c Field),
    /// Traced from each place that is asked for.
    Paths,
}

/// What was computed before the image.
pub(crate) struct Known<'c> {
    pub(crate) multiple: Multiple<'c>,
    /// Single scattering of light from skies, where records hold it.
    pub(crate) sky: Option<&'c MediaCache>,
    /// Single scattering of all light, where records hold it.
    pub(crate) single: Option<&'c MediaCache>,
    /// For whom records of light in media are.
    pub(crate) for_whom: For,
    /// Light on surfaces, where records hold it: indirect, and where there are records of light from skies that, too.
    pub(crate) indirect: Option<&'c SurfaceCache>,
}

/// Computes camera samples of one scene; one for each row of the image.
pub(crate) struct Camera<'s> {
    scene: &'s Scene,
    view: View,
    reach: Reach<'s>,
    geometry: Counted<'s>,
    lookups: Cell<u64>,
    missed: Cell<u64>,
}

/// What camera samples cost.
#[derive(Clone, Copy, Debug, Default)]
pub(crate) struct Tally {
    pub(crate) rays: u64,
    pub(crate) lookups: u64,
    pub(crate) missed: u64,
    /// Samples that were not finite, and were left out.
    pub(crate) dropped: u64,
}

impl Tally {
    pub(crate) fn add(&mut self, other: &Self) {
        self.rays += other.rays;
        self.lookups += other.lookups;
        self.missed += other.missed;
        self.dropped += other.dropped;
    }
}

impl<'s> Camera<'s> {
    pub(crate) fn new(scene: &'s Scene, view: View, reach: Reach<'s>) -> Self {
        Self {
            scene,
            view,
            reach,
            geometry: Counted::new(scene),
            lookups: Cell::new(0),
            missed: Cell::new(0),
        }
    }

    pub(crate) fn tally(&self) -> Tally {
        Tally {
            rays: self.geometry.rays(),
            lookups: self.lookups.get(),
            missed: self.missed.get(),
            dropped: 0,
        }
    }

    /// The camera ray of a sample in pixel (x, y), box filtered over the pixel.
    fn ray(&self, x: u32, y: u32, sampler: &mut Sampler) -> Ray {
        let [u, v] = sampler.next_2d();
        self.view.ray(x as f32 + u, y as f32 + v)
    }

    fn may_scatter(&self, events: u32) -> bool {
        self.reach.max_depth.is_none_or(|max| events <= max)
    }

    /// A path-traced sample of pixel (x, y).
    pub(crate) fn path_traced(&self, x: u32, y: u32, sampler: &mut Sampler) -> Pixel {
        let world = self.geometry.world(self.scene);
        let ray = self.ray(x, y, sampler);
        let hit = world.geometry.intersect(&ray, f32::INFINITY);
        let start = Start {
            ray,
            hit: Some(hit),
            first: FirstEvent::Any,
            reach: Reach::depth(self.reach.max_depth),
        };
        let mut visitor = LayerVisitor::default();
        trace(&world, &start, sampler, &mut visitor);
        let layers = visitor.layers;
        let t_max = hit.map_or(f32::INFINITY, |h| h.t);
        let tau = world.media.optical_depth(&ray, t_max);
        Pixel {
            surface: layers.surface,
            single: layers.single,
            multiple: layers.multiple,
            emission: layers.emission,
            transmittance: tyndall_media::transmittance(tau),
            depth: hit.map_or(0.0, |h| h.t),
            lookups: 0.0,
        }
    }

    /// A sample of pixel (x, y) with what is `known` read, and the rest traced.
    pub(crate) fn cached(&self, x: u32, y: u32, sampler: &mut Sampler, known: &Known<'_>) -> Pixel {
        let world = self.geometry.world(self.scene);
        let ray = self.ray(x, y, sampler);
        let (hit, flight) = FreeFlight::to_surface(&world, &ray);
        let mut pixel = Pixel {
            surface: self.surface(&world, (&ray, hit), &flight, known, sampler),
            transmittance: flight.transmittance(),
            depth: hit.map_or(0.0, |h| h.t),
            ..Pixel::default()
        };
        if flight.segment().is_empty() {
            return pixel;
        }
        let w_o = -ray.direction;
        let trace = |x, _: &MediumPoint<'_>, path: &mut Sampler| {
            gather::one(&world, (x, w_o), self.reach, path)
        };
        let sampler = &mut sampler.branch(FOG_PART);
        if let Some(e) = emission::sample(&world, &ray, &flight, sampler.next_1d()) {
            pixel.emission = e.value;
        }
        if !flight.can_stop() {
            return pixel;
        }
        if self.may_scatter(1) {
            pixel.single = self.single(&world, &ray, &flight, known, sampler);
        }
        if self.may_scatter(least_multiple_depth(self.scene)) {
            match known.multiple {
                Multiple::None => {}
                Multiple::Records(cache) => {
                    pixel.multiple =
                        self.interpolated((&ray, &flight), (cache, known.for_whom), sampler, trace);
                }
                Multiple::Field(field) => {
                    let read = |(x, _), medium: &MediumPoint<'_>, path: &mut Sampler| {
                        let known = field.leaving(world.geometry, (x, medium), w_o);
                        known.map_or_else(
                            || trace(x, medium, path),
                            |light| light.value.max(Vec3::ZERO),
                        )
                    };
                    pixel.multiple = self.scattered(&ray, &flight, sampler, read);
                }
                Multiple::Paths => {
                    let read = |(x, _), medium: &MediumPoint<'_>, path: &mut Sampler| {
                        trace(x, medium, path)
                    };
                    pixel.multiple = self.scattered(&ray, &flight, sampler, read);
                }
            }
        }
        pixel
    }

    /// The part of single scattering that is light from skies, by a sample of pixel (x, y) that looks for nothing else.
    pub(crate) fn sky(&self, x: u32, y: u32, sampler: &mut Sampler) -> Vec3 {
        let world = self.geometry.world(self.scene);
        if world.lights.environment().is_empty() {
            return Vec3::ZERO;
        }
        let ray = self.ray(x, y, sampler);
        let (_, flight) = FreeFlight::to_surface(&world, &ray);
        if !flight.can_stop() {
            return Vec3::ZERO;
        }
        let sampler = &mut sampler.branch(FOG_PART);
        let read = |(x, _), medium: &MediumPoint<'_>, sampler: &mut Sampler| {
            from_sky(&world, x, (medium, -ray.direction), sampler)
        };
        self.scattered(&ray, &flight, sampler, read)
    }

    /// What the first surface sends to the eye, or the environment.
    fn surface<'w>(
        &self,
        world: &World<'w, Counted<'_>, LightSet>,
        (ray, hit): (&Ray, Option<SurfaceHit>),
        flight: &FreeFlight<'w>,
        known: &Known<'_>,
        sampler: &mut Sampler,
    ) -> Vec3 {
        let read = known.indirect.zip(hit).and_then(|(cache, hit)| {
            let normal = hit.bsdf.normal();
            if !surfaces::holds(&hit) {
                return None;
            }
            self.lookups.set(self.lookups.get() + 1);
            let indirect = surfaces::lookup(cache, hit.position, normal)?;
            Some((hit, indirect))
        });
        let Some((hit, indirect)) = read else {
            return self.traced(ray, hit, FirstEvent::Surface, sampler).surface;
        };
        let w_o = -ray.direction;
        let choice = sampler.next_1d();
        let lights = if known.sky.is_some() {
            direct::lamps
        } else {
            direct::sample
        };
        let u = sampler.next_2d();
        let direct = lights(world, hit.position, Some(&hit), choice, u)
            .map_or(Vec3::ZERO, |s| hit.bsdf.eval(w_o, s.w_i) * s.radiance);
        let even = hit.bsdf.diffuse_albedo(w_o) * indirect;
        let mut reflected = direct + even;
        if !hit.bsdf.is_lambert() {
            let path = &mut sampler.branch(GLOSS_PART);
            reflected += self.gloss(world, &hit, w_o, known.sky.is_some(), path);
        }
        flight.transmittance() * (hit.emission + reflected)
    }

    /// What the surface at `hit` reflects of the light that records hold beside its diffuse part, by one path; `sky` tells whether that
    /// of skies is held.
    fn gloss(
        &self,
        world: &World<'_, Counted<'_>, LightSet>,
        hit: &SurfaceHit,
        w_o: Vec3,
        sky: bool,
        sampler: &mut Sampler,
    ) -> Vec3 {
        let all = hit.bsdf.albedo(w_o).element_sum();
        let share = 1.0 - hit.bsdf.diffuse_albedo(w_o).element_sum() / all;
        let survival = share.clamp(LEAST_GLOSS, 1.0);
        if all <= 0.0 || sampler.next_1d() >= survival {
            return Vec3::ZERO;
        }
        let lobe = sampler.next_1d();
        let sample = hit.bsdf.sample_gloss(w_o, lobe, sampler.next_2d());
        sample
            .filter(|s| s.w_i.dot(hit.normal) > 0.0)
            .map_or(Vec3::ZERO, |s| {
                let path = &mut sampler.branch(GLOSS_PART);
                s.value / (survival * s.pdf)
                    * gather::along(world, hit.spawn(s.w_i), sky, self.reach, path)
            })
    }

    fn traced(
        &self,
        ray: &Ray,
        hit: Option<SurfaceHit>,
        first: FirstEvent,
        sampler: &mut Sampler,
    ) -> tyndall_transport::layers::Layers {
        let start = Start {
            ray: *ray,
            hit: Some(hit),
            first,
            reach: self.reach,
        };
        let mut visitor = LayerVisitor::default();
        trace(
            &self.geometry.world(self.scene),
            &start,
            sampler,
            &mut visitor,
        );
        visitor.layers
    }

    fn single<'w>(
        &self,
        world: &World<'w, Counted<'_>, LightSet>,
        ray: &Ray,
        flight: &FreeFlight<'w>,
        known: &Known<'_>,
        sampler: &mut Sampler,
    ) -> Vec3 {
        if let Some(cache) = known.single {
            let sampler = &mut sampler.branch(SINGLE_PART);
            let trace = |x, medium: &MediumPoint<'_>, sampler: &mut Sampler| {
                from_lights(world, x, (medium, -ray.direction), sampler)
            };
            let cache = (cache, known.for_whom);
            return self.interpolated((ray, flight), cache, sampler, trace);
        }
        let Some(mut lights) = SegmentLight::new(world, ray, flight) else {
            return Vec3::ZERO;
        };
        let mut shafts = Vec3::ZERO;
        if let Some(cache) = known.sky {
            lights.take_sky(world.lights);
            let sampler = &mut sampler.branch(SKY_PART);
            let trace = |x, medium: &MediumPoint<'_>, sampler: &mut Sampler| {
                from_sky(world, x, (medium, -ray.direction), sampler)
            };
            let cache = (cache, known.for_whom);
            shafts += self.interpolated((ray, flight), cache, sampler, trace);
        }
        for (light, probes) in lights.take_shafts(world.lights, SHAFT_PROBES) {
            let shaft = Shafts::new(world, ray, flight, light);
            shafts += shaft.radiance(probes, sampler.next_1d());
        }
        if !lights.has_lights(world.lights) {
            return shafts;
        }
        let mut sum = Vec3::ZERO;
        // One offset for all samples of the ray: their distances are evenly spread.
        let offset = sampler.next_1d();
        for i in 0..SINGLE_SAMPLES {
            let v = (offset + i as f32 / SINGLE_SAMPLES as f32).fract();
            let u = sampler.next_1d();
            let w = sampler.next_2d();
            if let Some(s) = lights.sample(world, u, v, w) {
                sum += s.value;
            }
        }
        shafts + sum / SINGLE_SAMPLES as f32
    }

    /// Light scattered in media towards the origin of `ray`, where `read` knows in-scattered radiance at a place and its distance, in the
    /// medium there.
    fn scattered(
        &self,
        ray: &Ray,
        flight: &FreeFlight<'_>,
        sampler: &mut Sampler,
        read: impl Fn((Vec3, f32), &MediumPoint<'_>, &mut Sampler) -> Vec3,
    ) -> Vec3 {
        let media = &self.scene.media;
        let offset = sampler.next_1d();
        let mut sum = Vec3::ZERO;
        for i in 0..MEDIA_SAMPLES {
            let Some(t) = flight.sample_inside((i as f32 + offset) / MEDIA_SAMPLES as f32) else {
                continue;
            };
            let x = ray.at(t);
            let medium = media.at(x);
            let radiance = read((x, t), &medium, &mut sampler.branch(u64::from(i)));
            let stop = flight.stop(t);
            sum += stop.transmittance * medium.sigma_s * radiance / flight.pdf_inside(&stop);
        }
        sum / MEDIA_SAMPLES as f32
    }

    /// As [`Camera::scattered`], of what `cache` knows; at a place where it knows nothing, of what `trace` finds.
    fn interpolated(
        &self,
        (ray, flight): (&Ray, &FreeFlight<'_>),
        (cache, for_whom): (&MediaCache, For),
        sampler: &mut Sampler,
        trace: impl Fn(Vec3, &MediumPoint<'_>, &mut Sampler) -> Vec3,
    ) -> Vec3 {
        self.scattered(ray, flight, sampler, |(x, t), medium, sampler| {
            self.lookups.set(self.lookups.get() + 1);
            let lobe = for_whom.lobe(medium, -ray.direction);
            media::lookup(cache, x, lobe.as_ref()).unwrap_or_else(|| {
                self.missed.set(self.missed.get() + 1);
                // The nearest record is a little off here, and a path would be noisy.
                media::nearest(cache, x, lobe.as_ref(), MAKESHIFT * t)
                    .unwrap_or_else(|| trace(x, medium, sampler))
            })
        })
    }
}

/// In-scattered radiance at `x` in `medium` towards `w_o` of light straight from all lights.
fn from_lights(
    world: &World<'_, Counted<'_>, LightSet>,
    x: Vec3,
    (medium, w_o): (&MediumPoint<'_>, Vec3),
    sampler: &mut Sampler,
) -> Vec3 {
    let (choice, u) = (sampler.next_1d(), sampler.next_2d());
    let sample = direct::sample(world, x, None, choice, u);
    sample.map_or(Vec3::ZERO, |s| medium.phase(w_o, s.w_i).value * s.radiance)
}

/// In-scattered radiance at `x` in `medium` towards `w_o` of light straight from skies.
fn from_sky(
    world: &World<'_, Counted<'_>, LightSet>,
    x: Vec3,
    (medium, w_o): (&MediumPoint<'_>, Vec3),
    sampler: &mut Sampler,
) -> Vec3 {
    let samples = direct::sky(world, x, None, sampler.next_2d());
    samples
        .map(|s| medium.phase(w_o, s.w_i).value * s.radiance)
        .sum()
}
