//! Media whose density is a grid: where the scene file places it, and what it says when it cannot.

#![allow(clippy::unwrap_used, reason = "tests")]

use glam::Vec3;
use std::fs;
use std::path::Path;
use std::sync::Arc;
use tyndall_math::Ray;
use tyndall_media::Density;
use tyndall_scene::{LoadOptions, Scene, SceneError, Warning, load_str};

/// A `.vol` file of cells in the box from −1 to 1, with `value` of the cell's number.
fn vol(size: [i32; 3], value: impl Fn(usize) -> f32) -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    for number in [1, size[0], size[1], size[2], 1] {
        bytes.extend(number.to_le_bytes());
    }
    for number in [-1.0_f32, -1.0, -1.0, 1.0, 1.0, 1.0] {
        bytes.extend(number.to_le_bytes());
    }
    let n = size.iter().product::<i32>() as usize;
    bytes.extend((0..n).flat_map(|i| value(i).to_le_bytes()));
    bytes
}

/// A folder with a constant, a negative, an empty and a broken volume, and one outside of it.
fn folder() -> tempfile::TempDir {
    let dir = tempfile::tempdir().unwrap();
    let scene = dir.path().join("scene");
    fs::create_dir(&scene).unwrap();
    fs::write(scene.join("two.vol"), vol([2, 2, 2], |_| 2.0)).unwrap();
    let negative = vol([2, 2, 2], |i| if i < 3 { -1.0 } else { 1.0 });
    fs::write(scene.join("negative.vol"), negative).unwrap();
    fs::write(scene.join("zero.vol"), vol([1, 1, 1], |_| 0.0)).unwrap();
    fs::write(scene.join("nan.vol"), vol([1, 1, 1], |_| f32::NAN)).unwrap();
    fs::write(scene.join("cut.vol"), &vol([2, 2, 2], |_| 2.0)[..60]).unwrap();
    fs::write(scene.join("large.vol"), vol([64, 64, 64], |i| i as f32)).unwrap();
    fs::write(dir.path().join("outside.vol"), vol([1, 1, 1], |_| 1.0)).unwrap();
    dir
}

const CAMERA: &str = "camera: LookAt(eye: (0, 0, 9), target: (0, 0, 0), vfov: 40), lights: [Sky(radiance: (1, 1, 1))]";

fn load_media(dir: &Path, media: &str, options: &LoadOptions) -> Result<Scene, SceneError> {
    let text = format!("Scene({CAMERA}, media: [{media}])");
    load_str(&text, &dir.join("scene"), options)
}

/// A medium with a density, and more fields.
fn medium(density: &str, more: &str) -> String {
    format!("Medium(sigma_t: (1, 2, 3), albedo: (0.9, 0.9, 0.9), density: {density}, {more})")
}

fn load(media: &str) -> Result<Scene, String> {
    let dir = folder();
    load_media(dir.path(), media, &LoadOptions::default()).map_err(|error| error.to_string())
}

#[test]
fn grids_are_scaled_and_placed() {
    let across = |density: &str, more: &str, origin: Vec3, direction: Vec3| {
        let scene = load(&medium(density, more)).unwrap();
        scene
            .media
            .optical_depth(&Ray::new(origin, direction), f32::INFINITY)
    };
    // Columns of 2 m × 2.
    let plain = across(r#"Grid(file: "two.vol")"#, "", Vec3::X * -9.0, Vec3::X);
    assert!(
        plain.abs_diff_eq(4.0 * Vec3::new(1.0, 2.0, 3.0), 1e-5),
        "{plain}"
    );
    let scaled = r#"Grid(file: "two.vol", grid: "density", scale: 0.25)"#;
    let scaled = across(scaled, "", Vec3::X * -9.0, Vec3::X);
    assert!(
        scaled.abs_diff_eq(Vec3::new(1.0, 2.0, 3.0), 1e-6),
        "{scaled}"
    );
    // Three times as wide, moved up by 10, and mirrored.
    let placed =
        r#"Grid(file: "two.vol", transform: [-3, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 10, 0, 1])"#;
    let high = across(placed, "", Vec3::new(-9.0, 10.0, 0.0), Vec3::X);
    assert!((high.x - 12.0).abs() < 1e-5, "{high}");
    assert_eq!(across(placed, "", Vec3::X * -9.0, Vec3::X), Vec3::ZERO);
    // Cut by a region.
    let half = "region: Box(min: (0, -5, -5), max: (5, 5, 5))";
    let half = across(r#"Grid(file: "two.vol")"#, half, Vec3::X * -9.0, Vec3::X);
    assert!((half.x - 2.0).abs() < 1e-5, "{half}");
}

#[test]
fn scenes_with_grids_have_bounds_a_summary_and_files() {
    let scene = load(&medium(r#"Grid(file: "two.vol")"#, "")).unwrap();
    assert!(scene.bounds.min.abs_diff_eq(Vec3::NEG_ONE, 1e-6));
    assert!(scene.bounds.max.abs_diff_eq(Vec3::ONE, 1e-6));
    assert_eq!(scene.summary(), "media: 1 grid; phase: isotropic");
    assert!(scene.files.iter().any(|file| file.ends_with("two.vol")));
    assert!(scene.warnings.is_empty(), "{:?}", scene.warnings);
    let vacuum = load(&medium(r#"Grid(file: "zero.vol")"#, "")).unwrap();
    assert!(vacuum.media.is_empty() && vacuum.bounds.is_empty());
}

#[test]
fn media_of_one_file_share_its_voxels() {
    let grid = r#"Grid(file: "two.vol", scale: 0.5)"#;
    let scene = load(&[medium(grid, ""), medium(grid, "emission: (1, 0, 0)")].join(", ")).unwrap();
    let [Density::Grid(a), Density::Grid(b)] = [0, 1].map(|i| scene.media.list()[i].density())
    else {
        panic!("two grids");
    };
    assert!(Arc::ptr_eq(a.voxels(), b.voxels()));
    assert_eq!(scene.files.len(), 2);
}

#[test]
fn negative_voxels_and_grids_outside_their_region_are_warned_of() {
    let scene = load(&medium(r#"Grid(file: "negative.vol")"#, "")).unwrap();
    let [Warning::NegativeVoxels { grid, count: 3, .. }] = scene.warnings.as_slice() else {
        panic!("{:?}", scene.warnings);
    };
    assert_eq!(grid, "density");
    let away = "name: \"smoke\", region: Sphere(center: (9, 0, 0), radius: 1)";
    let scene = load(&medium(r#"Grid(file: "two.vol")"#, away)).unwrap();
    let expected = Warning::GridOutsideRegion {
        medium: "smoke".into(),
    };
    assert_eq!(scene.warnings, [expected]);
}

#[test]
fn what_is_wrong_with_a_grid_is_said_with_its_place_and_file() {
    for (grid, says) in [
        (r#"Grid(file: "none.vdb")"#, "cannot read \"none.vdb\""),
        (r#"Grid(file: "../outside.vol")"#, "--allow-external"),
        (r#"Grid(file: "cut.vol")"#, "cut off"),
        (
            r#"Grid(file: "nan.vol")"#,
            "1 non-finite voxels, the first at (0, 0, 0)",
        ),
        (
            r#"Grid(file: "two.vol", grid: "smoke")"#,
            "the file holds \"density\"",
        ),
        (
            r#"Grid(file: "two.vol", transform: [1, 0, 0, 0, 1, 1e-9, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1])"#,
            "flattens space",
        ),
        (
            r#"Grid(file: "two.vol", scale: 1e10)"#,
            "at the medium's density too",
        ),
    ] {
        let message = load(&medium(grid, "")).map(|_| ()).unwrap_err();
        assert!(message.contains(says), "{message}");
        assert!(
            message.contains("media[0]") && message.contains("scene.ron:1:"),
            "{message}"
        );
    }
    let dir = folder();
    let external = LoadOptions {
        allow_external: true,
        ..LoadOptions::default()
    };
    let outside = medium(r#"Grid(file: "../outside.vol")"#, "");
    assert!(load_media(dir.path(), &outside, &external).is_ok());
    let frugal = LoadOptions {
        max_grid_bytes: Some(500_000),
        ..LoadOptions::default()
    };
    let large = medium(r#"Grid(file: "large.vol")"#, "");
    let message = load_media(dir.path(), &large, &frugal)
        .map(|_| ())
        .unwrap_err()
        .to_string();
    assert!(
        message.contains("more than the limit of 0.5 MiB; --max-grid-memory"),
        "{message}"
    );
    assert!(load_media(dir.path(), &large, &LoadOptions::default()).is_ok());
}
