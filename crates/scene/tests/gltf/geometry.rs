//! Triangles: primitive modes, placement in the world, repairs.

use crate::files::*;
use glam::Vec3;
use serde_json::json;

#[test]
fn a_triangle_without_indices_normals_or_material_is_read() {
    let scene = read_json(&triangle()).unwrap();
    assert_eq!(corners(&scene), [[Vec3::ZERO, Vec3::X, Vec3::Y]]);
    assert_eq!(scene.mesh.normals, [Vec3::ZERO; 3]);
    assert_eq!(scene.mesh.materials, [0]);
    assert_eq!(scene.materials.len(), 1);
    assert!(scene.mesh.colors.is_empty() && scene.mesh.uvs[0].is_empty());
    assert!(scene.warnings.is_empty());
}

#[test]
fn strips_and_fans_keep_the_front_side() {
    let mode = "/meshes/0/primitives/0/mode";
    for (mode_number, indices, n) in [
        (4, &[0, 1, 2, 2, 1, 3][..], 2),
        (5, &[0, 1, 2, 3], 2),
        (6, &[0, 1, 3, 2], 2),
        (5, &[0, 1], 0),
        (6, &[0], 0),
        (6, &[], 0),
        (4, &[], 0),
    ] {
        let scene = read_json(&with(indexed(indices), [(mode, json!(mode_number))])).unwrap();
        assert_eq!(
            geometric_normals(&scene),
            vec![Vec3::Z; n],
            "mode {mode_number}"
        );
    }
}

#[test]
fn points_and_lines_are_left_out_with_one_warning() {
    for mode in 0..=3 {
        let change = ("/meshes/0/primitives/0/mode", json!(mode));
        let scene = read_json(&with(triangle(), [change])).unwrap();
        assert!(scene.mesh.indices.is_empty());
        assert_eq!(
            warnings(&scene),
            "1 primitives of points or lines are left out (at /meshes/0/primitives/0)"
        );
    }
}

#[test]
fn positions_must_be_finite_and_not_absurdly_far() {
    for (bad, part) in [
        (f32::NAN, "positions must be finite (at /accessors/0)"),
        (f32::INFINITY, "positions must be finite"),
        (
            3e38,
            "node \"the node\" places vertices further than 1e9 metres",
        ),
    ] {
        let mut corner = [0., 0., 0., 1., 0., 0., 0., 1., 0.];
        corner[4] = bad;
        check_error(&file(&[("VEC3", 5126, 3, floats(&corner))]), part);
    }
}

#[test]
fn bad_normals_become_geometric_and_are_counted_once_per_mesh() {
    let normals = floats(&[f32::NAN, 0., 1., 0., 0., 0., 0., 0., 7.]);
    let value = with(
        file(&[("VEC3", 5126, 3, square()), ("VEC3", 5126, 3, normals)]),
        [
            ("/meshes/0/primitives/0/attributes/NORMAL", json!(1)),
            ("/scenes/0/nodes", json!([0, 1])),
            ("/nodes", json!([{"mesh": 0}, {"mesh": 0}])),
        ],
    );
    let scene = read_json(&value).unwrap();
    assert_eq!(scene.mesh.normals[..3], [Vec3::ZERO, Vec3::ZERO, Vec3::Z]);
    assert_eq!(
        warnings(&scene),
        "2 unusable normals replaced in mesh \"rock\""
    );
}

#[test]
fn degenerate_triangles_are_dropped_and_counted_and_needles_stay() {
    let positions = [
        [0., 0., 0., 1., 0., 0., 0., 1., 0.],    // sound
        [1., 2., 3., 1., 2., 3., 4., 5., 6.],    // two equal corners
        [0., 0., 0., 1., 1., 1., 2., 2., 2.],    // on a line
        [0., 0., 0., 1., 0., 0., 0.5, 1e-7, 0.], // a needle
    ];
    let value = file(&[("VEC3", 5126, 12, floats(positions.as_flattened()))]);
    let scene = read_json(&value).unwrap();
    assert_eq!(scene.mesh.indices, [[0, 1, 2], [9, 10, 11]]);
    assert_eq!(
        warnings(&scene),
        "2 degenerate triangles dropped in mesh \"rock\""
    );
}

#[test]
fn transforms_place_vertices_and_mirrors_keep_front_faces_in_front() {
    let normals = floats(&[0., 0., 1., 0., 0., 1., 0., 0., 1.]);
    for scale in [[2., 3., 4.], [-2., 3., 4.], [-2., -3., 4.], [2., 3., -4.]] {
        let value = with(
            file(&[
                ("VEC3", 5126, 3, square()),
                ("VEC3", 5126, 3, normals.clone()),
            ]),
            [
                ("/meshes/0/primitives/0/attributes/NORMAL", json!(1)),
                ("/nodes/0/scale", json!(scale)),
                ("/nodes/0/translation", json!([10, 20, 30])),
            ],
        );
        let scene = read_json(&value).unwrap();
        let outside = Vec3::Z * (scale[2] as f32).signum();
        assert_eq!(geometric_normals(&scene), [outside], "{scale:?}");
        assert_eq!(scene.mesh.normals, [outside; 3], "{scale:?}");
        let p = Vec3::new(10., 20. + 3. * (scale[1] as f32).signum(), 30.);
        assert_eq!(scene.mesh.positions[2], p, "{scale:?}");
    }
}

#[test]
fn normals_stay_perpendicular_under_uneven_scale() {
    // The plane x + y = 1 with normal (1, 1, 0); x is stretched fourfold.
    let positions = floats(&[1., 0., 0., 0., 1., 0., 0., 1., 1.]);
    let normals = floats(&[1., 1., 0., 1., 1., 0., 1., 1., 0.]);
    let value = with(
        file(&[("VEC3", 5126, 3, positions), ("VEC3", 5126, 3, normals)]),
        [
            ("/meshes/0/primitives/0/attributes/NORMAL", json!(1)),
            (
                "/nodes/0/matrix",
                json!([4, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
            ),
        ],
    );
    let scene = read_json(&value).unwrap();
    // Rounding of two normalisations in f32.
    let difference = scene.mesh.normals[0]
        .cross(geometric_normals(&scene)[0])
        .length();
    assert!(difference < 1e-6, "{difference}");
}

#[test]
fn flattening_transforms_name_the_node() {
    let value = with(triangle(), [("/nodes/0/scale", json!([1, 0, 1]))]);
    check_error(&value, "node \"the node\" has a singular transform");
}

#[test]
fn compressed_primitives_are_refused_even_where_the_extension_is_not_required() {
    let value = with(
        triangle(),
        [
            (
                "/accessors/0",
                json!({"type": "VEC3", "componentType": 5126, "count": 3}),
            ),
            (
                "/meshes/0/primitives/0/extensions/KHR_draco_mesh_compression",
                json!({"bufferView": 0, "attributes": {}}),
            ),
        ],
    );
    check_error(&value, "requires KHR_draco_mesh_compression");
}

#[test]
fn skins_morphs_and_unknown_extensions_give_one_warning_each() {
    let value = with(
        triangle(),
        [
            ("/nodes/0/weights", json!([0.5])),
            (
                "/extensionsUsed",
                json!([
                    "KHR_texture_transform",
                    "KHR_materials_volume",
                    "FB_ngon_encoding"
                ]),
            ),
        ],
    );
    let scene = read_json(&value).unwrap();
    assert!(warnings(&scene).contains(
        "ignored extensions: KHR_materials_volume, FB_ngon_encoding (at /extensionsUsed)"
    ));
    assert!(warnings(&scene).contains(
        "1 nodes with skins or morph weights are drawn in their rest shape (at /nodes/0)"
    ));
}
