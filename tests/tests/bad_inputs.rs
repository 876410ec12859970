//! Wrong scene files, glTF files and commands: each must end with exit status 2, one readable paragraph that a snapshot
//! keeps, and no panic.

#![allow(clippy::unwrap_used, reason = "tests")]

use serde_json::{Value, json};
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use tyndall_tests::image::Image;
use tyndall_tests::program::{ends, run_line};

/// A scene that renders; the cases break it.
const SCENE: &str = r#"Scene(
    gltf: "mesh.gltf",
    camera: LookAt(eye: (0.0, 0.0, 4.0), target: (0.0, 0.0, 0.0), vfov: 40.0),
    film: Film(width: 4, height: 3),
    lights: [
        Point(position: (0.0, 1.0, 0.0), intensity: (1.0, 1.0, 1.0)),
    ],
    media: [
        Medium(
            region: Sphere(center: (0.0, 0.0, 0.0), radius: 2.0),
            sigma_t: (0.5, 0.5, 0.5),
            albedo: (0.9, 0.9, 0.9),
            phase: HenyeyGreenstein(g: 0.0),
        ),
    ],
)
"#;

/// The mesh of [`SCENE`]: one triangle, its buffer beside it.
fn mesh() -> Value {
    json!({
        "asset": { "version": "2.0" },
        "scene": 0,
        "scenes": [{ "nodes": [0] }],
        "nodes": [{ "name": "leaf", "mesh": 0 }],
        "meshes": [{ "primitives": [{ "attributes": { "POSITION": 0 }, "indices": 1 }] }],
        "accessors": [
            { "bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3, "min": [0, 0, 0], "max": [1, 1, 0] },
            { "bufferView": 1, "componentType": 5125, "type": "SCALAR", "count": 3 },
        ],
        "bufferViews": [
            { "buffer": 0, "byteLength": 36 },
            { "buffer": 0, "byteOffset": 36, "byteLength": 12 },
        ],
        "buffers": [{ "uri": "mesh.bin", "byteLength": 48 }],
    })
}

fn buffer() -> Vec<u8> {
    let positions: [f32; 9] = [0.0, 0.0, 0.0, 1.0, 0.0, 0.0, 0.0, 1.0, 0.0];
    let positions = positions.iter().flat_map(|x| x.to_le_bytes());
    positions
        .chain([0_u32, 1, 2].iter().flat_map(|i| i.to_le_bytes()))
        .collect()
}

/// A folder that holds the good scene.
fn good_folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("scene.ron"), SCENE).unwrap();
    fs::write(folder.path().join("mesh.gltf"), mesh().to_string()).unwrap();
    fs::write(folder.path().join("mesh.bin"), buffer()).unwrap();
    folder
}

const RENDER: &str = "render scene.ron -o out.exr --spp 1 --quiet";

/// Runs `arguments` in `folder`; they must be refused, with the message of the snapshot `name`.
fn refused(name: &str, folder: &Path, arguments: &str) {
    let (status, message) = ends(folder, arguments);
    let message = message.replace(&folder.display().to_string(), "[folder]");
    assert_eq!(status, Some(2), "{name}: {message}");
    assert!(!message.contains("internal error"), "{name}: {message}");
    assert!(!folder.join("out.exr").exists(), "{name}: left an image");
    insta::assert_snapshot!(name, message);
}

/// The good scene with `from` replaced by `to` in its scene file.
fn refused_scene(name: &str, from: &str, to: &str) {
    assert!(SCENE.contains(from), "{name}: nothing to replace");
    let folder = good_folder();
    fs::write(folder.path().join("scene.ron"), SCENE.replace(from, to)).unwrap();
    refused(name, folder.path(), RENDER);
}

/// The good scene with the value at a JSON pointer of its glTF replaced, or appended to an object.
fn refused_mesh(name: &str, parent: &str, key: &str, value: Value) {
    let folder = good_folder();
    let mut mesh = mesh();
    mesh.pointer_mut(parent).unwrap()[key] = value;
    fs::write(folder.path().join("mesh.gltf"), mesh.to_string()).unwrap();
    refused(name, folder.path(), RENDER);
}

#[test]
fn the_scene_that_the_cases_break_is_good() {
    let folder = good_folder();
    let output = run_line(folder.path(), RENDER);
    assert!(
        output.status.success(),
        "{}",
        String::from_utf8_lossy(&output.stderr)
    );
}

#[test]
fn wrong_scene_files_are_refused_with_line_and_column() {
    for (name, from, to) in [
        ("ron_misspelt_field", "sigma_t:", "sigma_T:"),
        ("ron_missing_field", "albedo: (0.9, 0.9, 0.9),", ""),
        (
            "ron_duplicate_field",
            "film: Film",
            "film: Film(width: 1, height: 1),\n    film: Film",
        ),
        ("ron_wrong_type", "vfov: 40.0", "vfov: \"wide\""),
        ("ron_trailing_text", "    ],\n)\n", "    ],\n)\nand more"),
        ("ron_unclosed", "    ],\n)\n", "    ],\n"),
        ("ron_not_a_number", "radius: 2.0", "radius: NaN"),
        ("ron_infinite", "(0.5, 0.5, 0.5)", "(0.5, inf, 0.5)"),
        (
            "ron_number_too_large",
            "(0.5, 0.5, 0.5)",
            "(0.5, 1e400, 0.5)",
        ),
        (
            "ron_negative_extinction",
            "(0.5, 0.5, 0.5)",
            "(0.5, -0.5, 0.5)",
        ),
        ("ron_albedo_above_one", "(0.9, 0.9, 0.9)", "(0.9, 1.2, 0.9)"),
        ("ron_g_too_large", "g: 0.0", "g: 1.5"),
        ("ron_negative_radius", "radius: 2.0", "radius: -2.0"),
        (
            "ron_negative_intensity",
            "(1.0, 1.0, 1.0)",
            "(1.0, -1.0, 1.0)",
        ),
        ("ron_unknown_light", "Point(", "Lantern("),
        ("ron_empty_film", "width: 4", "width: 0"),
        ("ron_negative_film", "width: 4", "width: -1"),
        ("ron_huge_film", "width: 4", "width: 2147483648"),
        ("ron_vfov_zero", "vfov: 40.0", "vfov: 0.0"),
        ("ron_vfov_half_turn", "vfov: 40.0", "vfov: 180.0"),
        (
            "ron_look_at_own_eye",
            "target: (0.0, 0.0, 0.0)",
            "target: (0.0, 0.0, 4.0)",
        ),
        (
            "ron_up_along_view",
            "vfov: 40.0",
            "vfov: 40.0, up: (0.0, 0.0, 1.0)",
        ),
        (
            "ron_unknown_camera",
            "LookAt(eye: (0.0, 0.0, 4.0), target: (0.0, 0.0, 0.0), vfov: 40.0)",
            "Gltf(\"balcony\")",
        ),
        (
            "ron_error_zero",
            "    media:",
            "    render: Render(error: 0.0),\n    media:",
        ),
    ] {
        refused_scene(name, from, to);
    }
}

#[test]
fn scene_files_that_are_no_text_or_too_deep_are_refused() {
    let folder = good_folder();
    let scene = folder.path().join("scene.ron");
    for (name, bytes) in [
        ("ron_not_utf8", b"Scene(gltf: \"\xff\xfe\")".to_vec()),
        ("ron_empty", Vec::new()),
        ("ron_nested_deeply", b"(".repeat(10_000)),
    ] {
        fs::write(&scene, bytes).unwrap();
        refused(name, folder.path(), RENDER);
    }
}

#[test]
fn wrong_gltf_files_are_refused_with_the_place() {
    for (name, parent, key, value) in [
        ("gltf_version_1", "/asset", "version", json!("1.0")),
        (
            "gltf_required_extension",
            "",
            "extensionsRequired",
            json!(["KHR_draco_mesh_compression"]),
        ),
        (
            "gltf_missing_buffer",
            "/buffers/0",
            "uri",
            json!("gone.bin"),
        ),
        (
            "gltf_buffer_outside_the_folder",
            "/buffers/0",
            "uri",
            json!("../../secret.bin"),
        ),
        (
            "gltf_buffer_outside_encoded",
            "/buffers/0",
            "uri",
            json!("%2e%2e/secret.bin"),
        ),
        (
            "gltf_buffer_by_network",
            "/buffers/0",
            "uri",
            json!("http://example.org/mesh.bin"),
        ),
        (
            "gltf_bad_percent_encoding",
            "/buffers/0",
            "uri",
            json!("%ff.bin"),
        ),
        (
            "gltf_bad_base64",
            "/buffers/0",
            "uri",
            json!("data:application/octet-stream;base64,@@@"),
        ),
        ("gltf_short_buffer", "/buffers/0", "byteLength", json!(4096)),
        (
            "gltf_accessor_beyond_view",
            "/accessors/0",
            "count",
            json!(4),
        ),
        (
            "gltf_accessor_count_huge",
            "/accessors/0",
            "count",
            json!(4_294_967_295_u32),
        ),
        (
            "gltf_accessor_offset_overflows",
            "/accessors/0",
            "byteOffset",
            json!(u64::MAX),
        ),
        (
            "gltf_view_beyond_buffer",
            "/bufferViews/1",
            "byteOffset",
            json!(40),
        ),
        (
            "gltf_view_of_no_buffer",
            "/bufferViews/0",
            "buffer",
            json!(7),
        ),
        (
            "gltf_node_is_its_own_child",
            "/nodes/0",
            "children",
            json!([0]),
        ),
        ("gltf_node_of_no_mesh", "/nodes/0", "mesh", json!(3)),
        (
            "gltf_infinite_matrix",
            "/nodes/0",
            "matrix",
            json!([1e39, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
        ),
        (
            "gltf_zero_rotation",
            "/nodes/0",
            "rotation",
            json!([0, 0, 0, 0]),
        ),
        ("gltf_wrong_type", "", "nodes", json!("many")),
    ] {
        refused_mesh(name, parent, key, value);
    }
}

#[test]
fn wrong_gltf_data_are_refused_with_the_place() {
    let index_beyond = [buffer()[..44].to_vec(), 9_u32.to_le_bytes().to_vec()].concat();
    let infinite = [f32::INFINITY.to_le_bytes().to_vec(), buffer()[4..].to_vec()].concat();
    for (name, bytes) in [
        ("gltf_index_beyond_vertices", index_beyond),
        ("gltf_infinite_position", infinite),
    ] {
        let folder = good_folder();
        fs::write(folder.path().join("mesh.bin"), bytes).unwrap();
        refused(name, folder.path(), RENDER);
    }
}

#[test]
fn wrong_binary_gltf_files_are_refused() {
    let word = |n: u32| n.to_le_bytes();
    for (name, bytes) in [
        ("glb_empty", Vec::new()),
        ("glb_header_alone", [*b"glTF", word(2), word(12)].concat()),
        (
            "glb_chunk_beyond_file",
            [*b"glTF", word(2), word(24), word(4000), *b"JSON", *b"{}  "].concat(),
        ),
        (
            "glb_no_json",
            [
                *b"glTF",
                word(2),
                word(24),
                word(4),
                *b"BIN\0",
                *b"\0\0\0\0",
            ]
            .concat(),
        ),
    ] {
        let folder = good_folder();
        fs::write(folder.path().join("mesh.glb"), bytes).unwrap();
        fs::write(
            folder.path().join("scene.ron"),
            SCENE.replace("mesh.gltf", "mesh.glb"),
        )
        .unwrap();
        refused(name, folder.path(), RENDER);
    }
}

#[test]
fn files_that_are_not_there_are_named() {
    refused_scene("file_missing_gltf", "mesh.gltf", "gone.gltf");
    refused_scene(
        "file_gltf_outside_the_folder",
        "mesh.gltf",
        "../secret.gltf",
    );
    refused_scene(
        "file_missing_environment",
        "Point(",
        "Environment(file: \"gone.exr\"),\n        Point(",
    );
    let folder = good_folder();
    refused(
        "file_missing_scene",
        folder.path(),
        "render gone.ron -o out.exr",
    );
    refused(
        "file_of_unknown_kind",
        folder.path(),
        "render mesh.bin -o out.exr",
    );
    refused(
        "file_output_of_unknown_kind",
        folder.path(),
        "render scene.ron -o out.tiff",
    );
    refused(
        "file_output_folder_missing",
        folder.path(),
        "render scene.ron -o gone/out.exr",
    );
}

#[test]
fn an_environment_with_a_texel_that_is_no_number_is_refused() {
    let folder = good_folder();
    let mut pixels = vec![glam::Vec3::ONE; 32];
    pixels[11].y = f32::NAN;
    Image {
        size: [8, 4],
        pixels,
    }
    .write_exr(&folder.path().join("sky.exr"))
    .unwrap();
    let scene = SCENE.replace("Point(", "Environment(file: \"sky.exr\"),\n        Point(");
    fs::write(folder.path().join("scene.ron"), scene).unwrap();
    refused("environment_not_a_number", folder.path(), RENDER);
}

#[test]
fn wrong_commands_are_refused() {
    let folder = good_folder();
    for (name, options) in [
        ("command_width_zero", "--width 0"),
        ("command_width_negative", "--width=-1"),
        ("command_width_huge", "--width 4294967295"),
        ("command_crop_outside", "--crop 2,2,3,3"),
        ("command_crop_three_numbers", "--crop 0,0,1"),
        ("command_spp_zero", "--spp 0"),
        ("command_error_zero", "--error 0"),
        ("command_error_not_a_number", "--error nan"),
        ("command_threads_zero", "--threads 0"),
        ("command_seed_negative", "--seed=-1"),
        ("command_max_depth_negative", "--max-depth=-1"),
        ("command_time_limit_negative", "--time-limit=-1"),
        ("command_fog_without_number", "--fog thick"),
        ("command_fog_albedo_above_one", "--fog 0.5,1.5"),
        ("command_unknown_layer", "--layers beauty,albedo"),
        ("command_unknown_integrator", "--integrator bidirectional"),
        ("command_unknown_option", "--samples 4"),
    ] {
        refused(
            name,
            folder.path(),
            &format!("render scene.ron -o out.exr {options}"),
        );
    }
    refused("command_nothing_to_render", folder.path(), "render");
}

#[test]
fn images_that_cannot_be_compared_are_refused() {
    let folder = good_folder();
    let image = |name: &str, size: [usize; 2]| {
        let pixels = vec![glam::Vec3::ONE; size[0] * size[1]];
        Image { size, pixels }
            .write_exr(&folder.path().join(name))
            .unwrap();
    };
    image("a.exr", [4, 3]);
    image("b.exr", [3, 4]);
    let whole = fs::read(folder.path().join("a.exr")).unwrap();
    fs::write(folder.path().join("half.exr"), &whole[..whole.len() / 2]).unwrap();
    refused("compare_sizes_differ", folder.path(), "compare a.exr b.exr");
    refused(
        "compare_missing_file",
        folder.path(),
        "compare a.exr gone.exr",
    );
    refused(
        "compare_truncated_file",
        folder.path(),
        "compare a.exr half.exr",
    );
    refused("compare_no_image", folder.path(), "compare a.exr mesh.bin");
}
