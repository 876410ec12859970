//! Fills the coarse field of light in which the paths of records and of surfaces end.
//!
//! Walks start along camera rays and are followed in batches: in parallel, while what they found is counted in their order, so that
//! the field does not depend on the number of threads.

use super::counted::Counted;
use super::has_passed;
use super::view::{View, spread};
use crate::options::{Phase, Progress};
use glam::Vec3;
use rayon::prelude::*;
use serde::{Deserialize, Serialize};
use std::time::Instant;
use tyndall_math::stats::Welford;
use tyndall_math::{Key, Purpose, Sampler};
use tyndall_scene::Scene;
use tyndall_transport::field::{CellWidths, Field, Filling, Found};
use tyndall_transport::free_flight::FreeFlight;

/// Width of cells over their distance from the eye, at most; at least half of it.
const WIDTH: f32 = 1.0 / 24.0;
/// The same over the mean free path where camera rays scatter in smoke, and by how much it makes cells narrower at most: what varies from
/// voxel to voxel is lit as unevenly. Smoke 53 m wide seen from 150 m away, at 32 × 32 pixels: the image was off by 3.4 % with cells of
/// 4 to 8 m, by 1.4 and 1.0 % with cells of 1 to 2 and of 0.5 to 1 m (2026-11-23).
const WIDTH_OF_PATH: f32 = 0.25;
const NARROWEST: f32 = 1.0 / 16.0;
/// Camera rays that tell that mean free path.
const PATHS_SEEN: u64 = 512;
/// Least width of cells over the eye's coordinates.
const LEAST_WIDTH: f32 = 1e-5;
/// Eyes from which cells look small, at most: each read of the field looks for the nearest.
const EYES: usize = 16;
/// Light found at an error of 1: how much is asked for goes with the inverse square of the error.
const FOUND_GAIN: f32 = 600.0;
/// Least and most light found, counted by scatterings.
const FOUND: [f32; 2] = [200_000.0, 10_000_000.0];
/// How much of that is found where there are grids, through which each ray is a long walk: in smoke a quarter was enough (2026-11-23).
const FOUND_IN_GRIDS: f32 = 0.25;
/// Most light found over what was asked for, where it is still too noisy.
const MOST: u64 = 4;
/// Noise of the light at which walks scatter first, over the error asked for: walks go on until it is lower. In thick fog few of them
/// ever come near a lamp.
const NOISE: f32 = 0.25;
/// Walks that may find too little before the filling ends, per scattering asked for: most rays may leave the scene at once.
const WALKS_PER_FOUND: u64 = 2;
/// Walks of one batch.
const BATCH: u64 = 4096;
/// Walks that a thread follows in one piece.
const PIECE: u64 = 256;

/// A filled field and what it cost.
#[derive(Clone, Deserialize, Serialize)]
pub(super) struct FilledField {
    pub(super) field: Field,
    #[serde(skip)]
    pub(super) rays: u64,
    /// Whether the deadline ended the filling.
    pub(super) cut_short: bool,
    /// Whether walks found too little of what lights the scene, and no more were allowed.
    pub(super) unsure: bool,
}

/// Follows walks from the cameras of `views`, the more the smaller the `error` asked for.
pub(super) fn fill(
    scene: &Scene,
    views: &[View],
    seed: u64,
    error: f32,
    deadline: Option<Instant>,
    progress: &dyn Progress,
) -> FilledField {
    let counted = Counted::new(scene);
    let wanted = (FOUND_GAIN / (error * error)).clamp(FOUND[0], FOUND[1]);
    let share = if scene.media.has_grids() {
        FOUND_IN_GRIDS
    } else {
        1.0
    };
    let wanted = (share * wanted) as u64;
    let eyes: Vec<Vec3> = spread(views, EYES).map(View::eye).collect();
    // No smaller than coordinates are fine.
    let farthest = eyes.iter().map(|eye| eye.abs().max_element());
    let least = farthest.fold(f32::MIN_POSITIVE, |least, c| least.max(LEAST_WIDTH * c));
    let share = WIDTH.min(WIDTH_OF_PATH * free_path(scene, views, seed));
    let share = share.max(NARROWEST * WIDTH);
    let mut filling = Filling::new(CellWidths::around(&eyes, share, least), &scene.media);
    let (mut first, mut held) = (0, 0);
    let mut cut_short = false;
    // Light where walks scatter first: how well it is known tells whether walks find what lights the scene.
    let mut light = Welford::new();
    let noise = |light: &Welford| light.standard_error() / light.mean();
    let unsure = |light: &Welford| noise(light) > f64::from(NOISE * error);
    while (held < wanted || unsure(&light))
        && held < MOST * wanted
        && first < WALKS_PER_FOUND * wanted
        && !cut_short
    {
        let last = first + BATCH;
        let pieces: Vec<(Vec<Found>, Vec<f64>)> = (first..last)
            .step_by(PIECE as usize)
            .collect::<Vec<_>>()
            .into_par_iter()
            .map(|piece| {
                let (mut found, mut lights) = (Vec::new(), Vec::new());
                for walk in piece..(piece + PIECE).min(last) {
                    let held = found.len();
                    let view = &views[(walk % views.len() as u64) as usize];
                    follow(scene, &counted, view, seed, walk, &mut found);
                    // The first vertex of a walk is told last.
                    let light = found[held..].last().map(Found::light);
                    lights.extend(light.map(|light| f64::from(light.element_sum())));
                }
                (found, lights)
            })
            .collect();
        let mut found = Vec::new();
        for (part, lights) in pieces {
            found.extend(part);
            lights.into_iter().for_each(|value| light.push(value));
        }
        let cells = filling.place(&found);
        let sides: Vec<Option<u32>> = found
            .par_iter()
            .zip(&cells)
            .map(|(found, &cell)| filling.side(&counted, cell, found))
            .collect();
        for ((found, &cell), side) in found.iter().zip(&cells).zip(sides) {
            filling.add(&counted, cell, side, found);
        }
        first = last;
        held += found.len() as u64;
        cut_short = has_passed(deadline) || progress.is_cancelled();
        progress.update(Phase::Fill, (0.2 * held as f32 / wanted as f32).min(0.2), 0);
    }
    let mut field = filling.end(&counted);
    let surroundings = (0..field.len())
        .into_par_iter()
        .map(|cell| field.surroundings_of(&counted, cell))
        .collect();
    field.set_surroundings(surroundings);
    FilledField {
        field,
        rays: counted.rays(),
        cut_short,
        unsure: noise(&light) > f64::from(error),
    }
}

/// The mean free path in grids over the distance to the eye, where camera rays scatter: the harmonic mean, infinite where there are no grids.
fn free_path(scene: &Scene, views: &[View], seed: u64) -> f32 {
    if !scene.media.has_grids() {
        return f32::INFINITY;
    }
    let world = scene.world();
    let key = Key {
        seed,
        purpose: Purpose::Field,
        index: 1,
    };
    let mut lengths = Welford::new();
    for ray in 0..PATHS_SEEN {
        let mut sampler = Sampler::new(key, ray);
        let view = &views[(ray % views.len() as u64) as usize];
        let ray = view.ray_at(sampler.next_2d());
        let (_, flight) = FreeFlight::to_surface(&world, &ray);
        let u = sampler.next_1d();
        if flight.can_stop()
            && let Some(t) = flight.sample_inside(u)
        {
            lengths.push((scene.media.at(ray.at(t)).sigma_t.element_sum() / 3.0 * t).into());
        }
    }
    (1.0 / lengths.mean()) as f32
}

/// Walk number `walk`, through a place in the frame of its own.
fn follow(
    scene: &Scene,
    counted: &Counted<'_>,
    view: &View,
    seed: u64,
    walk: u64,
    found: &mut Vec<Found>,
) {
    let key = Key {
        seed,
        purpose: Purpose::Field,
        index: 0,
    };
    let mut sampler = Sampler::new(key, walk);
    let ray = view.ray_at(sampler.next_2d());
    Filling::walk(&counted.world(scene), ray, &mut sampler, found);
}
