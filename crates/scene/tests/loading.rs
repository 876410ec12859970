//! From files to scenes: what is put together, and what is warned of.

#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::Vec3;
use serde_json::{Value, json};
use std::path::Path;
use tyndall_media::PhaseFunction;
use tyndall_scene::{Camera, Fog, LoadOptions, Scene, SceneError, Warning, load, load_str};

fn scene(text: &str) -> Scene {
    load_str(text, Path::new("."), &LoadOptions::default())
        .unwrap_or_else(|error| panic!("{text}\n{error}"))
}

/// A camera for scenes with nothing to frame.
const CAMERA: &str = "camera: LookAt(eye: (0, 1, 5), target: (0, 1, 0), vfov: 40)";

/// A unit square from (0, 0, 0) to (1, 1, 0), seen by the cameras "front" and "side".
const SQUARE: &str = r#"{
    "asset": {"version": "2.0"}, "scene": 0, "scenes": [{"nodes": [0, 1, 2]}],
    "nodes": [
        {"mesh": 0},
        {"name": "front", "camera": 0, "translation": [0.5, 0.5, 3]},
        {"name": "side", "camera": 0, "translation": [4, 0.5, 0], "rotation": [0, 0.7071068, 0, 0.7071068]}
    ],
    "cameras": [{"type": "perspective", "perspective": {"yfov": 0.5, "znear": 0.1}}],
    "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1}]}],
    "accessors": [
        {"bufferView": 0, "componentType": 5126, "count": 4, "type": "VEC3", "min": [0, 0, 0], "max": [1, 1, 0]},
        {"bufferView": 1, "componentType": 5123, "count": 6, "type": "SCALAR"}
    ],
    "bufferViews": [{"buffer": 0, "byteLength": 48}, {"buffer": 0, "byteOffset": 48, "byteLength": 12}],
    "buffers": [{"byteLength": 60, "uri": "data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAACAPwAAgD8AAAAAAAAAAAAAgD8AAAAAAAABAAIAAAACAAMA"}]
}"#;

/// A folder with a difficult name that holds `square.gltf`.
fn folder() -> (tempfile::TempDir, std::path::PathBuf) {
    let dir = tempfile::tempdir().unwrap();
    let folder = dir.path().join("a folder, ünïcode 🌫");
    std::fs::create_dir(&folder).unwrap();
    std::fs::write(folder.join("square.gltf"), SQUARE).unwrap();
    (dir, folder)
}

fn fog(sigma_t: f32) -> LoadOptions {
    LoadOptions {
        fog: Some(Fog::new(sigma_t)),
        ..Default::default()
    }
}

#[test]
fn lamps_in_fog_need_no_gltf() {
    let scene = scene(&format!(
        "Scene({CAMERA}, lights: [Point(position: (0, 1, 0), intensity: (1, 2, 3))],
            media: [Medium(sigma_t: (0.1, 0.2, 0.3), albedo: (0.9, 0.9, 0.9), emission: (1, 0, 0)), Medium(
                name: \"mist\", sigma_t: (1, 1, 1), albedo: (1, 1, 1), density: Height(), phase: HenyeyGreenstein(g: 0.5))],
            render: Render(error: 0.1, max_depth: 3, exposure: -1))"
    ));
    let world = scene.world();
    assert_eq!(world.lights.list().len(), 1);
    assert_eq!(scene.geometry.len(), 0);
    assert!(scene.bounds.is_empty());
    let [first, second] = world.media.list() else {
        panic!("{:?}", world.media);
    };
    assert_eq!((first.name(), second.name()), ("medium1", "mist"));
    assert_eq!(first.emission(), Vec3::X);
    assert_eq!(scene.settings.max_depth, Some(3));
    assert_eq!((scene.settings.error, scene.settings.exposure), (0.1, -1.0));
    assert_eq!((scene.film.width, scene.film.height), (1024, 768));
    assert_eq!(scene.warnings, []);
    assert_eq!(
        scene.summary(),
        "media: 1 homogeneous, 1 height; phase: isotropic and Henyey-Greenstein"
    );
}

#[test]
fn phase_functions_of_a_scene_file_are_those_of_the_media() {
    let hg = |g| PhaseFunction::henyey_greenstein(g).unwrap();
    let mixture = |parts: &[_]| PhaseFunction::mixture(parts).unwrap();
    for (written, expected) in [
        ("Isotropic", PhaseFunction::Isotropic),
        ("HenyeyGreenstein(g: -0.4)", hg(-0.4)),
        ("Rayleigh", PhaseFunction::Rayleigh),
        (
            "Mixture([(0.8, HenyeyGreenstein(g: 0.8)), (0.2, Isotropic)])",
            mixture(&[(0.8, hg(0.8)), (0.2, PhaseFunction::Isotropic)]),
        ),
        (
            "Mixture([(0.5, Rayleigh), (0.5, Mixture([(0.5, Rayleigh), (0.5, HenyeyGreenstein(g: 0.9))]))])",
            mixture(&[(0.75, PhaseFunction::Rayleigh), (0.25, hg(0.9))]),
        ),
        (
            "Mixture([(1, Rayleigh), (0, HenyeyGreenstein())])",
            PhaseFunction::Rayleigh,
        ),
    ] {
        let scene = scene(&format!(
            "Scene({CAMERA}, media: [Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), phase: {written})])"
        ));
        assert_eq!(scene.media.list()[0].phase(), &expected, "{written}");
    }
}

#[test]
fn the_summary_names_kinds_of_media_and_phase_functions() {
    for (media, summary) in [
        ("", "media: none"),
        (
            "Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1))",
            "media: 1 homogeneous; phase: isotropic",
        ),
        (
            "Medium(sigma_t: (1, 1, 1), albedo: (0, 0, 0))",
            "media: 1 homogeneous; phase: none",
        ),
        (
            "Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), density: Height(), phase: HenyeyGreenstein())",
            "media: 1 height; phase: Henyey-Greenstein",
        ),
        (
            "Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), phase: HenyeyGreenstein(g: 0))",
            "media: 1 homogeneous; phase: isotropic",
        ),
        (
            "Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), phase: Rayleigh)",
            "media: 1 homogeneous; phase: Rayleigh",
        ),
        (
            "Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), phase: Mixture([(0.9, HenyeyGreenstein()), (0.1, Rayleigh)])),
             Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1)),
             Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), phase: Rayleigh),
             Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), phase: Mixture([(1, HenyeyGreenstein())]))",
            "media: 4 homogeneous; phase: isotropic, Henyey-Greenstein, Rayleigh and mixture",
        ),
    ] {
        assert_eq!(
            scene(&format!("Scene({CAMERA}, media: [{media}])")).summary(),
            summary
        );
    }
}

#[test]
fn lights_that_cannot_arrive_and_scenes_without_light_are_warned_of() {
    const EVERYWHERE: &str = "Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1))";
    const HEIGHT: &str = "Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), density: Height())";
    const BALL: &str = "Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), region: Sphere(center: (0, 0, 0), radius: 9))";
    const CLEAR: &str = "Medium(sigma_t: (0, 0, 0), albedo: (1, 1, 1))";
    const GLOW: &str = "Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), emission: (1, 1, 1))";
    const DOWN: &str = "Directional(direction: (0.1, -1, 0), irradiance: (1, 1, 1))";
    const UP: &str = "Directional(direction: (0, 1, 0), irradiance: (1, 1, 1))";
    const SKY: &str = "Sky(radiance: (1, 1, 1))";
    const LAMP: &str = "Point(position: (0, 0, 0), intensity: (1, 1, 1))";
    let nothing_arrives = |kind: &str| Warning::NothingArrives {
        light: format!("the {kind} light"),
        medium: "medium1".into(),
    };
    let dark = |light: &str| Warning::DarkLight {
        light: light.into(),
    };
    for (light, medium, expected) in [
        (DOWN, EVERYWHERE, vec![nothing_arrives("directional")]),
        (SKY, EVERYWHERE, vec![nothing_arrives("sky")]),
        (LAMP, EVERYWHERE, vec![]),
        (DOWN, HEIGHT, vec![]),
        (UP, HEIGHT, vec![nothing_arrives("directional")]),
        (SKY, HEIGHT, vec![]),
        (DOWN, BALL, vec![]),
        (SKY, BALL, vec![]),
        (SKY, CLEAR, vec![]),
        ("", EVERYWHERE, vec![Warning::NoLights]),
        ("", GLOW, vec![]),
        (
            "Sky(radiance: (0, 0, 0))",
            BALL,
            vec![dark("the sky light lights[0]"), Warning::NoLights],
        ),
    ] {
        let scene = scene(&format!(
            "Scene({CAMERA}, lights: [{light}], media: [{medium}])"
        ));
        assert_eq!(scene.warnings, expected, "{light} {medium}");
    }
}

#[test]
fn a_gltf_beside_the_scene_file_gives_surfaces_and_cameras() {
    let (_dir, folder) = folder();
    let path = folder.join("scène.ron");
    let load_with = |camera: &str| {
        std::fs::write(&path, format!("Scene(gltf: \"square.gltf\", {camera})")).unwrap();
        load(&path, &LoadOptions::default())
    };
    let scene = load_with("").unwrap();
    assert_eq!(scene.geometry.len(), 2);
    assert_eq!(
        (scene.bounds.min, scene.bounds.max),
        (Vec3::ZERO, Vec3::new(1.0, 1.0, 0.0))
    );
    assert_eq!(scene.camera.eye(), Vec3::new(0.5, 0.5, 3.0));
    assert!((scene.camera.yfov() - 0.5).abs() < 1e-6);
    let side = load_with("camera: Gltf(\"side\")").unwrap().camera;
    // The quaternion has seven digits.
    assert!((side.forward() - Vec3::NEG_X).length() < 1e-6);
    let error = load_with("camera: Gltf(\"back\")").unwrap_err().to_string();
    assert!(
        error.starts_with(
            "the glTF file has no camera \"back\"; its cameras are \"front\", \"side\" (at `camera`, line 1, column 36, "
        ),
        "{error}"
    );
}

#[test]
fn a_path_moves_the_camera_and_a_still_camera_is_the_same_at_every_frame() {
    let still = scene(&format!("Scene({CAMERA})"));
    assert_eq!(still.frames(), None);
    for frame in [0.0, 12.5, 1e9, f32::NAN] {
        assert_eq!(still.camera_at(frame), Ok(still.camera));
    }
    let moving = scene(
        "Scene(camera: Path([
            Key(frame: 2, eye: (0, 1, 5), target: (0, 1, 0), vfov: 40),
            Key(frame: 10, eye: (8, 1, 5), target: (8, 1, 0), vfov: 40)]))",
    );
    assert_eq!(moving.frames(), Some(2..=10));
    assert_eq!(
        moving.camera, still.camera,
        "frame 0 stands at the first key"
    );
    let eye = moving.camera_at(3.0).unwrap().eye();
    // Rounding of f32 coordinates below 8.
    assert!((eye - Vec3::new(1.0, 1.0, 5.0)).length() < 1e-6, "{eye}");
}

/// The square whose camera "front" stands at x = 0, 1 and 2 m from frames 0, 1 and 3 of 24 a second on.
fn animated_square() -> String {
    let times = [0.0f32, 1.0 / 24.0, 3.0 / 24.0];
    let places = [0.0, 0.0, 3.0, 1.0, 0.0, 3.0, 2.0, 0.0, 3.0];
    let bytes: Vec<u8> = times
        .into_iter()
        .chain(places)
        .flat_map(f32::to_le_bytes)
        .collect();
    let uri = format!("data:;base64,{}", STANDARD.encode(&bytes));
    let mut file: Value = serde_json::from_str(SQUARE).unwrap();
    let mut add = |key: &str, value: Value| file[key].as_array_mut().unwrap().push(value);
    add("buffers", json!({"byteLength": 48, "uri": uri}));
    add("bufferViews", json!({"buffer": 1, "byteLength": 48}));
    let float = 5126;
    add(
        "accessors",
        json!({"bufferView": 2, "componentType": float, "count": 3, "type": "SCALAR"}),
    );
    add(
        "accessors",
        json!({"bufferView": 2, "byteOffset": 12, "componentType": float, "count": 3, "type": "VEC3"}),
    );
    file["animations"] = json!([{
        "channels": [{"sampler": 0, "target": {"node": 1, "path": "translation"}}],
        "samplers": [{"input": 2, "output": 3, "interpolation": "STEP"}],
    }]);
    file.to_string()
}

#[test]
fn an_animated_gltf_camera_moves_at_the_films_frame_rate() {
    let dir = tempfile::tempdir().unwrap();
    std::fs::write(dir.path().join("a.gltf"), animated_square()).unwrap();
    let load_with = |fields: &str| {
        let text = format!("Scene(gltf: \"a.gltf\", {fields})");
        load_str(&text, dir.path(), &LoadOptions::default()).unwrap()
    };
    let x = |scene: &Scene, frame: f32| scene.camera_at(frame).unwrap().eye().x;
    for (fields, frames) in [
        ("", [0.0, 1.0, 3.0]),
        ("camera: Gltf(\"front\")", [0.0, 1.0, 3.0]),
        ("film: Film(fps: 24)", [0.0, 1.0, 3.0]),
        ("film: Film(fps: 48)", [0.0, 2.0, 6.0]),
        ("film: Film(fps: 240, width: 8)", [0.0, 10.0, 30.0]),
    ] {
        let scene = load_with(fields);
        assert_eq!(scene.frames(), Some(0..=frames[2] as u32), "{fields}");
        assert_eq!(scene.camera.eye().x, 0.0);
        // A step is taken at its own frame, and not a rounding of its time later.
        for (i, frame) in frames.into_iter().enumerate() {
            assert_eq!(x(&scene, frame), i as f32, "{fields}");
            assert_eq!(x(&scene, frame + 0.5), i as f32, "{fields}");
        }
        let length = scene.motion.as_ref().unwrap().length();
        assert!((length - 2.0).abs() < 1e-6, "{length}");
        assert!((scene.camera.yfov() - 0.5).abs() < 1e-6);
    }
    for still in [CAMERA, "camera: Gltf(\"side\")"] {
        assert_eq!(load_with(still).frames(), None, "{still}");
    }
    let bare = load(&dir.path().join("a.gltf"), &fog(0.25)).unwrap();
    assert_eq!(bare.frames(), Some(0..=3));
}

#[test]
fn a_bare_gltf_with_fog_is_a_scene() {
    let (_dir, folder) = folder();
    let scene = load(&folder.join("square.gltf"), &fog(0.25)).unwrap();
    let [medium] = scene.media.list() else {
        panic!("{:?}", scene.media);
    };
    assert_eq!(medium.sigma_t(), Vec3::splat(0.25));
    assert_eq!(medium.albedo(), Vec3::splat(0.95));
    assert_eq!(scene.summary(), "media: 1 homogeneous; phase: isotropic");
    // 1 % on each axis, of the diagonal on the flat one; f32 rounding.
    let size = scene.bounds.max - scene.bounds.min;
    let expected = Vec3::new(1.01, 1.01, 0.01 * 2.0_f32.sqrt());
    assert!((size - expected).length() < 1e-6, "{size}");
    assert!(scene.warnings.contains(&Warning::NoLights));
}

#[test]
fn fog_is_added_to_a_scene_file_too_where_it_has_bounds() {
    let ball = format!(
        "Scene({CAMERA}, media: [Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), region: Sphere(center: (0, 0, 0), radius: 1))])"
    );
    let scene = load_str(&ball, Path::new("."), &fog(0.5)).unwrap();
    assert_eq!(scene.media.list().len(), 2);
    assert!((scene.bounds.max - Vec3::splat(1.01)).length() < 1e-6);
    let message = |text: &str, fog: Fog| {
        let options = LoadOptions {
            fog: Some(fog),
            ..Default::default()
        };
        load_str(text, Path::new("."), &options)
            .unwrap_err()
            .to_string()
    };
    let boundless = message(&format!("Scene({CAMERA})"), Fog::new(0.5));
    assert!(
        boundless.starts_with("--fog fills the scene's bounding box"),
        "{boundless}"
    );
    for (bad, what) in [
        (
            Fog {
                sigma_t: -1.0,
                ..Fog::new(1.0)
            },
            "sigma_t",
        ),
        (
            Fog {
                sigma_t: f32::NAN,
                ..Fog::new(1.0)
            },
            "sigma_t",
        ),
        (
            Fog {
                albedo: 1.5,
                ..Fog::new(1.0)
            },
            "albedo",
        ),
        (
            Fog {
                g: 1.0,
                ..Fog::new(1.0)
            },
            "strictly between -1 and 1",
        ),
    ] {
        let message = message(&ball, bad);
        assert!(
            message.starts_with("--fog: ") && message.contains(what),
            "{message}"
        );
    }
}

#[test]
fn a_scene_without_camera_is_framed_and_one_without_bounds_is_an_error() {
    let framed = scene(
        "Scene(media: [Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1), region: Box(min: (0, 0, 0), max: (1, 2, 3)))],
            film: Film(width: 300, height: 100))",
    );
    assert_eq!(framed.camera, Camera::framing(&framed.bounds, 3.0).unwrap());
    let boundless = "Scene(media: [Medium(sigma_t: (1, 1, 1), albedo: (1, 1, 1))])";
    let error = load_str(boundless, Path::new("."), &LoadOptions::default()).unwrap_err();
    assert!(matches!(error, SceneError::NoCamera { .. }), "{error}");
}

#[test]
fn the_size_asked_for_replaces_the_scenes_and_is_checked() {
    let load_sized = |width, height| {
        let options = LoadOptions {
            width,
            height,
            ..Default::default()
        };
        load_str(
            &format!("Scene({CAMERA}, film: Film(width: 40, height: 30))"),
            Path::new("."),
            &options,
        )
        .map(|scene| (scene.film.width, scene.film.height))
    };
    assert_eq!(load_sized(None, None).unwrap(), (40, 30));
    assert_eq!(load_sized(Some(8), None).unwrap(), (8, 30));
    assert_eq!(load_sized(Some(8), Some(9)).unwrap(), (8, 9));
    for (width, height) in [
        (Some(0), None),
        (Some(65537), None),
        (Some(65536), Some(65536)),
    ] {
        let error = load_sized(width, height).unwrap_err().to_string();
        assert!(error.contains("each side has 1 to 65536 pixels"), "{error}");
    }
}

#[test]
fn an_environment_image_lights_the_scene() {
    let dir = tempfile::tempdir().unwrap();
    // Radiance HDR, 2 x 1 texels of (1, 0.5, 0.25): mantissa / 256 times 2^(exponent - 128).
    let mut image = b"#?RADIANCE\nFORMAT=32-bit_rle_rgbe\n\n-Y 1 +X 2\n".to_vec();
    image.extend([128, 64, 32, 129, 128, 64, 32, 129]);
    std::fs::write(dir.path().join("sky.hdr"), image).unwrap();
    let text = format!("Scene({CAMERA}, lights: [Environment(file: \"sky.hdr\", scale: 2)])");
    let scene = load_str(&text, dir.path(), &LoadOptions::default()).unwrap();
    let world = scene.world();
    use tyndall_transport::Lights;
    let radiance = world
        .lights
        .environment_radiance(world.lights.environment()[0], Vec3::Y);
    // Eight-bit mantissas are exact here; interpolation rounds.
    assert!(
        (radiance - Vec3::new(2.0, 1.0, 0.5)).length() < 1e-5,
        "{radiance}"
    );
}

#[test]
fn the_shared_scenes_load() {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets/scenes");
    for name in [
        "cornell_bevy/CornellBox.glb",
        "milk_truck/CesiumMilkTruck.glb",
    ] {
        let path = assets.join(name);
        if path.is_file() {
            let scene = load(&path, &fog(1e-3)).unwrap_or_else(|error| panic!("{error}"));
            assert!(
                !scene.geometry.is_empty() && scene.bounds.diagonal() > 0.0,
                "{name}"
            );
        }
    }
}
