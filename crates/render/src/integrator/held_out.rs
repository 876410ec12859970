//! How far off the light is that was computed before the image, told by light gathered afresh where camera rays ask for it.
//!
//! Two independent gathers g1, g2 at a place stand for the truth: (x − g1)(x − g2) has the squared error of what is read there as its
//! mean. They end in the same coarse field as records do, so what is wrong with that is not seen.

use super::counted::Counted;
use super::fill::media::{self, For, MediaCache};
use super::fill::surfaces::{self, SurfaceCache};
use super::has_passed;
use super::pilot::{self, Pilot};
use super::view::View;
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::time::Instant;
use tyndall_math::stats::Welford;
use tyndall_math::{Key, Purpose, Sampler};
use tyndall_scene::Scene;
use tyndall_transport::field::Field;
use tyndall_transport::free_flight::FreeFlight;
use tyndall_transport::gather::{self, GatherPattern, Towards, What};
use tyndall_transport::irradiance::irradiance;
use tyndall_transport::path::Reach;

/// One of so many blocks of the pilot is looked at; no divisor of a row's blocks, so that all columns have their turn.
const EVERY: usize = 5;
/// Places on a camera ray at which light in media is compared: errors of places far apart cancel in a pixel, as they do here.
const PLACES: usize = 2;
/// Keeps the numbers of these evaluations from those of the finished image's.
const HELD_OUT: u64 = 1 << 48;

/// Most rays of a gather.
const MOST_RAYS: usize = 2048;
/// Keys of one block: the place and each gather have one.
const KEYS: u64 = 1 + 2 * PLACES as u64;

/// What light that is read adds to the relative error of the image.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub(super) struct Share {
    /// Mean squared error; negative where noise outweighs it.
    pub(super) squared: f64,
    /// Standard error of that mean.
    pub(super) deviation: f64,
}

impl Share {
    /// Root mean square.
    pub(super) fn error(self) -> f64 {
        self.squared.max(0.0).sqrt()
    }
}

/// What an evaluation is of.
#[derive(Clone, Copy)]
pub(super) enum Read<'c> {
    /// Multiple scattering in the coarse field.
    Field(&'c Field),
    /// Multiple scattering in records.
    Multiple(&'c MediaCache),
    /// Single scattering of light from skies in records.
    Sky(&'c MediaCache),
    /// Light on surfaces in records, with that of skies or without.
    Surface(&'c SurfaceCache, bool),
}

/// Evaluations held out from what was computed.
pub(super) struct HeldOut<'s> {
    pub(super) scene: &'s Scene,
    /// From where the image is seen.
    pub(super) views: &'s [View],
    pub(super) seed: u64,
    pub(super) reach: Reach<'s>,
    /// For whom records of light in media are.
    pub(super) for_whom: For,
    pub(super) pilot: &'s Pilot,
    /// When to stop.
    pub(super) deadline: Option<Instant>,
}

impl HeldOut<'_> {
    /// What errors of `read` add to the relative error of the image, and the rays it took to know. Each gather takes `n_rays`, or
    /// [`MOST_RAYS`]. No error is known where the deadline came first.
    pub(super) fn error(&self, read: Read<'_>, n_rays: usize) -> (Option<Share>, u64) {
        let pattern = GatherPattern::new(n_rays.min(MOST_RAYS));
        let geometry = Counted::new(self.scene);
        let blocks: Vec<usize> = (0..self.pilot.len()).step_by(EVERY).collect();
        let squares: Option<Vec<f64>> = (blocks.par_iter())
            .map(|&block| {
                if has_passed(self.deadline) {
                    return None;
                }
                let found = self.difference(&geometry, read, block, &pattern);
                let [d1, d2] = found.unwrap_or_default().map(Vec3::as_dvec3);
                Some((d1 * d2 * self.pilot.weight(block)).element_sum() / 3.0)
            })
            .collect::<Vec<Option<f64>>>()
            .into_iter()
            .collect();
        let share = squares.map(|squares| {
            let mut mean = Welford::new();
            squares.iter().for_each(|&squared| mean.push(squared));
            Share {
                squared: mean.mean(),
                deviation: mean.standard_error(),
            }
        });
        (share, geometry.rays())
    }

    /// By how much what is read differs from two gathers on a camera ray through `block`; `None` where nothing is read.
    fn difference(
        &self,
        geometry: &Counted<'_>,
        read: Read<'_>,
        block: usize,
        pattern: &GatherPattern,
    ) -> Option<[Vec3; 2]> {
        let world = geometry.world(self.scene);
        let key = |k: u64| Key {
            seed: self.seed,
            purpose: Purpose::Validation,
            index: HELD_OUT + KEYS * block as u64 + k,
        };
        let mut sampler = Sampler::new(key(0), 0);
        let place = pilot::place(block as u32, sampler.next_2d());
        let ray = pilot::view(self.views, block).ray_at(place);
        let (hit, flight) = FreeFlight::to_surface(&world, &ray);
        if let Read::Surface(cache, sky) = read {
            let hit = hit.filter(surfaces::holds)?;
            let known = surfaces::lookup(cache, hit.position, hit.bsdf.normal())?;
            let weight = flight.transmittance() * hit.bsdf.diffuse_albedo(-ray.direction);
            let fresh = |key| irradiance(&world, &hit, pattern.n_rays(), sky, self.reach, key);
            return Some([1, 2].map(|k| weight * (known - fresh(key(k)).value)));
        }
        if !flight.can_stop() {
            return None;
        }
        let u = sampler.next_1d();
        let towards = Some(Towards::Direction(-ray.direction));
        let mut difference = [Vec3::ZERO; 2];
        for place in 0..PLACES {
            let Some(t) = flight.sample_inside((place as f32 + u) / PLACES as f32) else {
                continue;
            };
            let x = ray.at(t);
            let medium = world.media.at(x);
            let known = match read {
                Read::Field(field) => {
                    let light = field.leaving(geometry, (x, &medium), -ray.direction);
                    light.map(|light| light.value.max(Vec3::ZERO))
                }
                Read::Multiple(cache) | Read::Sky(cache) => {
                    let lobe = self.for_whom.lobe(&medium, -ray.direction);
                    media::lookup(cache, x, lobe.as_ref())
                }
                Read::Surface(..) => None,
            };
            let Some(known) = known else {
                continue;
            };
            let stop = flight.stop(t);
            let weight = stop.transmittance * medium.sigma_s / flight.pdf_inside(&stop);
            for (k, difference) in difference.iter_mut().enumerate() {
                let key = key(1 + (2 * place + k) as u64);
                let what = match read {
                    Read::Sky(_) => What::Sky,
                    _ => What::Scattered(self.reach),
                };
                let fresh = gather::towards(&world, x, towards, what, pattern, key);
                *difference += weight * (known - fresh.value) / PLACES as f32;
            }
        }
        Some(difference)
    }
}
