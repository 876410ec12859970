//! Numerically hard but legal scenes, one a row: each gives an image without a number that is not finite, in bounded time, and what is
//! known of it exactly is checked. Broken files are in `bad_inputs.rs` and beside the readers; `docs/hard_cases.md` has the whole list.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::Path;
use std::process::Command;
use std::time::Instant;
use tempfile::TempDir;
use tyndall_render::Outcome;
use tyndall_render::options::{Integrator, RenderOptions};
use tyndall_scene::{LoadOptions, load_str};
use tyndall_tests::image::Channels;
use tyndall_tests::program::{ends, succeed, told, tyndall};
use tyndall_tests::room::room;

/// A lamp and a sky over a floor with a wall on it, in a box of fog that both cross; rows change parts of it.
const SCENE: &str = r#"Scene(
    gltf: "room.gltf",
    camera: LookAt(eye: (0, 1, 4), target: (0, 1, 0), vfov: 45),
    film: Film(width: 8, height: 6),
    lights: [Point(position: (0.5, 1.6, 0.5), intensity: (4, 3, 2)), Sky(radiance: (0.2, 0.3, 0.4))],
    media: [Medium(
        region: Box(min: (-1.5, 0, -1.5), max: (1.5, 2, 1.5)),
        density: Constant(1),
        sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9),
    )],
    render: Render(error: 0.5),
)"#;

const LAMP: &str = "Point(position: (0.5, 1.6, 0.5), intensity: (4, 3, 2))";
const LIGHTS: &str =
    "Point(position: (0.5, 1.6, 0.5), intensity: (4, 3, 2)), Sky(radiance: (0.2, 0.3, 0.4))";
const EYE: &str = "eye: (0, 1, 4)";
const TARGET: &str = "target: (0, 1, 0)";
const VFOV: &str = "vfov: 45";
const SIGMA: &str = "sigma_t: (0.5, 0.5, 0.5)";
const ALBEDO: &str = "albedo: (0.9, 0.9, 0.9)";
const BOX: &str = "Box(min: (-1.5, 0, -1.5), max: (1.5, 2, 1.5))";
const DENSITY: &str = "Constant(1)";
const FILM: &str = "width: 8, height: 6";
const GLTF: &str = "gltf: \"room.gltf\",";
const DEPTH: &str = "error: 0.5";

/// What must hold of a row's image.
type Check = fn(&Outcome);

/// Number and name of a case, what it changes in [`SCENE`], and what must hold.
type Row<'r> = (&'r str, &'r [(&'r str, &'r str)], Check);

/// A `.vol` file of 4 × 4 × 4 cells in the cube from −1 to 1.
fn vol(value: impl Fn(usize) -> f32) -> Vec<u8> {
    let mut bytes = b"VOL\x03".to_vec();
    bytes.extend([1, 4, 4, 4, 1].iter().flat_map(|n: &i32| n.to_le_bytes()));
    let corners = [-1.0_f32, -1.0, -1.0, 1.0, 1.0, 1.0];
    bytes.extend(corners.iter().flat_map(|x| x.to_le_bytes()));
    bytes.extend((0..64).flat_map(|i| value(i).to_le_bytes()));
    bytes
}

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    let write = |name: &str, bytes: &[u8]| fs::write(folder.path().join(name), bytes).unwrap();
    write("room.gltf", room().as_bytes());
    write("zero.vol", &vol(|_| 0.0));
    write("spark.vol", &vol(|i| if i == 21 { 1e4 } else { 0.0 }));
    // Along all three axes neighbours differ.
    write(
        "steps.vol",
        &vol(|i| {
            if (i + i / 4 + i / 16) % 2 == 0 {
                0.0
            } else {
                1e6
            }
        }),
    );
    folder
}

/// The scene with parts replaced.
fn scene(changes: &[(&str, &str)]) -> String {
    changes.iter().fold(SCENE.to_owned(), |text, (from, to)| {
        assert!(text.contains(from), "nothing to replace: {from}");
        text.replace(from, to)
    })
}

fn render(folder: &Path, text: &str, integrator: Integrator) -> Outcome {
    let scene = load_str(text, folder, &LoadOptions::default()).unwrap_or_else(|e| panic!("{e}"));
    let options = RenderOptions {
        integrator,
        spp: Some(4),
        layers: Some(
            "beauty,surface,single,multiple,emission,transmittance"
                .parse()
                .unwrap(),
        ),
        ..RenderOptions::default()
    };
    tyndall_render::render(&scene, &options, &()).unwrap()
}

fn sum(outcome: &Outcome, channel: &str) -> f64 {
    let values = outcome.image.channels[channel].iter();
    values.map(|&v| f64::from(v)).sum()
}

fn is_lit(outcome: &Outcome) {
    assert!(sum(outcome, "R") > 0.0);
}

fn is_black(outcome: &Outcome) {
    assert_eq!(
        sum(outcome, "R") + sum(outcome, "G") + sum(outcome, "B"),
        0.0
    );
}

fn is_any(_: &Outcome) {}

fn is_red_alone(outcome: &Outcome) {
    is_lit(outcome);
    for layer in ["", "surface.", "single.", "multiple."] {
        for channel in ["G", "B"] {
            let values = &outcome.image.channels[&format!("{layer}{channel}")];
            assert!(values.iter().all(|&v| v == 0.0), "{layer}{channel}");
        }
    }
}

/// Nothing is scattered, and nothing was kept of it.
fn only_absorbs(outcome: &Outcome) {
    is_lit(outcome);
    assert_eq!(sum(outcome, "single.R") + sum(outcome, "multiple.R"), 0.0);
    assert_eq!(outcome.stats.records.get("multiple"), None);
}

/// In the limit of thin fog, light scattered once is σs times an integral that does not depend on it.
fn scatters_in_proportion(outcome: &Outcome) {
    let single = sum(outcome, "single.R");
    assert!(single > 0.0 && single < 1e-9, "{single}");
    let [red, green] = ["R", "G"].map(|c| sum(outcome, &format!("single.{c}")));
    // The lamp's colours are 4 : 3, the sky's 2 : 3; what they add up to lies between.
    assert!((0.6..1.4).contains(&(red / green)), "{red} {green}");
}

/// Three boxes of optical depth 0.25 each with gaps between them, along one pencil of rays.
fn lets_through_three_quarters(outcome: &Outcome) {
    let expected = (-0.75_f32).exp();
    for t in &outcome.image.channels["transmittance.R"] {
        assert!((t / expected - 1.0).abs() < 1e-5, "{t}");
    }
}

fn warns(outcome: &Outcome) {
    is_black(outcome);
    assert!(outcome.stats.wall_s < 5.0);
}

#[test]
fn hard_but_legal_scenes_give_finite_images() {
    let folder = folder();
    let far = "eye: (100000, 100001, -99996)";
    let boxes = r#"region: Box(min: (-1, 0, -1), max: (1, 2, -0.5)), sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9)),
        Medium(region: Box(min: (-1, 0, 0), max: (1, 2, 0.5)), sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9)),
        Medium(region: Box(min: (-1, 0, 1), max: (1, 2, 1.5))"#;
    #[rustfmt::skip]
    let rows: &[Row<'_>] = &[
        ("8 no geometry", &[(GLTF, "")], is_lit),
        ("17 fog ends in the plane of the floor", &[], is_lit),
        ("22 thin fog", &[(SIGMA, "sigma_t: (1e-12, 1e-12, 1e-12)")], scatters_in_proportion),
        ("23 opaque fog", &[(SIGMA, "sigma_t: (1e6, 1e6, 1e6)")], is_lit),
        ("25 one opaque channel", &[(SIGMA, "sigma_t: (0.002, 0.002, 10000)")], is_lit),
        ("26 albedo 0", &[(ALBEDO, "albedo: (0, 0, 0)")], only_absorbs),
        ("27 albedo 1", &[(ALBEDO, "albedo: (1, 1, 1)")], is_lit),
        ("30 a red lamp", &[(LIGHTS, "Point(position: (0.5, 1.6, 0.5), intensity: (4, 0, 0))")], is_red_alone),
        ("32 light without measure", &[(LAMP, "Point(position: (0.5, 1.6, 0.5), intensity: (1e30, 1e30, 1e30))")], is_lit),
        ("32 light at the edge of numbers", &[(LIGHTS, "Point(position: (0.5, 1.6, 0.5), intensity: (1e-38, 1e-38, 1e-38))")], is_any),
        ("34 scattering straight on", &[(ALBEDO, "albedo: (0.9, 0.9, 0.9), phase: HenyeyGreenstein(g: 0.9999)")], is_lit),
        ("34 scattering straight back", &[(ALBEDO, "albedo: (0.9, 0.9, 0.9), phase: HenyeyGreenstein(g: -0.9999)")], is_lit),
        ("38 a steep height fog", &[(DENSITY, "Height(base: 0, scale_height: 1e-3)")], is_lit),
        ("38 a flat height fog", &[(DENSITY, "Height(base: 0, scale_height: 1e6)")], is_lit),
        ("38 a camera far below a height fog", &[(DENSITY, "Height(base: 1e4, scale_height: 0.01)")], is_lit),
        ("40 gaps between boxes; 97 a narrow view", &[(GLTF, ""), (VFOV, "vfov: 0.001"), ("region: Box(min: (-1.5, 0, -1.5), max: (1.5, 2, 1.5))", boxes), ("density: Constant(1),", "")], lets_through_three_quarters),
        ("42 a camera on the border of the fog", &[(EYE, "eye: (0, 1, 1.5)")], is_lit),
        ("42 a camera in the fog", &[(EYE, "eye: (0, 1, 1)")], is_lit),
        ("43 no lights", &[(LIGHTS, "")], warns),
        ("44 a sky alone", &[(LIGHTS, "Sky(radiance: (1, 1, 1))")], is_lit),
        ("44 a black sky", &[(LIGHTS, "Sky(radiance: (0, 0, 0))")], warns),
        ("46 a lamp without power", &[(LIGHTS, "Point(position: (0.5, 1.6, 0.5), intensity: (0, 0, 0))")], warns),
        ("47 a lamp at the eye", &[(LAMP, "Point(position: (0, 1, 4), intensity: (4, 3, 2))")], is_lit),
        ("47 a lamp at the eye in the fog", &[(EYE, "eye: (0, 1, 1)"), (LAMP, "Point(position: (0, 1, 1), intensity: (4, 3, 2))")], is_lit),
        ("47 a lamp where the camera looks", &[(LAMP, "Point(position: (0, 1, 0), intensity: (4, 3, 2))")], is_lit),
        ("48 a lamp on the floor and on the border of the fog", &[(LIGHTS, "Point(position: (1, 0, 1), intensity: (4, 3, 2))")], is_any),
        ("51 a spot without width", &[(LAMP, "Spot(position: (0.5, 1.6, 0.5), direction: (0, -1, 0), intensity: (4, 3, 2), inner_cone: 0, outer_cone: 1e-3)")], is_lit),
        ("52 lamps whose light changes in opposite ways", &[(LIGHTS, "Point(position: (1, 1, 0.5), intensity: (4, 3, 2)), Point(position: (-1, 1, 0.5), intensity: (4, 3, 2))")], is_lit),
        ("64 a grid of nothing", &[(DENSITY, "Grid(file: \"zero.vol\")")], is_lit),
        ("64 one bright voxel", &[(DENSITY, "Grid(file: \"spark.vol\")")], is_lit),
        ("68 neighbours of 0 and 1e6", &[(DENSITY, "Grid(file: \"steps.vol\")")], is_lit),
        ("92 one pixel", &[(FILM, "width: 1, height: 1")], is_any),
        ("97 a view of nearly half a turn", &[(VFOV, "vfov: 179.999")], is_lit),
        ("98 a camera that looks away", &[(TARGET, "target: (0, 1, 9)"), (LIGHTS, LAMP)], is_black),
        ("103 depth 0", &[(DEPTH, "error: 0.5, max_depth: Some(0)")], is_lit),
        ("103 depth 1000", &[(DEPTH, "error: 0.5, max_depth: Some(1000)"), (ALBEDO, "albedo: (1, 1, 1)")], is_lit),
        ("14 far from the origin", &[(GLTF, ""), (EYE, far), (TARGET, "target: (100000, 100001, -100000)"), (BOX, "Box(min: (99998.5, 100000, -100001.5), max: (100001.5, 100002, -99998.5))")], is_lit),
    ];
    for (name, changes, check) in rows {
        for integrator in [Integrator::Cache, Integrator::Path] {
            let begun = Instant::now();
            let outcome = render(folder.path(), &scene(changes), integrator);
            outcome.image.check_finite().unwrap();
            let bugs = outcome.notes.iter().filter(|note| note.contains("bug"));
            assert_eq!(bugs.count(), 0, "{name}: {:?}", outcome.notes);
            check(&outcome);
            // Far above what any row takes.
            assert!(begun.elapsed().as_secs() < 60, "{name}, {integrator:?}");
        }
    }
}

#[test]
fn fog_that_scatters_and_absorbs_nothing_is_vacuum_bit_for_bit() {
    let folder = folder();
    let nothing = scene(&[(SIGMA, "sigma_t: (0, 0, 0)")]);
    let begin = nothing.find("media:").unwrap();
    let end = nothing.find("render:").unwrap();
    let vacuum = format!("{}{}", &nothing[..begin], &nothing[end..]);
    let grid = scene(&[(DENSITY, "Grid(file: \"zero.vol\")")]);
    for integrator in [Integrator::Cache, Integrator::Path] {
        let expected = render(folder.path(), &vacuum, integrator).image;
        let found = render(folder.path(), &nothing, integrator).image;
        assert!(found == expected, "{integrator:?}");
        // Empty voxels take random numbers of their own; nothing of theirs is seen.
        let found = render(folder.path(), &grid, integrator).image;
        for channel in ["single.R", "multiple.R"] {
            assert!(found.channels[channel].iter().all(|&v| v == 0.0));
        }
    }
}

#[test]
fn media_that_overlap_add_up_and_one_may_be_cut_in_two() {
    let folder = folder();
    let whole = "region: Box(min: (-1.5, 0, -1.5), max: (1.5, 2, 1.5)), sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9),";
    let text = scene(&[("density: Constant(1),", ""), (GLTF, "")]);
    let begin = text.find("region:").unwrap();
    let end = text.find("    )],\n    render").unwrap();
    let with = |media: &str| format!("{}{media}{}", &text[..begin], &text[end..]);
    let thin = whole.replace("sigma_t: (0.5, 0.5, 0.5)", "sigma_t: (0.25, 0.25, 0.25)");
    let left = whole.replace("max: (1.5,", "max: (0.2,");
    let right = whole.replace("min: (-1.5,", "min: (0.2,");
    let one = render(folder.path(), &with(whole), Integrator::Path).image;
    for parts in [[&thin, &thin], [&left, &right]] {
        let media = format!("{}), Medium({}", parts[0], parts[1]);
        let two = render(folder.path(), &with(&media), Integrator::Path).image;
        // The same camera rays: what they let through is the same to rounding.
        let pairs = one.channels["transmittance.R"]
            .iter()
            .zip(&two.channels["transmittance.R"]);
        for (a, b) in pairs {
            assert!((a / b - 1.0).abs() < 1e-5, "{a} {b}");
        }
    }
}

/// A lamp in fog whose image takes no time.
const LAMP_ALONE: &str = "Scene(
    camera: LookAt(eye: (0, 0, 4), target: (0, 0, 0), vfov: 40),
    film: Film(width: 8, height: 6),
    lights: [Point(position: (0, 1, 0), intensity: (1, 1, 1))],
    media: [Medium(sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9))],
    render: Render(max_depth: Some(1)),
)";

#[test]
fn numbers_at_the_edge_of_options_are_taken_or_refused() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("s.ron"), LAMP_ALONE).unwrap();
    let render = |options: &str| ends(folder.path(), &format!("render s.ron -o x.exr {options}"));
    for options in [
        "--spp 1 --threads 64",
        "--spp 1 --seed 18446744073709551615",
        "--spp 1 --max-depth 4294967295 --error 0.5",
        "--error 1e-9 --time-limit 0.5",
        "--error 10",
        "--spp 1 --width 1 --height 1",
        "--spp 1 --crop 7,5,1,1",
    ] {
        let (status, stderr) = render(options);
        assert_eq!(status, Some(0), "{options}: {stderr}");
        let pixels = Channels::read(&folder.path().join("x.exr")).unwrap();
        let pixels = pixels.rgb("").unwrap().pixels;
        assert!(pixels.iter().all(|p| p.is_finite()), "{options}");
        fs::remove_file(folder.path().join("x.exr")).unwrap();
    }
    for options in [
        "--spp 4294967296",
        "--threads 18446744073709551616",
        "--seed 18446744073709551616",
        "--width 65536 --height 65536",
        "--crop 8,0,1,1",
        "--time-limit nan",
        "--time-limit 1e300",
        "--error inf",
        "--checkpoint-interval -1",
    ] {
        let (status, stderr) = render(options);
        assert_eq!(status, Some(2), "{options}: {stderr}");
        assert!(!folder.path().join("x.exr").exists(), "{options}");
    }
}

#[test]
fn the_environment_of_the_process_does_not_shape_pixels() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("s.ron"), LAMP_ALONE).unwrap();
    succeed(folder.path(), "render s.ron -o a.exr --spp 4 --quiet");
    let mut command = Command::new(tyndall());
    command.args("render s.ron -o b.exr --spp 4 --quiet".split(' '));
    command
        .env("RAYON_NUM_THREADS", "0")
        .env("LANG", "tr_TR.UTF-8");
    assert!(
        command
            .current_dir(folder.path())
            .status()
            .unwrap()
            .success()
    );
    let read = |name: &str| Channels::read(&folder.path().join(name)).unwrap();
    assert!(read("a.exr") == read("b.exr"));
}

#[test]
fn names_of_any_letters_and_length_are_read_and_written() {
    let folder = TempDir::new().unwrap();
    let deep = ["d".repeat(100), "e".repeat(100), "f".repeat(100)].join("/");
    for name in ["with space", "ümläut", "😀", deep.as_str()] {
        let place = folder.path().join(name);
        fs::create_dir_all(&place).unwrap();
        let [scene, image] = ["s n.ron", "im äge.exr"].map(|file| place.join(file));
        fs::write(&scene, LAMP_ALONE).unwrap();
        let mut command = Command::new(tyndall());
        command.arg("render").arg(&scene).arg("-o").arg(&image);
        let output = command.args(["--spp", "1"]).output().unwrap();
        let stderr = String::from_utf8(output.stderr).unwrap();
        assert!(output.status.success(), "{name}: {stderr}");
        assert!(image.exists(), "{name}");
    }
}

/// The largest frame there is has 34 GB of sums; the limit stands for a machine that has less.
#[cfg(target_os = "linux")]
#[test]
fn a_frame_larger_than_memory_is_refused_before_anything_is_computed() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("s.ron"), LAMP_ALONE).unwrap();
    let render = "render s.ron -o x.exr --threads 2 --width 16384 --height 16384";
    let line = |options: &str| {
        format!(
            "ulimit -v 4000000; exec {} {render} {options}",
            tyndall().display()
        )
    };
    let run = |options: &str| {
        let mut command = Command::new("sh");
        command
            .args(["-c", &line(options)])
            .current_dir(folder.path());
        let output = command.output().unwrap();
        told(output)
    };
    // Built before time counts.
    tyndall();
    let begun = Instant::now();
    let (status, stderr) = run("");
    assert_eq!(status, Some(1), "{stderr}");
    assert!(
        stderr.contains("MiB of memory") && stderr.contains("--crop"),
        "{stderr}"
    );
    assert!(begun.elapsed().as_secs() < 20);
    let (status, stderr) = run("--spp 1 --crop 16000,16000,64,64");
    assert_eq!(status, Some(0), "{stderr}");
}
