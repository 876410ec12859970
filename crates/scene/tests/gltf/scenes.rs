//! Scenes, cameras and lights.

use crate::files::*;
use glam::Vec3;
use serde_json::{Value, json};
use std::f32::consts::FRAC_PI_2;
use std::path::Path;
use tyndall_scene::gltf::{PunctualLight, ReadOptions, read};

#[test]
fn the_default_scene_the_first_or_the_named_one_is_shown() {
    let nodes =
        json!([{"translation": [1, 0, 0], "camera": 0}, {"translation": [2, 0, 0], "camera": 0}]);
    let base = with(
        triangle(),
        [
            ("/nodes", nodes),
            (
                "/scenes",
                json!([{"nodes": [0], "name": "one"}, {"nodes": [1], "name": "two"}]),
            ),
            (
                "/cameras",
                json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]),
            ),
        ],
    );
    let x = |value: &Value, scene: Option<&str>| {
        let dir = tempfile::tempdir().unwrap();
        let path = dir.path().join("a.gltf");
        std::fs::write(&path, value.to_string()).unwrap();
        let options = ReadOptions {
            scene: scene.map(Into::into),
            ..ReadOptions::default()
        };
        read(&path, &options)
            .map(|found| found.cameras[0].world_from_camera.translation.x)
            .map_err(|error| error.to_string())
    };
    assert_eq!(x(&base, None), Ok(1.0));
    let with_default = with(base.clone(), [("/scene", json!(1))]);
    assert_eq!(x(&with_default, None), Ok(2.0));
    assert_eq!(x(&with_default, Some("one")), Ok(1.0));
    assert!(
        x(&base, Some("three"))
            .unwrap_err()
            .contains("[\"one\", \"two\"]")
    );
    check_error(
        &with(base, [("/scenes", json!([]))]),
        "the file has no scene",
    );
}

#[test]
fn cameras_are_rigid_and_called_by_their_own_or_their_nodes_name() {
    let value = with(
        triangle(),
        [
            (
                "/nodes",
                json!([{"name": "eye", "camera": 0, "translation": [1, 2, 3], "scale": [2, 2, -2]}, {"camera": 1}]),
            ),
            ("/scenes/0/nodes", json!([0, 1])),
            (
                "/cameras",
                json!([
                    {"name": "lens", "type": "perspective", "perspective": {"yfov": 0.5, "aspectRatio": 2, "znear": 0.1}},
                    {"type": "orthographic", "orthographic": {"xmag": 1, "ymag": 1, "znear": 0, "zfar": 1}},
                ]),
            ),
        ],
    );
    let scene = read_json(&value).unwrap();
    let [camera] = &scene.cameras[..] else {
        panic!("{} cameras", scene.cameras.len());
    };
    assert!(camera.is_called("eye") && camera.is_called("lens") && !camera.is_called("2"));
    assert_eq!((camera.yfov, camera.aspect), (0.5, Some(2.0)));
    let to_world = |v| camera.world_from_camera.transform_vector3(v);
    // The mirrored node looks along +z; right stays right of the viewer.
    assert_eq!(to_world(Vec3::NEG_Z), Vec3::Z);
    assert_eq!(to_world(Vec3::Y), Vec3::Y);
    assert_eq!(to_world(Vec3::X), Vec3::NEG_X);
    assert!(warnings(&scene).contains("orthographic camera is left out"));
    for (key, bad) in [
        ("yfov", json!(0)),
        ("yfov", json!(3.2)),
        ("aspectRatio", json!(-1)),
    ] {
        let pointer = format!("/cameras/0/perspective/{key}");
        check_error(
            &with(value.clone(), [(&pointer, bad)]),
            &format!("(at {pointer})"),
        );
    }
}

#[test]
fn punctual_lights_keep_their_numbers_and_shine_along_minus_z() {
    // A quarter turn about x takes −z to +y, up to the rounding of its sine in f32.
    let node = json!({"translation": [1, 2, 3], "rotation": [0.707_106_77, 0, 0, 0.707_106_77], "scale": [2, 2, 2]});
    let position = Vec3::new(1., 2., 3.);
    let color = json!([1, 0.5, 0]);
    let intensity = Vec3::new(80., 40., 0.);
    let light = |type_: &str| {
        with_light(
            json!({"type": type_, "color": color, "intensity": 80, "range": 5}),
            node.clone(),
        )
    };
    let scene = read_json(&light("point")).unwrap();
    assert_eq!(
        scene.lights,
        [PunctualLight::Point {
            position,
            intensity
        }]
    );
    assert!(warnings(&scene).contains("range is ignored"));
    let scene = read_json(&light("directional")).unwrap();
    let PunctualLight::Directional {
        direction,
        irradiance,
    } = scene.lights[0]
    else {
        panic!("{:?}", scene.lights);
    };
    assert!((direction - Vec3::Y).length() < 1e-6 && irradiance == intensity);
    let scene = read_json(&light("spot")).unwrap();
    let PunctualLight::Spot {
        inner_cone,
        outer_cone,
        ..
    } = scene.lights[0]
    else {
        panic!("{:?}", scene.lights);
    };
    assert_eq!((inner_cone, outer_cone), (0.0, std::f32::consts::FRAC_PI_4));
}

#[test]
fn lights_with_impossible_numbers_are_refused() {
    let spot = |inner: f32, outer: f32| json!({"type": "spot", "spot": {"innerConeAngle": inner, "outerConeAngle": outer}});
    for (light, part) in [
        (
            json!({"type": "point", "intensity": -1}),
            "both must be finite and not negative",
        ),
        (
            json!({"type": "point", "color": [-1, -1, -1], "intensity": -1}),
            "not negative",
        ),
        (json!({"type": "point", "intensity": 1e39}), "not negative"),
        (json!({"type": "area"}), "allowed are \"point\""),
        (spot(0.5, 0.4), "0 ≤ inner ≤ outer"),
        (spot(0.0, 0.0), "0 ≤ inner ≤ outer"),
        (spot(0.0, 1.6), "0 ≤ inner ≤ outer"),
    ] {
        check_error(&with_light(light, json!({})), part);
    }
    for sound in [spot(0.3, 0.3), spot(0.0, FRAC_PI_2)] {
        assert!(read_json(&with_light(sound, json!({}))).is_ok());
    }
}

#[test]
fn a_missing_file_names_itself() {
    let error = read(Path::new("nowhere/scene.gltf"), &ReadOptions::default()).unwrap_err();
    assert!(error.to_string().contains("nowhere/scene.gltf"));
}
