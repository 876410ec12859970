//! Golden images: one test for each shipped scene and integrator, at thumbnail size with fixed samples and seed.
//!
//! `cargo xtask golden` runs them, `cargo xtask golden --bless` replaces the images in `tests/golden`. What is compared,
//! and how closely, stands in `tyndall_tests::golden`.

use anyhow::{Context, Result};
use glam::Vec3;
use libtest_mimic::{Arguments, Failed, Trial};
use std::env;
use tyndall_render::options::{Integrator, RenderOptions};
use tyndall_scene::LoadOptions;
use tyndall_tests::golden::Goldens;
use tyndall_tests::image::Image;
use tyndall_tests::program::workspace;

/// Shipped scenes: folder, name and the size of the thumbnail.
const SCENES: [(&str, &str, [u32; 2]); 8] = [
    ("cornell_box", "cornell_box", [32, 32]),
    ("cornell_box", "cornell_box_forward", [32, 32]),
    ("cornell_box", "cornell_box_backward", [32, 32]),
    ("lamp", "lamp", [32, 24]),
    ("hall", "hall", [40, 30]),
    ("street", "street", [40, 30]),
    ("smoke", "smoke", [32, 32]),
    ("cloud", "cloud", [40, 25]),
];

/// The integrators and their samples per pixel, which keep every golden under a few seconds.
const INTEGRATORS: [(Integrator, u32); 2] = [(Integrator::Cache, 4), (Integrator::Path, 16)];

fn main() {
    let mut trials = Vec::new();
    for (folder, scene, size) in SCENES {
        for (integrator, spp) in INTEGRATORS {
            let name = format!("{scene}_{}", integrator.name());
            let options = RenderOptions {
                integrator,
                // Few and cheap records: a golden guards the picture, not its quality.
                error: Some(0.2),
                spp: Some(spp),
                width: Some(size[0]),
                height: Some(size[1]),
                seed: 1,
                ..RenderOptions::default()
            };
            trials.push(Trial::test(name.clone(), move || {
                check(&name, (folder, scene), &options)
                    .map_err(|error| Failed::from(format!("{error:#}")))
            }));
        }
    }
    libtest_mimic::run(&Arguments::from_args(), trials).exit();
}

fn check(name: &str, (folder, scene): (&str, &str), options: &RenderOptions) -> Result<()> {
    let goldens = Goldens {
        references: workspace().join("tests/golden"),
        failures: workspace().join("target/golden-failures"),
        bless: env::var_os("TYNDALL_BLESS").is_some(),
    };
    let path = workspace().join(format!("assets/{folder}/{scene}.ron"));
    let scene = tyndall_scene::load(&path, &LoadOptions::default())?;
    let image = tyndall_render::render(&scene, options, &())?.image;
    let beauty = image.layer("beauty").context("an image without beauty")?;
    let [r, g, b] = beauty[..]
        .try_into()
        .context("beauty without three channels")?;
    let pixels = r
        .iter()
        .zip(g)
        .zip(b)
        .map(|((&r, &g), &b)| Vec3::new(r, g, b));
    goldens.check(
        name,
        &Image {
            size: [image.width, image.height],
            pixels: pixels.collect(),
        },
    )
}
