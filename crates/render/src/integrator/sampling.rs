//! Camera samples of one frame, taken in passes until there are enough everywhere.
//!
//! With a cache each block of pixels gets what its noise asks for; path-traced images get one number throughout.

use super::camera::{Camera, Known, Tally};
use super::checkpoint::OfFrame;
use super::stages::{Next, State};
use super::view::View;
use super::{Run, has_passed};
use crate::error::RenderError;
use crate::film::{Film, FilmRow, Pixel};
use crate::layers::LayerSet;
use crate::options::{Integrator, Phase};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tyndall_math::{Key, Purpose, Sampler};
use tyndall_transport::path::Reach;

/// How long the first samples of a cancelled render may take, so that there is an image at all.
const GRACE: Duration = Duration::from_millis(500);

/// Takes the samples of one frame.
pub(super) struct Sampling<'f> {
    pub(super) run: &'f Run<'f>,
    pub(super) view: View,
    pub(super) seed: u64,
    /// What samples read.
    pub(super) known: Known<'f>,
    pub(super) reach: Reach<'f>,
    pub(super) layers: &'f LayerSet,
    /// The noise to which more samples are taken.
    pub(super) target: f64,
}

impl Sampling<'_> {
    /// A film of the part of the frame that is asked for, with as many samples as were asked for or as lower its noise to the target; what
    /// they cost, and whether the end came before. Goes on from a state that an earlier process left, and keeps its own now and then.
    pub(super) fn run(
        &self,
        known: Option<State>,
        checkpoint: &mut OfFrame<'_>,
    ) -> Result<(Film, Tally, bool), RenderError> {
        let known = known.and_then(|mut state| self.fits(&mut state).then_some(state));
        let mut state = match known {
            Some(state) => state,
            None => self.begin()?,
        };
        let mut too_early = false;
        loop {
            let is_met = loop {
                if !too_early {
                    checkpoint.keep(Some(&state), false);
                }
                // A pass ends within about a second on common scenes, so that a time limit is kept.
                let share = state.deadline();
                let (films, goals) = state.films();
                let (pass, complete) = self.pass(films, goals, share);
                state.tally.add(&pass.tally);
                if !complete || !pass.short_of_goals {
                    break complete;
                }
            };
            if !is_met && !too_early {
                too_early = true;
                // Whoever cancels a render may want to go on; what comes from now on only rounds the image off.
                if self.run.progress.is_cancelled() {
                    checkpoint.keep(Some(&state), true);
                }
            }
            state = match self.next(state, is_met)? {
                Next::Stage(state) => state,
                Next::End(film, tally) => return Ok((film, tally, too_early)),
            };
        }
    }

    /// Takes some samples of every pixel that is short of its goal; false where that
    /// share of a time limit was over before all rows were done.
    fn pass(&self, films: Vec<&mut Film>, goals: &[Vec<u32>], share: f64) -> (Pass, bool) {
        let wanted: u64 = goals.iter().flatten().map(|&goal| u64::from(goal)).sum();
        let had: f64 = (films.iter())
            .map(|film| film.mean_samples() * film.len() as f64)
            .sum();
        let is_first = films.iter().any(|film| film.has_gaps());
        let added = AtomicU64::new(0);
        let begun = Instant::now();
        let top = films.iter().map(|film| film.crop().y).min().unwrap_or(0);
        let mut rows: Vec<(FilmRow<'_>, &[u32])> = Vec::new();
        for (film, goals) in films.into_iter().zip(goals) {
            let width = film.crop().width as usize;
            rows.extend(film.rows().into_iter().zip(goals.chunks(width)));
        }
        // From coarse to fine over the image, so that rows which time leaves out stand between others. The first is always taken.
        rows.sort_by_key(|(row, _)| (row.y - top).reverse_bits());
        let passes: Vec<Option<Pass>> = rows
            .par_iter_mut()
            .with_max_len(1)
            .map(|(row, goals)| {
                let is_graced = self.run.progress.is_cancelled() && begun.elapsed() < GRACE;
                let is_over = has_passed(self.run.deadline(share));
                if is_over && !(is_first && (is_graced || row.y == top)) {
                    return None;
                }
                let (pass, samples) = self.row(row, goals);
                let added = added.fetch_add(samples, Ordering::Relaxed) + samples;
                let fraction = (had + added as f64) / wanted.max(1) as f64;
                let progress = self.run.progress;
                progress.update(Phase::Render, fraction as f32, 0);
                Some(pass)
            })
            .collect();
        let complete = passes.iter().all(Option::is_some);
        let mut sum = Pass::default();
        for pass in passes.iter().flatten() {
            sum.tally.add(&pass.tally);
            sum.short_of_goals |= pass.short_of_goals;
        }
        (sum, complete)
    }

    /// Takes samples of one row; tells how many, too.
    fn row(&self, row: &mut FilmRow<'_>, goals: &[u32]) -> (Pass, u64) {
        let camera = Camera::new(self.run.scene, self.view, self.reach);
        let mut dropped = 0;
        let mut samples = 0;
        let mut short_of_goals = false;
        for (x, &goal) in row.columns().zip(goals) {
            let pixel = u64::from(row.y) * u64::from(self.view.frame()[0]) + u64::from(x);
            let taken = row.taken(x);
            let until = goal.clamp(taken, taken + pass_length(taken));
            short_of_goals |= until < goal;
            samples += u64::from(until - taken);
            for sample in taken..until {
                // The film's halves are independent sequences, each stratified in itself.
                let key = Key {
                    seed: self.seed,
                    purpose: Purpose::Pixel,
                    index: 2 * pixel + u64::from(sample & 1),
                };
                let mut sampler = Sampler::new(key, u64::from(sample >> 1));
                let before = camera.tally().lookups;
                let mut value = match self.run.options.integrator {
                    Integrator::Path => camera.path_traced(x, row.y, &mut sampler),
                    Integrator::Cache => camera.cached(x, row.y, &mut sampler, &self.known),
                };
                value.lookups = (camera.tally().lookups - before) as f32;
                match finite(value) {
                    Some(value) => row.add(x, sample, &value),
                    None => {
                        dropped += 1;
                        row.add(x, sample, &Pixel::default());
                    }
                }
            }
        }
        let tally = Tally {
            dropped,
            ..camera.tally()
        };
        let pass = Pass {
            tally,
            short_of_goals,
        };
        (pass, samples)
    }
}

/// What a pass over the image came to.
#[derive(Default)]
struct Pass {
    tally: Tally,
    /// Whether some pixels have fewer samples than they should.
    short_of_goals: bool,
}

/// Samples that a pass may take of a pixel that has `taken`.
fn pass_length(taken: u32) -> u32 {
    taken.clamp(2, 16)
}

/// The gate of the film: a sample that is not finite is a bug; it is counted, reported and must not spoil the pixel.
fn finite(pixel: Pixel) -> Option<Pixel> {
    let ok = pixel.surface.is_finite()
        && pixel.single.is_finite()
        && pixel.multiple.is_finite()
        && pixel.emission.is_finite();
    debug_assert!(ok, "a camera sample is not finite: {pixel:?}");
    ok.then_some(pixel)
}
