//! A scene moved far from the origin, or built a thousand times smaller or larger, looks as before.
#![allow(clippy::unwrap_used, reason = "tests")]

use serde_json::{Value, json};
use std::fs;
use tempfile::TempDir;
use tyndall_render::options::{Integrator, RenderOptions};
use tyndall_scene::LoadOptions;
use tyndall_tests::image;
use tyndall_tests::program::workspace;

/// Means of the layers of the shipped Cornell box, enlarged by `scale` and then moved by `shift` metres.
fn means(integrator: Integrator, scale: f32, shift: [f32; 3]) -> [f64; 3] {
    let folder = TempDir::new().unwrap();
    let assets = workspace().join("assets/cornell_box");
    let text = fs::read_to_string(assets.join("cornell_box.gltf")).unwrap();
    let mut gltf: Value = serde_json::from_str(&text).unwrap();
    // All nodes hang on one more that moves them.
    let roots = gltf["scenes"][0]["nodes"].clone();
    let nodes = gltf["nodes"].as_array_mut().unwrap();
    nodes.push(json!({"children": roots, "scale": [scale, scale, scale], "translation": shift}));
    let root = nodes.len() - 1;
    gltf["scenes"][0]["nodes"] = json!([root]);
    fs::write(folder.path().join("moved.gltf"), gltf.to_string()).unwrap();
    fs::copy(
        assets.join("cornell_box.bin"),
        folder.path().join("cornell_box.bin"),
    )
    .unwrap();

    let place = |p: [f32; 3]| {
        let [x, y, z] = std::array::from_fn(|i| p[i] * scale + shift[i]);
        format!("({x:?}, {y:?}, {z:?})")
    };
    let sigma = 1.5 / scale;
    let ron = format!(
        "Scene(gltf: \"moved.gltf\",
        camera: LookAt(eye: {}, target: {}, vfov: 39.3077),
        media: [Medium(region: Box(min: {}, max: {}), sigma_t: ({sigma:?}, {sigma:?}, {sigma:?}), albedo: (0.67, 0.67, 0.67))])",
        place([0.0, 0.273, 0.8]),
        place([0.0, 0.273, 0.0]),
        place([-0.4, -0.1, -0.7]),
        place([0.4, 0.65, 0.85]),
    );
    let scene = tyndall_scene::load_str(&ron, folder.path(), &LoadOptions::default()).unwrap();
    let options = RenderOptions {
        integrator,
        error: Some(0.1),
        spp: Some(32),
        width: Some(32),
        height: Some(32),
        ..RenderOptions::default()
    };
    let rendered = tyndall_render::render(&scene, &options, &()).unwrap().image;
    ["surface", "single", "multiple"].map(|layer| image::mean(&rendered, layer))
}

/// The same random numbers make the same paths but where rounding turns a decision around: means differ by far less than
/// their noise of some per cent. A light that shades itself took a third of the surface away.
fn check(integrator: Integrator, tolerance: f64) {
    let here = means(integrator, 1.0, [0.0; 3]);
    for (scale, shift) in [
        (1.0, [30.0, -20.0, 50.0]),
        (1.0, [1000.0, 3000.0, -2000.0]),
        (1e-3, [0.0; 3]),
        (1e3, [1e4, 0.0, -3e4]),
    ] {
        let there = means(integrator, scale, shift);
        for (a, b) in here.iter().zip(there) {
            assert!(
                (b / a - 1.0).abs() < tolerance,
                "{integrator:?}, scale {scale}, moved by {shift:?}: {there:?} instead of {here:?}"
            );
        }
    }
}

#[test]
fn the_path_tracer_sees_the_same_box_wherever_it_stands() {
    check(Integrator::Path, 0.02);
}

#[test]
fn the_cache_sees_the_same_box_wherever_it_stands() {
    check(Integrator::Cache, 0.02);
}
