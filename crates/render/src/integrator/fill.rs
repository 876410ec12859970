//! Fills the cache of multiple scattering before the image is made.
//!
//! Camera rays on a lattice that grows finer report points no record covers; these are thinned in a fixed order, computed
//! in parallel and inserted together, so that the records do not depend on the number of threads.

use super::counted::Counted;
use crate::options::{Phase, Progress};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;
use tyndall_cache::{Cache, Record};
use tyndall_math::{Key, Purpose, Ray, Sampler, warp};
use tyndall_scene::Scene;
use tyndall_transport::free_flight::FreeFlight;
use tyndall_transport::gather::{self, GatherPattern};
use tyndall_transport::world::{Geometry, Lights, World};

/// Camera rays along the longer side of the frame on the first level; each level doubles them, at most to one per pixel.
const FIRST_RAYS: u32 = 16;
/// Levels end when no more than this share of a new level's points is found without a record: the camera pass then
/// traces paths there.
const GAPS_LEFT: f32 = 0.02;
/// Points on each camera ray, evenly spread in transmittance.
const POINTS_PER_RAY: u32 = 8;
/// Rounds on one level: radii shrink when records come in, and open gaps that the next round closes.
const ROUNDS: usize = 4;
/// Accepted points of one round keep this share of a predicted radius between them.
const SPACING: f32 = 0.7;
/// Neighbouring radii may differ by this much per metre between them.
const RADIUS_SLOPE: f32 = 1.0;
/// Radii at an error of 1, in lengths over which the field changes. On the shipped Cornell box at 256 × 192, error 0.03: 20 000
/// records and 41 s of filling with 2, with 4 (and surfaces counting half) 1 200 records, 4 s, and half the error (2026-11-22).
const RADIUS_GAIN: f32 = 4.0;
/// Directions of a record at an error of 1: their number goes with the inverse square of the error.
const RAYS_GAIN: f32 = 0.9;
/// Smallest and largest radius as shares of the length over which the view looks into the fog.
const RADIUS_RANGE: [f32; 2] = [0.01, 0.25];
/// Smallest radius in pixels seen from the camera: detail below half a pixel is averaged away. A whole pixel was too much:
/// where the field bends towards the edge of a medium, all pixels erred to one side (furnace, 24 × 24: +0.2 % in the mean).
const SMALLEST_FOOTPRINT: f32 = 0.5;
/// A record may reach past the nearest surface by this factor.
const PAST_SURFACE: f32 = 1.5;

/// Records are moved this far off surfaces, as a share of the length over which the view looks into the fog.
const CLEARANCE: f32 = 0.04;
/// Rays that look for the nearest surface.
const CLEARANCE_RAYS: u64 = 32;

/// What the fill has to achieve.
pub(crate) struct Fill<'s> {
    pub(crate) scene: &'s Scene,
    pub(crate) frame: [u32; 2],
    pub(crate) max_depth: Option<u32>,
    pub(crate) seed: u64,
    /// Target error of the image.
    pub(crate) error: f32,
    /// Directions gathered for a record.
    pub(crate) pattern: GatherPattern,
    /// When to stop with what there is.
    pub(crate) deadline: Option<Instant>,
}

/// Directions of a record: noise falls with the error asked for, and about eight records blend at a point.
pub(crate) fn pattern(error: f32) -> GatherPattern {
    GatherPattern::new(((RAYS_GAIN / error).powi(2) as usize).clamp(128, 4096))
}

/// A filled cache.
pub(super) struct Filled {
    pub(super) cache: Cache<3>,
    /// The pixel through which each record was asked for: column and row.
    pub(super) pixels: Vec<[u32; 2]>,
    pub(super) rays: u64,
    /// Whether the deadline ended the fill.
    pub(super) cut_short: bool,
}

/// A point on a camera ray that asks for a record.
#[derive(Clone, Copy)]
struct Candidate {
    position: Vec3,
    /// Size of a pixel there, in metres.
    footprint: f32,
    /// Column and row of the pixel it is seen in.
    pixel: [u32; 2],
}

impl Fill<'_> {
    /// Computes the records the camera needs.
    pub(super) fn run(&self, progress: &dyn Progress) -> Filled {
        let mut filled = Filled {
            cache: Cache::new(),
            pixels: Vec::new(),
            rays: 0,
            cut_short: false,
        };
        let scale = self.view_scale();
        let strides = strides(self.frame);
        for (level, &stride) in strides.iter().enumerate() {
            for round in 0..ROUNDS {
                let fraction = (level as f32 + round as f32 / ROUNDS as f32) / strides.len() as f32;
                progress.update(Phase::Fill, fraction, filled.cache.len());
                let (missing, share) = self.uncovered(&filled.cache, level as u64, stride);
                if self.out_of_time() {
                    filled.cut_short = true;
                    return filled;
                }
                if missing.is_empty() || (round == 0 && share < GAPS_LEFT) {
                    break;
                }
                let points = thin(&missing, &filled.cache, scale);
                if !self.compute(&mut filled, &points, scale, progress, fraction) {
                    break;
                }
            }
        }
        filled
    }

    /// Computes records at `points` and inserts them in order; false where the cache refused them.
    fn compute(
        &self,
        filled: &mut Filled,
        points: &[Candidate],
        scale: f32,
        progress: &dyn Progress,
        fraction: f32,
    ) -> bool {
        let first = filled.cache.len();
        let done = AtomicUsize::new(0);
        let computed: Vec<(Option<Record<3>>, u64)> = points
            .par_iter()
            .enumerate()
            .map(|(i, point)| {
                if self.out_of_time() {
                    return (None, 0);
                }
                let geometry = Counted::new(self.scene);
                let record = self.record(&geometry, point, (first + i) as u64, scale);
                let n = done.fetch_add(1, Ordering::Relaxed) + 1;
                progress.update(Phase::Fill, fraction, first + n);
                (record, geometry.rays())
            })
            .collect();
        filled.rays += computed.iter().map(|(_, n)| n).sum::<u64>();
        let (records, seen): (Vec<_>, Vec<_>) = computed
            .into_iter()
            .zip(points)
            .filter_map(|((record, _), point)| Some((record?, point.pixel)))
            .unzip();
        let cache = &mut filled.cache;
        let kept = cache
            .insert(records)
            .and_then(|()| cache.clamp_radii(RADIUS_SLOPE));
        debug_assert!(kept.is_ok(), "{kept:?}");
        if kept.is_ok() {
            filled.pixels.extend(seen);
        }
        kept.is_ok()
    }

    fn out_of_time(&self) -> bool {
        self.deadline.is_some_and(|d| Instant::now() >= d)
    }

    /// Mean length over which camera rays see into the media, in metres.
    fn view_scale(&self) -> f32 {
        let [w, h] = self.frame;
        let world = self.scene.world();
        let (mut sum, mut n) = (0.0, 0.0);
        for j in 0..8 {
            for i in 0..8 {
                let (x, y) = ((i as f32 + 0.5) / 8.0, (j as f32 + 0.5) / 8.0);
                let ray = self.scene.camera.ray(x * w as f32, y * h as f32, w, h);
                let t_max = world
                    .geometry
                    .intersect(&ray, f32::INFINITY)
                    .map_or(f32::INFINITY, |h| h.t);
                let flight = FreeFlight::new(world.media.segment(&ray, t_max), Vec3::ONE);
                if flight.can_stop() {
                    let start = flight.segment().range().0;
                    if let Some(t) = flight.sample_inside(0.9) {
                        sum += t - start;
                        n += 1.0;
                    }
                }
            }
        }
        if n > 0.0 { sum / n } else { 1.0 }
    }

    /// Points on the camera rays of one level that no record covers, in a fixed order, and their share of all points.
    fn uncovered(&self, cache: &Cache<3>, level: u64, stride: u32) -> (Vec<Candidate>, f32) {
        let [w, h] = self.frame;
        let rows: Vec<u32> = (0..h).step_by(stride as usize).collect();
        let found: Vec<(Vec<Candidate>, usize)> = rows
            .par_iter()
            .map(|&y| {
                let (mut row, mut points) = (Vec::new(), 0);
                for x in (0..w).step_by(stride as usize) {
                    let index = (level << 40) | (u64::from(y) * u64::from(w) + u64::from(x));
                    let key = Key {
                        seed: self.seed,
                        purpose: Purpose::Placement,
                        index,
                    };
                    let mut sampler = Sampler::new(key, 0);
                    let [u, v] = sampler.next_2d();
                    let ray = self.scene.camera.ray(
                        (x as f32 + u * stride as f32).min(w as f32),
                        (y as f32 + v * stride as f32).min(h as f32),
                        w,
                        h,
                    );
                    self.points_on(&ray, [x, y], sampler.next_1d(), |candidate| {
                        points += 1;
                        if !cache.covers(candidate.position) {
                            row.push(candidate);
                        }
                    });
                }
                (row, points)
            })
            .collect();
        let points: usize = found.iter().map(|(_, n)| n).sum();
        let missing: Vec<Candidate> = found.into_iter().flat_map(|(row, _)| row).collect();
        let share = missing.len() as f32 / points.max(1) as f32;
        (missing, share)
    }

    fn points_on(&self, ray: &Ray, pixel: [u32; 2], offset: f32, mut visit: impl FnMut(Candidate)) {
        let world = self.scene.world();
        let t_max = world
            .geometry
            .intersect(ray, f32::INFINITY)
            .map_or(f32::INFINITY, |h| h.t);
        let flight = FreeFlight::new(world.media.segment(ray, t_max), Vec3::ONE);
        if !flight.can_stop() {
            return;
        }
        for i in 0..POINTS_PER_RAY {
            if let Some(t) = flight.sample_inside((i as f32 + offset) / POINTS_PER_RAY as f32) {
                visit(Candidate {
                    position: ray.at(t),
                    footprint: self.scene.camera.footprint(t, self.frame[1]),
                    pixel,
                });
            }
        }
    }

    /// The record at a point; `None` where it would not be finite.
    fn record(
        &self,
        geometry: &Counted<'_>,
        point: &Candidate,
        index: u64,
        scale: f32,
    ) -> Option<Record<3>> {
        let world = geometry.world(self.scene);
        let key = Key {
            seed: self.seed,
            purpose: Purpose::Record,
            index,
        };
        let x = clear_of_surfaces(&world, point.position, CLEARANCE * scale, key);
        let g = gather::multiple(&world, x, &self.pattern, self.max_depth, key);
        // Lengths over which the field changes: to surfaces, to lamps, to the edge of a medium (where the field falls off
        // ever faster) unless it lies behind a surface, a free path, and its own relative gradient. Surfaces count half: they
        // are near on one side, and light does not end there. Edges count more: at half, the furnace was 0.25 % too bright.
        let edge = world.media.distance_to_boundary(x);
        let edge = if edge < g.nearest { 1.5 / edge } else { 0.0 };
        let sum: f32 = g.value.element_sum();
        let slope: f32 = g.gradient.iter().map(|d| d.length()).sum();
        let inverse = 0.5 / g.harmonic_mean_distance
            + 1.0 / world.lights.distance_to_point_lights(x)
            + edge
            + world.media.at(x).sigma_t.element_sum() / 3.0
            + if sum > 0.0 { slope / sum } else { 0.0 };
        // What is left of the interpolant's error grows with the square of the radius.
        let radius = (RADIUS_GAIN * self.error.sqrt()).clamp(0.1, 1.0) / inverse;
        // Surfaces bound a radius against leaks, of which one pixel's width cannot be seen.
        let past_surface = (PAST_SURFACE * g.nearest).max(point.footprint);
        let radius = radius
            .max(SMALLEST_FOOTPRINT * point.footprint)
            .min(past_surface)
            .clamp(RADIUS_RANGE[0] * scale, RADIUS_RANGE[1] * scale);
        let variance = g.value_error * g.value_error;
        let finite =
            g.value.is_finite() && variance.is_finite() && g.gradient.iter().all(|d| d.is_finite());
        finite.then_some(Record {
            position: x,
            radius,
            value: g.value.max(Vec3::ZERO).to_array(),
            gradient: g.gradient,
            variance: variance.to_array(),
        })
    }
}

/// The point, moved away from the nearest surface until it is `clearance` off or half-way to what lies opposite.
///
/// A record may not reach far past a surface. At a wall it would be tiny; a little off, one does for many.
fn clear_of_surfaces<G: Geometry, L>(
    world: &World<'_, G, L>,
    x: Vec3,
    clearance: f32,
    key: Key,
) -> Vec3 {
    let nearest = (0..CLEARANCE_RAYS)
        .filter_map(|i| {
            let w = warp::uniform_sphere(Sampler::new(key, i).next_2d());
            world.geometry.intersect(&Ray::new(x, w), 2.0 * clearance)
        })
        .min_by(|a, b| a.t.total_cmp(&b.t));
    let Some(hit) = nearest else {
        return x;
    };
    let height = (x - hit.position).dot(hit.normal);
    if height >= clearance {
        return x;
    }
    let away = Ray::new(x, hit.normal);
    let wanted = clearance - height.max(0.0);
    let room = world.geometry.intersect(&away, 2.0 * wanted);
    away.at(room.map_or(wanted, |hit| 0.5 * hit.t))
}

/// Pixels between the camera rays of each level, coarse to fine, the last one 1.
fn strides(frame: [u32; 2]) -> Vec<u32> {
    let longest = frame[0].max(frame[1]);
    let first = (longest / FIRST_RAYS).max(1);
    (0..=first.ilog2()).rev().map(|level| 1 << level).collect()
}

/// Drops candidates that an earlier one will probably cover; keeps their order.
fn thin(candidates: &[Candidate], cache: &Cache<3>, scale: f32) -> Vec<Candidate> {
    let cell = RADIUS_RANGE[1] * scale;
    let mut grid: std::collections::HashMap<[i32; 3], Vec<(Vec3, f32)>> =
        std::collections::HashMap::new();
    let mut kept = Vec::new();
    for c in candidates {
        let mut radius = RADIUS_RANGE[1] * scale;
        cache.for_each_near(c.position, radius, |_, r| {
            radius = radius.min(r.radius + RADIUS_SLOPE * r.position.distance(c.position));
        });
        let key = (c.position / cell).floor().as_ivec3().to_array();
        let taken = (-1..=1).any(|dz| {
            (-1..=1).any(|dy| {
                (-1..=1).any(|dx| {
                    let near = [
                        key[0].wrapping_add(dx),
                        key[1].wrapping_add(dy),
                        key[2].wrapping_add(dz),
                    ];
                    grid.get(&near).is_some_and(|points| {
                        points
                            .iter()
                            .any(|&(p, r)| p.distance(c.position) < SPACING * r.min(radius))
                    })
                })
            })
        });
        if !taken {
            grid.entry(key).or_default().push((c.position, radius));
            kept.push(*c);
        }
    }
    kept
}
