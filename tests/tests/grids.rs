//! Fog from voxels looks as the fog that it stands for.
#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::Path;
use tyndall_math::stats::Welford;
use tyndall_render::image::Image;
use tyndall_render::options::{Integrator, RenderOptions};
use tyndall_scene::{LoadOptions, Scene, load_str};

const SEEDS: u64 = 6;
const SIDE: usize = 12;
/// Edge of the blocks of pixels that are compared.
const BLOCK: usize = 4;
const LAYERS: [&str; 3] = ["surface", "single", "multiple"];

/// A `.vol` file of cells of value 1 in the cube from −1 to 1.
fn constant(size: [i32; 3]) -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    for number in [1, size[0], size[1], size[2], 1] {
        bytes.extend(number.to_le_bytes());
    }
    for number in [-1.0_f32, -1.0, -1.0, 1.0, 1.0, 1.0] {
        bytes.extend(number.to_le_bytes());
    }
    let n = size.iter().product::<i32>() as usize;
    bytes.extend(std::iter::repeat_n(1.0_f32.to_le_bytes(), n).flatten());
    bytes
}

/// A cube of coloured fog under a lamp and a sky, told by its region and density.
fn scene(folder: &Path, fog: &str) -> Scene {
    let text = format!(
        "Scene(
            camera: LookAt(eye: (1.5, 0.8, 4.0), target: (0, 0, 0), vfov: 42),
            lights: [Point(position: (0.5, 1.6, 0.7), intensity: (6, 6, 6)), Sky(radiance: (0.2, 0.3, 0.4))],
            media: [Medium({fog}, sigma_t: (0.8, 1.2, 1.6), albedo: (0.9, 0.8, 0.7), phase: HenyeyGreenstein(g: 0.4))],
        )"
    );
    load_str(&text, folder, &LoadOptions::default()).unwrap()
}

fn render(scene: &Scene, seed: u64) -> Image {
    let options = RenderOptions {
        integrator: Integrator::Path,
        spp: Some(64),
        width: Some(SIDE as u32),
        height: Some(SIDE as u32),
        seed,
        ..RenderOptions::default()
    };
    tyndall_render::render(scene, &options, &()).unwrap().image
}

/// Means over blocks of pixels and colours, of each layer.
fn blocks(image: &Image) -> Vec<f64> {
    let across = SIDE / BLOCK;
    let mut sums = Vec::new();
    for layer in LAYERS {
        for block in 0..across * across {
            let [x, y] = [block % across, block / across].map(|b| b * BLOCK);
            let pixels = (0..BLOCK * BLOCK).map(|i| (y + i / BLOCK) * SIDE + x + i % BLOCK);
            let channels = ["R", "G", "B"].map(|c| &image.channels[&format!("{layer}.{c}")]);
            let sum: f64 = pixels
                .flat_map(|pixel| channels.map(|c| f64::from(c[pixel])))
                .sum();
            sums.push(sum / (3 * BLOCK * BLOCK) as f64);
        }
    }
    sums
}

fn means(scene: &Scene, first_seed: u64) -> Vec<Welford> {
    let mut means = vec![Welford::new(); LAYERS.len() * (SIDE / BLOCK).pow(2)];
    for seed in first_seed..first_seed + SEEDS {
        for (mean, block) in means.iter_mut().zip(blocks(&render(scene, seed))) {
            mean.push(block);
        }
    }
    means
}

/// Within 4 standard errors and f32 rounding in each block of each layer. The seeds are fixed: a green test stays green until the code
/// changes; with a new seed one of the 81 comparisons would fail by chance in about one of five runs (Student's t, 10 degrees of freedom).
#[test]
fn a_constant_grid_looks_like_the_homogeneous_box() {
    let folder = tempfile::tempdir().unwrap();
    let expected = scene(
        folder.path(),
        "region: Box(min: (-1, -1, -1), max: (1, 1, 1))",
    );
    let expected = means(&expected, 0);
    for (i, size) in [[1, 1, 1], [5, 9, 17], [8, 8, 8]].into_iter().enumerate() {
        fs::write(folder.path().join("fog.vol"), constant(size)).unwrap();
        let grid = scene(folder.path(), r#"density: Grid(file: "fog.vol")"#);
        let found = means(&grid, 100 * (i as u64 + 1));
        for (block, (a, b)) in found.iter().zip(&expected).enumerate() {
            let error = a.standard_error().hypot(b.standard_error());
            let difference = (a.mean() - b.mean()).abs();
            assert!(
                difference <= 4.0 * error + 1e-6 * b.mean(),
                "{size:?}, block {block}: {} against {} ± {error}",
                a.mean(),
                b.mean()
            );
        }
    }
}
