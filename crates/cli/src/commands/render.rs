//! `tyndall render`: from a scene file to image files.

use crate::args::RenderArgs;
use crate::error::CliError;
use crate::output;
use crate::progress::Bar;
use crate::signals::{Signal, Signals};
use std::collections::HashSet;
use std::path::{Path, PathBuf};
use std::time::Instant;
use tyndall_render::image_file::{
    ImageFormat, WriteOptions, check_place, check_writable, write_image,
};
use tyndall_render::options::RenderOptions;
use tyndall_render::{Outcome, Renderer};
use tyndall_scene::camera::Camera;
use tyndall_scene::numbered::{has_place, numbered};
use tyndall_scene::{LoadOptions, Scene};

pub(super) fn run(args: &RenderArgs, signals: &Signals) -> Result<(), CliError> {
    let start = Instant::now();
    let options = render_options(args);
    options.check()?;
    let outputs = outputs(args);
    let jobs = jobs(args, &outputs)?;
    for path in jobs.iter().flat_map(|job| &job.outputs) {
        check_writable(path)?;
    }
    let numbers = jobs.iter().filter_map(|job| job.stats.as_ref());
    let checkpoint = checkpoint(&outputs);
    for path in numbers.chain(&args.cache_out).chain(&checkpoint) {
        check_place(path)?;
    }
    let load = |job: &Job| {
        let options = LoadOptions {
            frame: job.number,
            ..load_options(args)
        };
        tyndall_scene::load(&args.scene, &options)
    };
    let [first, others @ ..] = jobs.as_slice() else {
        return Ok(());
    };
    let scene = load(first)?;
    // Records may go back where they came from.
    let read = args.cache_in.as_ref();
    let read = read.and_then(|path| path.canonicalize().ok());
    let kept = args
        .cache_out
        .iter()
        .filter(|path| read.is_none() || path.canonicalize().ok() != read);
    let written = jobs
        .iter()
        .flat_map(|job| job.outputs.iter().chain(&job.stats));
    apart(
        scene.files.iter().chain(&args.cache_in),
        written.chain(kept).chain(&checkpoint),
    )?;
    output::warn(&scene.warnings);
    let shows_colour_alone = |path: &PathBuf| matches!(ImageFormat::of(path), Ok(ImageFormat::Png));
    if args.layers.is_some() && outputs.iter().any(shows_colour_alone) {
        output::warn([
            "a PNG file shows the colour of the image alone; --layers takes effect in .exr files",
        ]);
    }
    if !scene.is_sequence || others.is_empty() {
        let images = (&jobs[..], checkpoint.as_deref());
        return render_jobs(args, &options, &scene, images, (start, signals));
    }
    if args.cache_in.is_some() || args.cache_out.is_some() || args.resume {
        return Err(CliError::CacheOfSequence);
    }
    let images = (std::slice::from_ref(first), None);
    render_jobs(args, &options, &scene, images, (start, signals))?;
    drop(scene);
    for job in others {
        let start = Instant::now();
        let scene = load(job)?;
        if let Some(signal) = signals.last() {
            output::say(&format!("interrupted by {} between frames", signal.name()));
            return Err(CliError::Interrupted(signal));
        }
        let images = (std::slice::from_ref(job), None);
        render_jobs(args, &options, &scene, images, (start, signals))?;
    }
    Ok(())
}

/// Makes images of one scene, which share their records; `start` is when its loading began.
fn render_jobs(
    args: &RenderArgs,
    options: &RenderOptions,
    scene: &Scene,
    (jobs, checkpoint): (&[Job], Option<&Path>),
    (start, signals): (Instant, &Signals),
) -> Result<(), CliError> {
    let load_s = start.elapsed().as_secs_f64();
    let bar = Bar::new(args.quiet, signals);
    let mut renderer = Renderer::new(scene, options, &bar)?;
    let cameras: Vec<Camera> = jobs
        .iter()
        .map(|job| camera(scene, job))
        .collect::<Result<_, CliError>>()?;
    let resumed = match checkpoint {
        Some(path) => resume(args, &mut renderer, path, &cameras)?,
        None => None,
    };
    // A checkpoint holds all records that there were.
    if let Some(path) = args.cache_in.as_ref().filter(|_| resumed.is_none()) {
        renderer.read_cache(path)?;
    }
    signals.defer();
    // A render that goes on was filled before.
    let is_filled_ahead = args.fill_only || args.frames.is_some() || args.cache_out.is_some();
    if is_filled_ahead && resumed.is_none() {
        renderer.fill(&cameras);
    }
    if let Some(path) = &args.cache_out {
        renderer.write_cache(path)?;
        if !args.quiet {
            output::say(&format!("wrote {}", path.display()));
        }
    }
    if args.fill_only {
        bar.finish();
        if let Some(signal) = signals.last() {
            output::say(&format!(
                "interrupted by {}: the cache file holds the records so far; a render that starts from it goes on with them",
                signal.name()
            ));
            return Err(CliError::Interrupted(signal));
        }
        if renderer.is_cut_short() {
            output::warn([
                "the time limit ended the filling of the cache; a render that starts from the file goes on with it",
            ]);
        }
        return Ok(());
    }
    let mut since = start;
    // What stands still in a sequence of densities shall look still: its noise, too.
    let number_of = |job: &Job| {
        let number = job.number.filter(|_| !scene.is_sequence);
        number.unwrap_or(0)
    };
    let is_done = |job: &Job| resumed.is_some_and(|number| number_of(job) < number);
    let mut left = jobs
        .iter()
        .zip(&cameras)
        .skip_while(|(job, _)| is_done(job))
        .peekable();
    while let Some((job, camera)) = left.next() {
        let outcome = renderer.render(camera, number_of(job));
        bar.finish();
        let mut outcome = outcome?;
        outcome.stats.load_s = if since == start { load_s } else { 0.0 };
        finish(args, scene, job, &mut outcome, since)?;
        if let Some(signal) = signals.last() {
            if !outcome.cancelled {
                match left.peek() {
                    Some((next, _)) => renderer.keep_checkpoint_before(number_of(next)),
                    None => renderer.remove_checkpoint()?,
                }
            }
            output::say(&interrupted(signal, &outcome, renderer.has_checkpoint()));
            return Err(CliError::Interrupted(signal));
        }
        since = Instant::now();
    }
    renderer.remove_checkpoint()?;
    Ok(())
}

/// Where what there is of the images is kept until they are finished.
fn checkpoint(outputs: &[PathBuf]) -> Option<PathBuf> {
    let mut name = outputs.first()?.as_os_str().to_owned();
    name.push(".checkpoint");
    Some(name.into())
}

/// Keeps checkpoints from now on, and goes on from the last one if that is asked for; tells the frame that was under way.
fn resume(
    args: &RenderArgs,
    renderer: &mut Renderer<'_>,
    path: &Path,
    cameras: &[Camera],
) -> Result<Option<u32>, CliError> {
    renderer.keep_checkpoints(path, args.checkpoint_interval, cameras)?;
    if !args.resume {
        if path.exists() {
            output::warn([format!(
                "an earlier render left a checkpoint, which --resume goes on from and this render replaces: {}",
                path.display()
            )]);
        }
        return Ok(None);
    }
    let resumed = renderer.resume()?;
    if !args.quiet {
        let from = match resumed {
            Some(_) => "going on from",
            None => "starting from the beginning, for there is no",
        };
        output::say(&format!("{from} {}", path.display()));
    }
    Ok(resumed)
}

/// Says what a signal leaves.
fn interrupted(signal: Signal, outcome: &Outcome, has_checkpoint: bool) -> String {
    let image = if outcome.cancelled {
        let spp = outcome.stats.spp;
        format!("the best so far, after {spp:.1} samples per pixel")
    } else {
        "finished".to_owned()
    };
    let rest = if has_checkpoint {
        "; --resume goes on from here"
    } else {
        ""
    };
    format!(
        "interrupted by {}: the image is {image}{rest}",
        signal.name()
    )
}

/// One image, and where it goes.
struct Job {
    /// Of a frame; none for a still.
    number: Option<u32>,
    outputs: Vec<PathBuf>,
    stats: Option<PathBuf>,
}

/// The images to make: one, or one a frame.
fn jobs(args: &RenderArgs, outputs: &[PathBuf]) -> Result<Vec<Job>, CliError> {
    let Some(frames) = &args.frames else {
        return Ok(vec![Job {
            number: None,
            outputs: outputs.to_vec(),
            stats: args.stats.clone(),
        }]);
    };
    let mut paths = outputs.iter().chain(&args.stats);
    if let Some(path) = paths
        .find(|path| !has_place(path))
        .filter(|_| frames.len() > 1)
    {
        return Err(CliError::OneFileForFrames { path: path.clone() });
    }
    let job = |number| Job {
        number: Some(number),
        outputs: outputs.iter().map(|path| numbered(path, number)).collect(),
        stats: args.stats.as_ref().map(|path| numbered(path, number)),
    };
    Ok(frames.clone().map(job).collect())
}

/// From where a job's image is seen.
fn camera(scene: &Scene, job: &Job) -> Result<Camera, CliError> {
    match job.number {
        None => Ok(scene.camera),
        Some(number) => Ok(scene.camera_at(number as f32)?),
    }
}

/// Writes an image and tells about it.
fn finish(
    args: &RenderArgs,
    scene: &Scene,
    job: &Job,
    outcome: &mut Outcome,
    since: Instant,
) -> Result<(), CliError> {
    output::warn(&outcome.notes);
    let write = WriteOptions {
        exposure: scene.settings.exposure,
        metadata: Some(metadata(args, outcome)),
    };
    for path in &job.outputs {
        write_image(path, &outcome.image, &write)?;
    }
    outcome.stats.wall_s = since.elapsed().as_secs_f64();
    if let Some(path) = &job.stats {
        outcome.stats.write(path)?;
    }
    if args.quiet {
        return Ok(());
    }
    let stats = &outcome.stats;
    output::say(&outcome.summary);
    output::say(&format!(
        "{:.1} s on {} threads, {:.1} samples per pixel",
        stats.wall_s, stats.threads, stats.spp
    ));
    if let Some(error) = &stats.estimated_error {
        // Few samples may give an estimate of the squared error below 0: all that is known then is the bound.
        let value = if error.value > 0.0 {
            format!("{:.2} %", 100.0 * error.value)
        } else {
            "too small to tell".to_owned()
        };
        output::say(&format!(
            "estimated error {value} (95 %: {:.2} to {:.2} %), bias {:+.2} %",
            100.0 * error.ci95[0],
            100.0 * error.ci95[1],
            100.0 * error.bias
        ));
    }
    for path in &job.outputs {
        output::say(&format!("wrote {}", path.display()));
    }
    Ok(())
}

/// Refuses outputs that would replace a file of the scene or one another.
fn apart<'a>(
    inputs: impl Iterator<Item = &'a PathBuf>,
    outputs: impl Iterator<Item = &'a PathBuf>,
) -> Result<(), CliError> {
    let real = |path: &Path| std::fs::canonicalize(path).unwrap_or_else(|_| path.to_owned());
    let mut taken: HashSet<PathBuf> = inputs.map(|path| real(path)).collect();
    for output in outputs {
        let place = real(output);
        if !taken.insert(place) {
            return Err(CliError::Overwrites {
                path: output.clone(),
            });
        }
    }
    Ok(())
}

/// The files to write. Without a choice it is one beside the user, and not named like a scene's own images might be.
fn outputs(args: &RenderArgs) -> Vec<PathBuf> {
    if args.fill_only || !args.output.is_empty() {
        return args.output.clone();
    }
    let mut name = args.scene.file_stem().unwrap_or_default().to_owned();
    name.push(if args.frames.is_some() {
        "-render.####.exr"
    } else {
        "-render.exr"
    });
    vec![Path::new(&name).to_owned()]
}

fn load_options(args: &RenderArgs) -> LoadOptions {
    // One side given alone keeps the scene's proportions, which only the renderer knows how to do.
    let [width, height] = if args.width.is_some() && args.height.is_some() {
        [args.width, args.height]
    } else {
        [None, None]
    };
    LoadOptions {
        width,
        height,
        ..args.source.load_options()
    }
}

fn render_options(args: &RenderArgs) -> RenderOptions {
    RenderOptions {
        integrator: args.integrator.0,
        multiple: args.multiple.into(),
        single: args.single.into(),
        method: args.method.map(Into::into),
        error: args.error,
        spp: args.spp,
        width: args.width,
        height: args.height,
        crop: args.crop,
        max_depth: args.max_depth,
        seed: args.seed,
        threads: args.threads,
        time_limit: args.time_limit,
        layers: args.layers.clone(),
    }
}

/// How the image came about, as RON for the EXR file. The number of threads and times stay out: they do not shape the image.
fn metadata(args: &RenderArgs, outcome: &Outcome) -> String {
    format!(
        "(version: {:?}, integrator: {:?}, seed: {}, spp: {:?}, summary: {:?})",
        env!("CARGO_PKG_VERSION"),
        args.integrator.0.name(),
        args.seed,
        outcome.stats.spp,
        outcome.summary,
    )
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;
    use crate::args::{Cli, Command};
    use clap::Parser;

    fn args(line: &str) -> RenderArgs {
        match Cli::try_parse_from(format!("tyndall render {line}").split_whitespace())
            .unwrap()
            .command
        {
            Command::Render(args) => *args,
            other => panic!("{other:?}"),
        }
    }

    #[test]
    fn an_image_without_a_name_is_named_after_the_scene_in_the_current_folder() {
        assert_eq!(
            outputs(&args("some/folder/sky.ron")),
            [PathBuf::from("sky-render.exr")]
        );
        assert_eq!(
            outputs(&args("sky.ron -o x.png -o x.exr")),
            [PathBuf::from("x.png"), PathBuf::from("x.exr")]
        );
    }

    #[test]
    fn one_side_given_alone_is_left_to_the_renderer() {
        let one = args("sky.ron --width 64");
        assert_eq!(
            (load_options(&one).width, render_options(&one).width),
            (None, Some(64))
        );
        let both = args("sky.ron --width 64 --height 32");
        assert_eq!(
            (load_options(&both).width, load_options(&both).height),
            (Some(64), Some(32))
        );
    }

    #[test]
    fn bad_options_and_places_are_found_before_the_scene_is_opened() {
        for line in [
            "none.ron --spp 0",
            "none.ron --integrator path --method jarosz08",
            "none.ron -o picture.jpg",
            "none.ron -o no-such-folder/x.exr",
            "none.ron -o x.exr --stats no-such-folder/s.json",
        ] {
            let error = run(&args(line), &Signals::listen().unwrap()).unwrap_err();
            assert!(matches!(error, CliError::Render(_)), "{line}: {error}");
            assert_eq!(error.status(), 2);
        }
    }
}
