//! Camera samples of one frame, taken in passes until there are enough everywhere.
//!
//! With a cache each block of pixels gets what its noise asks for; path-traced images get one number throughout.

use super::camera::{Camera, Known, Tally};
use super::view::View;
use super::{RENDER_DEADLINE, Run, has_passed};
use crate::error::RenderError;
use crate::film::{Film, FilmRow, Pixel};
use crate::layers::LayerSet;
use crate::noise::{MOST_SAMPLES, Region, Rule, pilot, whole_blocks, with_margin};
use crate::options::{Crop, Integrator, Phase};
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::{Duration, Instant};
use tyndall_math::{Key, Purpose, Sampler};
use tyndall_transport::path::Reach;

/// Samples per pixel before the noise is believed.
const FIRST_SAMPLES: u32 = 8;
/// By how much the samples of a path-traced image may grow at once.
const GROWTH: f64 = 4.0;
/// How long the first samples of a cancelled render may take, so that there is an image at all.
const GRACE: Duration = Duration::from_millis(500);
/// Keeps the numbers of the pilot's places from those of its samples.
const PLACES: u64 = 1 << 32;

/// Takes the samples of one frame.
pub(super) struct Sampling<'f> {
    pub(super) run: &'f Run<'f>,
    pub(super) view: View,
    pub(super) seed: u64,
    /// What samples read.
    pub(super) known: Known<'f>,
    pub(super) reach: Reach<'f>,
}

impl Sampling<'_> {
    /// A film of the part of the frame that is asked for, with as many samples as were asked for or as lower its noise to `target`; what
    /// they cost, and whether the time was up before.
    pub(super) fn run(
        &self,
        layers: &LayerSet,
        target: f64,
    ) -> Result<(Film, Tally, bool), RenderError> {
        let Run {
            frame,
            crop,
            options,
            ..
        } = *self.run;
        if options.integrator == Integrator::Cache && options.spp.is_none() {
            return self.by_blocks(layers, target);
        }
        let mut film = Film::new(frame, crop, layers.clone())?;
        let (tally, timed_out) = self.evenly(&mut film, target);
        Ok((film, tally, timed_out))
    }

    /// Takes equally many samples of all pixels: samples that decide where more are taken would bias the ground truth.
    fn evenly(&self, film: &mut Film, target: f64) -> (Tally, bool) {
        let mut tally = Tally::default();
        let mut goal = self.run.options.spp.unwrap_or(FIRST_SAMPLES);
        loop {
            let goals = vec![goal; film.len()];
            if !self.reach_goals(&mut [film], &[goals], &mut tally) {
                return (tally, true);
            }
            let error = film.relative_error();
            // Where it is not a number there is nothing to aim at.
            let short = error.filter(|error| *error > target && goal < MOST_SAMPLES);
            let Some(error) = short.filter(|_| self.run.options.spp.is_none()) else {
                return (tally, false);
            };
            let factor = (error / target).powi(2).clamp(1.1, GROWTH);
            goal = ((f64::from(goal) * factor).ceil() as u32 + 1).min(MOST_SAMPLES) & !1;
        }
    }

    /// Takes samples where blocks of pixels need them; which ones a block gets does not depend on the part of the frame that is asked for.
    fn by_blocks(
        &self,
        layers: &LayerSet,
        target: f64,
    ) -> Result<(Film, Tally, bool), RenderError> {
        let (frame, crop) = (self.run.frame, self.run.crop);
        let mut tally = Tally::default();
        let key = Key {
            seed: self.run.options.seed,
            purpose: Purpose::Pilot,
            index: PLACES,
        };
        let tiles = pilot(frame, key);
        let margins = tiles.iter().map(|&tile| with_margin(tile, frame));
        let mut begun = self.begin(margins.collect(), layers, &[], &mut tally)?;
        let mut regions = tiles
            .iter()
            .zip(&begun)
            .map(|(&tile, first)| Region::new(tile, frame, layers, first))
            .collect::<Result<Vec<Region>, _>>()?;
        let rule = loop {
            let (rule, noise) = Rule::new(&regions, target);
            let goals: Vec<Vec<u32>> = regions.iter().map(|region| rule.goals(region)).collect();
            let is_met = regions
                .iter()
                .zip(&goals)
                .all(|(region, goals)| region.meets(goals));
            // Where the noise is not a number there is nothing to aim at.
            if noise.is_nan() || noise <= target || is_met {
                break rule;
            }
            let mut films: Vec<&mut Film> = regions.iter_mut().map(|r| &mut r.film).collect();
            if !self.reach_goals(&mut films, &goals, &mut tally) {
                break rule;
            }
        };
        let part = whole_blocks(crop, frame);
        let margin = vec![with_margin(part, frame)];
        begun = self.begin(margin, layers, &begun, &mut tally)?;
        let mut region = Region::new(part, frame, layers, &begun[0])?;
        for of_pilot in &regions {
            region.film.adopt(&of_pilot.film);
        }
        drop(begun);
        let mut timed_out = region.film.has_gaps();
        while !timed_out {
            let goals = rule.goals(&region);
            if region.meets(&goals) {
                break;
            }
            timed_out = !self.reach_goals(&mut [&mut region.film], &[goals], &mut tally);
        }
        let mut film = Film::new(frame, crop, layers.clone())?;
        film.adopt(&region.film);
        if film.has_gaps() {
            // The one row that is always taken may stand in the margin.
            let goals = vec![FIRST_SAMPLES; film.len()];
            self.reach_goals(&mut [&mut film], &[goals], &mut tally);
        }
        Ok((film, tally, timed_out))
    }

    /// Films of `parts` of the frame with the first samples of each pixel, which some films may `have` already.
    fn begin(
        &self,
        parts: Vec<Crop>,
        layers: &LayerSet,
        have: &[Film],
        tally: &mut Tally,
    ) -> Result<Vec<Film>, RenderError> {
        let begin = |part: Crop| {
            let mut film = Film::new(self.run.frame, part, layers.clone())?;
            have.iter().for_each(|other| film.adopt(other));
            Ok(film)
        };
        let mut films = parts
            .into_iter()
            .map(begin)
            .collect::<Result<Vec<Film>, RenderError>>()?;
        let goals: Vec<Vec<u32>> = films
            .iter()
            .map(|film| vec![FIRST_SAMPLES; film.len()])
            .collect();
        self.reach_goals(&mut films.iter_mut().collect::<Vec<_>>(), &goals, tally);
        Ok(films)
    }

    /// Takes samples until each pixel of some films has as many as it should; false where time ran out before.
    fn reach_goals(&self, films: &mut [&mut Film], goals: &[Vec<u32>], tally: &mut Tally) -> bool {
        loop {
            // A pass ends within about a second on common scenes, so that a time limit is kept.
            let (pass, complete) = self.pass(films, goals);
            tally.add(&pass.tally);
            if !complete || !pass.short_of_goals {
                return complete;
            }
        }
    }

    /// Takes some samples of every pixel that is short of its goal; false where time ran out before all rows were done.
    fn pass(&self, films: &mut [&mut Film], goals: &[Vec<u32>]) -> (Pass, bool) {
        let wanted: u64 = goals.iter().flatten().map(|&goal| u64::from(goal)).sum();
        let had: f64 = (films.iter())
            .map(|film| film.mean_samples() * film.len() as f64)
            .sum();
        let is_first = films.iter().any(|film| film.has_gaps());
        let added = AtomicU64::new(0);
        let begun = Instant::now();
        let top = films.iter().map(|film| film.crop().y).min().unwrap_or(0);
        let mut rows: Vec<(FilmRow<'_>, &[u32])> = Vec::new();
        for (film, goals) in films.iter_mut().zip(goals) {
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
                let is_over = has_passed(self.run.deadline(RENDER_DEADLINE));
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
