//! Materials, textures and images.

use crate::files::*;
use glam::{Vec2, Vec3, Vec4};
use serde_json::{Value, json};
use std::f32::consts::FRAC_PI_2;
use tyndall_scene::gltf::GltfScene;

fn base_color(scene: &GltfScene, uv: Vec2) -> Vec4 {
    let map = scene.materials[0].base_color_texture.unwrap();
    map.color(&scene.textures, &[uv, Vec2::ZERO])
}

#[test]
fn images_come_from_data_uris_files_and_buffer_views() {
    let file_name = json!({"uri": "a%20red.png"});
    let mut in_view = textured(json!({"bufferView": 2, "mimeType": "image/png"}));
    let (views, buffers) = (
        json!({"buffer": 2, "byteLength": png().len()}),
        json!({"uri": data_uri(&png()), "byteLength": png().len()}),
    );
    in_view["bufferViews"].as_array_mut().unwrap().push(views);
    in_view["buffers"].as_array_mut().unwrap().push(buffers);
    for value in [
        textured(json!({"uri": data_uri(&png())})),
        textured(file_name),
        in_view,
    ] {
        let scene = read_text(value.to_string().as_bytes(), &[("a red.png", png())]).unwrap();
        assert_eq!(warnings(&scene), "");
        assert_eq!(scene.mesh.uvs[0], [Vec2::ZERO, Vec2::X, Vec2::Y]);
        assert_eq!(
            base_color(&scene, Vec2::new(0.1, 0.5)),
            Vec4::new(1., 0., 0., 1.)
        );
        assert_eq!(
            base_color(&scene, Vec2::new(3.0, 0.5)),
            Vec4::new(0., 1., 0., 128. / 255.)
        );
    }
}

#[test]
fn broken_images_are_white_with_a_warning_and_outside_images_are_refused() {
    let mut truncated = png();
    truncated.truncate(40);
    for (image, part) in [
        (
            json!({"uri": "nowhere.png"}),
            "texture \"nowhere.png\" is drawn white: cannot read",
        ),
        (
            json!({"uri": data_uri(&truncated)}),
            "texture \"images/0\" is drawn white",
        ),
        (
            json!({"uri": data_uri(b"KTX 20")}),
            "texture \"images/0\" is drawn white",
        ),
        (json!({"uri": "data:image/png;base64,???"}), "a data URI is"),
        (json!({}), "neither uri nor bufferView"),
        (json!({"bufferView": 9}), "index 9 is out of range"),
    ] {
        let scene = read_json(&textured(image)).unwrap();
        assert!(scene.materials[0].base_color_texture.is_none());
        assert!(warnings(&scene).contains(part), "{}", warnings(&scene));
    }
    for uri in ["../secret.png", "%2e%2e/secret.png", "/etc/hostname"] {
        check_error(
            &textured(json!({"uri": uri})),
            "refers outside the scene's folder",
        );
    }
    for uri in ["http://example.org/a.png", "file:///etc/hostname"] {
        check_error(&textured(json!({"uri": uri})), "is an address");
    }
}

#[test]
fn images_that_nothing_uses_are_not_touched() {
    let value = with(
        textured(json!({"uri": "../secret.png"})),
        [("/meshes/0/primitives/0/material", json!(null))],
    );
    assert_eq!(warnings(&read_json(&value).unwrap()), "");
}

#[test]
fn textures_that_cannot_be_used_are_left_out_with_a_warning() {
    let png = json!({"uri": data_uri(&png())});
    for (pointer, change, part) in [
        (
            "/textures",
            json!([]),
            "the file has no such texture (used by material \"paint\")",
        ),
        ("/textures/0", json!({}), "it has no PNG or JPEG image"),
        ("/images", json!([]), "the file has no such image"),
        (
            "/materials/0/pbrMetallicRoughness/baseColorTexture/texCoord",
            json!(2),
            "beyond TEXCOORD_1",
        ),
    ] {
        let scene = read_json(&with(textured(png.clone()), [(pointer, change)])).unwrap();
        assert!(warnings(&scene).contains(part), "{}", warnings(&scene));
    }
}

#[test]
fn texture_transforms_scale_turn_and_move_coordinates_and_choose_the_set() {
    let value = with(
        textured(json!({"uri": data_uri(&png())})),
        [(
            "/materials/0/pbrMetallicRoughness/baseColorTexture/extensions",
            json!({"KHR_texture_transform": {"scale": [2, 4], "rotation": FRAC_PI_2, "offset": [0.5, 0], "texCoord": 1}}),
        )],
    );
    let scene = read_json(&value).unwrap();
    let map = scene.materials[0].base_color_texture.unwrap();
    assert_eq!(map.tex_coord, 1);
    // Coordinates turn counter-clockwise as seen with v downwards: u goes to −v. Khronos's TextureTransformTest agrees: its
    // marker for the right rotation by π/8 lies at 67.5° in (u, v) and must show the texture's diagonal.
    for (uv, expected) in [
        (Vec2::X, Vec2::new(0.5, -2.0)),
        (Vec2::Y, Vec2::new(4.5, 0.0)),
    ] {
        let found = map.transform * uv + map.offset;
        assert!((found - expected).length() < 1e-6, "{uv}: {found}");
    }
}

fn material(value: Value) -> Result<GltfScene, String> {
    read_json(&with(
        triangle(),
        [
            ("/materials", json!([value])),
            ("/meshes/0/primitives/0/material", json!(0)),
        ],
    ))
}

#[test]
fn materials_keep_their_factors() {
    let scene = material(json!({
        "name": "lamp", "doubleSided": true, "alphaMode": "MASK", "emissiveFactor": [1, 0.5, 0],
        "pbrMetallicRoughness": {"baseColorFactor": [0.1, 0.2, 0.3, 0.4], "metallicFactor": 0.5, "roughnessFactor": 0.25},
        "extensions": {
            "KHR_materials_emissive_strength": {"emissiveStrength": 10},
            "KHR_materials_specular": {"specularFactor": 0.5, "specularColorFactor": [2, 1, 0]},
        },
    }))
    .unwrap();
    let found = &scene.materials[0];
    assert_eq!(found.base_color, Vec4::new(0.1, 0.2, 0.3, 0.4));
    assert_eq!(
        (found.metallic, found.roughness, found.specular_factor),
        (0.5, 0.25, 0.5)
    );
    assert_eq!(found.specular_color, Vec3::new(2., 1., 0.));
    assert_eq!(found.alpha_cutoff, Some(0.5));
    assert!(found.is_hole(&[], [Vec2::ZERO; 2], Vec4::ONE));
    assert_eq!(
        found.emission(&[], [Vec2::ZERO; 2], false),
        Vec3::new(10., 5., 0.)
    );
    assert_eq!(warnings(&scene), "");
}

#[test]
fn blend_is_drawn_opaque_with_a_warning() {
    let scene = material(json!({"name": "glass", "alphaMode": "BLEND"})).unwrap();
    assert_eq!(scene.materials[0].alpha_cutoff, None);
    assert_eq!(
        warnings(&scene),
        "material \"glass\": alpha mode BLEND is drawn opaque"
    );
}

#[test]
fn impossible_materials_are_refused_and_too_bright_ones_clamped() {
    for (value, part) in [
        (
            json!({"pbrMetallicRoughness": {"baseColorFactor": [-1, 0, 0, 1]}}),
            "(at /materials/0/pbrMetallicRoughness/baseColorFactor)",
        ),
        (
            json!({"pbrMetallicRoughness": {"roughnessFactor": 1e39}}),
            "(at /materials/0/pbrMetallicRoughness/roughnessFactor)",
        ),
        (
            json!({"emissiveFactor": [0, -1, 0]}),
            "(at /materials/0/emissiveFactor)",
        ),
        (
            json!({"extensions": {"KHR_materials_emissive_strength": {"emissiveStrength": -1}}}),
            "emissiveStrength)",
        ),
        (
            json!({"extensions": {"KHR_materials_specular": {"specularFactor": "x"}}}),
            "invalid type: string",
        ),
        (json!({"alphaMode": "GLOW"}), "allowed are \"OPAQUE\""),
    ] {
        let message = material(value).err().unwrap_or_default();
        assert!(message.contains(part), "{message}");
    }
    let scene = material(
        json!({"name": "snow", "pbrMetallicRoughness": {"baseColorFactor": [2, 0.5, 0, 1]}}),
    )
    .unwrap();
    assert_eq!(scene.materials[0].base_color, Vec4::new(1., 0.5, 0., 1.));
    assert!(warnings(&scene).contains("\"snow\" has factors above 1"));
}
