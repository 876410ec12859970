//! From a scene to an image: fills the cache where one is used, then takes camera samples until the image is good enough.
//!
//! Samples are taken in passes over the whole image; between passes the noise is measured from the film's two halves.

mod camera;
mod counted;
mod estimate;
mod fill;

use crate::error::RenderError;
use crate::film::{Film, FilmRow, Pixel};
use crate::image::Image;
use crate::layers::LayerSet;
use crate::options::{Crop, Depth, Integrator, Phase, Progress, RenderOptions};
use crate::stats::{Stats, peak_rss_mib};
use camera::{Camera, Multiple, Tally, least_multiple_depth};
use estimate::Estimate;
use fill::{Fill, Filled};
use glam::Vec3;
use rayon::prelude::*;
use std::sync::atomic::{AtomicUsize, Ordering};
use std::time::Instant;
use tyndall_math::{Key, Purpose, Sampler};
use tyndall_scene::{FilmSize, Scene};
use tyndall_transport::world::Lights;

/// Samples per pixel before the noise is believed.
const FIRST_SAMPLES: u32 = 16;
/// Samples per pixel at which a render ends even if its error is not met.
const MOST_SAMPLES: u32 = 1 << 20;
/// Share of the target error that noise may take when records are interpolated; the rest is left to interpolation
/// (added in squares, 0.8² + 0.6² = 1).
const NOISE_SHARE: f64 = 0.8;

/// Shares of a time limit after which the fill and the samples end; the rest goes to the estimate of the error.
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
        self.deadline(RENDER_DEADLINE)
            .is_some_and(|d| Instant::now() >= d)
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
        let filled = (way == Way::Records).then(|| self.fill());
        let cut_short = filled.as_ref().is_some_and(|filled| filled.cut_short);
        if let Some(filled) = &filled {
            stats.rays += filled.rays;
            let count = filled.cache.len() as u64;
            stats.records.insert("multiple".to_owned(), count);
        }
        stats.fill_s = self.start.elapsed().as_secs_f64();

        let rendering = Instant::now();
        let multiple = match (&filled, way) {
            (Some(filled), _) => Multiple::Records(&filled.cache),
            (None, Way::Paths) => Multiple::Paths,
            (None, _) => Multiple::None,
        };
        let (tally, timed_out) = self.sample(&mut film, &multiple);
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
                "the time limit ended the filling of the cache: where records are missing paths are traced, with more noise"
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
        let found = match way {
            Way::PathIntegrator => "integrator: path".to_owned(),
            Way::NoMultiple => "records: none; single: direct; SH: off".to_owned(),
            Way::Records => format!(
                "records: {} multiple; single: direct; SH: off",
                grouped(stats.records["multiple"])
            ),
            Way::Paths => {
                "records: none, multiple scattering path traced; single: direct; SH: off".to_owned()
            }
        };
        let mut image = film.image();
        if let (Some(filled), Some(points)) = (&filled, image.channels.get_mut("records")) {
            mark_records(&filled.pixels, self.crop, points);
        }
        Ok(Outcome {
            image,
            stats,
            notes,
            timed_out: timed_out || cut_short,
            summary: format!("{}; {found}", self.scene.summary()),
        })
    }

    /// The cheapest way that does what this scene needs.
    fn way(&self, notes: &mut Vec<String>) -> Way {
        let media = &self.scene.media;
        let lit = self.scene.lights.count() > 0 || media.emits();
        let scatters = media.list().iter().any(|m| m.sigma_s() != Vec3::ZERO);
        if self.options.integrator == Integrator::Path {
            Way::PathIntegrator
        } else if !lit
            || !scatters
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

    /// Fills the cache for the whole frame, whatever the crop, so that a crop shows the pixels of the full image.
    fn fill(&self) -> Filled {
        let fill = Fill {
            scene: self.scene,
            frame: self.frame,
            max_depth: self.max_depth,
            seed: self.options.seed,
            error: self.error,
            pattern: fill::pattern(self.error),
            deadline: self.deadline(FILL_DEADLINE),
        };
        fill.run(self.progress)
    }

    /// Takes samples in passes until the samples or the error asked for are reached, or the time is up.
    fn sample(&self, film: &mut Film, multiple: &Multiple<'_>) -> (Tally, bool) {
        let mut tally = Tally::default();
        let mut taken = 0;
        let target = match self.options.integrator {
            Integrator::Path => f64::from(self.error),
            Integrator::Cache => f64::from(self.error) * NOISE_SHARE,
        };
        let mut goal = self.options.spp.unwrap_or(FIRST_SAMPLES);
        loop {
            // A pass ends within about a second on common scenes, so that a time limit is kept.
            let until = goal.min(taken + pass_length(taken));
            let (pass, complete) = self.pass(film, taken..until, goal, multiple);
            tally.add(&pass);
            if !complete {
                return (tally, true);
            }
            taken = until;
            if taken < goal {
                continue;
            }
            if self.options.spp.is_some() || taken >= MOST_SAMPLES {
                return (tally, false);
            }
            let Some(error) = film.relative_error() else {
                return (tally, false);
            };
            if error <= target {
                return (tally, false);
            }
            // Noise falls with the root of the samples; aim at the goal, at most fourfold at once.
            let factor = (error / target).powi(2).clamp(1.1, 4.0);
            goal = ((f64::from(taken) * factor).ceil() as u32 + 1).min(MOST_SAMPLES) & !1;
        }
    }

    /// Takes samples number `samples` of every pixel; false where time ran out before all rows were done.
    fn pass(
        &self,
        film: &mut Film,
        samples: std::ops::Range<u32>,
        goal: u32,
        multiple: &Multiple<'_>,
    ) -> (Tally, bool) {
        let rows_done = AtomicUsize::new(0);
        let mut rows = film.rows();
        let n_rows = rows.len();
        // From coarse to fine over the image, so that rows which time leaves out stand between others. The first is always taken.
        rows.sort_by_key(|row| (row.y - self.crop.y).reverse_bits());
        let tallies: Vec<Option<Tally>> = rows
            .par_iter_mut()
            .with_max_len(1)
            .map(|row| {
                if self.out_of_time() && (samples.start > 0 || row.y > self.crop.y) {
                    return None;
                }
                let tally = self.row(row, samples.clone(), multiple);
                let done = rows_done.fetch_add(1, Ordering::Relaxed) + 1;
                let in_pass = done as f32 / n_rows as f32 * samples.len() as f32;
                let fraction = (samples.start as f32 + in_pass) / goal as f32;
                self.progress.update(Phase::Render, fraction, 0);
                Some(tally)
            })
            .collect();
        let complete = tallies.iter().all(Option::is_some);
        let mut sum = Tally::default();
        for tally in tallies.iter().flatten() {
            sum.add(tally);
        }
        (sum, complete)
    }

    fn row(
        &self,
        row: &mut FilmRow<'_>,
        samples: std::ops::Range<u32>,
        multiple: &Multiple<'_>,
    ) -> Tally {
        let camera = Camera::new(self.scene, self.frame, self.max_depth);
        let mut dropped = 0;
        for x in row.columns() {
            let pixel = u64::from(row.y) * u64::from(self.frame[0]) + u64::from(x);
            for sample in samples.clone() {
                // The film's halves are independent sequences, each stratified in itself.
                let key = Key {
                    seed: self.options.seed,
                    purpose: Purpose::Pixel,
                    index: 2 * pixel + u64::from(sample & 1),
                };
                let mut sampler = Sampler::new(key, u64::from(sample >> 1));
                let value = match self.options.integrator {
                    Integrator::Path => camera.path_traced(x, row.y, &mut sampler),
                    Integrator::Cache => camera.cached(x, row.y, &mut sampler, multiple),
                };
                match finite(value) {
                    Some(value) => row.add(x, sample, &value),
                    None => {
                        dropped += 1;
                        row.add(x, sample, &Pixel::default());
                    }
                }
            }
        }
        Tally {
            dropped,
            ..camera.tally()
        }
    }
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

/// Counts the records asked for through each pixel of `crop`.
fn mark_records(pixels: &[[u32; 2]], crop: Crop, counts: &mut [f32]) {
    for &[x, y] in pixels {
        let inside =
            x >= crop.x && y >= crop.y && x - crop.x < crop.width && y - crop.y < crop.height;
        if inside {
            counts[((y - crop.y) * crop.width + (x - crop.x)) as usize] += 1.0;
        }
    }
}

/// Samples a pass may take when `taken` have been taken.
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
