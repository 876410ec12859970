//! From a scene to images: fills the cache where one is used, then takes camera samples until each image is good enough.
//!
//! [`Renderer`] keeps what was computed ahead for all frames of a walk-through; [`render`] makes one still image.

mod cache_info;
mod camera;
mod checkpoint;
mod counted;
mod estimate;
mod field;
mod fill;
mod frame;
mod held_out;
mod jarosz08;
mod kept;
mod pilot;
mod prepare;
mod record_map;
mod sampling;
mod stages;
mod summary;
mod view;

pub use cache_info::CacheInfo;

use crate::error::RenderError;
use crate::film::Film;
use crate::image::Image;
use crate::options::{Crop, Depth, Integrator, Method, Progress, RenderOptions};
use crate::stats::{Stats, peak_rss_mib};
use camera::least_multiple_depth;
use checkpoint::{Keeper, OfFrame};
use frame::Frame;
use glam::Vec3;
use prepare::Prepared;
use stages::State;
use std::path::Path;
use std::time::Instant;
use tyndall_scene::{Camera, FilmSize, Scene};
use tyndall_transport::world::Lights;
use view::View;

/// Shares of a time limit after which the filling of the field, that of the caches, the image's pilot and the samples end; the rest goes to the estimate
/// of the error.
const FIELD_DEADLINE: f64 = 0.2;
const FILL_DEADLINE: f64 = 0.4;
const PILOT_DEADLINE: f64 = 0.5;
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
    /// As `timed_out`, where [`Progress::is_cancelled`] ended it.
    pub cancelled: bool,
    /// What was switched on, in one line.
    pub summary: String,
}

/// Renders `scene` from its own camera as `options` ask; values not given come from the scene file.
///
/// # Errors
/// Those of [`Renderer::new`] and [`Renderer::render`].
pub fn render(
    scene: &Scene,
    options: &RenderOptions,
    progress: &dyn Progress,
) -> Result<Outcome, RenderError> {
    Renderer::new(scene, options, progress)?.render(&scene.camera, 0)
}

/// Renders frames of one scene, which share what is computed ahead of them.
pub struct Renderer<'s> {
    run: Run<'s>,
    pool: rayon::ThreadPool,
    prepared: Prepared,
    /// What the filling took since the last image, s.
    fill_s: f64,
    /// Views that were filled, or begun, since the last image.
    begun: Vec<View>,
    keeper: Option<Keeper>,
    /// The frame that an earlier process left, and where its sampling stands.
    resumed: Option<(u32, State)>,
}

impl<'s> Renderer<'s> {
    /// A renderer without records; see [`Renderer::read_cache`].
    ///
    /// # Errors
    /// Options out of range, a crop outside the frame, too little memory for it, or threads that cannot be started.
    pub fn new(
        scene: &'s Scene,
        options: &'s RenderOptions,
        progress: &'s dyn Progress,
    ) -> Result<Self, RenderError> {
        options.check()?;
        let frame = options.frame([scene.film.width, scene.film.height]);
        FilmSize::new(frame[0], frame[1])?;
        if options.method == Some(Method::Jarosz08) && !scene.media.is_isotropic() {
            return Err(RenderError::NotBuilt {
                what:
                    "caching of light in anisotropic media as published in 2008 (--method jarosz08)"
                        .to_owned(),
                instead: "leave the option out".to_owned(),
            });
        }
        let crop = options.crop.unwrap_or(Crop::whole(frame)).within(frame)?;
        Film::check_memory(crop, &options.layers_of(scene))?;
        let mut pool = rayon::ThreadPoolBuilder::new();
        if let Some(threads) = options.threads {
            pool = pool.num_threads(threads);
        }
        let pool = pool.build().map_err(|e| RenderError::Threads {
            threads: options.threads.unwrap_or(0),
            reason: e.to_string(),
        })?;
        Ok(Self {
            run: Run::new(scene, options, progress, frame, crop),
            pool,
            prepared: Prepared::default(),
            fill_s: 0.0,
            begun: Vec::new(),
            keeper: None,
            resumed: None,
        })
    }

    /// Starts from the records that [`Renderer::write_cache`] kept in a file; to be called before any others are computed.
    ///
    /// # Errors
    /// A file that cannot be read, is damaged, of another version or scene, or was made with other options.
    pub fn read_cache(&mut self, path: &Path) -> Result<(), RenderError> {
        self.prepared = self.run.read_cache(path)?;
        Ok(())
    }

    /// Keeps the records in a file, which appears whole or not at all.
    ///
    /// # Errors
    /// A scene whose files cannot be read again, a path integrator, which has no records, or a file that cannot be written.
    pub fn write_cache(&self, path: &Path) -> Result<(), RenderError> {
        self.run.write_cache(path, &self.prepared)
    }

    /// Computes the records that frames seen from `cameras` need and that there are not yet. Frames filled together share records that
    /// serve them all.
    pub fn fill(&mut self, cameras: &[Camera]) {
        let mut views: Vec<View> = Vec::new();
        for &camera in cameras {
            let view = View::new(camera, self.run.frame);
            if !views.contains(&view) {
                views.push(view);
            }
        }
        let is_served = |view: &View| self.prepared.for_whom.serves(view);
        let is_unknown = |view: &View| {
            let has_begun = self.begun.contains(view) && is_served(view);
            !(self.prepared.is_for(view) || has_begun)
        };
        if !views.iter().any(is_unknown) {
            return;
        }
        // For whom records are is chosen from all that are to share them.
        if views.iter().all(is_served) {
            views.retain(is_unknown);
        }
        let start = Instant::now();
        let prepared = std::mem::take(&mut self.prepared);
        self.prepared = self.pool.install(|| self.run.prepare_for(&views, prepared));
        self.begun.extend(self.prepared.for_whom.served(&views));
        self.fill_s += start.elapsed().as_secs_f64();
    }

    /// Whether a time limit, or who cancelled it, ended the filling; the next frame, or who reads the cache file, goes on with it.
    pub fn is_cut_short(&self) -> bool {
        self.prepared.is_cut_short()
    }

    /// Renders the frame of this number as it is seen from `camera`; frames of other numbers have other random numbers. Fills what it
    /// needs. A time limit counts from the end of the frame before.
    ///
    /// # Errors
    /// Where the system refuses memory for the film.
    pub fn render(&mut self, camera: &Camera, number: u32) -> Result<Outcome, RenderError> {
        self.fill(std::slice::from_ref(camera));
        let frame = Frame {
            run: &self.run,
            prepared: &self.prepared,
            view: View::new(*camera, self.run.frame),
            // The frame's own pixels, and no other frame's.
            seed: self.run.options.seed.wrapping_add(u64::from(number) << 32),
        };
        let resumed = self.resumed.take().filter(|(of, _)| *of == number);
        let mut checkpoint = OfFrame {
            keeper: self.keeper.as_mut(),
            prepared: &self.prepared,
            number,
        };
        let outcome =
            (self.pool).install(|| frame.render(resumed.map(|(_, state)| state), &mut checkpoint));
        let mut outcome = outcome?;
        outcome.notes.extend(self.checkpoint_fault());
        outcome.stats.fill_s = self.fill_s;
        outcome.stats.wall_s = self.run.start.elapsed().as_secs_f64();
        outcome.stats.threads = self.pool.current_num_threads();
        outcome.stats.peak_rss_mib = peak_rss_mib();
        self.fill_s = 0.0;
        self.begun.clear();
        self.prepared.forget_costs();
        self.run.start = Instant::now();
        Ok(outcome)
    }
}

/// What holds for all frames of a scene.
struct Run<'s> {
    scene: &'s Scene,
    options: &'s RenderOptions,
    progress: &'s dyn Progress,
    frame: [u32; 2],
    crop: Crop,
    error: f32,
    max_depth: Option<u32>,
    way: Way,
    /// From when time limits count.
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
            way: Way::of(scene, options.integrator, max_depth),
            start: Instant::now(),
        }
    }

    /// When a share of the time limit is spent; it is where the render is cancelled.
    fn deadline(&self, share: f64) -> Option<Instant> {
        if self.progress.is_cancelled() {
            return Some(self.start);
        }
        let limit = self.options.time_limit?;
        self.start.checked_add(limit.mul_f64(share))
    }
}

/// Whether there is a deadline, and it is over.
fn has_passed(deadline: Option<Instant>) -> bool {
    deadline.is_some_and(|d| Instant::now() >= d)
}

/// How multiple scattering in media is computed.
#[derive(Clone, Copy, PartialEq, Eq)]
enum Way {
    PathIntegrator,
    NoMultiple,
    Records,
}

impl Way {
    /// The cheapest way that does what the scene needs.
    fn of(scene: &Scene, integrator: Integrator, max_depth: Option<u32>) -> Self {
        if integrator == Integrator::Path {
            Self::PathIntegrator
        } else if !is_lit(scene)
            || !scatters(scene)
            || max_depth.is_some_and(|max| max < least_multiple_depth(scene))
        {
            Self::NoMultiple
        } else {
            Self::Records
        }
    }
}

/// Whether light is scattered anywhere.
fn scatters(scene: &Scene) -> bool {
    let mut media = scene.media.list().iter();
    media.any(|m| m.sigma_s() != Vec3::ZERO)
}

/// Whether there is light at all.
fn is_lit(scene: &Scene) -> bool {
    scene.lights.count() > 0 || scene.media.emits()
}
