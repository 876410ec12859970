//! The white furnace, end to end: a medium that absorbs nothing under a sky of radiance 1 cannot be seen.
#![allow(clippy::unwrap_used, reason = "tests")]
#![allow(
    clippy::print_stdout,
    reason = "a failure is easier to read beside the other figures"
)]

use std::path::Path;
use tyndall_math::stats::Welford;
use tyndall_render::options::{Integrator, RenderOptions};
use tyndall_scene::LoadOptions;
use tyndall_tests::image;

const FURNACE: &str = "Scene(
    camera: LookAt(eye: (0.0, 0.0, 3.0), target: (0.0, 0.0, 0.0), vfov: 30.0),
    film: Film(width: 24, height: 24),
    lights: [Sky(radiance: (1.0, 1.0, 1.0))],
    media: [Medium(region: Sphere(center: (0.0, 0.0, 0.0), radius: 1.0), sigma_t: (0.5, 1.5, 3.0), albedo: (1.0, 1.0, 1.0))],
)";

/// Mean of the image for each of several seeds: independent renders, so their spread gives the standard error.
fn furnace(integrator: Integrator, spp: u32) -> Welford {
    let scene = tyndall_scene::load_str(FURNACE, Path::new("."), &LoadOptions::default()).unwrap();
    let mut means = Welford::new();
    for seed in 0..10 {
        let options = RenderOptions {
            integrator,
            spp: Some(spp),
            seed,
            ..RenderOptions::default()
        };
        let outcome = tyndall_render::render(&scene, &options, &()).unwrap();
        means.push(image::mean(&outcome.image, ""));
    }
    means
}

/// Four standard errors: with ten seeds the false-alarm rate (Student's t, 9 degrees of freedom) is 3e-3; the seeds
/// are fixed, so a passing test stays green until the code changes.
fn check(integrator: Integrator, spp: u32) {
    let means = furnace(integrator, spp);
    let (mean, error) = (means.mean(), means.standard_error());
    println!("{integrator:?}: {mean} ± {error}");
    assert!(error < 0.003, "{integrator:?}: standard error {error}");
    assert!(
        (mean - 1.0).abs() < 4.0 * error,
        "{integrator:?}: {mean} ± {error}"
    );
}

#[test]
fn the_path_tracer_sees_nothing_in_a_white_furnace() {
    check(Integrator::Path, 32);
}

#[test]
fn the_cache_sees_nothing_in_a_white_furnace() {
    check(Integrator::Cache, 16);
}
