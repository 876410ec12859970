//! Cameras that animations move.

use crate::files::*;
use glam::{DQuat, Vec3};
use serde_json::{Value, json};
use std::f64::consts::FRAC_1_SQRT_2;
use tyndall_scene::CameraError;
use tyndall_scene::gltf::{AnimatedCamera, CameraAnimation, GltfScene, ReadOptions, read};

/// Node that carries the camera.
const CAMERA: usize = 2;

/// Parent of the camera's node.
const RIG: usize = 1;

/// A node's property, how it is interpolated, its times, and its values as an accessor.
type Moved<'a> = (usize, &'a str, &'a str, &'a [f32], Stored);

/// A triangle on node 0, and a camera on node 2, child of node 1, that one animation moves.
fn animated(channels: &[Moved<'_>]) -> Value {
    let mut accessors = vec![("VEC3", 5126, 3, square())];
    for (.., times, values) in channels {
        accessors.push(("SCALAR", 5126, times.len(), floats(times)));
        accessors.push(values.clone());
    }
    let list = |f: &dyn Fn(usize, &Moved<'_>) -> Value| {
        Value::Array(channels.iter().enumerate().map(|(i, c)| f(i, c)).collect())
    };
    with(
        file(&accessors),
        [
            ("/scenes/0/nodes", json!([0, RIG])),
            (
                "/nodes",
                json!([{"mesh": 0}, {"children": [CAMERA]}, {"name": "eye", "camera": 0}]),
            ),
            (
                "/cameras",
                json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]),
            ),
            (
                "/animations",
                json!([{
                    "name": "flight",
                    "channels": list(&|i, c| json!({"sampler": i, "target": {"node": c.0, "path": c.1}})),
                    "samplers": list(&|i, c| json!({
                        "input": 1 + 2 * i, "output": 2 + 2 * i, "interpolation": c.2})),
                }]),
            ),
        ],
    )
}

fn vectors(values: &[f32]) -> Stored {
    ("VEC3", 5126, values.len() / 3, floats(values))
}

fn quaternions(values: &[f32]) -> Stored {
    ("VEC4", 5126, values.len() / 4, floats(values))
}

/// sin and cos of 45°, which make a quarter turn.
const S: f32 = std::f32::consts::FRAC_1_SQRT_2;

fn animation(value: &Value) -> CameraAnimation {
    let scene = read_json(value).unwrap();
    scene.cameras[0].animation.clone().unwrap()
}

#[track_caller]
fn eye(animation: &CameraAnimation, time: f32, expected: [f32; 3]) {
    let found = animation.at(time).unwrap().translation;
    // Rounding of f32 values below 8.
    assert!(
        (Vec3::from(found) - Vec3::from(expected)).length() < 1e-6,
        "at {time} s: {found}"
    );
}

/// Checks the direction of view by its angle from −z towards −x, in radians.
#[track_caller]
fn turn(animation: &CameraAnimation, time: f32, angle: f64) {
    let forward = animation
        .at(time)
        .unwrap()
        .transform_vector3(Vec3::NEG_Z)
        .as_dvec3();
    let found = (-forward.x).atan2(-forward.z);
    // Rounding of quaternions in f32.
    assert!((found - angle).abs() < 3e-7, "at {time} s: {found}");
    assert!(forward.y.abs() < 1e-7);
}

#[test]
fn linear_steps_and_cubics_move_the_camera_as_worked_out_by_hand() {
    let line = [0., 0., 0., 4., 2., 0., 4., 2., 6.];
    let linear = animation(&animated(&[(
        CAMERA,
        "translation",
        "LINEAR",
        &[1., 2., 4.],
        vectors(&line),
    )]));
    for (time, expected) in [
        (0.0, [0., 0., 0.]),
        (1.0, [0., 0., 0.]),
        (1.25, [1., 0.5, 0.]),
        (2.0, [4., 2., 0.]),
        (3.0, [4., 2., 3.]),
        (4.0, [4., 2., 6.]),
        (9.0, [4., 2., 6.]),
        (f32::INFINITY, [4., 2., 6.]),
        (f32::NAN, [0., 0., 0.]),
    ] {
        eye(&linear, time, expected);
    }
    assert_eq!(linear.span(), [1.0, 4.0]);
    let step = animation(&animated(&[(
        CAMERA,
        "translation",
        "STEP",
        &[1., 2., 4.],
        vectors(&line),
    )]));
    for (time, expected) in [
        (1.999_999_9, [0., 0., 0.]),
        (2.0, [4., 2., 0.]),
        (3.9, [4., 2., 0.]),
        (4.0, [4., 2., 6.]),
    ] {
        eye(&step, time, expected);
    }
    // From 0 at 1 m/s to 4 at rest in two seconds: half way 4/2 + 2 (1 - 0)/8 = 2.25; after a quarter
    // 4 (3/16 - 2/64) + 2 (1/64 - 2/16 + 1/4) = 0.90625. The outer slopes are of no use.
    let cubic = animation(&animated(&[(
        CAMERA,
        "translation",
        "CUBICSPLINE",
        &[1., 3.],
        vectors(&[
            7., 7., 7., 0., 0., 0., 1., 0., 0., //
            0., 0., 0., 4., 0., 0., 7., 7., 7.,
        ]),
    )]));
    for (time, x) in [
        (0.5, 0.0),
        (1.0, 0.0),
        (1.5, 0.90625),
        (2.0, 2.25),
        (3.0, 4.0),
        (5.0, 4.0),
    ] {
        eye(&cubic, time, [x, 0., 0.]);
    }
}

#[test]
fn rotations_run_evenly_on_the_shorter_way_or_along_a_normalised_cubic() {
    let quarter = std::f64::consts::FRAC_PI_2;
    for sign in [1.0, -1.0] {
        let turned = [0., 0., 0., 1., 0., sign * S, 0., sign * S];
        let linear = animation(&animated(&[(
            CAMERA,
            "rotation",
            "LINEAR",
            &[0., 3.],
            quaternions(&turned),
        )]));
        for (time, share) in [(0.0, 0.0), (1.0, 1.0 / 3.0), (1.5, 0.5), (3.0, 1.0)] {
            turn(&linear, time, share * quarter);
        }
        let step = animation(&animated(&[(
            CAMERA,
            "rotation",
            "STEP",
            &[0., 3.],
            quaternions(&turned),
        )]));
        turn(&step, 2.9, 0.0);
        turn(&step, 3.0, quarter);
    }
    let cubic = animation(&animated(&[(
        CAMERA,
        "rotation",
        "CUBICSPLINE",
        &[0., 4.],
        quaternions(&[
            0., 0., 0., 0., 0., 0., 0., 1., 0., 0.5, 0., 0., //
            0., 0., 0., 0., 0., S, 0., S, 0., 0., 0., 0.,
        ]),
    )]));
    turn(&cubic, 0.0, 0.0);
    turn(&cubic, 4.0, quarter);
    // After a quarter: weights 27/32 and 5/32 of the values, 4 × 9/64 of the first slope.
    let y = 5.0 / 32.0 * FRAC_1_SQRT_2 + 4.0 * 9.0 / 64.0 * 0.5;
    let w = 27.0 / 32.0 + 5.0 / 32.0 * FRAC_1_SQRT_2;
    turn(&cubic, 1.0, 2.0 * f64::atan2(y, w));
}

#[test]
fn rotations_stored_as_integers_are_normalised() {
    let quarter = std::f64::consts::FRAC_PI_2;
    let i16s = |v: i16| [0, v, 0, v].iter().flat_map(|v| v.to_le_bytes()).collect();
    let u16s = |v: u16| [0, v, 0, v].iter().flat_map(|v| v.to_le_bytes()).collect();
    for (component, bytes) in [
        (5120, vec![0, 90, 0, 90]),
        (5121, vec![0, 180, 0, 180]),
        (5122, i16s(23170)),
        (5123, u16s(46341)),
    ] {
        let stored = ("VEC4", component, 1, bytes);
        let value = animated(&[(CAMERA, "rotation", "LINEAR", &[0.], stored)]);
        check_error(
            &value,
            "allows 5126 (float) and normalized integers of 8 and 16 bits",
        );
        let value = with(value, [("/accessors/2/normalized", json!(true))]);
        turn(&animation(&value), 0.0, quarter);
    }
}

#[test]
fn ancestors_carry_the_camera_and_what_no_channel_moves_stays_at_rest() {
    // The rig grows from 1 to 3 and turns by a quarter about y, which takes the camera's x to -z.
    let value = with(
        animated(&[
            (
                RIG,
                "scale",
                "LINEAR",
                &[0., 2.],
                vectors(&[1., 1., 1., 3., 3., 3.]),
            ),
            (
                RIG,
                "rotation",
                "STEP",
                &[0., 1.],
                quaternions(&[0., 0., 0., 1., 0., S, 0., S]),
            ),
            (
                CAMERA,
                "translation",
                "LINEAR",
                &[2., 3.],
                vectors(&[1., 0., 0., 2., 0., 0.]),
            ),
        ]),
        [
            ("/nodes/1/translation", json!([0, 5, 0])),
            ("/nodes/2/rotation", json!([0, S, 0, S])),
        ],
    );
    let animation = animation(&value);
    assert_eq!(animation.span(), [0.0, 3.0]);
    for (time, at, quarters) in [
        (0.0, [1., 5., 0.], 1.0),
        (0.5, [1.5, 5., 0.], 1.0),
        (1.0, [0., 5., -2.], 2.0),
        (2.0, [0., 5., -3.], 2.0),
        (3.0, [0., 5., -6.], 2.0),
    ] {
        eye(&animation, time, at);
        let forward = animation.at(time).unwrap().transform_vector3(Vec3::NEG_Z);
        let expected =
            DQuat::from_rotation_y(quarters * std::f64::consts::FRAC_PI_2) * glam::DVec3::NEG_Z;
        assert!((forward.as_dvec3() - expected).length() < 1e-6, "{forward}");
    }
}

#[test]
fn a_camera_sheared_by_an_animation_stands_as_one_sheared_at_rest() {
    let (scale, tilt) = (json!([1, 4, -2]), [0.3, 0.1, 0.0, 0.9]);
    let value = with(
        animated(&[(
            RIG,
            "scale",
            "LINEAR",
            &[0., 1.],
            vectors(&[1., 1., 2., 1., 4., -2.]),
        )]),
        [
            ("/nodes/1/scale", scale),
            ("/nodes/2/rotation", json!(tilt)),
            ("/nodes/2/translation", json!([1, 2, 3])),
        ],
    );
    let scene = read_json(&value).unwrap();
    let camera = &scene.cameras[0];
    let moved = camera.animation.as_ref().unwrap();
    assert_eq!(moved.at(1.0).unwrap(), camera.world_from_camera);
    assert_ne!(moved.at(0.0).unwrap(), camera.world_from_camera);
    // Between scales of 2 and -2 the camera is flattened, and that is an error of this time alone.
    assert_eq!(moved.at(0.5), Err(CameraError::Transform));
    assert!(moved.at(0.499).is_ok());
}

fn read_with(value: &Value, animated: AnimatedCamera) -> GltfScene {
    let dir = tempfile::tempdir().unwrap();
    let path = dir.path().join("a.gltf");
    std::fs::write(&path, value.to_string()).unwrap();
    let options = ReadOptions {
        animated,
        ..ReadOptions::default()
    };
    read(&path, &options).unwrap()
}

#[test]
fn the_first_animation_of_the_camera_that_is_asked_for_is_read() {
    let value = animated(&[(CAMERA, "translation", "STEP", &[0.], vectors(&[1., 0., 0.]))]);
    let first = value["animations"][0].clone();
    let moving = |node: usize, name: &str| {
        with(
            first.clone(),
            [
                ("/channels/0/target/node", json!(node)),
                ("/name", json!(name)),
            ],
        )
    };
    let animations = [
        moving(3, "other"),
        moving(CAMERA, "walk"),
        moving(RIG, "run"),
        moving(0, "shake"),
    ];
    let value = with(
        value,
        [
            ("/animations", json!(animations)),
            (
                "/nodes",
                json!([{"mesh": 0}, {"children": [CAMERA]}, {"name": "eye", "camera": 0}, {"name": "ear", "camera": 0}]),
            ),
            ("/scenes/0/nodes", json!([0, RIG, 3])),
        ],
    );
    let moves = |scene: &GltfScene| -> Vec<bool> {
        let cameras = scene.cameras.iter();
        cameras.map(|camera| camera.animation.is_some()).collect()
    };
    let still = "an animation moves surfaces or lights, which stand still here; only cameras move (at /animations/3)";
    let several =
        "2 animations move the camera, of which the first, \"walk\", is used (at /animations/1)";
    for (asked, expected, warned) in [
        (
            AnimatedCamera::First,
            [true, false],
            [still, several].join("; "),
        ),
        (
            AnimatedCamera::Named("eye".into()),
            [true, false],
            [still, several].join("; "),
        ),
        (
            AnimatedCamera::Named("ear".into()),
            [false, true],
            still.into(),
        ),
        (
            AnimatedCamera::Named("toe".into()),
            [false, false],
            still.into(),
        ),
        (AnimatedCamera::None, [false, false], still.into()),
    ] {
        let scene = read_with(&value, asked.clone());
        assert_eq!(moves(&scene), expected, "{asked:?}");
        assert_eq!(warnings(&scene), warned, "{asked:?}");
    }
}

#[test]
fn surfaces_that_ride_with_the_camera_or_hang_on_joints_are_warned_of() {
    let value = animated(&[(RIG, "translation", "STEP", &[0.], vectors(&[1., 0., 0.]))]);
    assert_eq!(warnings(&read_json(&value).unwrap()), "");
    let still = "stand still here";
    let riding = with(value.clone(), [("/nodes/1/children", json!([CAMERA, 0]))]);
    let riding = with(riding, [("/scenes/0/nodes", json!([RIG]))]);
    assert!(warnings(&read_json(&riding).unwrap()).contains(still));
    let joint = with(value.clone(), [("/skins", json!([{"joints": [CAMERA]}]))]);
    assert!(warnings(&read_json(&joint).unwrap()).contains(still));
    let morph = [
        ("/animations/0/channels/0/target/path", json!("weights")),
        ("/animations/0/channels/0/target/node", json!(0)),
    ];
    let scene = read_json(&with(value, morph)).unwrap();
    assert!(warnings(&scene).contains(still) && scene.cameras[0].animation.is_none());
}

#[test]
fn broken_animations_of_the_camera_are_errors_with_their_place() {
    let sound = || {
        animated(&[
            (
                CAMERA,
                "translation",
                "LINEAR",
                &[0., 1.],
                vectors(&[0., 0., 0., 1., 0., 0.]),
            ),
            (
                CAMERA,
                "rotation",
                "LINEAR",
                &[0., 1.],
                quaternions(&[0., 0., 0., 1., 0., S, 0., S]),
            ),
        ])
    };
    assert!(read_json(&sound()).is_ok());
    for (pointer, value, part) in [
        (
            "/animations/0/channels/0/sampler",
            json!(9),
            "index 9 is out of range: the file has 2 samplers in this animation (at /animations/0/channels/0/sampler)",
        ),
        (
            "/animations/0/channels/0/target/node",
            json!(9),
            "the file has 3 nodes (at /animations/0/channels/0/target/node)",
        ),
        (
            "/animations/0/channels/0/target/path",
            json!("colour"),
            "allowed are translation, rotation, scale and weights (at /animations/0/channels/0/target/path)",
        ),
        (
            "/animations/0/channels/1/target/path",
            json!("translation"),
            "a second channel for one property of one node",
        ),
        (
            "/animations/0/samplers/0/interpolation",
            json!("CUBIC"),
            "allowed are LINEAR, STEP and CUBICSPLINE (at /animations/0/samplers/0/interpolation)",
        ),
        (
            "/animations/0/samplers/0/interpolation",
            json!("CUBICSPLINE"),
            "needs three elements per keyframe (slope, value, slope), 6 (at /accessors/2/count)",
        ),
        (
            "/animations/0/samplers/0/input",
            json!(99),
            "the file has 5 accessors (at /animations/0/samplers/0/input)",
        ),
        (
            "/animations/0/samplers/0/output",
            json!(99),
            "the file has 5 accessors (at /animations/0/samplers/0/output)",
        ),
        (
            "/animations/0/samplers/0/output",
            json!(4),
            "Vec4 is not allowed here",
        ),
        (
            "/animations/0/samplers/1/output",
            json!(2),
            "Vec3 is not allowed here",
        ),
        (
            "/animations/0/samplers/0/input",
            json!(2),
            "Vec3 is not allowed here",
        ),
        (
            "/accessors/1/count",
            json!(0),
            "at least one is needed (at /animations/0/samplers/0/input)",
        ),
        (
            "/accessors/1/count",
            json!(1),
            "needs one element per keyframe, 1 (at /accessors/2/count)",
        ),
        ("/accessors/1/count", json!(u64::MAX), "bytes from byte"),
        (
            "/nodes/2/matrix",
            json!([1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1, 0, 0, 0, 0, 1]),
            "node \"eye\" has a matrix and is animated",
        ),
    ] {
        check_error(&with(sound(), [(pointer, value)]), part);
    }
    let zeros = json!({"type": "SCALAR", "componentType": 5126, "count": 2});
    check_error(
        &with(sound(), [("/accessors/1", zeros)]),
        "a keyframe at 0 s after one at 0 s is not allowed here; times must increase",
    );
    let zeros = json!({"type": "VEC4", "componentType": 5126, "count": 2});
    check_error(
        &with(sound(), [("/accessors/4", zeros)]),
        "a rotation of length 0 at 0 s is not allowed here",
    );
}

#[test]
fn keyframes_out_of_order_or_out_of_range_are_refused() {
    for (times, part) in [
        (
            [0.0, -1.0],
            "a keyframe at -1 s is not allowed here; keyframes lie from 0 to 100000 s",
        ),
        ([2.0, 1.0], "a keyframe at 1 s after one at 2 s"),
        ([0.0, 1.1e5], "a keyframe at 110000 s"),
        ([0.0, f32::NAN], "a keyframe at NaN s"),
        ([f32::INFINITY, 1.0], "a keyframe at inf s"),
    ] {
        let values = vectors(&[0.0; 6]);
        check_error(
            &animated(&[(CAMERA, "translation", "LINEAR", &times, values)]),
            part,
        );
    }
    for bad in [f32::NAN, f32::INFINITY] {
        let values = vectors(&[0., 0., 0., 0., 0., 0., bad, 0., 0.]);
        check_error(
            &animated(&[(CAMERA, "translation", "CUBICSPLINE", &[0.], values)]),
            "values of keyframes must be finite (at /animations/0/samplers/0/output)",
        );
    }
}

#[test]
fn places_no_camera_can_stand_at_are_errors_of_their_time() {
    let far = animation(&animated(&[(
        CAMERA,
        "translation",
        "LINEAR",
        &[0., 1.],
        vectors(&[0., 0., 0., 3e38, 0., 0.]),
    )]));
    assert!(far.at(0.0).is_ok());
    assert_eq!(far.at(0.5), Err(CameraError::Transform));
    // Opposite quaternions without slopes: the cubic passes through zero, though both are the same rotation.
    let lost = animation(&animated(&[(
        CAMERA,
        "rotation",
        "CUBICSPLINE",
        &[0., 1.],
        quaternions(&[
            0., 0., 0., 0., 0., 0., 0., 1., 0., 0., 0., 0., //
            0., 0., 0., 0., 0., 0., 0., -1., 0., 0., 0., 0.,
        ]),
    )]));
    assert!(lost.at(0.25).is_ok());
    assert_eq!(lost.at(0.5), Err(CameraError::Transform));
}

#[test]
fn every_number_of_an_animated_camera_may_be_absurd_without_a_panic() {
    let value = animated(&[
        (
            RIG,
            "scale",
            "LINEAR",
            &[0., 1.],
            vectors(&[1., 1., 1., 2., 2., 2.]),
        ),
        (
            CAMERA,
            "rotation",
            "CUBICSPLINE",
            &[0.],
            quaternions(&[0., 0., 0., 1., 0., S, 0., S, 0., 0., 0., 0.]),
        ),
    ]);
    crate::hostile::with_absurd_numbers(&value, |scene| {
        for animation in scene.cameras.iter().filter_map(|c| c.animation.as_ref()) {
            for time in [-1.0, 0.0, 0.5, 1e30] {
                // Whether there is a view depends on the number; that there is an answer is the test.
                let _ = animation.at(time);
            }
        }
    });
}
