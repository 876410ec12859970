//! Typed arrays: every index and length is checked, and all forms of storage are read.

use crate::files::*;
use glam::{Vec3, Vec4};
use serde_json::json;

#[test]
fn indices_are_checked_against_the_vertices() {
    check_error(
        &indexed(&[0, 1, 4]),
        "index 4 is out of range: the file has 4 vertices in this primitive (at /accessors/1, element 2)",
    );
    check_error(
        &indexed(&[0, 1, 2, 3]),
        "4 is not allowed here; triangles need a multiple of 3",
    );
    let five = file(&[("VEC3", 5126, 4, square())]);
    check_error(
        &five,
        "triangles need a multiple of 3 (at /meshes/0/primitives/0/count)",
    );
}

#[test]
fn indices_of_all_widths_are_read() {
    for (component, bytes) in [
        (5121, vec![3, 2, 1]),
        (5123, vec![3, 0, 2, 0, 1, 0]),
        (5125, vec![3, 0, 0, 0, 2, 0, 0, 0, 1, 0, 0, 0]),
    ] {
        let mut value = file(&[("VEC3", 5126, 4, square()), ("SCALAR", component, 3, bytes)]);
        value["meshes"][0]["primitives"][0]["indices"] = json!(1);
        assert_eq!(read_json(&value).unwrap().mesh.indices, [[3, 2, 1]]);
    }
}

#[test]
fn every_reference_to_something_missing_is_an_error_with_its_place() {
    for (pointer, part) in [
        ("/scenes/0/nodes", "nodes (at /scenes/0/nodes/0)"),
        ("/nodes/0/mesh", "meshes (at /nodes/0/mesh)"),
        ("/nodes/0/camera", "cameras (at /nodes/0/camera)"),
        (
            "/meshes/0/primitives/0/attributes/POSITION",
            "accessors (at /meshes/0/primitives/0/attributes/POSITION)",
        ),
        (
            "/meshes/0/primitives/0/indices",
            "accessors (at /meshes/0/primitives/0/indices)",
        ),
        (
            "/meshes/0/primitives/0/material",
            "materials (at /meshes/0/primitives/0/material)",
        ),
        (
            "/accessors/0/bufferView",
            "buffer views (at /accessors/0/bufferView)",
        ),
        (
            "/bufferViews/0/buffer",
            "buffers (at /bufferViews/0/buffer)",
        ),
        ("/scene", "scenes (at /scene)"),
    ] {
        let index = if pointer.ends_with("nodes") {
            json!([99])
        } else {
            json!(99)
        };
        let value = with(triangle(), [(pointer, index)]);
        let message = read_json(&value).err().unwrap_or_default();
        assert!(
            message.contains("index 99 is out of range") && message.contains(part),
            "{message}"
        );
    }
    let light = with(
        triangle(),
        [("/nodes/0/extensions/KHR_lights_punctual/light", json!(3))],
    );
    check_error(&light, "the file has 0 lights");
}

#[test]
fn accessors_never_leave_their_bytes() {
    for (pointer, value) in [
        ("/accessors/0/count", json!(6)),
        ("/accessors/0/count", json!(u32::MAX)),
        ("/accessors/0/count", json!(u64::MAX)),
        ("/accessors/0/byteOffset", json!(24)),
        ("/accessors/0/byteOffset", json!(u64::MAX)),
        ("/bufferViews/0/byteLength", json!(49)),
        ("/bufferViews/0/byteOffset", json!(u64::MAX)),
        ("/bufferViews/0/byteStride", json!(252)),
        ("/buffers/0/byteLength", json!(49)),
        ("/buffers/0/byteLength", json!(u64::MAX)),
    ] {
        check_error(&with(triangle(), [(pointer, value)]), "bytes from byte");
    }
    let overlapping = with(triangle(), [("/bufferViews/0/byteStride", json!(4))]);
    check_error(&overlapping, "a byteStride of 4 is not allowed");
}

#[test]
fn accessors_of_the_wrong_kind_are_refused() {
    for (pointer, value, part) in [
        (
            "/accessors/0/type",
            json!("VEC2"),
            "Vec2 is not allowed here",
        ),
        ("/accessors/0/type", json!("VEC9"), "an unknown name"),
        (
            "/accessors/0/componentType",
            json!(5125),
            "5125 is not allowed here",
        ),
        ("/accessors/0/componentType", json!(1), "an unknown number"),
        ("/meshes/0/primitives/0/indices", json!(0), "allows Scalar"),
        (
            "/meshes/0/primitives/0/mode",
            json!(7),
            "allowed are 0 to 6",
        ),
    ] {
        check_error(&with(triangle(), [(pointer, value)]), part);
    }
    let normals = with(
        file(&[
            ("VEC3", 5126, 3, square()),
            ("VEC3", 5126, 2, floats(&[0.0; 6])),
        ]),
        [("/meshes/0/primitives/0/attributes/NORMAL", json!(1))],
    );
    check_error(
        &normals,
        "needs one element per vertex, 3 (at /accessors/1/count)",
    );
}

#[test]
fn an_accessor_without_bytes_is_zero_and_sparse_values_replace_elements() {
    // Three zeros, of which elements 1 and 2 become corners 1 and 2 of the square.
    let mut value = file(&[("VEC3", 5126, 3, square()), ("SCALAR", 5121, 2, vec![1, 2])]);
    value["accessors"][0] = json!({
        "type": "VEC3", "componentType": 5126, "count": 3,
        "sparse": {
            "count": 2,
            "indices": {"bufferView": 1, "componentType": 5121},
            "values": {"bufferView": 0, "byteOffset": 12},
        },
    });
    assert_eq!(
        corners(&read_json(&value).unwrap()),
        [[Vec3::ZERO, Vec3::X, Vec3::Y]]
    );
    let sparse = "/accessors/0/sparse";
    for (key, change, part) in [
        ("count", json!(4), "at most the accessor's count 3"),
        (
            "values/byteOffset",
            json!(48),
            "24 bytes from byte 48 on are needed",
        ),
        (
            "indices/byteOffset",
            json!(1),
            "2 bytes from byte 1 on are needed",
        ),
        (
            "indices/componentType",
            json!(5126),
            "allowed are 5121, 5123 and 5125",
        ),
    ] {
        check_error(
            &with(value.clone(), [(&format!("{sparse}/{key}"), change)]),
            part,
        );
    }
    let beyond = with(value.clone(), [("/accessors/0/count", json!(2))]);
    check_error(
        &beyond,
        "index 2 is out of range: the file has 2 elements in this accessor",
    );
    value["accessors"][0] = json!({"type": "VEC3", "componentType": 5126, "count": 3});
    assert!(warnings(&read_json(&value).unwrap()).contains("1 degenerate triangles"));
    value["accessors"][0]["count"] = json!(u32::MAX);
    check_error(&value, "4294967295 elements without a buffer view");
}

#[test]
fn interleaved_and_quantised_attributes_are_read() {
    // Positions as i16 and unsigned 8-bit colours, in one view with a stride of 12.
    let mut bytes = Vec::new();
    for (p, c) in [([0i16, 0, 0], 0u8), ([2, 0, 0], 51), ([0, 2, 0], 255)] {
        bytes.extend(p.iter().flat_map(|v| v.to_le_bytes()));
        bytes.extend([0, 0, c, 255, 0, 0]);
    }
    let mut value = with(
        file(&[("VEC3", 5122, 3, bytes)]),
        [
            ("/bufferViews/0/byteStride", json!(12)),
            ("/extensionsRequired", json!(["KHR_mesh_quantization"])),
            (
                "/meshes/0/primitives/0/attributes",
                json!({"POSITION": 0, "COLOR_0": 1}),
            ),
        ],
    );
    value["accessors"].as_array_mut().unwrap().push(json!({
        "bufferView": 0, "byteOffset": 8, "type": "VEC3", "componentType": 5121, "normalized": true, "count": 3,
    }));
    let scene = read_json(&value).unwrap();
    assert_eq!(
        corners(&scene),
        [[Vec3::ZERO, 2.0 * Vec3::X, 2.0 * Vec3::Y]]
    );
    let expected = [0.0, 0.2, 1.0].map(|c| Vec4::new(c, 1.0, 0.0, 1.0));
    assert_eq!(scene.mesh.colors, expected);
}
