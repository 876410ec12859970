//! What a cache record is made of: multiple-scattered radiance at a point, its gradient and their standard errors.
//!
//! Stratified directions over the sphere start unbiased paths; light straight from emitters is left out, because single
//! scattering is computed where it is needed.

use crate::lamp_directions::LampDirections;
use crate::path::{FirstEvent, Source, Start, Vertex, Visitor, lamps_in_fog, trace};
use crate::warp_translation::WarpVisitor;
use crate::world::{Geometry, Lights, World};
use glam::Vec3;
use std::f32::consts::PI;
use tyndall_math::{Key, Ray, Sampler, warp};
use tyndall_media::MediumPoint;

/// Batches over which standard errors are taken; each is a stratified set of its own. Parts of one set would not do: their
/// spread knows nothing of what stratification against each other gains, and overstates the error two- to fivefold.
const BATCHES: usize = 16;
/// The displacement field ends this far short of the nearest surface, light or boundary.
const WARP_REACH: f32 = 0.9;
/// It reaches at least this share of the nearest surface's distance or of a free path, however close a boundary of a medium
/// is: closer, the noise of the gradient outweighs the missing boundary term.
const WARP_REACH_MIN: f32 = 0.1;

/// In-scattered radiance of light scattered before, at one point.
#[derive(Clone, Copy, Debug)]
pub struct Gathered {
    /// ∫ p L dω per colour channel, W/(m² sr); p is 1/4π where directions are weighted alike.
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

/// Directions in which light is gathered at a point: by the phase function there, and close to lamps.
#[derive(Clone, Debug)]
pub struct GatherDirections<'m> {
    lamps: LampDirections,
    /// The direction towards the eye and the medium, where it matters.
    lobe: Option<(Vec3, MediumPoint<'m>)>,
}

/// One of [`GatherDirections`].
#[derive(Clone, Copy, Debug)]
pub struct GatherDirection {
    /// Unit direction to where light comes from.
    pub w_i: Vec3,
    /// Phase function over the density of this direction, per colour channel.
    pub weight: Vec3,
    /// The uniform density over the density of this direction.
    uniform_weight: f32,
}

impl<'m> GatherDirections<'m> {
    /// Directions at `x` for light that leaves `towards` the eye; `None` weights them all alike, as isotropic media do.
    pub fn new<G, L: Lights>(world: &World<'m, G, L>, x: Vec3, towards: Option<Vec3>) -> Self {
        let medium = world.media.at(x);
        let lamps = lamps_in_fog(world.lights, x, &medium);
        let matters = !world.media.is_isotropic() && medium.sigma_s != Vec3::ZERO;
        Self {
            lamps,
            lobe: towards.filter(|_| matters).map(|w_o| (w_o, medium)),
        }
    }

    /// The direction for two numbers in [0, 1).
    pub fn sample(&self, [u, v]: [f32; 2]) -> GatherDirection {
        let share = self.lamps.share();
        let rest = (u - share) / (1.0 - share);
        let w_i = match &self.lobe {
            _ if u < share => self.lamps.sample([u, v]),
            None => warp::uniform_sphere([rest, v]),
            Some((w_o, medium)) => {
                medium
                    .sample_phase(*w_o, [rest.min(1.0 - f32::EPSILON), v])
                    .0
            }
        };
        let uniform = 0.25 / PI;
        let (phase, pdf) = match &self.lobe {
            None => (Vec3::splat(uniform), uniform),
            Some((w_o, medium)) => (medium.phase(*w_o, w_i).value, medium.phase_pdf(*w_o, w_i)),
        };
        let pdf = (1.0 - share) * pdf + self.lamps.pdf(w_i);
        GatherDirection {
            w_i,
            weight: phase / pdf,
            uniform_weight: uniform / pdf,
        }
    }
}

/// Gathers multiple-scattered light at `x` from `n_rays` paths (at least one), weighting all directions alike.
///
/// `max_depth` counts the scattering at `x` itself.
pub fn multiple<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    x: Vec3,
    n_rays: usize,
    max_depth: Option<u32>,
    key: Key,
) -> Gathered {
    multiple_towards(world, x, None, n_rays, max_depth, key)
}

/// As [`multiple`], with directions weighted by the phase function at `x` for light that leaves `towards` the eye.
///
/// Value and gradient are those of ∫ p L dω with p the media's phase functions mixed by scattering.
pub fn multiple_towards<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    x: Vec3,
    towards: Option<Vec3>,
    n_rays: usize,
    max_depth: Option<u32>,
    key: Key,
) -> Gathered {
    let directions = GatherDirections::new(world, x, towards);
    let sampler = |i: usize| Sampler::new(batch_key(key, i % BATCHES), (i / BATCHES) as u64);
    let starts: Vec<(Start, GatherDirection)> = (0..n_rays)
        .map(|i| {
            let direction = directions.sample(sampler(i).next_2d());
            let ray = Ray::new(x, direction.w_i);
            let start = Start {
                ray,
                hit: Some(world.geometry.intersect(&ray, f32::INFINITY)),
                first: FirstEvent::Any,
                max_depth: max_depth.map(|d| d.saturating_sub(1)),
            };
            (start, direction)
        })
        .collect();
    let distances = || {
        let met = starts
            .iter()
            .filter_map(|(s, direction)| Some((s.hit.flatten()?.t, direction.uniform_weight)));
        met.map(|(t, weight)| (t.max(f32::MIN_POSITIVE), weight))
    };
    let nearest = distances().map(|(t, _)| t).fold(f32::INFINITY, f32::min);
    let inverse: f32 = distances().map(|(t, weight)| weight / t).sum();
    let radius = warp_radius(world, x, nearest);

    let mut batches = Batches::default();
    for (i, (start, direction)) in starts.iter().enumerate() {
        let mut sampler = sampler(i);
        let towards = directions.lobe.as_ref().map(|(w_o, _)| *w_o);
        let mut visitor = WarpVisitor::new(world.media, x, radius, towards);
        trace(world, start, &mut sampler, &mut visitor);
        let weight = direction.weight;
        let [dr, dg, db] = visitor.gradient;
        batches.add(
            i,
            visitor.value * weight,
            [dr * weight.x, dg * weight.y, db * weight.z],
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

/// One path's estimate of (1/4π) ∫ L dω at `x`, light straight from emitters left out: what a record there would hold, unbiased
/// and with the noise of a single path. All directions weigh alike.
pub fn one<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    x: Vec3,
    max_depth: Option<u32>,
    sampler: &mut Sampler,
) -> Vec3 {
    let directions = GatherDirections::new(world, x, None);
    one_of(&directions, world, x, max_depth, sampler)
}

/// As [`one`], for directions prepared at `x`, with the phase function they were prepared for.
pub fn one_of<G: Geometry, L: Lights>(
    directions: &GatherDirections<'_>,
    world: &World<'_, G, L>,
    x: Vec3,
    max_depth: Option<u32>,
    sampler: &mut Sampler,
) -> Vec3 {
    let direction = directions.sample(sampler.next_2d());
    let start = Start {
        ray: Ray::new(x, direction.w_i),
        hit: None,
        first: FirstEvent::Any,
        max_depth: max_depth.map(|d| d.saturating_sub(1)),
    };
    let mut visitor = ScatteredLight::default();
    trace(world, &start, sampler, &mut visitor);
    visitor.value * direction.weight
}

/// Sums what a path finds, but for light straight from emitters.
#[derive(Default)]
struct ScatteredLight {
    scattered: bool,
    value: Vec3,
}

impl Visitor for ScatteredLight {
    fn vertex(&mut self, _vertex: Vertex<'_, '_>) {
        self.scattered = true;
    }

    fn light(&mut self, value: Vec3, last: Option<Vertex<'_, '_>>, _source: Source) {
        if self.scattered || last.is_some() {
            self.value += value;
        }
    }
}

/// The key of one batch of a gather; the highest bit keeps it from the keys of whoever draws with `key` itself.
fn batch_key(key: Key, batch: usize) -> Key {
    Key {
        index: key
            .index
            .wrapping_mul(BATCHES as u64)
            .wrapping_add(batch as u64)
            | 1 << 63,
        ..key
    }
}

/// D of the displacement field at `x`.
fn warp_radius<G, L: Lights>(world: &World<'_, G, L>, x: Vec3, nearest: f32) -> f32 {
    let light = world.lights.distance_to_point_lights(x);
    let solid = nearest.min(light);
    let boundary = world.media.distance_to_boundary(x);
    let sigma = world.media.at(x).sigma_t.max_element();
    let free_path = if sigma > 0.0 {
        1.0 / sigma
    } else {
        f32::INFINITY
    };
    // Without anything near, a few free paths: farther vertices need no displacement.
    let reach = WARP_REACH * solid.min(boundary).min(4.0 * free_path);
    reach
        .max(WARP_REACH_MIN * solid.min(free_path))
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
