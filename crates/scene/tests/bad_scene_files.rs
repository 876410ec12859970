//! Scene files that are wrong: each message says what, where, what is allowed, and ends in the place.
//!
//! The messages themselves are kept in a snapshot; `INSTA_UPDATE=always` writes it anew, for reading before it is committed.

#![allow(clippy::unwrap_used, reason = "a failing test panics")]

use std::fmt::Write;
use std::path::Path;
use tyndall_scene::scene_file::{Fault, MAX_BYTES, SceneFileError, parse};
use tyndall_scene::{LoadOptions, SceneError, load, load_str};

/// The message for a scene file, without the folder in front of its name.
fn message(text: &str) -> String {
    let folder = Path::new("folder");
    let error = load_str(text, folder, &LoadOptions::default()).unwrap_err();
    let message = error.to_string();
    let name = folder.join("scene.ron").display().to_string();
    assert!(message.contains(&name), "{message}");
    assert!(!message.contains('\n'), "{message}");
    message.replace(&name, "scene.ron")
}

fn fault(text: &str) -> Box<SceneFileError> {
    parse(text.as_bytes(), Path::new("scene.ron")).unwrap_err()
}

/// Writes a medium's further fields into a scene.
fn with_medium(fields: &str) -> String {
    format!("Scene(media: [Medium(sigma_t: (1, 1, 1), albedo: (0, 1, 0), {fields})])")
}

const SCENES: &[&str] = &[
    "Scene(media: [Medium(sigma_T: (1, 2, 3))])",
    "Scene(media: [(sigma_T: (1, 2, 3))])",
    r#"Scene(camra: Gltf("a"))"#,
    "Scene(camera: Lookat(eye: (1, 1, 1), vfov: 30))",
    "Scene(media: [Medium(\n  sigma_t: (1, 2, 3), albedo: (0, 0, 0),\n  phase: Isotropc)])",
    "Scene(media: [Nedium(sigma_t: (1, 2, 3))])",
    "Scene(camera: LookAt(eye: (1, 1, 1), target: (0, 0, 0)))",
    "Scene(media: [Medium(albedo: (1, 1, 1))])",
    "Scene(lights: [Point(position: (0, 0, 0))])",
    "Scene(lights: [Environment(scale: 2)])",
    "Scene(film: Film(width: 3, width: 4))",
    r#"Scene(media: [Medium(sigma_t: (1, "a", 3), albedo: (0, 0, 0))])"#,
    "Scene(media: [Medium(sigma_t: (1, 2), albedo: (0, 0, 0))])",
    "Scene(media: [Medium(sigma_t: (1, 2, 3, 4), albedo: (0, 0, 0))])",
    "Scene(media: [Medium(sigma_t: 0.5, albedo: (0, 0, 0))])",
    "Scene(media: [Medium(sigma_t: [1, 2, 3], albedo: (0, 0, 0))])",
    "Scene(media: Medium(sigma_t: (1, 2, 3), albedo: (0, 0, 0)))",
    "Scene(gltf: 3)",
    "Scene(gltf: a.glb)",
    "Scene(media: [Medium(sigma_t: (1, -2, 3), albedo: (0, 0, 0))])",
    "Scene(media: [Medium(sigma_t: (1, 1e30, 3), albedo: (0, 0, 0))])",
    "Scene(media: [Medium(sigma_t: (1, NaN, 3), albedo: (0, 0, 0))])",
    "Scene(media: [Medium(sigma_t: (1, nan, 3), albedo: (0, 0, 0))])",
    "Scene(media: [Medium(sigma_t: (1, 1e400, 3), albedo: (0, 0, 0))])",
    "Scene(media: [Medium(sigma_t: (1, -inf, 3), albedo: (0, 0, 0))])",
    "Scene(media: [Medium(sigma_t: (1, 0x10, 3), albedo: (0, 0, 0))])",
    "Scene(media: [Medium(sigma_t: (1, 1234567890123456789012345678901234567890, 3), albedo: (0, 0, 0))])",
    "Scene(media: [Medium(sigma_t: (1, 1, 1), albedo: (0, 1.2, 0))])",
    "Scene(media: [Medium(sigma_t: (1, 1, 1), albedo: (0, 1, -0.1))])",
    "Scene(media: [Medium(sigma_t: (1, 1e8, 1), albedo: (0, 1, 0), density: Constant(1e6))])",
    "Scene(camera: LookAt(eye: (0, 0, 1), target: (0, 0, 0), vfov: 180))",
    "Scene(camera: LookAt(eye: (0, 0, 1), target: (0, 0, 0), vfov: 0))",
    "Scene(camera: LookAt(eye: (0, 0, 1), target: (0, 0, 1), vfov: 40))",
    "Scene(\n  camera: LookAt(eye: (0, 5, 0), target: (0, 0, 0), vfov: 40),\n)",
    "Scene(camera: Path([]))",
    "Scene(camera: Path())",
    "Scene(camera: Path)",
    "Scene(camera: Path(Key(frame: 0, eye: (0, 0, 1), target: (0, 0, 0), vfov: 40)))",
    "Scene(camera: Path([Key(frame: -1, eye: (0, 0, 1), target: (0, 0, 0), vfov: 40)]))",
    "Scene(camera: Path([Key(frame: inf, eye: (0, 0, 1), target: (0, 0, 0), vfov: 40)]))",
    "Scene(camera: Path([Key(eye: (0, 0, 1), target: (0, 0, 0), vfov: 40)]))",
    "Scene(camera: Path([Key(frame: 0, eye: (0, 0, 1), target: (0, 0, 0), fov: 40)]))",
    "Scene(camera: Path([Key(frame: 0, eye: (0, 0, 1), target: (0, 0, 0), vfov: 180)]))",
    "Scene(camera: Path([Key(frame: 0, eye: (0, 0, 1), target: (0, 0, 1), vfov: 40)]))",
    "Scene(camera: Path([\n  Key(frame: 9, eye: (0, 0, 1), target: (0, 0, 0), vfov: 40),\n  Key(frame: 9, eye: (0, 0, 1), target: (0, 0, 0), vfov: 40),\n]))",
    "Scene(camera: Path([\n  (frame: 9, eye: (0, 0, 1), target: (0, 0, 0), vfov: 40),\n  (frame: 10, eye: (0, 5, 0), target: (0, 0, 0), vfov: 40),\n]))",
    r#"Scene(camera: Gltf("front"))"#,
    "Scene()",
    "Scene(film: Film(width: 0))",
    "Scene(film: Film(width: -1))",
    "Scene(film: Film(height: 1.5))",
    "Scene(film: Film(width: 2147483648))",
    "Scene(film: Film(width: 65536, height: 65536))",
    "Scene(film: Film(fps: 0))",
    "Scene(film: Film(fps: inf))",
    "Scene(film: Film(fps: -24))",
    "Scene(lights: [Spot(position: (0, 0, 0), direction: (0, 0, 0), intensity: (1, 1, 1), inner_cone: 1, outer_cone: 2)])",
    "Scene(lights: [Spot(position: (0, 0, 0), direction: (0, 1, 0), intensity: (1, 1, 1), inner_cone: 3, outer_cone: 2)])",
    "Scene(lights: [Spot(position: (0, 0, 0), direction: (0, 1, 0), intensity: (1, 1, 1), inner_cone: 3, outer_cone: 180)])",
    "Scene(lights: [Spot(position: (0, 0, 0), direction: (0, 1, 0), intensity: (1, 1, 1), inner_cone: 0, outer_cone: 0)])",
    "Scene(lights: [Point(position: (0, 0, 0), intensity: (1, -1, 1))])",
    "Scene(lights: [Point(position: (3e38, 0, 0), intensity: (1, 1, 1))])",
    "Scene(render: Render(error: 0))",
    "Scene(render: Render(max_depth: -1))",
    r#"Scene(render: Render(max_depth: "none"))"#,
    "Scene(render: Render(exposure: 1e3))",
    "Scene(render: Render(erorr: 0))",
    r#"Scene(gltf: "a.glb)"#,
    "Scene(gltf: \"a\\qb\")",
    "Scene() x",
    "Scene(film: Film(width: 3)",
    "Scene(film = 3)",
    "Scene",
    "",
    r#"{"gltf": 3}"#,
    "glTF\u{2}\0\0",
    "/* open ",
    "Scene(film: Film(width: 3)\n  lights: [])",
    "Scene(lights: [Point(position: (0, 0, 0), intensity: (1, 1, 1)]",
    "#![enable(nonsense)]\nScene()",
];

const MEDIA: &[&str] = &[
    "phase: HenyeyGreenstein(g: 1.5)",
    "phase: HenyeyGreenstein(g: 0.99999999)",
    "phase: HenyeyGreenstein(0.5)",
    "phase: HenyeyGreenstein",
    "phase: Isotropic()",
    "phase: Mixture([(0.5, Isotropic)])",
    "phase: Mixture([(0.5, Isotropic), (0.5, HenyeyGreenstein(g: -1))])",
    "phase: Mixture([])",
    "phase: Mixture([(0.1, Rayleigh), (0.1, Isotropic), (0.1, HenyeyGreenstein(g: 0.1)), (0.1, HenyeyGreenstein(g: 0.2)), (0.6, Mixture([
        (0.2, HenyeyGreenstein(g: 0.3)), (0.2, HenyeyGreenstein(g: 0.4)), (0.2, HenyeyGreenstein(g: 0.5)), (0.2, HenyeyGreenstein(g: 0.6)),
        (0.2, HenyeyGreenstein(g: 0.7))]))])",
    "phase: Rayleigh()",
    r#"density: Grid(file: "a.vdb", transform: [1, 2, 3])"#,
    r#"density: Grid(file: "a.vdb", transform: [0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 0, 1])"#,
    r#"density: Grid(file: "a.vdb", transform: (1, 2, 3))"#,
    "density: Constant(-1)",
    "density: Height(scale_height: 0)",
    "region: Box(min: (0, 0, 0), max: (1, 0, 1))",
    "region: Sphere(center: (0, 0, 0), radius: -1)",
];

#[test]
fn every_message_names_place_fault_and_remedy() {
    let media = MEDIA.iter().map(|fields| with_medium(fields));
    let scenes = SCENES.iter().map(|text| String::from(*text));
    let mut report = String::new();
    for text in scenes.chain(media) {
        writeln!(report, "{}\n  {}\n", text.escape_debug(), message(&text)).unwrap();
    }
    insta::assert_snapshot!(report);
}

/// One of everything but a camera that moves, to be spoilt.
const ALL: &str = r#"Scene(
    camera: LookAt(eye: (0.5, 1.5, 3.5), target: (0.5, 1.5, 0.5), up: (0.5, 1.5, 0.5), vfov: 39.5),
    film: Film(width: 1024, height: 768, fps: 24.5),
    lights: [
        Point(position: (0.5, 1.5, 0.5), intensity: (8.5, 8.5, 8.5)),
        Spot(position: (1.5, 2.5, 3.5), direction: (0.5, -2.5, 0.5), intensity: (4.5, 5.5, 6.5), inner_cone: 10.5, outer_cone: 20.5),
        Directional(direction: (0.5, -1.5, 0.5), irradiance: (1.5, 2.5, 3.5)),
        Sky(radiance: (0.5, 0.5, 0.5)),
        Environment(file: "sky.exr", scale: 1.5, rotation: 0.5),
    ],
    media: [
        Medium(density: Constant(1.5), sigma_t: (0.5, 0.5, 0.5), albedo: (0.5, 0.5, 0.5), emission: (0.5, 0.5, 0.5)),
        Medium(sigma_t: (0.5, 0.5, 0.5), albedo: (0.5, 0.5, 0.5), region: Box(min: (0.5, 0.5, 0.5), max: (1.5, 1.5, 1.5)),
            density: Height(base: 0.5, scale_height: 2.5)),
        Medium(sigma_t: (0.5, 0.5, 0.5), albedo: (0.5, 0.5, 0.5), region: Sphere(center: (0.5, 0.5, 0.5), radius: 0.5),
            density: Grid(file: "smoke.vdb", scale: 1.5, transform: [1.5, 0, 0, 0, 0, 1.5, 0, 0, 0, 0, 1.5, 0, 0.5, 0.5, 0.5, 1])),
        Medium(sigma_t: (0.5, 0.5, 0.5), albedo: (0.5, 0.5, 0.5),
            phase: Mixture([(0.8, HenyeyGreenstein(g: 0.5)), (0.2, Isotropic)])),
    ],
    render: Render(error: 0.5, max_depth: 7, exposure: 0.5),
)"#;

/// A camera that moves, to be spoilt.
const PATH: &str = r#"Scene(
    camera: Path([
        Key(frame: 0.5, eye: (0.5, 1.5, 3.5), target: (0.5, 1.5, 0.5), up: (0.5, 1.5, 0.5), vfov: 39.5),
        (frame: 47.5, eye: (2.5, 1.5, 3.5), target: (0.5, 1.5, 0.5), vfov: 59.5),
    ]),
)"#;

/// Byte ranges of the numbers in `text`.
fn numbers(text: &str) -> Vec<std::ops::Range<usize>> {
    let is_part = |c: char| c.is_ascii_digit() || c == '.' || c == '-';
    let mut ranges = Vec::new();
    let mut start = None;
    for (i, c) in text.char_indices() {
        match (start, is_part(c)) {
            (None, true) => start = Some(i),
            (Some(begin), false) => {
                if text[begin..i].chars().any(|c| c.is_ascii_digit()) {
                    ranges.push(begin..i);
                }
                start = None;
            }
            _ => {}
        }
    }
    ranges
}

#[test]
fn no_numeric_field_takes_nan_infinity_or_what_f32_cannot_hold() {
    let ranges = |text| numbers(text).into_iter().map(move |range| (text, range));
    let all: Vec<_> = ranges(ALL).chain(ranges(PATH)).collect();
    assert!(all.len() > 110, "{}", all.len());
    for (sound, range) in all {
        assert!(parse(sound.as_bytes(), Path::new("scene.ron")).is_ok());
        for bad in [
            "NaN", "-NaN", "inf", "-inf", "1e400", "-1e400", "1e39", "nan", "\"1\"", "()",
        ] {
            let mut text = String::from(sound);
            text.replace_range(range.clone(), bad);
            let line_start = text[..range.start].rfind('\n').map_or(0, |i| i + 1);
            let line = text[..range.start].matches('\n').count() + 1;
            let error = fault(&text);
            let place = (error.place.line, error.place.column);
            assert_eq!(place, (line, range.start - line_start + 1), "{error}");
            assert!(!error.field.is_empty(), "{error}");
        }
    }
}

#[test]
fn a_file_cut_short_or_spoilt_anywhere_is_an_error_or_a_scene_but_never_a_panic() {
    let path = Path::new("scene.ron");
    for (text, end) in [ALL, PATH]
        .map(|text| (0..text.len()).map(move |i| (text, i)))
        .into_iter()
        .flatten()
    {
        parse(&text.as_bytes()[..end], path).unwrap_err();
        for byte in [
            b'(', b')', b'"', b'-', b'9', b',', b':', b'\\', b'/', b'*', 0, 0xff,
        ] {
            let mut bytes = text.as_bytes().to_vec();
            bytes[end] = byte;
            if let Err(error) = parse(&bytes, path) {
                assert!(error.to_string().contains("scene.ron:"), "{error}");
            }
        }
    }
}

#[test]
fn brackets_nested_without_end_are_an_error() {
    for depth in [200, 10_000, 1_000_000] {
        let open = "Mixture([(1, ".repeat(depth);
        let error = fault(&with_medium(&format!("phase: {open}")));
        assert_eq!(error.fault, Fault::TooDeep);
        for open in ["(", "[", "/*", "\"", "Some("] {
            fault(&open.repeat(depth));
            fault(&format!("Scene(gltf: {}", open.repeat(depth)));
        }
    }
}

#[test]
fn lists_of_a_million_entries_are_read_or_refused_quickly() {
    let lights = "Sky(radiance: (1, 1, 1)),".repeat(100_000);
    let scene = parse(
        format!("Scene(lights: [{lights}])").as_bytes(),
        Path::new("a"),
    )
    .unwrap();
    assert_eq!(scene.lights.len(), 100_000);
    let numbers = "1,".repeat(1_000_000);
    let grid = format!("density: Grid(file: \"a\", transform: [{numbers}])");
    let error = fault(&with_medium(&grid));
    assert_eq!(error.field, "media[0].density.transform");
}

#[test]
fn bytes_that_are_not_text_are_named_with_their_place() {
    let check = |bytes: &[u8], place: (usize, usize), hint: &str| {
        let error = parse(bytes, Path::new("scene.ron")).unwrap_err();
        assert_eq!((error.place.line, error.place.column), place);
        assert!(error.to_string().contains(hint), "{error}");
    };
    check(b"Scene(\n  gltf: \"\xff\")", (2, 10), "save it as UTF-8");
    check(b"\xff\xfeS\0c\0", (1, 1), "UTF-16");
}

#[test]
fn files_that_cannot_be_scenes_are_refused_before_they_are_read() {
    let dir = tempfile::tempdir().unwrap();
    let message = |name: &str| {
        let error = load(&dir.path().join(name), &LoadOptions::default()).unwrap_err();
        let message = error.to_string();
        assert!(message.ends_with(&format!("{name})")), "{message}");
        message
    };
    assert!(message("missing.ron").starts_with("cannot read the scene file: "));
    let large = std::fs::File::create(dir.path().join("large.ron")).unwrap();
    large.set_len(MAX_BYTES + 1).unwrap();
    assert!(message("large.ron").starts_with("the scene file holds 67108865 bytes"));
    for (name, end) in [
        ("scene.obj", "\"obj\""),
        ("scene", "nothing"),
        ("scene.RON.bak", "\"bak\""),
    ] {
        assert!(message(name).contains(&format!("this name ends in {end}")));
    }
    for name in ["a.glb", "a.gltf", "a.GLB"] {
        assert!(message(name).contains("add some with --fog"));
    }
    std::fs::create_dir(dir.path().join("folder.ron")).unwrap();
    assert!(message("folder.ron").starts_with("cannot read the scene file: "));
}

#[test]
fn files_that_a_scene_names_are_sought_in_its_folder_alone() {
    let dir = tempfile::tempdir().unwrap();
    let message = |text: &str| {
        let error = load_str(text, dir.path(), &LoadOptions::default()).unwrap_err();
        assert!(matches!(error, SceneError::Field { .. }), "{error}");
        error.to_string()
    };
    for (text, what, place) in [
        (
            r#"Scene(gltf: "missing.glb")"#,
            "cannot read",
            "at `gltf`, line 1, column 13",
        ),
        (
            r#"Scene(gltf: "../a.glb")"#,
            "outside",
            "at `gltf`, line 1, column 13",
        ),
        (
            r#"Scene(gltf: "https://a.b/c.glb")"#,
            "address",
            "at `gltf`, line 1, column 13",
        ),
        (
            r#"Scene(lights: [Sky(radiance: (1, 1, 1)), Environment(file: "missing.exr")])"#,
            "cannot read",
            "at `lights[1].file`, line 1, column 60",
        ),
    ] {
        let message = message(text);
        assert!(
            message.contains(what) && message.contains(place),
            "{message}"
        );
    }
}
