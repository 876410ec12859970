//! Renders that a signal ends, tried on the `tyndall` program as a user runs it.

#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "tests")]

use std::path::Path;
use std::process::Child;
use std::thread::sleep;
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tyndall_tests::image::Channels;
use tyndall_tests::program::{run_line, signal, start_line, told, workspace};

/// A render that takes hours, until a signal ends it.
fn render(options: &str) -> String {
    let scene = workspace().join("assets/cornell_box/cornell_box.ron");
    let size = "--width 48 --height 48";
    format!("render {} {size} --error 1e-4 {options}", scene.display())
}

/// Waits until there is a file, for no longer than a minute.
fn await_file(path: &Path) {
    let begun = Instant::now();
    while !path.exists() {
        assert!(begun.elapsed().as_secs() < 60, "no {}", path.display());
        sleep(Duration::from_millis(10));
    }
}

/// Exit status and standard error of a program that has been asked to end.
fn end(program: Child) -> (Option<i32>, String) {
    let begun = Instant::now();
    let output = program.wait_with_output().unwrap();
    // A pass takes some tenths of a second; the rest is for machines with other work to do.
    assert!(begun.elapsed().as_secs() < 20, "it goes on");
    told(output)
}

fn assert_shows_something(path: &Path) {
    let image = Channels::read(path).unwrap();
    let pixels = image.rgb("").unwrap().pixels;
    assert!(pixels.iter().all(|p| p.is_finite()));
    let lit = pixels.iter().filter(|p| p.max_element() > 0.0).count();
    assert!(lit * 2 > pixels.len(), "{lit} pixels are lit");
}

#[test]
fn a_signal_while_samples_are_taken_leaves_the_best_image_so_far() {
    let folder = TempDir::new().unwrap();
    let file = |name: &str| folder.path().join(name);
    for (name, number, integrator) in [("INT", 2, "cache"), ("TERM", 15, "path")] {
        let cache = match integrator {
            "cache" => "--cache-out out.cache --multiple field",
            _ => "",
        };
        let options = format!("--integrator {integrator} -o {name}.exr --spp 1000000 {cache}");
        let line = render(&options).replace("1e-4", "0.5");
        let program = start_line(folder.path(), &line);
        if integrator == "cache" {
            await_file(&file("out.cache"));
        }
        sleep(Duration::from_secs(1));
        signal(&program, name);
        let (status, stderr) = end(program);
        assert_eq!(status, Some(128 + number), "{stderr}");
        let said = format!("interrupted by SIG{name}: the image is the best so far");
        assert!(stderr.contains(&said), "{stderr}");
        assert!(!stderr.contains("time limit"), "{stderr}");
        assert_shows_something(&file(&format!("{name}.exr")));
    }
}

#[test]
fn a_signal_while_the_cache_is_filled_leaves_what_there_is_of_it_and_an_image() {
    let folder = TempDir::new().unwrap();
    let file = |name: &str| folder.path().join(name);
    let program = start_line(
        folder.path(),
        &render("-o out.exr --cache-out out.cache --multiple records"),
    );
    sleep(Duration::from_secs(2));
    assert!(!file("out.cache").exists(), "the filling takes minutes");
    signal(&program, "INT");
    let (status, stderr) = end(program);
    assert_eq!(status, Some(130), "{stderr}");
    assert!(stderr.contains("interrupted by SIGINT"), "{stderr}");
    assert_shows_something(&file("out.exr"));
    let output = run_line(folder.path(), "info out.cache");
    assert!(output.status.success());
}

#[test]
fn a_second_signal_ends_the_program_at_once() {
    let folder = TempDir::new().unwrap();
    let options = "-o out.exr --cache-out out.cache --multiple field --width 3000 --height 3000";
    let line = render(options)
        .replace("--width 48 --height 48", "")
        .replace("1e-4", "0.5");
    let program = start_line(folder.path(), &line);
    await_file(&folder.path().join("out.cache"));
    signal(&program, "TERM");
    signal(&program, "INT");
    let (status, stderr) = end(program);
    assert_eq!(status, Some(130), "{stderr}");
    assert_eq!(stderr, "wrote out.cache\n");
    assert!(!folder.path().join("out.exr").exists());
}
