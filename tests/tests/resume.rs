//! Renders that something ends go on from their checkpoint, and end with the pixels of one without a break.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::Path;
use std::sync::atomic::{AtomicI64, Ordering};
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tyndall_render::Renderer;
use tyndall_render::image::Image;
use tyndall_render::options::{Crop, Depth, Integrator, Phase, Progress, RenderOptions};
use tyndall_scene::{LoadOptions, Scene};
use tyndall_tests::image::Channels;
use tyndall_tests::program::{ends, signal, start_line, succeed, told, workspace};

/// Cancels the render after so many rows of pixels.
struct Rows(AtomicI64);

impl Progress for Rows {
    fn update(&self, phase: Phase, _fraction: f32, _records: usize) {
        if phase == Phase::Render {
            self.0.fetch_sub(1, Ordering::Relaxed);
        }
    }

    fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed) <= 0
    }
}

const NEVER: i64 = i64::MAX;

/// The image, and whether it was cancelled, after so many rows beyond those of the checkpoint in `folder`.
fn go_on(scene: &Scene, options: &RenderOptions, folder: &Path, rows: i64) -> (Image, bool) {
    let progress = Rows(AtomicI64::new(rows));
    let mut renderer = Renderer::new(scene, options, &progress).unwrap();
    let path = folder.join("image.checkpoint");
    let (long, cameras) = (Duration::from_secs(3600), [scene.camera]);
    renderer.keep_checkpoints(&path, long, &cameras).unwrap();
    assert_eq!(renderer.resume().unwrap().is_some(), path.exists());
    let outcome = renderer.render(&scene.camera, 0).unwrap();
    assert_eq!(outcome.notes, [""; 0]);
    if !outcome.cancelled {
        renderer.remove_checkpoint().unwrap();
    }
    assert_eq!(path.exists(), outcome.cancelled);
    (outcome.image, outcome.cancelled)
}

#[test]
fn breaks_in_every_stage_of_sampling_leave_no_trace() {
    let lamp = workspace().join("assets/lamp/lamp.ron");
    let scene = tyndall_scene::load(&lamp, &LoadOptions::default()).unwrap();
    // Frames that a pilot looks at as a whole, and one of which it looks at some tiles; numbers of rows divide no stage. Single scattering
    // needs no records; one case has some.
    let cache = RenderOptions {
        width: Some(24),
        height: Some(18),
        error: Some(0.02),
        max_depth: Some(Depth::Limit(1)),
        ..RenderOptions::default()
    };
    let path = RenderOptions {
        integrator: Integrator::Path,
        error: Some(0.03),
        ..cache.clone()
    };
    let fixed = RenderOptions {
        spp: Some(21),
        error: Some(0.5),
        max_depth: None,
        ..cache.clone()
    };
    let tiles = RenderOptions {
        width: Some(3100),
        height: Some(4),
        error: Some(0.05),
        max_depth: Some(Depth::Limit(1)),
        crop: Some("1001,1,1999,2".parse::<Crop>().unwrap()),
        ..RenderOptions::default()
    };
    for (options, rows) in [
        (cache, [37, 37]),
        (path, [53, 53]),
        (fixed, [29, 29]),
        // Many rows in the tiles, few in the part of the frame that is asked for.
        (tiles, [1500, 5]),
    ] {
        let folder = TempDir::new().unwrap();
        let (whole, cancelled) = go_on(&scene, &options, folder.path(), NEVER);
        assert!(!cancelled);
        let mut breaks = 0;
        let parts = loop {
            let (image, cancelled) = go_on(&scene, &options, folder.path(), rows[breaks % 2]);
            if !cancelled {
                break image;
            }
            breaks += 1;
            assert!(breaks < 100, "{options:?}: it gets nowhere");
        };
        assert!(breaks > 2, "{options:?}: {breaks} breaks");
        assert!(whole == parts, "{options:?}");
    }
}

/// A render of the Cornell box to `name`, some seconds long.
fn render(name: &str, options: &str) -> String {
    let scene = workspace().join("assets/cornell_box/cornell_box.ron");
    let scene = scene.display();
    format!("render {scene} -o {name} --width 32 --height 32 --spp 150 --error 0.5{options}")
}

#[test]
fn a_render_killed_at_any_moment_goes_on_to_the_same_pixels() {
    let folder = TempDir::new().unwrap();
    let file = |name: &str| folder.path().join(name);
    let begun = Instant::now();
    succeed(folder.path(), &render("whole.exr", ""));
    let whole = begun.elapsed();
    let resume = render("killed.exr", " --resume --checkpoint-interval 0");
    let mut kept = 0;
    for i in 0_u32..5 {
        let mut program = start_line(folder.path(), &resume);
        // Moments spread evenly over the time that the whole render takes.
        let share = (f64::from(i) * 0.618_034).fract();
        sleep(whole.mul_f64(share));
        program.kill().unwrap();
        program.wait().unwrap();
        kept += u32::from(file("killed.exr.checkpoint").exists());
        if file("killed.exr").exists() {
            break;
        }
    }
    assert!(kept > 0, "no checkpoint was kept in {whole:?}");
    succeed(folder.path(), &resume);
    let [whole, killed] = ["whole.exr", "killed.exr"].map(|name| {
        let path = folder.path().join(name);
        Channels::read(&path).unwrap()
    });
    assert!(whole == killed);
    let mut left: Vec<String> = fs::read_dir(folder.path())
        .unwrap()
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    left.sort();
    assert_eq!(left, ["killed.exr", "whole.exr"]);
}

#[test]
fn a_checkpoint_of_something_else_is_refused_with_what_differs() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("out.exr.checkpoint");
    let lamp = workspace().join("assets/lamp/lamp.ron");
    let text = fs::read_to_string(&lamp).unwrap();
    fs::write(folder.path().join("lamp.ron"), &text).unwrap();
    // The film is given, so that scenes differ in what they show alone.
    let line = "render lamp.ron -o out.exr --width 16 --height 12 --spp 100000 --max-depth 1";
    let program = start_line(folder.path(), &format!("{line} --checkpoint-interval 0"));
    let begun = Instant::now();
    while !path.exists() {
        assert!(begun.elapsed().as_secs() < 60, "no checkpoint");
        sleep(Duration::from_millis(10));
    }
    let mut program = program;
    program.kill().unwrap();
    program.wait().unwrap();
    let whole = fs::read(&path).unwrap();
    let refused = |line: &str, bytes: &[u8], message: &str| {
        fs::write(&path, bytes).unwrap();
        let (status, stderr) = ends(folder.path(), &format!("{line} --resume"));
        assert_eq!(status, Some(2), "{message}: {stderr}");
        assert!(stderr.contains(message), "{message}: {stderr}");
        assert!(
            fs::read(&path).unwrap() == bytes,
            "{message}: it was changed"
        );
    };
    for (from, to, message) in [
        ("--spp 100000", "--spp 100001", "--spp 100000, and 100001"),
        ("--width 16", "--width 17", "frame 16 × 12, and 17 × 12"),
        ("lamp.ron", "lamp.ron --seed 3", "--seed 0, and 3"),
        (
            "lamp.ron",
            "lamp.ron --integrator path",
            "--integrator cache",
        ),
        (
            "lamp.ron",
            "lamp.ron --layers beauty",
            "--layers none, and beauty",
        ),
        ("lamp.ron", "lamp.ron --crop 1,1,5,5", "--crop 0,0,16,12"),
    ] {
        refused(&line.replace(from, to), &whole, message);
    }
    let flipped = |at: usize| {
        let mut bytes = whole.clone();
        bytes[at] ^= 1;
        bytes
    };
    refused(line, &flipped(whole.len() / 2), "damaged");
    refused(line, &flipped(8), "version");
    refused(line, &whole[..whole.len() - 1], "cut short");
    refused(line, b"", "something else");
    let (lamp, camera) = (text.replace("intensity: (", "intensity: (1"), "vfov: ");
    assert!(lamp != text && text.contains(camera));
    fs::write(folder.path().join("lamp.ron"), lamp).unwrap();
    refused(line, &whole, "another scene");
    fs::write(
        folder.path().join("lamp.ron"),
        text.replace(camera, "vfov: 1"),
    )
    .unwrap();
    refused(line, &whole, "other cameras");
}

#[test]
fn a_walk_that_a_signal_ends_goes_on_with_the_frame_under_way() {
    let folder = TempDir::new().unwrap();
    let scene = workspace().join("assets/lamp/lamp.ron");
    let line = |name: &str| {
        let options = "--width 32 --height 24 --spp 400 --max-depth 1 --frames 0..3";
        format!("render {} -o {name}.#.exr {options}", scene.display())
    };
    succeed(folder.path(), &line("whole"));
    let program = start_line(folder.path(), &line("parts"));
    while !folder.path().join("parts.0.exr").exists() {
        sleep(Duration::from_millis(5));
    }
    signal(&program, "TERM");
    let (status, stderr) = told(program.wait_with_output().unwrap());
    assert_eq!(status, Some(143), "{stderr}");
    assert!(stderr.contains("--resume goes on"), "{stderr}");
    let said = succeed(folder.path(), &format!("{} --resume", line("parts")));
    assert!(said.contains("going on from"), "{said}");
    for frame in 0..3 {
        let [whole, parts] = ["whole", "parts"].map(|name| {
            let path = folder.path().join(format!("{name}.{frame}.exr"));
            Channels::read(&path).unwrap()
        });
        assert!(whole == parts, "frame {frame}");
    }
    assert!(!folder.path().join("parts.#.exr.checkpoint").exists());
}
