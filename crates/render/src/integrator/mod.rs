//! From a scene to an image: fills the cache where one is used, then takes camera samples until the image is good enough.
//!
//! Samples are taken in passes over the whole image; between passes the noise is measured from the film's two halves.

mod camera;
mod counted;
mod estimate;
mod field;
mod fill;
mod held_out;
mod jarosz08;
mod pilot;
mod prepare;
mod record_map;

use crate::error::RenderError;
use crate::film::{Film, FilmRow, Pixel};
use crate::image::Image;
use crate::layers::LayerSet;
use crate::options::{Crop, Depth, Integrator, Method, Phase, Progress, RenderOptions};
use crate::stats::{Stats, peak_rss_mib};
use camera::{Camera, Known, Tally, least_multiple_depth};
use estimate::Estimate;
use field::FilledField;
use fill::{Fill, Filled, Kind};
use glam::Vec3;
use prepare::Prepared;
use rayon::prelude::*;
use std::sync::atomic::{AtomicU64, Ordering};
use std::time::Instant;
use tyndall_math::{Key, Purpose, Sampler};
use tyndall_scene::{FilmSize, Scene};
use tyndall_transport::path::Reach;
use tyndall_transport::world::Lights;

/// Samples per pixel before the noise is believed.
const FIRST_SAMPLES: u32 = 8;
/// By how much the samples of a pixel may grow at once: what few samples tell of noise may be far off.
const GROWTH: u32 = 4;
/// Samples per pixel at which a render ends even if its error is not met.
const MOST_SAMPLES: u32 = 1 << 20;
/// Least and greatest share of the target error that noise may take where the field or records are read; the rest is left to these. The
/// least, where their error is not known.
const NOISE_SHARES: [f64; 2] = [0.6, 0.85];

/// An image errs more than asked where its error is this many times that; what is held out tells errors with some error of its own.
const TOLERATED: f64 = 1.25;

/// Shares of a time limit after which the filling of the field, that of the caches and the samples end; the rest goes to the estimate
/// of the error.
const FIELD_DEADLINE: f64 = 0.2;
const FILL_DEADLINE: f64 = 0.4;
const RENDER_DEADLINE: f64 = 0.8;

/// A finished render.
#[derive(Clone, Debug)]
pub struct Outcome {
    /// The image with the layers asked for.
    pub image: Image,
    /// What it cost.
    pub stats: Stats,
    /// What the user should know about this render.
    pub notes: Vec<String>,
    /// Whether the time limit ended the render before its error or samples were met.
    pub timed_out: bool,
    /// What was switched on, in one line.
    pub summary: String,
}

/// Renders `scene` as `options` ask; values not given come from the scene file.
///
/// # Errors
/// Options out of range, a crop outside the frame, or threads that cannot be started.
pub fn render(
    scene: &Scene,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<Outcome, RenderError> {
    options.check()?;
    let frame = options.frame([scene.film.width, scene.film.height]);
    FilmSize::new(frame[0], frame[1])?;
    if options.method == Some(Method::Jarosz08) && !scene.media.is_isotropic() {
        return Err(RenderError::NotBuilt {
            what: "caching of light in anisotropic media as published in 2008 (--method jarosz08)"
                .to_owned(),
            instead: "leave the option out".to_owned(),
        });
    }
    let crop = options.crop.unwrap_or(Crop::whole(frame)).within(frame)?;
    let mut pool = rayon::ThreadPoolBuilder::new();
    if let Some(threads) = options.threads {
        pool = pool.num_threads(threads);
    }
    let pool = pool.build().map_err(|e| RenderError::Threads {
        threads: options.threads.unwrap_or(0),
        reason: e.to_string(),
    })?;
    let run = Run::new(scene, options, progress, frame, crop);
    let mut outcome = pool.install(|| run.render())?;
    outcome.stats.threads = pool.current_num_threads();
    outcome.stats.peak_rss_mib = peak_rss_mib();
    Ok(outcome)
}

/// One render under way.
struct Run<'s> {
    scene: &'s Scene,
    options: &'s RenderOptions,
    progress: &'s dyn Progress,
    frame: [u32; 2],
    crop: Crop,
    error: f32,
    max_depth: Option<u32>,
    start: Instant,
}

impl<'s> Run<'s> {
    fn new(
        scene: &'s Scene,
        options: &'s RenderOptions,
        progress: &'s dyn Progress,
        frame: [u32; 2],
        crop: Crop,
    ) -> Self {
        let max_depth = match options.max_depth {
            None => scene.settings.max_depth,
            Some(Depth::Unlimited) => None,
            Some(Depth::Limit(n)) => Some(n),
        };
        Self {
            scene,
            options,
            progress,
            frame,
            crop,
            error: options.error.unwrap_or(scene.settings.error),
            max_depth,
            start: Instant::now(),
        }
    }

    /// When a share of the time limit is spent.
    fn deadline(&self, share: f64) -> Option<Instant> {
        let limit = self.options.time_limit?;
        self.start.checked_add(limit.mul_f64(share))
    }

    fn out_of_time(&self) -> bool {
        has_passed(self.deadline(RENDER_DEADLINE))
    }

    fn render(&self) -> Result<Outcome, RenderError> {
        let mut notes = Vec::new();
        let mut stats = Stats::default();
        let layers = self
            .options
            .layers
            .clone()
            .unwrap_or_else(|| LayerSet::usual(self.scene.media.emits()));
        let mut film = Film::new(self.frame, self.crop, layers)?;

        let way = self.way(&mut notes);
        let prepared = self.prepare(way);
        let cut_short = prepared.is_cut_short();
        prepared.count(&mut stats);
        stats.fill_s = self.start.elapsed().as_secs_f64();

        let rendering = Instant::now();
        let reach = self.reach(prepared.field.as_ref());
        let target = self.noise_target(&prepared);
        let known = prepared.known(way);
        let (tally, timed_out) = self.sample(&mut film, target, &known, reach);
        stats.error_shares.extend(prepared.known_shares());
        if let Some(noise) = film.noise() {
            stats.error_shares.insert("noise", noise.error());
        }
        stats.spp = film.mean_samples();
        film.fill_gaps();
        stats.render_s = rendering.elapsed().as_secs_f64();

        let estimating = Instant::now();
        let estimate = Estimate {
            scene: self.scene,
            frame: self.frame,
            max_depth: self.max_depth,
            seed: self.options.seed,
            deadline: self.deadline(1.0),
        };
        let (error, estimate_tally) = estimate.run(&film, self.progress);
        stats.estimated_error = error;
        stats.estimate_s = estimating.elapsed().as_secs_f64();

        stats.rays += tally.rays + estimate_tally.rays;
        stats.lookups = tally.lookups;
        stats.lookups_missed = tally.missed;
        stats.wall_s = self.start.elapsed().as_secs_f64();
        if tally.dropped > 0 {
            notes.push(format!(
                "{} camera samples were not finite and count as black: this is a bug, please report it with the scene",
                tally.dropped
            ));
        }
        if cut_short {
            notes.push(
                "the time limit ended the filling of the cache: where light is not known paths are traced, with more noise"
                    .to_owned(),
            );
        }
        if stats.spp < 1.0 {
            notes.push(
                "the time limit left rows of the image without samples: they repeat their neighbours"
                    .to_owned(),
            );
        }
        if timed_out {
            notes.push(format!(
                "the time limit ended the render after {:.1} samples per pixel; the image is the best so far",
                stats.spp
            ));
        }
        if prepared
            .field
            .as_ref()
            .is_some_and(|filled| filled.unsure && !filled.cut_short)
        {
            notes.push(
                "few walks through the fog find the lights: the image may be too dark; `--integrator path` or thinner fog would tell"
                    .to_owned(),
            );
        }
        let tolerated = TOLERATED * f64::from(self.error);
        if let Some(error) = prepared.error().filter(|&error| error > tolerated)
            && self.options.spp.is_none()
        {
            notes.push(short_of_error(&prepared, error));
        }
        let count = |kind: &str| grouped(stats.records.get(kind).copied().unwrap_or(0));
        let surface = count("surface");
        let how_single = match (&prepared.sky, &prepared.single) {
            (Some(_), _) => format!("{} records of skies, else direct", count("single")),
            (_, Some(_)) => format!("{} records", count("single")),
            (None, None) => "direct".to_owned(),
        };
        let found = match way {
            Way::PathIntegrator => "integrator: path".to_owned(),
            Way::NoMultiple => format!("records: {surface} surface; single: {how_single}; SH: off"),
            Way::Records if prepared.reads_field => {
                format!(
                    "multiple: coarse field; records: {surface} surface; single: {how_single}; SH: off"
                )
            }
            Way::Records => format!(
                "records: {} multiple, {surface} surface; single: {how_single}; SH: off",
                count("multiple")
            ),
            Way::Paths => {
                "records: none, multiple scattering path traced; single: direct; SH: off".to_owned()
            }
        };
        let mut image = film.image();
        prepared.show_records(self.crop, &mut image);
        let found = if self.is_jarosz08() {
            format!("{found}; method: jarosz08")
        } else {
            found
        };
        Ok(Outcome {
            image,
            stats,
            notes,
            timed_out: timed_out || cut_short,
            summary: format!("{}; {found}", self.scene.summary()),
        })
    }

    fn is_lit(&self) -> bool {
        self.scene.lights.count() > 0 || self.scene.media.emits()
    }

    fn scatters(&self) -> bool {
        let mut media = self.scene.media.list().iter();
        media.any(|m| m.sigma_s() != Vec3::ZERO)
    }

    /// The cheapest way that does what this scene needs.
    fn way(&self, notes: &mut Vec<String>) -> Way {
        let media = &self.scene.media;
        if self.options.integrator == Integrator::Path {
            Way::PathIntegrator
        } else if !self.is_lit()
            || !self.scatters()
            || self
                .max_depth
                .is_some_and(|max| max < least_multiple_depth(self.scene))
        {
            Way::NoMultiple
        } else if media.is_isotropic() {
            Way::Records
        } else {
            notes.push(
                "records for anisotropic media are not built yet: multiple scattering is path traced, which is slower and \
                 leaves noise"
                    .to_owned(),
            );
            Way::Paths
        }
    }

    /// Whether paths end in a coarse field: where they may be long, and scatter in media as a field knows it.
    fn has_field(&self, way: Way) -> bool {
        way != Way::PathIntegrator
            && self.is_lit()
            && self.max_depth.is_none()
            && self.scene.media.is_isotropic()
            && (way == Way::Records || !self.scene.geometry.is_empty())
    }

    /// Whether indirect light on surfaces is read from records: where paths of these can end in a field.
    fn has_surface_records(&self, way: Way) -> bool {
        self.has_field(way) && !self.scene.geometry.is_empty()
    }

    /// Whether light straight from skies may be read from records: where surfaces hide most of them, few samples find it.
    fn may_hold_sky(&self, way: Way) -> bool {
        way == Way::Records
            && self.max_depth.is_none()
            && self.scene.lights.has_even_skies()
            && !self.scene.geometry.is_empty()
    }

    /// How far paths go that may end in a field.
    fn reach<'f>(&self, field: Option<&'f FilledField>) -> Reach<'f> {
        Reach {
            max_depth: self.max_depth,
            field: field.map(|filled| &filled.field),
        }
    }

    fn field(&self) -> FilledField {
        field::fill(
            self.scene,
            self.frame,
            self.options.seed,
            self.error,
            self.deadline(FIELD_DEADLINE),
            self.progress,
        )
    }

    /// Fills a cache for the whole frame, whatever the crop, so that a crop shows the pixels of the full image.
    fn fill<K: Kind>(&self, kind: K) -> Filled<K::Tag> {
        let fill = Fill {
            kind,
            scene: self.scene,
            frame: self.frame,
            seed: self.options.seed,
            deadline: self.deadline(FILL_DEADLINE),
        };
        fill.run(self.progress)
    }

    /// The noise up to which samples are taken, beside the error of what was `prepared`: errors add in squares.
    fn noise_target(&self, prepared: &Prepared) -> f64 {
        let error = f64::from(self.error);
        if prepared.is_empty() {
            return error;
        }
        let [least, most] = NOISE_SHARES;
        let left = prepared.error().map(|own| 1.0 - (own / error).powi(2));
        error * left.unwrap_or(0.0).max(0.0).sqrt().clamp(least, most)
    }

    /// Takes samples in passes until the samples asked for or the `target` of noise are reached, or the time is up.
    fn sample(
        &self,
        film: &mut Film,
        target: f64,
        known: &Known<'_>,
        reach: Reach<'_>,
    ) -> (Tally, bool) {
        let mut tally = Tally::default();
        let pixels = (self.crop.width * self.crop.height) as usize;
        let mut goals = vec![self.options.spp.unwrap_or(FIRST_SAMPLES); pixels];
        loop {
            // A pass ends within about a second on common scenes, so that a time limit is kept.
            let (pass, complete) = self.pass(film, &goals, known, reach);
            tally.add(&pass.tally);
            if !complete {
                return (tally, true);
            }
            if pass.short_of_goals {
                continue;
            }
            let mean_samples = film.mean_samples();
            if self.options.spp.is_some() || mean_samples >= f64::from(MOST_SAMPLES) {
                return (tally, false);
            }
            let Some(noise) = film.noise() else {
                return (tally, false);
            };
            let error = noise.error();
            // Where it is not a number there is nothing to aim at.
            if error.is_nan() || error <= target {
                return (tally, false);
            }
            let next = match self.options.integrator {
                // Samples that decide where more are taken would bias the ground truth.
                Integrator::Path => {
                    let factor = (error / target).powi(2).clamp(1.1, f64::from(GROWTH));
                    let goal = (mean_samples * factor).ceil() as u32 + 1;
                    vec![goal.min(MOST_SAMPLES) & !1; pixels]
                }
                Integrator::Cache => noise.goals(target, GROWTH),
            };
            if next == goals {
                return (tally, false);
            }
            goals = next;
        }
    }

    /// Takes some samples of every pixel that is short of its goal; false where time ran out before all rows were done.
    fn pass(
        &self,
        film: &mut Film,
        goals: &[u32],
        known: &Known<'_>,
        reach: Reach<'_>,
    ) -> (Pass, bool) {
        let wanted: u64 = goals.iter().map(|&goal| u64::from(goal)).sum();
        let had = film.mean_samples() * goals.len() as f64;
        let is_first = had == 0.0;
        let added = AtomicU64::new(0);
        let mut rows = film.rows();
        // From coarse to fine over the image, so that rows which time leaves out stand between others. The first is always taken.
        rows.sort_by_key(|row| (row.y - self.crop.y).reverse_bits());
        let passes: Vec<Option<Pass>> = rows
            .par_iter_mut()
            .with_max_len(1)
            .map(|row| {
                if self.out_of_time() && (!is_first || row.y > self.crop.y) {
                    return None;
                }
                let first = (row.y - self.crop.y) as usize * self.crop.width as usize;
                let goals = &goals[first..first + self.crop.width as usize];
                let (pass, samples) = self.row(row, goals, known, reach);
                let added = added.fetch_add(samples, Ordering::Relaxed) + samples;
                let fraction = (had + added as f64) / wanted.max(1) as f64;
                self.progress.update(Phase::Render, fraction as f32, 0);
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
    fn row(
        &self,
        row: &mut FilmRow<'_>,
        goals: &[u32],
        known: &Known<'_>,
        reach: Reach<'_>,
    ) -> (Pass, u64) {
        let camera = Camera::new(self.scene, self.frame, reach);
        let mut dropped = 0;
        let mut samples = 0;
        let mut short_of_goals = false;
        for (x, &goal) in row.columns().zip(goals) {
            let pixel = u64::from(row.y) * u64::from(self.frame[0]) + u64::from(x);
            let taken = row.taken(x);
            let until = goal.min(taken + pass_length(taken));
            short_of_goals |= until < goal;
            samples += u64::from(until - taken);
            for sample in taken..until {
                // The film's halves are independent sequences, each stratified in itself.
                let key = Key {
                    seed: self.options.seed,
                    purpose: Purpose::Pixel,
                    index: 2 * pixel + u64::from(sample & 1),
                };
                let mut sampler = Sampler::new(key, u64::from(sample >> 1));
                let before = camera.tally().lookups;
                let mut value = match self.options.integrator {
                    Integrator::Path => camera.path_traced(x, row.y, &mut sampler),
                    Integrator::Cache => camera.cached(x, row.y, &mut sampler, known),
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

/// Whether there is a deadline, and it is over.
fn has_passed(deadline: Option<Instant>) -> bool {
    deadline.is_some_and(|d| Instant::now() >= d)
}

/// Says that what was computed ahead errs more than the image may, and which part of it most.
fn short_of_error(prepared: &Prepared, error: f64) -> String {
    let worst = prepared.known_shares().max_by(|a, b| a.1.total_cmp(&b.1));
    let (layer, share) = worst.unwrap_or_default();
    format!(
        "the error asked for may not be met: light known ahead of the image is off by {:.1} % of it, most of that ({:.1} %) in the \
         `{layer}` layer; a smaller --error gives more and better records",
        100.0 * error,
        100.0 * share
    )
}

/// What a pass over the image came to.
#[derive(Default)]
struct Pass {
    tally: Tally,
    /// Whether some pixels have fewer samples than they should.
    short_of_goals: bool,
}

/// How multiple scattering in media is computed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    PathIntegrator,
    NoMultiple,
    Records,
    Paths,
}

/// A number with its thousands set apart.
fn grouped(n: u64) -> String {
    if n < 1000 {
        n.to_string()
    } else {
        format!("{} {:03}", grouped(n / 1000), n % 1000)
    }
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
