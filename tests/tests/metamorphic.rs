//! Scenes told in another way look as before: brighter lights, exchanged colours, a turned world, lamp and detector exchanged. No
//! reference is needed. Moved and enlarged scenes are in `moved.rs`, grids in `grids.rs`, crops, threads and seeds in `contract.rs`.

#![allow(clippy::unwrap_used, reason = "tests")]

use glam::Vec3;
use std::path::Path;
use tyndall_math::stats::Welford;
use tyndall_render::image::Image;
use tyndall_render::options::{Integrator, RenderOptions};
use tyndall_render::probe::{Derivatives, ProbeOptions, probe};
use tyndall_scene::{LoadOptions, Scene, load_str};

const INTEGRATORS: [Integrator; 2] = [Integrator::Path, Integrator::Cache];
const LAYERS: [&str; 2] = ["single", "multiple"];

fn vector(v: Vec3) -> String {
    format!("({:?}, {:?}, {:?})", v.x, v.y, v.z)
}

/// Two boxes of coloured fog under a lamp, a spot and a sky, every place, direction and colour of which is changed.
fn scene(place: impl Fn(Vec3) -> Vec3, colour: impl Fn(Vec3) -> Vec3, brightness: f32) -> Scene {
    let p = |x, y, z| vector(place(Vec3::new(x, y, z)));
    let c = |r, g, b| vector(colour(Vec3::new(r, g, b)));
    let light = |r, g, b| vector(brightness * colour(Vec3::new(r, g, b)));
    let fog = |min: Vec3, max: Vec3, albedo: Vec3| {
        let (a, b) = (place(min), place(max));
        format!(
            "Medium(region: Box(min: {}, max: {}), sigma_t: {}, albedo: {})",
            vector(a.min(b)),
            vector(a.max(b)),
            c(0.5, 1.0, 1.5),
            vector(colour(albedo)),
        )
    };
    let text = format!(
        "Scene(
            camera: LookAt(eye: {}, target: {}, vfov: 42),
            film: Film(width: 12, height: 12),
            lights: [
                Point(position: {}, intensity: {}),
                Spot(position: {}, direction: {}, intensity: {}, inner_cone: 20, outer_cone: 40),
                Sky(radiance: {}),
            ],
            media: [{}, {}],
            render: Render(error: 0.2),
        )",
        p(1.5, 0.75, 4.0),
        p(0.0, 0.0, 0.0),
        p(0.5, 1.5, 0.75),
        light(6.0, 4.0, 2.0),
        p(-1.0, 2.0, 0.0),
        p(0.25, -1.0, 0.0),
        light(3.0, 5.0, 8.0),
        light(0.25, 0.125, 0.5),
        fog(
            Vec3::splat(-1.0),
            Vec3::new(0.0, 1.0, 1.0),
            Vec3::new(0.9, 0.8, 0.7)
        ),
        fog(
            Vec3::new(0.0, -1.0, -1.0),
            Vec3::ONE,
            Vec3::new(0.5, 0.6, 0.95)
        ),
    );
    load_str(&text, Path::new("."), &LoadOptions::default()).unwrap()
}

fn same<T>(value: T) -> T {
    value
}

fn render(scene: &Scene, integrator: Integrator, spp: u32, seed: u64) -> Image {
    let options = RenderOptions {
        integrator,
        spp: Some(spp),
        seed,
        ..RenderOptions::default()
    };
    tyndall_render::render(scene, &options, &()).unwrap().image
}

/// Mean of a channel of a layer.
fn mean(image: &Image, layer: &str, channel: &str) -> f64 {
    let values = &image.channels[&format!("{layer}.{channel}")];
    values.iter().map(|&v| f64::from(v)).sum::<f64>() / values.len() as f64
}

/// Numbers twice as large have the same digits: paths are the same, and so is what they find. Records are averaged in logarithms, which
/// round.
#[test]
fn lights_twice_as_bright_make_images_twice_as_bright() {
    for (integrator, tolerance) in INTEGRATORS.into_iter().zip([0.0, 1e-3]) {
        let [one, two] = [1.0, 2.0].map(|brightness| {
            let scene = scene(same, same, brightness);
            render(&scene, integrator, 8, 1)
        });
        for (name, values) in &one.channels {
            for (a, b) in values.iter().zip(&two.channels[name]) {
                let difference = (2.0 * a - b).abs();
                assert!(
                    difference <= tolerance * b,
                    "{integrator:?} {name}: {a} {b}"
                );
            }
        }
    }
}

/// Few samples of many seeds: some paths are bright, and of a few means nobody could tell how far they spread.
const SEEDS: u64 = 24;

/// Means of what two scenes show, path traced, agree within 4 standard errors. The seeds are fixed: a green test stays green until the code
/// changes; with new ones one of the 12 comparisons would fail by chance in about one of 300 runs (Student's t, 46 degrees of freedom).
fn agree(a: &Scene, b: &Scene, exchanged: [&str; 3]) {
    let means = |scene: &Scene, first: u64| {
        let mut means = [[Welford::new(); 3]; LAYERS.len()];
        for seed in first..first + SEEDS {
            let image = render(scene, Integrator::Path, 8, seed);
            for (means, layer) in means.iter_mut().zip(LAYERS) {
                for (of_channel, channel) in means.iter_mut().zip(["R", "G", "B"]) {
                    of_channel.push(mean(&image, layer, channel));
                }
            }
        }
        means
    };
    let (of_a, of_b) = (means(a, 0), means(b, 1000));
    for (layer, (of_a, of_b)) in LAYERS.iter().zip(of_a.iter().zip(&of_b)) {
        for (channel, y) in exchanged.iter().zip(of_b) {
            let x = &of_a["RGB".find(channel).unwrap()];
            let error = x.standard_error().hypot(y.standard_error());
            assert!(
                (x.mean() - y.mean()).abs() <= 4.0 * error,
                "{layer}.{channel}: {} against {} ± {error}",
                x.mean(),
                y.mean()
            );
        }
    }
}

#[test]
fn exchanged_colours_show_exchanged_colours() {
    let a = scene(same, same, 1.0);
    let b = scene(same, |c| Vec3::new(c.z, c.y, c.x), 1.0);
    agree(&a, &b, ["B", "G", "R"]);
}

#[test]
fn a_turned_world_looks_the_same() {
    let a = scene(same, same, 1.0);
    // A quarter turn about the vertical, in which no digit is lost.
    let b = scene(|p| Vec3::new(p.z, p.y, -p.x), same, 1.0);
    agree(&a, &b, ["R", "G", "B"]);
}

/// Light that fog scatters from a lamp to a point is what it would scatter from that point to the lamp, wherever walls of denser fog stand.
#[test]
fn lamp_and_detector_may_be_exchanged() {
    let (a, b) = (Vec3::new(-0.5, 0.25, 0.0), Vec3::new(0.75, -0.25, 0.5));
    let found = |lamp: Vec3, detector: Vec3, seed: u64| {
        let text = format!(
            "Scene(lights: [Point(position: {}, intensity: (1, 1, 1))], media: [
                Medium(region: Sphere(center: (0, 0, 0), radius: 2), sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.5, 1)),
                Medium(region: Box(min: (0, -1, -1), max: (0.5, 1, 1)), sigma_t: (1, 2, 3), albedo: (0.9, 0.9, 0.2)),
            ])",
            vector(lamp)
        );
        let scene = load_str(&text, Path::new("."), &LoadOptions::default()).unwrap();
        let options = ProbeOptions {
            at: detector,
            towards: None,
            samples: 30_000,
            integrator: Integrator::Path,
            derivatives: Derivatives::Aware,
            seed,
        };
        let probe = probe(&scene, &options).unwrap();
        [probe.single, probe.multiple]
    };
    for (there, back) in found(a, b, 1).into_iter().zip(found(b, a, 2)) {
        for c in 0..3 {
            let error = there.stderr[c].hypot(back.stderr[c]);
            let (x, y) = (there.value[c], back.value[c]);
            // Of normal errors, 6 comparisons fail once in 2600 seeds; the seeds are fixed.
            assert!((x - y).abs() <= 4.0 * error + 1e-5 * x, "{x} {y} ± {error}");
            assert!(error < 0.1 * x, "{x} ± {error} tells nothing");
        }
    }
}
