//! What a cache record is made of: multiple-scattered radiance at a point, its gradient and their standard errors.
//!
//! Stratified directions over the sphere start unbiased paths; light straight from emitters is left out, because single
//! scattering is computed where it is needed.

use crate::path::{FirstEvent, Start, lamps_in_fog, trace};
use crate::warp_translation::WarpVisitor;
use crate::world::{Geometry, Lights, World};
use glam::Vec3;
use std::f32::consts::PI;
use tyndall_math::{Key, Ray, Sampler, warp};

/// Batches over which standard errors are taken.
const BATCHES: usize = 16;
/// The displacement field ends this far short of the nearest surface, light or boundary.
const WARP_REACH: f32 = 0.9;
/// It reaches at least this share of the nearest surface's distance, however close a boundary of a medium is: closer,
/// the noise of the gradient outweighs the missing boundary term.
const WARP_REACH_MIN: f32 = 0.1;

/// Isotropic in-scattered radiance of light scattered before, at one point.
#[derive(Clone, Copy, Debug)]
pub struct Gathered {
    /// (1/4π) ∫ L dω per colour channel, W/(m² sr).
    pub value: Vec3,
    /// Its gradient per metre, one vector per channel.
    pub gradient: [Vec3; 3],
    /// Standard error of the value.
    pub value_error: Vec3,
    /// Standard error of each component of the gradient.
    pub gradient_error: [Vec3; 3],
    /// Distance to the nearest surface met by a gather ray, in metres; infinite without surfaces.
    pub nearest: f32,
    /// Harmonic mean of the distances to surfaces, in metres; infinite without surfaces.
    pub harmonic_mean_distance: f32,
}

/// Gathers multiple-scattered light at `x` from `n_rays` paths (at least one).
///
/// `max_depth` counts the scattering at `x` itself. Isotropic scattering at `x` is assumed.
pub fn multiple<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    x: Vec3,
    n_rays: usize,
    max_depth: Option<u32>,
    key: Key,
) -> Gathered {
    let lamps = lamps_in_fog(world.lights, x, &world.media.at(x));
    // Each start with its weight, the uniform density over the density of its direction.
    let starts: Vec<(Start, f32)> = (0..n_rays)
        .map(|i| {
            let [u, v] = Sampler::new(key, i as u64).next_2d();
            let w = if u < lamps.share() {
                lamps.sample([u, v])
            } else {
                warp::uniform_sphere([(u - lamps.share()) / (1.0 - lamps.share()), v])
            };
            let ray = Ray::new(x, w);
            let start = Start {
                ray,
                hit: Some(world.geometry.intersect(&ray, f32::INFINITY)),
                first: FirstEvent::Any,
                max_depth: max_depth.map(|d| d.saturating_sub(1)),
            };
            let uniform = 0.25 / PI;
            (
                start,
                uniform / ((1.0 - lamps.share()) * uniform + lamps.pdf(w)),
            )
        })
        .collect();
    let distances = || {
        let met = starts
            .iter()
            .filter_map(|(s, weight)| Some((s.hit.flatten()?.t, *weight)));
        met.map(|(t, weight)| (t.max(f32::MIN_POSITIVE), weight))
    };
    let nearest = distances().map(|(t, _)| t).fold(f32::INFINITY, f32::min);
    let inverse: f32 = distances().map(|(t, weight)| weight / t).sum();
    let radius = warp_radius(world, x, nearest);

    let mut batches = Batches::default();
    for (i, (start, weight)) in starts.iter().enumerate() {
        let mut sampler = Sampler::new(key, i as u64);
        let mut visitor = WarpVisitor::new(world.media, x, radius);
        trace(world, start, &mut sampler, &mut visitor);
        batches.add(
            i,
            visitor.value * *weight,
            visitor.gradient.map(|d| d * *weight),
        );
    }
    let [value, dr, dg, db] = batches.means();
    let [value_error, er, eg, eb] = batches.errors();
    Gathered {
        value,
        gradient: [dr, dg, db],
        value_error,
        gradient_error: [er, eg, eb],
        nearest,
        harmonic_mean_distance: n_rays as f32 / inverse,
    }
}

/// D of the displacement field at `x`.
fn warp_radius<G, L: Lights>(world: &World<'_, G, L>, x: Vec3, nearest: f32) -> f32 {
    let light = world.lights.distance_to_point_lights(x);
    let solid = nearest.min(light);
    let boundary = world.media.distance_to_boundary(x);
    let sigma = world.media.at(x).sigma_t.max_element();
    // Without anything near, a few free paths: farther vertices need no displacement.
    let free = if sigma > 0.0 {
        4.0 / sigma
    } else {
        f32::INFINITY
    };
    let reach = WARP_REACH * solid.min(boundary).min(free);
    reach
        .max(WARP_REACH_MIN * solid.min(free))
        .clamp(f32::MIN_POSITIVE.sqrt(), f32::MAX.sqrt())
}

/// Sums of value and gradient by batch; f64 because thousands of terms of both signs are added.
#[derive(Default)]
struct Batches {
    sums: [[glam::DVec3; 4]; BATCHES],
    counts: [usize; BATCHES],
}

impl Batches {
    fn add(&mut self, i: usize, value: Vec3, gradient: [Vec3; 3]) {
        let batch = &mut self.sums[i % BATCHES];
        let [dr, dg, db] = gradient;
        for (sum, term) in batch.iter_mut().zip([value, dr, dg, db]) {
            *sum += term.as_dvec3();
        }
        self.counts[i % BATCHES] += 1;
    }

    fn means(&self) -> [Vec3; 4] {
        let n = self.counts.iter().sum::<usize>().max(1) as f64;
        std::array::from_fn(|k| (self.sums.iter().map(|s| s[k]).sum::<glam::DVec3>() / n).as_vec3())
    }

    /// Standard errors from the spread of batch means; infinite where fewer than two batches hold samples.
    fn errors(&self) -> [Vec3; 4] {
        let full: Vec<usize> = (0..BATCHES).filter(|&b| self.counts[b] > 0).collect();
        let n = full.len() as f64;
        if full.len() < 2 {
            return [Vec3::INFINITY; 4];
        }
        std::array::from_fn(|k| {
            let means: Vec<_> = full
                .iter()
                .map(|&b| self.sums[b][k] / self.counts[b] as f64)
                .collect();
            let mean = means.iter().sum::<glam::DVec3>() / n;
            let var = means
                .iter()
                .map(|m| (*m - mean) * (*m - mean))
                .sum::<glam::DVec3>()
                / (n - 1.0);
            (var / n).as_vec3().map(f32::sqrt)
        })
    }
}
