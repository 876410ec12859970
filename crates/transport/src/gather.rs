//! What a cache record is made of: multiple-scattered radiance at a point, its gradient and their standard errors.
//!
//! Stratified directions over the sphere start paths, which go to their end or into a coarse field of light. Light straight from
//! emitters is left out, because single scattering is computed where it is needed.

use crate::lamp_directions::LampDirections;
use crate::lobe::{self, n_above};
use crate::occlusion::{self, Seen};
use crate::path::{
    FirstEvent, Reach, Source, Start, Vertex, Visitor, lamps_in_fog, straight_from_sky, trace,
};
use crate::walls::Walls;
use crate::warp_translation::WarpVisitor;
use crate::world::{Geometry, Lights, World};
use glam::{Quat, Vec3};
use std::f32::consts::{PI, TAU};
use std::sync::OnceLock;
use tyndall_math::spherical::{Border, SphericalVoronoi};
use tyndall_math::{Key, Ray, Sampler, SphericalFibonacci, warp};
use tyndall_media::MediumPoint;

/// Batches over which standard errors are taken. Paths are independent between them, directions are parts of one set: where the noise of
/// paths is what counts the errors told are those found, and where light differs by direction alone they are overstated, at 1024
/// directions about threefold at an edge and more where light is smooth.
pub(crate) const BATCHES: usize = 16;
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
    /// Mean over the paths of ‖∇L‖, summed over channels, per metre: gradients that cancel in the sum do not cancel here.
    pub gradient_norm: f32,
    /// Distance to the nearest surface met by a gather ray, in metres; infinite without surfaces.
    pub nearest: f32,
    /// Harmonic mean of the distances to surfaces, in metres; infinite without surfaces.
    pub harmonic_mean_distance: f32,
    /// The nearest surfaces that gather rays met.
    pub walls: Walls,
}

/// Where light goes from the point at which it is gathered.
#[derive(Clone, Copy, Debug)]
pub enum Towards {
    /// In this unit direction, wherever the point moves.
    Direction(Vec3),
    /// To an eye at this place: the direction turns when the point moves.
    Eye(Vec3),
}

impl Towards {
    /// The unit direction from `x`, and how fast it turns when `x` moves: `∂w_o = (1 − w_o w_oᵀ) rate`.
    fn from(self, x: Vec3) -> (Vec3, f32) {
        match self {
            Self::Direction(w_o) => (w_o, 0.0),
            Self::Eye(eye) => {
                let (w_o, distance) = (eye - x).normalize_and_length();
                (w_o, -1.0 / distance.max(f32::MIN_POSITIVE))
            }
        }
    }
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

    /// As [`GatherDirections::new`]; light straight from skies is not looked for past lamps.
    fn of<G, L: Lights>(
        world: &World<'m, G, L>,
        x: Vec3,
        towards: Option<Vec3>,
        what: What<'_>,
    ) -> Self {
        let directions = Self::new(world, x, towards);
        match what {
            What::Scattered(_) => directions,
            What::Sky => Self {
                lamps: LampDirections::default(),
                ..directions
            },
        }
    }

    /// The direction for two numbers in [0, 1).
    pub fn sample(&self, [u, v]: [f32; 2]) -> GatherDirection {
        let share = self.lamps.share();
        if u < share {
            return self.weighted(self.lamps.sample([u, v]), share);
        }
        let rest = ((u - share) / (1.0 - share)).min(1.0 - f32::EPSILON);
        let w_i = match &self.lobe {
            None => warp::uniform_sphere([rest, v]),
            Some((w_o, medium)) => medium.sample_phase(*w_o, [rest, v]).0,
        };
        self.weighted(w_i, share)
    }

    /// The direction that stands for the unit vector `d` of a pattern, where `share` of all directions are left to lamps.
    fn along_pattern(&self, d: Vec3, share: f32) -> GatherDirection {
        let w_i = match &self.lobe {
            None => d,
            Some((w_o, medium)) => {
                let u = (0.5 - 0.5 * d.z).clamp(0.0, 1.0 - f32::EPSILON);
                let v = (d.y.atan2(d.x) / TAU)
                    .rem_euclid(1.0)
                    .min(1.0 - f32::EPSILON);
                medium.sample_phase(*w_o, [u, v]).0
            }
        };
        self.weighted(w_i, share)
    }

    /// A direction around a lamp for two numbers in [0, 1), where `share` of all directions are.
    fn around_lamp(&self, [u, v]: [f32; 2], share: f32) -> GatherDirection {
        self.weighted(self.lamps.sample([u * self.lamps.share(), v]), share)
    }

    /// `w_i` with its weights where `share` of all directions are around lamps.
    fn weighted(&self, w_i: Vec3, share: f32) -> GatherDirection {
        let uniform = 0.25 / PI;
        let pdf = match &self.lobe {
            None => uniform,
            Some((w_o, medium)) => medium.phase_pdf(*w_o, w_i),
        };
        let around = if share > 0.0 {
            share / self.lamps.share() * self.lamps.pdf(w_i)
        } else {
            0.0
        };
        let pdf = (1.0 - share) * pdf + around;
        GatherDirection {
            w_i,
            weight: self.phase(w_i) / pdf,
            uniform_weight: uniform / pdf,
        }
    }

    /// The phase function for light from `w_i`, per colour channel and steradian.
    fn phase(&self, w_i: Vec3) -> Vec3 {
        match &self.lobe {
            None => Vec3::splat(0.25 / PI),
            Some((w_o, medium)) => medium.phase(*w_o, w_i).value,
        }
    }
}

/// Whether gradients know that what is hidden changes when the point moves.
#[derive(Clone, Copy, Debug, Default, PartialEq, Eq)]
pub enum Derivatives {
    /// Visibility moves with the silhouettes that the gather rays see.
    #[default]
    Aware,
    /// Visibility is taken as constant.
    Blind,
}

/// The directions of a gather, made once and turned at random for every record.
///
/// A spherical Fibonacci set, dealt out to the batches in turn, and its Voronoi diagram, fine enough for silhouettes: a diagram of each
/// batch's own was not (docs/derivatives.md). There is one such set for records to which no lamp is near, and some of fewer directions
/// that leave up to half of the paths to directions around lamps.
#[derive(Debug)]
pub struct GatherPattern {
    /// Paths of one batch.
    paths: usize,
    /// Batches that share a diagram; all of them but for huge numbers of paths.
    group: usize,
    sets: [OnceLock<PatternSet>; LAMP_LEVELS],
}

/// Directions of one group, batch by batch, and the cells that all of them make, once silhouettes ask for them.
#[derive(Debug)]
struct PatternSet {
    directions: Vec<Vec3>,
    cells: OnceLock<SphericalVoronoi>,
}

impl PatternSet {
    fn borders(&self) -> &[Border] {
        self.cells
            .get_or_init(|| SphericalVoronoi::new(&self.directions))
            .borders()
    }
}

/// Parts by which shares of lamp directions are counted, rounded up.
const LAMP_EIGHTHS: usize = 8;
/// Shares of lamp directions: none to a half.
const LAMP_LEVELS: usize = 5;
/// Most directions of one diagram, where batches are not larger: finer cells would gain nothing and take memory.
const DIAGRAM: usize = 1 << 16;

impl GatherPattern {
    /// For records of `n_rays` paths, rounded to a multiple of the number of batches (16), at least one each.
    pub fn new(n_rays: usize) -> Self {
        let paths = n_rays.div_ceil(BATCHES).max(1);
        // A power of two, so that groups are equal.
        let group = (1..=BATCHES)
            .rev()
            .find(|g| g.is_power_of_two() && g * paths <= DIAGRAM)
            .unwrap_or(1);
        Self {
            paths,
            group,
            sets: Default::default(),
        }
    }

    /// Number of paths of a record.
    pub fn n_rays(&self) -> usize {
        self.paths * BATCHES
    }

    /// How many of a batch's paths are around lamps.
    fn around_lamps(&self, eighths: usize) -> usize {
        (self.paths * eighths)
            .div_ceil(LAMP_EIGHTHS)
            .min(self.paths - 1)
    }

    fn set(&self, eighths: usize) -> &PatternSet {
        self.sets[eighths].get_or_init(|| {
            let n = self.paths - self.around_lamps(eighths);
            let all = SphericalFibonacci::new((n * self.group) as u32, [0.0; 3]);
            let directions: Vec<Vec3> = (0..self.group)
                .flat_map(|member| {
                    (0..n).map(move |i| all.direction((i * self.group + member) as u32))
                })
                .collect();
            PatternSet {
                directions,
                cells: OnceLock::new(),
            }
        })
    }
}

/// Gathers multiple-scattered light at `x` along `pattern`, weighting all directions alike.
///
/// `reach` counts the scattering at `x` itself.
pub fn multiple<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    x: Vec3,
    pattern: &GatherPattern,
    reach: Reach<'_>,
    key: Key,
) -> Gathered {
    multiple_towards(world, x, None, pattern, Derivatives::Aware, reach, key)
}

/// As [`multiple`], with directions weighted by the phase function at `x` for light that leaves `towards` somewhere, and a choice of
/// `derivatives`.
///
/// Value and gradient are those of ∫ p L dω with p the media's phase functions mixed by scattering.
pub fn multiple_towards<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    x: Vec3,
    towards: Option<Towards>,
    pattern: &GatherPattern,
    derivatives: Derivatives,
    reach: Reach<'_>,
    key: Key,
) -> Gathered {
    let what = (What::Scattered(reach), derivatives);
    gather_towards(world, x, towards, what, pattern, key)
}

/// Which light is gathered.
#[derive(Clone, Copy, Debug)]
pub enum What<'f> {
    /// Light scattered or reflected before, along paths that go so far.
    Scattered(Reach<'f>),
    /// Light straight from skies and environment images.
    Sky,
}

/// Gathers light at `x` alike from all directions along `pattern`, and its directions: coefficients of bands 1 to `order` of spherical
/// harmonics, radiance over 4π; see [`crate::lobe`].
pub fn incident<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    x: Vec3,
    what: What<'_>,
    order: usize,
    pattern: &GatherPattern,
    key: Key,
) -> (Gathered, Vec<Vec3>) {
    let from = (x, GatherDirections::of(world, x, None, what), 0.0);
    let mut bands = vec![Vec3::ZERO; n_above(order)];
    let aware = Derivatives::Aware;
    let found = gather(world, from, pattern, aware, what, key, |w_i, light| {
        lobe::add(order, &mut bands, w_i, light);
    });
    for c in &mut bands {
        *c /= pattern.n_rays() as f32;
    }
    (found, bands)
}

/// Gathers light at `x` along `pattern` as it leaves `towards` somewhere; see [`multiple_towards`].
pub fn towards<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    x: Vec3,
    towards: Option<Towards>,
    what: What<'_>,
    pattern: &GatherPattern,
    key: Key,
) -> Gathered {
    gather_towards(world, x, towards, (what, Derivatives::Aware), pattern, key)
}

fn gather_towards<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    x: Vec3,
    towards: Option<Towards>,
    (what, derivatives): (What<'_>, Derivatives),
    pattern: &GatherPattern,
    key: Key,
) -> Gathered {
    let leaving = towards.map(|towards| towards.from(x));
    let directions = GatherDirections::of(world, x, leaving.map(|(w_o, _)| w_o), what);
    let from = (x, directions, leaving.map_or(0.0, |(_, rate)| rate));
    gather(world, from, pattern, derivatives, what, key, |_, _| {})
}

/// Gathers light, and lets `see` each direction with what comes from there, whose mean over all rays is the value.
fn gather<'m, G: Geometry, L: Lights>(
    world: &World<'m, G, L>,
    (x, directions, rate): (Vec3, GatherDirections<'m>, f32),
    pattern: &GatherPattern,
    derivatives: Derivatives,
    what: What<'_>,
    key: Key,
    mut see: impl FnMut(Vec3, Vec3),
) -> Gathered {
    let share = directions.lamps.share();
    let eighths = ((LAMP_EIGHTHS as f32 * share).ceil() as usize).min(LAMP_LEVELS - 1);
    let set = pattern.set(eighths);
    let around_lamps = pattern.around_lamps(eighths);
    let in_pattern = pattern.paths - around_lamps;
    let share = around_lamps as f32 / pattern.paths as f32;
    let sampler = |batch: usize, i: usize| Sampler::new(batch_key(key, batch), i as u64);
    // Drawn from a sample that no path has.
    let turn = |group: usize| {
        let u = random_rotation(&mut sampler(group * pattern.group, pattern.paths));
        SphericalFibonacci::new(1, u).rotation()
    };

    let starts: Vec<(Start<'_>, GatherDirection)> = (0..BATCHES)
        .flat_map(|batch| {
            let (group, member) = (batch / pattern.group, batch % pattern.group);
            let turn = turn(group);
            let directions = &directions;
            (0..pattern.paths).map(move |i| {
                let direction = if i < in_pattern {
                    let d = turn * set.directions[member * in_pattern + i];
                    directions.along_pattern(d.normalize(), share)
                } else {
                    directions.around_lamp(sampler(batch, i).next_2d(), share)
                };
                let ray = Ray::new(x, direction.w_i);
                let start = Start {
                    ray,
                    hit: Some(world.geometry.intersect(&ray, f32::INFINITY)),
                    first: FirstEvent::Any,
                    reach: match what {
                        What::Scattered(reach) => reach.behind_one(),
                        What::Sky => Reach::default(),
                    },
                };
                (start, direction)
            })
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
    let leaving = directions.lobe.as_ref().map(|(w_o, _)| (*w_o, rate));
    // Without surfaces nothing hides anything.
    let aware = derivatives == Derivatives::Aware && nearest.is_finite();

    let mut batches = Batches::default();
    let mut seen = Vec::with_capacity(set.directions.len());
    for (batch, starts) in starts.chunks(pattern.paths).enumerate() {
        for (i, (start, direction)) in starts.iter().enumerate() {
            let mut visitor = WarpVisitor::new(world.media, x, radius, leaving);
            match what {
                What::Scattered(_) => trace(world, start, &mut sampler(batch, i), &mut visitor),
                What::Sky => straight_from_sky(world, start, visitor.straight()),
            }
            let weight = direction.weight;
            see(direction.w_i, visitor.value * weight);
            let [dr, dg, db] = visitor.gradient;
            batches.add(
                batch,
                visitor.value * weight,
                [dr * weight.x, dg * weight.y, db * weight.z],
            );
            if aware && i < in_pattern {
                seen.push(Seen::new(
                    direction.w_i,
                    start.hit.flatten(),
                    visitor.arrivals,
                ));
            }
        }
        if seen.len() < set.directions.len() {
            continue;
        }
        // The group is complete. A border's share goes to the batch of the ray that sees what is hidden.
        let group = batch / pattern.group;
        let phase = |w_i: Vec3| directions.phase(w_i);
        let add = |far: usize, moved: [Vec3; 3]| {
            let batch = group * pattern.group + far / in_pattern;
            batches.add_to_gradient(batch, moved.map(|m| m * pattern.group as f32));
        };
        match &directions.lobe {
            None => occlusion::gradient(set.borders(), turn(group), x, &seen, phase, add),
            // Directions drawn by a phase function make cells of their own.
            Some(_) => {
                let drawn: Vec<Vec3> = seen.iter().map(|s| s.direction).collect();
                let cells = SphericalVoronoi::new(&drawn);
                occlusion::gradient(cells.borders(), Quat::IDENTITY, x, &seen, phase, add);
            }
        }
        seen.clear();
    }
    let [value, dr, dg, db] = batches.means();
    let [value_error, er, eg, eb] = batches.errors();
    Gathered {
        value,
        gradient: [dr, dg, db],
        value_error,
        gradient_error: [er, eg, eb],
        gradient_norm: batches.gradient_norm(),
        nearest,
        harmonic_mean_distance: starts.len() as f32 / inverse,
        walls: Walls::new(starts.iter().filter_map(|(s, _)| s.hit.as_ref()?.as_ref())),
    }
}

/// Three numbers in [0, 1) that choose a rotation.
fn random_rotation(sampler: &mut Sampler) -> [f32; 3] {
    let [u, v] = sampler.next_2d();
    [u, v, sampler.next_1d()]
}

/// One path's estimate of ∫ p L dω for light that leaves `x` in the unit direction `w_o`, light straight from emitters left out: what a
/// record there would hold, unbiased and with the noise of a single path.
pub fn one<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    (x, w_o): (Vec3, Vec3),
    reach: Reach<'_>,
    sampler: &mut Sampler,
) -> Vec3 {
    let directions = GatherDirections::new(world, x, Some(w_o));
    one_of(&directions, world, x, reach, sampler)
}

/// As [`one`], for directions prepared at `x`, with the phase function they were prepared for.
pub fn one_of<G: Geometry, L: Lights>(
    directions: &GatherDirections<'_>,
    world: &World<'_, G, L>,
    x: Vec3,
    reach: Reach<'_>,
    sampler: &mut Sampler,
) -> Vec3 {
    let direction = directions.sample(sampler.next_2d());
    let ray = Ray::new(x, direction.w_i);
    along(world, ray, false, reach, sampler) * direction.weight
}

/// Light that arrives along `ray` at its origin by one path; straight from skies if `sky`, and from no other emitter.
pub fn along<G: Geometry, L: Lights>(
    world: &World<'_, G, L>,
    ray: Ray,
    sky: bool,
    reach: Reach<'_>,
    sampler: &mut Sampler,
) -> Vec3 {
    let start = Start {
        ray,
        hit: None,
        first: FirstEvent::Any,
        reach: reach.behind_one(),
    };
    let mut visitor = ScatteredLight {
        sky,
        ..ScatteredLight::default()
    };
    trace(world, &start, sampler, &mut visitor);
    visitor.value
}

/// Sums what a path finds, but for light straight from emitters.
#[derive(Default)]
struct ScatteredLight {
    scattered: bool,
    /// Whether light straight from skies counts.
    sky: bool,
    value: Vec3,
}

impl Visitor for ScatteredLight {
    fn vertex(&mut self, _vertex: Vertex<'_, '_>) {
        self.scattered = true;
    }

    fn light(&mut self, value: Vec3, last: Option<Vertex<'_, '_>>, source: Source) {
        let from_sky = self.sky && matches!(source, Source::Far(_));
        if self.scattered || last.is_some() || from_sky {
            self.value += value;
        }
    }
}

/// The key of one batch of a gather; the highest bit keeps it from the keys of whoever draws with `key` itself.
pub(crate) fn batch_key(key: Key, batch: usize) -> Key {
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
pub(crate) fn warp_radius<G, L: Lights>(world: &World<'_, G, L>, x: Vec3, nearest: f32) -> f32 {
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
pub(crate) struct Batches {
    sums: [[glam::DVec3; 4]; BATCHES],
    counts: [usize; BATCHES],
    gradient_norms: f64,
}

impl Batches {
    pub(crate) fn add(&mut self, batch: usize, value: Vec3, gradient: [Vec3; 3]) {
        let [dr, dg, db] = gradient;
        for (sum, term) in self.sums[batch].iter_mut().zip([value, dr, dg, db]) {
            *sum += term.as_dvec3();
        }
        self.counts[batch] += 1;
        self.gradient_norms += f64::from(gradient.map(Vec3::length).iter().sum::<f32>());
    }

    /// Adds to the mean gradient of a batch that is complete.
    fn add_to_gradient(&mut self, batch: usize, gradient: [Vec3; 3]) {
        let n = self.counts[batch] as f64;
        for (sum, term) in self.sums[batch][1..].iter_mut().zip(gradient) {
            *sum += term.as_dvec3() * n;
        }
    }

    pub(crate) fn means(&self) -> [Vec3; 4] {
        let n = self.counts.iter().sum::<usize>().max(1) as f64;
        std::array::from_fn(|k| (self.sums.iter().map(|s| s[k]).sum::<glam::DVec3>() / n).as_vec3())
    }

    /// Mean norm of the gradients added, summed over channels.
    pub(crate) fn gradient_norm(&self) -> f32 {
        let n = self.counts.iter().sum::<usize>().max(1) as f64;
        (self.gradient_norms / n) as f32
    }

    /// Standard errors from the spread of batch means; infinite where fewer than two batches hold samples.
    pub(crate) fn errors(&self) -> [Vec3; 4] {
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
