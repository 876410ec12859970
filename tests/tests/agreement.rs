//! Both integrators make the same image: layer by layer, records against the unbiased path tracer.
#![allow(clippy::unwrap_used, reason = "tests")]
#![allow(
    clippy::print_stdout,
    reason = "a failure is easier to read beside the other figures"
)]

use tyndall_math::stats::Welford;
use tyndall_render::options::{Integrator, RenderOptions};
use tyndall_scene::LoadOptions;
use tyndall_tests::image;
use tyndall_tests::program::workspace;

const SEEDS: u64 = 6;
/// Bias that interpolation may leave in a layer.
const BIAS: f64 = 0.01;

/// Means of one layer over the image, one for each seed.
fn means(
    scene: &tyndall_scene::Scene,
    integrator: Integrator,
    spp: u32,
    layers: &[&str],
) -> Vec<Welford> {
    let mut means = vec![Welford::new(); layers.len()];
    for seed in 0..SEEDS {
        let options = RenderOptions {
            integrator,
            // Fewer rays a record than the scenes ask for; their noise is part of the standard error.
            error: Some(0.05),
            spp: Some(spp),
            width: Some(32),
            height: Some(32),
            seed,
            ..RenderOptions::default()
        };
        let outcome = tyndall_render::render(scene, &options, &()).unwrap();
        for (mean, layer) in means.iter_mut().zip(layers) {
            mean.push(image::mean(&outcome.image, layer));
        }
    }
    means
}

/// Compares the layers of `name`: within 4 standard errors beside the bias budget. The seeds are fixed: a green test stays
/// green until the code changes; a new seed would fail by chance in fewer than 1 of 100 runs (Student's t).
fn check(name: &str, layers: &[&str], spp: [u32; 2]) {
    let path = workspace()
        .join("assets")
        .join(name)
        .join(format!("{name}.ron"));
    let scene = tyndall_scene::load(&path, &LoadOptions::default()).unwrap();
    let cached = means(&scene, Integrator::Cache, spp[0], layers);
    let traced = means(&scene, Integrator::Path, spp[1], layers);
    for ((layer, a), b) in layers.iter().zip(&cached).zip(&traced) {
        let error = a.standard_error().hypot(b.standard_error());
        let difference = a.mean() - b.mean();
        println!(
            "{name} {layer}: {:.5} against {:.5}, {:+.2} % ± {:.2} %",
            a.mean(),
            b.mean(),
            100.0 * difference / b.mean(),
            100.0 * error / b.mean()
        );
        assert!(
            difference.abs() < 4.0 * error + BIAS * b.mean(),
            "{name} {layer}: {} against {} ± {error}",
            a.mean(),
            b.mean()
        );
    }
}

#[test]
fn records_and_paths_agree_on_the_cornell_box() {
    check("cornell_box", &["surface", "single", "multiple"], [16, 64]);
}

#[test]
fn records_and_paths_agree_on_a_lamp_in_endless_fog() {
    check("lamp", &["single", "multiple"], [16, 128]);
}
