//! Fills a cache before the image is made, in media or on surfaces.
//!
//! Camera rays on a lattice that grows finer report points no record covers; these are thinned in a fixed order, computed
//! in parallel and inserted together, so that the records do not depend on the number of threads.

pub(super) mod jarosz08;
pub(super) mod media;
mod stored;
pub(super) mod surfaces;

use super::counted::Counted;
use super::has_passed;
use super::view::View;
use crate::options::{Phase, Progress};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::collections::HashMap;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;
use stored::Stored;
use tyndall_cache::{Cache, Record};
use tyndall_math::{Key, Purpose, Ray, Sampler};
use tyndall_scene::Scene;
use tyndall_transport::gather::Gathered;

/// Camera rays along the longer side of the frame on the first level; each level doubles them, at most to one per pixel.
const FIRST_RAYS: u32 = 16;
/// Levels end when no more than this share of a new level's points is found without a record: the camera pass then
/// makes do with the nearest one.
const GAPS_LEFT: f32 = 0.01;
/// Rounds on one level: radii shrink when records come in, and open gaps that the next round closes.
const ROUNDS: usize = 4;
/// Accepted points of one round keep this share of a predicted radius between them.
const SPACING: f32 = 0.7;
/// Neighbouring radii may differ by this much per metre between them.
const RADIUS_SLOPE: f32 = 1.0;

/// Each attempt at a record takes this many times the rays of the one before.
const MORE_RAYS: usize = 4;
/// Attempts at a record: light from small bright places needs more rays than most.
const ATTEMPTS: usize = 2;
/// The noise of a record over the error asked for with which no further attempt is made. Told errors are conservative, and about six
/// records blend at a point.
const NOISE: f32 = 4.0;

/// Which light records hold; their random numbers are kept apart by it.
#[derive(Clone, Copy, Debug, Deserialize, Serialize)]
pub(super) enum Light {
    Multiple,
    Surface,
    Single,
}

impl Light {
    /// The layer of the image that it is in.
    pub(super) fn layer(self) -> &'static str {
        match self {
            Self::Multiple => "multiple",
            Self::Surface => "surface",
            Self::Single => "single",
        }
    }

    /// Numbers of records, at most.
    const MOST_RECORDS: usize = 1 << 40;

    /// The random numbers of record number `index`.
    fn key(self, seed: u64, index: u64) -> Key {
        Key {
            seed,
            purpose: Purpose::Record,
            index: (self as u64) << 40 | index,
        }
    }
}

/// The first of some attempts, with ever more rays, whose noise is small for a target `error` of the image; else the last.
fn quiet_enough(error: f32, mut gather: impl FnMut(usize) -> Gathered) -> Gathered {
    let mut attempt = 0;
    loop {
        let found = gather(attempt);
        attempt += 1;
        let noise = found.value_error.element_sum();
        if attempt == ATTEMPTS || noise <= NOISE * error * found.value.element_sum() {
            return found;
        }
    }
}

/// Directions of the first attempt at a record: noise falls with the error asked for, from `gain` at an error of 1.
fn first_rays(gain: f32, error: f32) -> usize {
    ((gain / error).powi(2) as usize).clamp(128, 4096)
}

/// How fast a record's light changes per metre, relative to itself.
fn relative_slope(g: &Gathered) -> f32 {
    let sum: f32 = g.value.element_sum();
    let slope: f32 = g.gradient.iter().map(|d| d.length()).sum();
    if sum > 0.0 { slope / sum } else { 0.0 }
}

/// The record at `position` of a value, with its standard error, and a gradient found there; `None` where these are not finite.
fn record(
    position: Vec3,
    radius: f32,
    (value, error): (Vec3, Vec3),
    gradient: [Vec3; 3],
) -> Option<Record<3>> {
    let variance = error * error;
    let finite =
        value.is_finite() && variance.is_finite() && gradient.iter().all(|d| d.is_finite());
    finite.then(|| Record {
        position,
        radius: radius.max(f32::MIN_POSITIVE),
        value: value.max(Vec3::ZERO).to_array(),
        gradient,
        variance: variance.to_array(),
    })
}

/// What records of one kind are, and where they are wanted.
pub(super) trait Kind: Sync {
    /// Where a record is valid within its ball.
    type Tag: Clone + Send + Sync;

    /// Neighbouring radii may differ by this much per metre between them; infinite where they stay as they are.
    const RADIUS_SLOPE: f32 = RADIUS_SLOPE;

    /// Largest radius of a record at a point.
    fn most_radius(&self, candidate: &Candidate) -> f32;

    /// The points on a camera ray of `view` that ask for records.
    fn points_on(&self, view: &View, ray: &Ray, offset: f32, visit: impl FnMut(Candidate));

    /// Whether records are valid at a point.
    fn covers(&self, cache: &Cache<3, Self::Tag>, candidate: &Candidate) -> bool;

    /// The record at or near a point, with the random numbers of `index`; `None` where it would not be finite. In later rounds it must
    /// cover the point.
    fn record(
        &self,
        geometry: &Counted<'_>,
        candidate: &Candidate,
        index: u64,
        round: usize,
    ) -> Option<(Record<3>, Self::Tag)>;
}

/// What the fill has to achieve.
pub(super) struct Fill<'s, K> {
    pub(super) kind: K,
    pub(super) scene: &'s Scene,
    /// From where records are wanted.
    pub(super) views: &'s [View],
    pub(super) seed: u64,
    /// When to stop with what there is.
    pub(super) deadline: Option<Instant>,
}

/// Where a fill looks for points without records.
struct Gaps {
    /// Of the view.
    number: usize,
    /// How fine the lattice of camera rays is, and the pixels between these.
    level: usize,
    stride: u32,
}

/// A filled cache.
#[derive(Clone, Deserialize)]
#[serde(try_from = "Stored<'_, T>")]
#[serde(bound(deserialize = "T: Clone + Deserialize<'de>"))]
pub(super) struct Filled<T> {
    pub(super) cache: Cache<3, T>,
    pub(super) rays: u64,
    /// Points at which records were computed, kept or not: each has random numbers of its own.
    asked: usize,
    /// Whether the deadline, or who cancelled the render, ended the fill.
    pub(super) cut_short: bool,
}

impl<T: Clone> Filled<T> {
    /// Nothing yet.
    pub(super) fn empty() -> Self {
        Self {
            cache: Cache::tagged(),
            rays: 0,
            asked: 0,
            cut_short: false,
        }
    }
}

/// A point on a camera ray that asks for a record.
#[derive(Clone, Copy)]
pub(super) struct Candidate {
    position: Vec3,
    /// Unit normal on the viewer's side of a surface; zero in media.
    normal: Vec3,
    /// Size of a pixel there, in metres.
    footprint: f32,
    /// The camera ray.
    ray: Ray,
}

/// Surfaces share records where the cosine between their normals is at least this.
const SAME_SURFACE: f32 = 0.98;

impl Candidate {
    fn faces(&self, other: Vec3) -> bool {
        self.normal == Vec3::ZERO || self.normal.dot(other) >= SAME_SURFACE
    }
}

impl<K: Kind> Fill<'_, K> {
    /// Computes the records the cameras need beside those that there are.
    pub(super) fn run(
        &self,
        mut filled: Filled<K::Tag>,
        progress: &dyn Progress,
    ) -> Filled<K::Tag> {
        filled.cut_short = false;
        let mut order: Vec<usize> = (0..self.views.len()).collect();
        // Views far apart first: what lies between them has its records then.
        order.sort_by_key(|&number| (number as u32).reverse_bits());
        let done = |step: usize, part: f32| (step as f32 + part) / order.len() as f32;
        for (step, &number) in order.iter().enumerate() {
            let strides = strides(self.views[number].frame());
            for (level, &stride) in strides.iter().enumerate() {
                let gaps = Gaps {
                    number,
                    level,
                    stride,
                };
                let part = level as f32 / strides.len() as f32;
                let is_covered = self.close(&mut filled, &gaps, progress, done(step, part));
                if filled.cut_short {
                    return filled;
                }
                if is_covered && step > 0 {
                    break;
                }
            }
        }
        filled
    }

    /// Computes records where those of one level are missing; tells whether there were enough at once.
    fn close(
        &self,
        filled: &mut Filled<K::Tag>,
        gaps: &Gaps,
        progress: &dyn Progress,
        fraction: f32,
    ) -> bool {
        for round in 0..ROUNDS {
            progress.update(Phase::Fill, fraction, filled.cache.len());
            let (missing, share) = self.uncovered(&filled.cache, gaps);
            if self.is_over(progress) {
                filled.cut_short = true;
                return false;
            }
            if missing.is_empty() || (round == 0 && share < GAPS_LEFT) {
                return round == 0;
            }
            let points = thin(&missing, &filled.cache, |point| {
                self.kind.most_radius(point)
            });
            if !self.compute(filled, &points, round, progress, fraction) {
                return false;
            }
        }
        false
    }

    /// Computes records at `points` and inserts them in order; false where the cache refused them.
    fn compute(
        &self,
        filled: &mut Filled<K::Tag>,
        points: &[Candidate],
        round: usize,
        progress: &dyn Progress,
        fraction: f32,
    ) -> bool {
        let (first, held) = (filled.asked, filled.cache.len());
        filled.asked += points.len();
        let done = AtomicUsize::new(0);
        let computed: Vec<_> = points
            .par_iter()
            .enumerate()
            .map(|(i, point)| {
                if self.is_over(progress) {
                    return (None, 0);
                }
                let geometry = Counted::new(self.scene);
                let record = self
                    .kind
                    .record(&geometry, point, (first + i) as u64, round);
                let n = done.fetch_add(1, Ordering::Relaxed) + 1;
                progress.update(Phase::Fill, fraction, held + n);
                (record, geometry.rays())
            })
            .collect();
        filled.rays += computed.iter().map(|(_, n)| n).sum::<u64>();
        let records = computed.into_iter().filter_map(|(record, _)| record);
        let cache = &mut filled.cache;
        let mut kept = cache.insert_tagged(records.collect());
        if K::RADIUS_SLOPE.is_finite() {
            kept = kept.and_then(|()| cache.clamp_radii(K::RADIUS_SLOPE));
        }
        debug_assert!(kept.is_ok(), "{kept:?}");
        kept.is_ok()
    }

    fn is_over(&self, progress: &dyn Progress) -> bool {
        has_passed(self.deadline) || progress.is_cancelled()
    }

    /// Points on the camera rays of one level in view `number` that no record covers, in a fixed order, and their share of all points.
    fn uncovered(
        &self,
        cache: &Cache<3, K::Tag>,
        &Gaps {
            number,
            level,
            stride,
        }: &Gaps,
    ) -> (Vec<Candidate>, f32) {
        let view = &self.views[number];
        let [w, h] = view.frame();
        let rows: Vec<u32> = (0..h).step_by(stride as usize).collect();
        let found: Vec<(Vec<Candidate>, usize)> = rows
            .par_iter()
            .map(|&y| {
                let (mut row, mut points) = (Vec::new(), 0);
                for x in (0..w).step_by(stride as usize) {
                    let index = (number as u64) << 48
                        | (level as u64) << 40
                        | (u64::from(y) * u64::from(w) + u64::from(x));
                    let key = Key {
                        seed: self.seed,
                        purpose: Purpose::Placement,
                        index,
                    };
                    let mut sampler = Sampler::new(key, 0);
                    let [u, v] = sampler.next_2d();
                    let ray = view.ray(
                        (x as f32 + u * stride as f32).min(w as f32),
                        (y as f32 + v * stride as f32).min(h as f32),
                    );
                    let offset = sampler.next_1d();
                    self.kind.points_on(view, &ray, offset, |candidate| {
                        points += 1;
                        if !self.kind.covers(cache, &candidate) {
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
}

/// Pixels between the camera rays of each level, coarse to fine, the last one 1.
fn strides(frame: [u32; 2]) -> Vec<u32> {
    let longest = frame[0].max(frame[1]);
    let first = (longest / FIRST_RAYS).max(1);
    (0..=first.ilog2()).rev().map(|level| 1 << level).collect()
}

/// Drops candidates that an earlier one will probably cover; keeps their order.
fn thin<T: Clone>(
    candidates: &[Candidate],
    cache: &Cache<3, T>,
    most_radius: impl Fn(&Candidate) -> f32,
) -> Vec<Candidate> {
    let cell = (candidates.iter().map(&most_radius)).fold(f32::MIN_POSITIVE, f32::max);
    let mut grid: HashMap<[i32; 3], Vec<(Candidate, f32)>> = HashMap::new();
    let mut kept = Vec::new();
    for c in candidates {
        let mut radius = most_radius(c);
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
                        points.iter().any(|(other, r)| {
                            let distance = other.position.distance(c.position);
                            distance < SPACING * r.min(radius) && other.faces(c.normal)
                        })
                    })
                })
            })
        });
        if !taken {
            grid.entry(key).or_default().push((*c, radius));
            kept.push(*c);
        }
    }
    kept
}
