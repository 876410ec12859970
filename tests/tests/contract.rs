//! What the outward contract promises, tried on the `tyndall` program as a user runs it.

#![allow(clippy::unwrap_used, reason = "tests")]

use serde_json::{Value, json};
use std::collections::BTreeSet;
use std::fs;
use std::path::Path;
use std::time::Instant;
use tempfile::TempDir;
use tyndall_tests::image::{Channels, Image};
use tyndall_tests::program::{ends, run_line, run_tyndall, succeed, workspace};

/// The scene file of the contract, with numbers where it shows dots.
const EVERY_FIELD: &str = r#"
Scene(
    gltf: "cornell.glb",                 // path relative to this file
    camera: LookAt(eye: (0.0, 1.0, 3.9), target: (0.0, 1.0, 0.0), up: (0.0, 1.0, 0.0), vfov: 39.3),
    film: Film(width: 1024, height: 768),
    lights: [                            // added to the glTF's own
        Point(position: (0.0, 1.9, 0.0), intensity: (8.0, 8.0, 8.0)),
        Spot(position: (0.0, 1.9, 0.0), direction: (0.0, -1.0, 0.0), intensity: (5.0, 5.0, 5.0), inner_cone: 10.0, outer_cone: 20.0),
        Directional(direction: (0.3, -1.0, 0.2), irradiance: (1.0, 1.0, 1.0)),
        Sky(radiance: (0.1, 0.1, 0.2)),
        Environment(file: "sky.exr", scale: 1.0, rotation: 0.0),
    ],
    media: [
        Medium(
            name: "fog",
            region: Everywhere,
            density: Constant(1.0),
            sigma_t: (0.5, 0.5, 0.5),
            albedo: (0.9, 0.9, 0.9),
            phase: Isotropic,
            emission: (0.0, 0.0, 0.0),
        ),
    ],
    render: Render(error: 0.03, max_depth: None, exposure: 0.0),
)
"#;

/// The shortest scene with fog: all else has its default.
const FEW_FIELDS: &str = r#"
Scene(
    camera: LookAt(eye: (0, 0, 4), target: (0, 0, 0), vfov: 40),
    lights: [Point(position: (0, 1, 0), intensity: (1, 1, 1))],
    media: [Medium(sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9))],
)
"#;

const INTEGRATORS: [&str; 2] = ["cache", "path"];
const METHODS: [&str; 2] = ["tyndall", "jarosz08"];

/// Renders the shipped Cornell box, small, into `out.exr` of `folder`; returns its channels.
fn render_cornell(folder: &Path, options: &str) -> Channels {
    let scene = workspace().join("assets/cornell_box/cornell_box.ron");
    let scene = scene.display();
    succeed(
        folder,
        &format!("render {scene} -o out.exr --width 24 --height 24 --seed 7 {options}"),
    );
    Channels::read(&folder.join("out.exr")).unwrap()
}

/// A binary glTF with one triangle and a camera.
fn triangle_glb() -> Vec<u8> {
    let positions: [f32; 9] = [-1.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 2.0, 0.0];
    let buffer: Vec<u8> = positions.iter().flat_map(|x| x.to_le_bytes()).collect();
    let mut json = json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0, 1] }],
        "nodes": [{ "mesh": 0 }, { "name": "eye", "camera": 0, "translation": [0, 1, 4] }],
        "cameras": [{ "type": "perspective", "perspective": { "yfov": 0.7, "znear": 0.1 } }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 } }] }],
        "accessors": [{
            "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3,
            "min": [-1, 0, 0], "max": [1, 2, 0]
        }],
        "bufferViews": [{ "buffer": 0, "byteLength": 36 }],
        "buffers": [{ "byteLength": 36 }],
    })
    .to_string();
    while !json.len().is_multiple_of(4) {
        json.push(' ');
    }
    let word = |n: usize| (n as u32).to_le_bytes();
    let length = 12 + 8 + json.len() + 8 + buffer.len();
    let header = [*b"glTF", word(2), word(length)].concat();
    let text = [&word(json.len()), b"JSON".as_slice(), json.as_bytes()].concat();
    let binary = [&word(buffer.len()), b"BIN\0".as_slice(), &buffer].concat();
    [header, text, binary].concat()
}

#[test]
fn the_contracts_scene_file_renders() {
    let folder = TempDir::new().unwrap();
    let file = |name: &str| folder.path().join(name);
    fs::write(file("scene.ron"), EVERY_FIELD).unwrap();
    fs::write(file("cornell.glb"), triangle_glb()).unwrap();
    let sky = Image {
        size: [8, 4],
        pixels: vec![glam::Vec3::ONE; 32],
    };
    sky.write_exr(&file("sky.exr")).unwrap();
    for integrator in INTEGRATORS {
        let options = format!("--integrator {integrator} --width 8 --height 6 --spp 1");
        succeed(
            folder.path(),
            &format!("render scene.ron -o out.exr {options}"),
        );
        assert_eq!(Channels::read(&file("out.exr")).unwrap().size, [8, 6]);
    }
}

#[test]
fn fields_left_out_have_their_defaults() {
    let folder = TempDir::new().unwrap();
    let with_some = FEW_FIELDS.replace("camera: LookAt(", "gltf: None, camera: Some(LookAt(");
    let with_some = with_some.replace("vfov: 40)", "vfov: 40))");
    let mut images = Vec::new();
    for text in [FEW_FIELDS, &with_some] {
        fs::write(folder.path().join("scene.ron"), text).unwrap();
        succeed(
            folder.path(),
            "render scene.ron -o out.exr --width 16 --spp 1",
        );
        images.push(Image::read(&folder.path().join("out.exr")).unwrap());
    }
    assert_eq!(images[0].size, [16, 12], "the default film is 4:3");
    assert_eq!(
        images[0], images[1],
        "options are read with and without Some"
    );
}

#[test]
fn a_bare_gltf_renders_with_fog_from_the_command_line() {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("triangle.glb"), triangle_glb()).unwrap();
    let options = "--fog 0.5,0.9 --width 8 --height 8 --spp 1";
    succeed(
        folder.path(),
        &format!("render triangle.glb -o out.png {options}"),
    );
    assert!(folder.path().join("out.png").exists());
}

#[test]
fn an_exr_holds_the_default_layers_and_they_sum_to_beauty() {
    let folder = TempDir::new().unwrap();
    for integrator in INTEGRATORS {
        let channels = render_cornell(folder.path(), &format!("--spp 2 --integrator {integrator}"));
        let names: BTreeSet<String> = channels.samples.keys().cloned().collect();
        let expected = ["", "surface.", "single.", "multiple."]
            .map(|layer| ["R", "G", "B"].map(|c| format!("{layer}{c}")));
        assert_eq!(names, expected.into_iter().flatten().collect());

        let beauty = channels.rgb("").unwrap();
        let layers = ["surface.", "single.", "multiple."].map(|layer| channels.rgb(layer).unwrap());
        for (i, &sum) in beauty.pixels.iter().enumerate() {
            let layers: glam::Vec3 = layers.iter().map(|layer| layer.pixels[i]).sum();
            // Three roundings of f32, with room for the order of the sum.
            assert!(
                (sum - layers).abs().max_element() <= 1e-6 * sum.max_element(),
                "{integrator}: pixel {i}"
            );
        }
        for layer in &layers {
            assert!(layer.mean() > 0.0, "{integrator}: an empty layer");
        }
    }
}

#[test]
fn layers_are_chosen_by_name() {
    let folder = TempDir::new().unwrap();
    let channels = render_cornell(folder.path(), "--spp 1 --layers beauty,transmittance,depth");
    let names: Vec<&str> = channels.samples.keys().map(String::as_str).collect();
    assert_eq!(
        names,
        [
            "B",
            "G",
            "R",
            "Z",
            "transmittance.B",
            "transmittance.G",
            "transmittance.R"
        ]
    );
}

#[test]
fn layers_about_records_agree_with_the_statistics() {
    let folder = TempDir::new().unwrap();
    for method in METHODS {
        let options = "--spp 2 --error 0.5 --layers records,radius,lookups --stats stats.json";
        let layers = render_cornell(folder.path(), &format!("{options} --method {method}"));
        let [records, radius, lookups] =
            ["records", "radius", "lookups"].map(|name| &layers.samples[name]);
        let stats: Value =
            serde_json::from_slice(&fs::read(folder.path().join("stats.json")).unwrap()).unwrap();
        let kinds = stats["records"].as_object().unwrap().values();
        let n_records: u64 = kinds.map(|n| n.as_u64().unwrap()).sum();
        // Most are in sight: few have moved out of the frame or behind a block. Whole numbers, whose sums are exact.
        let shown = records.iter().sum::<f32>() / n_records as f32;
        assert!((0.8..=1.0).contains(&shown), "{method}: {shown}");
        let n_lookups = stats["lookups"].as_u64().unwrap();
        assert_eq!(
            2.0 * lookups.iter().sum::<f32>(),
            n_lookups as f32,
            "{method}"
        );
        assert!(n_lookups > 0 && n_records > 0, "{method}");
        for (n, radius) in records.iter().zip(radius) {
            assert_eq!(*n > 0.0, *radius > 0.0, "{method}");
        }
    }
}

#[test]
fn the_pixels_do_not_depend_on_the_number_of_threads() {
    let folder = TempDir::new().unwrap();
    let choices = ["--integrator path"].map(str::to_owned).into_iter();
    for choice in choices.chain(METHODS.map(|method| format!("--method {method}"))) {
        let render = |threads| {
            let options = format!("--spp 2 --error 0.2 {choice} --threads {threads}");
            render_cornell(folder.path(), &options).samples
        };
        assert!(render(1) == render(2), "{choice}");
    }
}

#[test]
fn a_method_is_only_for_caching() {
    let folder = TempDir::new().unwrap();
    let arguments = "render scene.ron --integrator path --method jarosz08";
    let (status, stderr) = ends(folder.path(), arguments);
    assert_eq!(status, Some(2), "{stderr}");
    assert!(stderr.contains("--method"), "{stderr}");
}

#[test]
fn a_crop_shows_the_same_pixels_as_the_whole() {
    let folder = TempDir::new().unwrap();
    for integrator in INTEGRATORS {
        let options = format!("--spp 2 --integrator {integrator}");
        let whole = render_cornell(folder.path(), &options).rgb("").unwrap();
        let part = render_cornell(folder.path(), &format!("{options} --crop 8,4,9,5"));
        let part = part.rgb("").unwrap();
        let rows = (4..9).flat_map(|y| &whole.pixels[y * 24 + 8..y * 24 + 17]);
        assert_eq!(part.size, [9, 5]);
        assert!(part.pixels.iter().eq(rows), "{integrator}");
    }
}

#[test]
fn another_seed_gives_another_image_and_the_same_seed_the_same() {
    let folder = TempDir::new().unwrap();
    let render = |seed: u64| {
        let scene = workspace().join("assets/lamp/lamp.ron");
        let options = format!("--width 8 --spp 2 --integrator path --seed {seed}");
        succeed(
            folder.path(),
            &format!("render {} -o out.exr {options}", scene.display()),
        );
        Image::read(&folder.path().join("out.exr")).unwrap()
    };
    assert_eq!(render(0), render(0));
    assert_ne!(render(0), render(u64::MAX));
}

/// The stats of a small render of the Cornell box that aims at an error.
fn stats(folder: &Path, integrator: &str) -> Value {
    let options = format!("--error 0.5 --integrator {integrator} --stats stats.json");
    render_cornell(folder, &options);
    serde_json::from_slice(&fs::read(folder.join("stats.json")).unwrap()).unwrap()
}

#[test]
fn stats_hold_the_fields_of_the_contract() {
    let folder = TempDir::new().unwrap();
    for integrator in INTEGRATORS {
        let stats = stats(folder.path(), integrator);
        for key in [
            "wall_s",
            "load_s",
            "fill_s",
            "render_s",
            "estimate_s",
            "lookups",
            "lookups_missed",
            "rays",
            "spp",
            "threads",
        ] {
            assert!(
                stats[key].is_number(),
                "{integrator}: {key} is {}",
                stats[key]
            );
        }
        assert!(stats["records"].is_object() && stats.get("peak_rss_mib").is_some());
    }
}

#[test]
fn the_estimated_error_comes_with_its_intervals() {
    let folder = TempDir::new().unwrap();
    for integrator in INTEGRATORS {
        let estimate = &stats(folder.path(), integrator)["estimated_error"];
        for key in ["value", "bias", "samples"] {
            assert!(estimate[key].is_number(), "{integrator}: {estimate}");
        }
        for key in ["ci95", "bias_ci95"] {
            let interval = estimate[key].as_array().map(Vec::len);
            assert_eq!(interval, Some(2), "{integrator}: {estimate}");
        }
    }
}

#[test]
fn a_time_limit_leaves_an_image_and_succeeds() {
    let folder = TempDir::new().unwrap();
    for integrator in INTEGRATORS {
        let scene = workspace().join("assets/cornell_box/cornell_box.ron");
        let begin = Instant::now();
        let said = succeed(
            folder.path(),
            &format!(
                "render {} -o out.exr --width 64 --error 1e-6 --time-limit 1 --integrator {integrator}",
                scene.display()
            ),
        );
        // Ten times the limit, for machines with other work to do; without a limit this render takes days.
        assert!(begin.elapsed().as_secs_f64() < 10.0);
        assert!(said.contains("time limit"), "{said}");
        let image = Channels::read(&folder.path().join("out.exr")).unwrap();
        let pixels = image.rgb("").unwrap().pixels;
        assert!(pixels.iter().all(|p| p.is_finite()));
    }
}

#[test]
fn the_program_says_at_the_end_what_it_switched_on() {
    let folder = TempDir::new().unwrap();
    let scene = workspace().join("assets/lamp/lamp.ron");
    let render = format!("render {} -o out.exr --width 8 --spp 1", scene.display());
    let said = succeed(folder.path(), &render);
    assert!(
        said.contains("media: 1 homogeneous") && said.contains("phase: isotropic"),
        "{said}"
    );
    assert_eq!(succeed(folder.path(), &format!("{render} --quiet")), "");
}

#[test]
fn an_image_compared_with_itself_has_no_error() {
    let folder = TempDir::new().unwrap();
    render_cornell(folder.path(), "--spp 1");
    let output = run_tyndall(folder.path(), &["compare", "out.exr", "out.exr", "--json"]);
    assert!(output.status.success());
    let numbers: Value = serde_json::from_slice(&output.stdout).unwrap();
    for key in ["rmse", "rel_rmse", "rel_mse", "error", "bias", "nan", "inf"] {
        assert_eq!(numbers[key].as_f64(), Some(0.0), "{key}");
    }
}

#[test]
fn outputs_never_replace_what_the_scene_is_read_from() {
    let folder = TempDir::new().unwrap();
    for file in fs::read_dir(workspace().join("assets/cornell_box")).unwrap() {
        let file = file.unwrap();
        fs::copy(file.path(), folder.path().join(file.file_name())).unwrap();
    }
    for file in ["cornell_box.ron", "cornell_box.gltf", "cornell_box.bin"] {
        let before = fs::read(folder.path().join(file)).unwrap();
        let command = format!("render cornell_box.ron -o out.exr --width 4 --spp 1 --stats {file}");
        let output = run_line(folder.path(), &command);
        assert_eq!(output.status.code(), Some(2), "{file}");
        assert_eq!(fs::read(folder.path().join(file)).unwrap(), before);
    }
}

#[test]
fn a_time_limit_too_short_for_one_sample_a_pixel_still_gives_a_whole_image() {
    let folder = TempDir::new().unwrap();
    let scene = workspace().join("assets/hall/hall.ron");
    let begin = Instant::now();
    let said = succeed(
        folder.path(),
        &format!("render {} -o out.exr --time-limit 0.2", scene.display()),
    );
    // 640 × 480 pixels take 10 s at one sample each; a row, which is begun and then ended, a tenth of a second.
    assert!(begin.elapsed().as_secs_f64() < 8.0);
    assert!(said.contains("repeat their neighbours"), "{said}");
    let image = Channels::read(&folder.path().join("out.exr")).unwrap();
    let pixels = image.rgb("").unwrap().pixels;
    let lit = pixels.iter().filter(|p| p.max_element() > 0.0).count();
    assert!(
        lit * 10 > pixels.len() * 9,
        "{lit} of {} pixels are lit",
        pixels.len()
    );
}

#[test]
fn a_comparison_without_a_finite_value_claims_nothing() {
    let folder = TempDir::new().unwrap();
    let nan = Image {
        size: [4, 4],
        pixels: vec![glam::Vec3::NAN; 16],
    };
    nan.write_exr(&folder.path().join("nan.exr")).unwrap();
    let output = run_tyndall(folder.path(), &["compare", "nan.exr", "nan.exr", "--json"]);
    let numbers: Value = serde_json::from_slice(&output.stdout).unwrap();
    assert!(numbers["error"].is_null() && numbers["rmse"].is_null());
    assert_eq!(numbers["nan"].as_f64(), Some(48.0));
    assert!(String::from_utf8_lossy(&output.stderr).contains("left out"));
}
