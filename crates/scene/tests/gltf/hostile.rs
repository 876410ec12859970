//! Damaged files: whatever is cut off or changed, reading returns.

use crate::files::*;
use serde_json::{Value, json};
use tyndall_scene::gltf::GltfScene;

#[test]
fn every_truncation_of_a_file_is_an_error_and_never_a_panic() {
    let text = textured(json!({"uri": data_uri(&png())})).to_string();
    for n in 0..text.len() {
        assert!(read_text(&text.as_bytes()[..n], &[]).is_err(), "{n} bytes");
    }
}

#[test]
fn every_number_of_a_file_may_be_absurd_without_a_panic() {
    let text = with_light(
        json!({"type": "spot", "spot": {"innerConeAngle": 0.1, "outerConeAngle": 0.2}, "intensity": 5}),
        json!({"mesh": 0, "scale": [1, 1, 1], "rotation": [0, 0, 0, 1], "camera": 0}),
    );
    let mut value = with(
        text,
        [(
            "/cameras",
            json!([{"type": "perspective", "perspective": {"yfov": 1, "znear": 0.1}}]),
        )],
    );
    value["accessors"][0]["byteOffset"] = json!(0);
    with_absurd_numbers(&value, |_| ());
}

/// Reads `value` with each of its numbers replaced in turn, and uses what loads.
pub(crate) fn with_absurd_numbers(value: &Value, use_scene: impl Fn(GltfScene)) {
    let mut pointers = Vec::new();
    numbers(value, String::new(), &mut pointers);
    assert!(pointers.len() > 20);
    for pointer in &pointers {
        for absurd in [
            json!(-1),
            json!(0),
            json!(1e38),
            json!(1e-38),
            json!(4294967295u32),
            json!(u64::MAX),
        ] {
            let mut changed = value.clone();
            *changed.pointer_mut(pointer).unwrap() = absurd;
            // Whether it loads depends on the number; that it returns is the test.
            if let Ok(scene) = read_json(&changed) {
                use_scene(scene);
            }
        }
    }
}

fn numbers(value: &Value, at: String, pointers: &mut Vec<String>) {
    match value {
        Value::Number(_) => pointers.push(at),
        Value::Array(list) => {
            for (i, v) in list.iter().enumerate() {
                numbers(v, format!("{at}/{i}"), pointers);
            }
        }
        Value::Object(map) => {
            for (key, v) in map {
                numbers(v, format!("{at}/{key}"), pointers);
            }
        }
        _ => {}
    }
}
