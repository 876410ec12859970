//! Two rooms of fog that share a wall without thickness, one lit and one dark: no light passes the wall.
#![allow(clippy::unwrap_used, reason = "tests")]

use serde_json::json;
use std::fs;
use std::path::Path;
use tempfile::TempDir;
use tyndall_render::options::RenderOptions;
use tyndall_scene::LoadOptions;

type Quad = [[f32; 3]; 4];

/// The walls of both rooms: x from −1 to 1, cut at 0; y from 0 to 1, z from −0.5 to 0.5.
fn walls() -> Vec<Quad> {
    let across = |x: f32| [[x, 0.0, -0.5], [x, 1.0, -0.5], [x, 1.0, 0.5], [x, 0.0, 0.5]];
    let level = |y: f32| {
        [
            [-1.0, y, -0.5],
            [1.0, y, -0.5],
            [1.0, y, 0.5],
            [-1.0, y, 0.5],
        ]
    };
    let along = |z: f32| [[-1.0, 0.0, z], [1.0, 0.0, z], [1.0, 1.0, z], [-1.0, 1.0, z]];
    vec![
        across(-1.0),
        across(0.0),
        across(1.0),
        level(0.0),
        level(1.0),
        along(-0.5),
        along(0.5),
    ]
}

/// Writes `quads` as `rooms.gltf` and `rooms.bin`.
fn write_gltf(folder: &Path, quads: &[Quad]) {
    let positions: Vec<u8> = (quads.iter().flatten().flatten())
        .flat_map(|x| x.to_le_bytes())
        .collect();
    let indices: Vec<u8> = (0..quads.len() as u16)
        .flat_map(|quad| [0, 1, 2, 0, 2, 3].map(|corner| 4 * quad + corner))
        .flat_map(u16::to_le_bytes)
        .collect();
    let gltf = json!({
        "asset": {"version": "2.0"},
        "scene": 0,
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0}],
        "meshes": [{"primitives": [{"attributes": {"POSITION": 0}, "indices": 1, "material": 0}]}],
        "materials": [{
            "pbrMetallicRoughness": {"baseColorFactor": [0.7, 0.7, 0.7, 1.0], "metallicFactor": 0.0},
            "extensions": {"KHR_materials_specular": {"specularFactor": 0.0}},
        }],
        "extensionsUsed": ["KHR_materials_specular"],
        "buffers": [{"uri": "rooms.bin", "byteLength": positions.len() + indices.len()}],
        "bufferViews": [
            {"buffer": 0, "byteOffset": 0, "byteLength": positions.len()},
            {"buffer": 0, "byteOffset": positions.len(), "byteLength": indices.len()},
        ],
        "accessors": [
            {"bufferView": 0, "componentType": 5126, "count": 4 * quads.len(), "type": "VEC3",
             "min": [-1.0, 0.0, -0.5], "max": [1.0, 1.0, 0.5]},
            {"bufferView": 1, "componentType": 5123, "count": 6 * quads.len(), "type": "SCALAR"},
        ],
    });
    fs::write(folder.join("rooms.gltf"), gltf.to_string()).unwrap();
    fs::write(folder.join("rooms.bin"), [positions, indices].concat()).unwrap();
}

/// The least and the greatest value of each layer of an image from the dark room on the left, whose camera looks at the shared wall, with
/// a lamp in a room.
fn seen(lamp: f32) -> Vec<(&'static str, f32, f32)> {
    let folder = TempDir::new().unwrap();
    write_gltf(folder.path(), &walls());
    let ron = format!(
        "Scene(
            gltf: \"rooms.gltf\",
            camera: LookAt(eye: (-0.9, 0.5, 0.1), target: (0.0, 0.45, 0.0), vfov: 80.0),
            film: Film(width: 40, height: 30),
            lights: [Point(position: ({lamp:?}, 0.6, 0.1), intensity: (1, 1, 1))],
            media: [Medium(region: Box(min: (-1, 0, -0.5), max: (1, 1, 0.5)), sigma_t: (1, 1, 1), albedo: (0.9, 0.9, 0.9))],
        )"
    );
    let scene = tyndall_scene::load_str(&ron, folder.path(), &LoadOptions::default()).unwrap();
    let options = RenderOptions {
        error: Some(0.1),
        ..RenderOptions::default()
    };
    let image = tyndall_render::render(&scene, &options, &()).unwrap().image;
    ["surface", "single", "multiple"]
        .map(|layer| {
            let values = || image.layer(layer).unwrap().into_iter().flatten().copied();
            let least = values().fold(f32::INFINITY, f32::min);
            (layer, least, values().fold(0.0, f32::max))
        })
        .to_vec()
}

#[test]
fn a_dark_room_beside_a_lit_one_stays_black() {
    for (layer, _, most) in seen(0.08) {
        assert_eq!(most, 0.0, "{layer}");
    }
}

#[test]
fn a_lamp_in_the_room_lights_all_of_it() {
    for (layer, least, _) in seen(-0.08) {
        assert!(least > 0.0, "{layer}: {least}");
    }
}
