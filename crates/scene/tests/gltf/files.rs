//! Tiny glTF files to start from, and how to read them.

use base64::Engine as _;
use base64::engine::general_purpose::STANDARD;
use glam::Vec3;
use serde_json::{Value, json};
use tyndall_scene::gltf::{GltfScene, ReadOptions, read};

/// The corners (0,0,0), (1,0,0), (0,1,0), (1,1,0) of a square, as bytes.
pub(crate) fn square() -> Vec<u8> {
    floats(&[0., 0., 0., 1., 0., 0., 0., 1., 0., 1., 1., 0.])
}

pub(crate) fn floats(values: &[f32]) -> Vec<u8> {
    values.iter().flat_map(|v| v.to_le_bytes()).collect()
}

pub(crate) fn data_uri(bytes: &[u8]) -> String {
    format!(
        "data:application/octet-stream;base64,{}",
        STANDARD.encode(bytes)
    )
}

/// Type, component type, count and bytes of an accessor.
pub(crate) type Stored = (&'static str, u32, usize, Vec<u8>);

/// A file in which accessor `i` is the whole of buffer `i`; one node shows one mesh of one non-indexed primitive that takes
/// POSITION from accessor 0.
pub(crate) fn file(accessors: &[Stored]) -> Value {
    let list = |f: &dyn Fn(usize, &Stored) -> Value| {
        Value::Array(accessors.iter().enumerate().map(|(i, a)| f(i, a)).collect())
    };
    json!({
        "asset": {"version": "2.0"},
        "scenes": [{"nodes": [0]}],
        "nodes": [{"mesh": 0, "name": "the node"}],
        "meshes": [{"name": "rock", "primitives": [{"attributes": {"POSITION": 0}}]}],
        "accessors": list(&|i, (type_, component, count, _)| json!(
            {"bufferView": i, "type": type_, "componentType": component, "count": count})),
        "bufferViews": list(&|i, a| json!({"buffer": i, "byteLength": a.3.len()})),
        "buffers": list(&|_, a| json!({"uri": data_uri(&a.3), "byteLength": a.3.len()})),
    })
}

/// One triangle: the first three corners of the square.
pub(crate) fn triangle() -> Value {
    file(&[("VEC3", 5126, 3, square())])
}

/// The square as an indexed primitive.
pub(crate) fn indexed(indices: &[u8]) -> Value {
    let mut value = file(&[
        ("VEC3", 5126, 4, square()),
        ("SCALAR", 5121, indices.len(), indices.to_vec()),
    ]);
    value["meshes"][0]["primitives"][0]["indices"] = json!(1);
    value
}

/// `value` with the parts at the given JSON pointers replaced; missing keys of objects are made.
pub(crate) fn with<const N: usize>(mut value: Value, changes: [(&str, Value); N]) -> Value {
    for (pointer, change) in changes {
        let mut at = &mut value;
        for key in pointer.split('/').skip(1) {
            at = match key.parse::<usize>() {
                Ok(i) => &mut at[i],
                Err(_) => &mut at[key],
            };
        }
        *at = change;
    }
    value
}

/// Reads `text` as a file in a folder with the given other files.
pub(crate) fn read_text(text: &[u8], others: &[(&str, Vec<u8>)]) -> Result<GltfScene, String> {
    let dir = tempfile::tempdir().unwrap();
    for (name, bytes) in others {
        std::fs::write(dir.path().join(name), bytes).unwrap();
    }
    let path = dir.path().join("scene.gltf");
    std::fs::write(&path, text).unwrap();
    read(&path, &ReadOptions::default()).map_err(|error| {
        let message = error.to_string();
        assert!(
            message.contains("scene.gltf"),
            "the file is named: {message}"
        );
        message
    })
}

pub(crate) fn read_json(value: &Value) -> Result<GltfScene, String> {
    read_text(value.to_string().as_bytes(), &[])
}

/// All warnings in one line.
pub(crate) fn warnings(scene: &GltfScene) -> String {
    let all: Vec<_> = scene.warnings.iter().map(ToString::to_string).collect();
    all.join("; ")
}

#[track_caller]
pub(crate) fn check_error(value: &Value, part: &str) {
    match read_json(value) {
        Ok(_) => panic!("read, although \"{part}\" was expected"),
        Err(message) => assert!(message.contains(part), "{message}"),
    }
}

/// Corners of all triangles.
pub(crate) fn corners(scene: &GltfScene) -> Vec<[Vec3; 3]> {
    (0..scene.mesh.indices.len())
        .map(|i| scene.mesh.corners(i))
        .collect()
}

pub(crate) fn geometric_normals(scene: &GltfScene) -> Vec<Vec3> {
    let normal = |[a, b, c]: [Vec3; 3]| (b - a).cross(c - a).normalize();
    corners(scene).into_iter().map(normal).collect()
}

pub(crate) fn with_light(light: Value, node: Value) -> Value {
    let node = with(node, [("/extensions/KHR_lights_punctual/light", json!(0))]);
    with(
        triangle(),
        [
            ("/nodes/0", node),
            ("/extensions/KHR_lights_punctual/lights", json!([light])),
        ],
    )
}

/// A PNG of 2 × 1 texels: red, then green with half alpha.
pub(crate) fn png() -> Vec<u8> {
    let texels = vec![255, 0, 0, 255, 0, 255, 0, 128];
    let image = image::RgbaImage::from_raw(2, 1, texels).unwrap();
    let mut bytes = std::io::Cursor::new(Vec::new());
    image.write_to(&mut bytes, image::ImageFormat::Png).unwrap();
    bytes.into_inner()
}

/// A triangle with texture coordinates and a material that shows image 0.
pub(crate) fn textured(image: Value) -> Value {
    with(
        file(&[
            ("VEC3", 5126, 3, square()),
            (
                "VEC2",
                5123,
                3,
                [0u16, 0, 65535, 0, 0, 65535]
                    .iter()
                    .flat_map(|v| v.to_le_bytes())
                    .collect(),
            ),
        ]),
        [
            ("/accessors/1/normalized", json!(true)),
            ("/meshes/0/primitives/0/attributes/TEXCOORD_0", json!(1)),
            ("/meshes/0/primitives/0/material", json!(0)),
            (
                "/materials",
                json!([{"name": "paint", "pbrMetallicRoughness": {"baseColorTexture": {"index": 0}}}]),
            ),
            ("/textures", json!([{"source": 0, "sampler": 0}])),
            (
                "/samplers",
                json!([{"wrapS": 33071, "wrapT": 33648, "magFilter": 9728}]),
            ),
            ("/images", json!([image])),
        ],
    )
}
