//! Cache files and frames, tried on the `tyndall` program as a user runs it.

#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::path::Path;
use tempfile::TempDir;
use tyndall_tests::image::Channels;
use tyndall_tests::program::{self, ends, run_line};
use tyndall_tests::room::room;

/// A box of fog with a wall, lit by a lamp and a sky: records of multiple scattering, of the sky and on surfaces.
const ROOM: &str = r#"Scene(
    gltf: "room.gltf",
    camera: LookAt(eye: (0.0, 1.0, 4.0), target: (0.0, 1.0, 0.0), vfov: 45.0),
    film: Film(width: 22, height: 18),
    lights: [
        Point(position: (0.5, 1.6, 0.5), intensity: (4.0, 3.0, 2.0)),
        Sky(radiance: (0.2, 0.3, 0.4)),
    ],
    media: [Medium(
        region: Box(min: (-1.5, 0.0, -1.5), max: (1.5, 2.0, 1.5)),
        sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9),
    )],
    render: Render(error: 0.2),
)"#;

/// A folder that holds the room.
fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("room.ron"), ROOM).unwrap();
    fs::write(folder.path().join("room.gltf"), room()).unwrap();
    folder
}

fn succeed(folder: &TempDir, arguments: &str) {
    program::succeed(folder.path(), arguments);
}

fn pixels(folder: &TempDir, name: &str) -> Channels {
    Channels::read(&folder.path().join(name)).unwrap()
}

#[test]
fn kept_records_make_the_pixels_that_fresh_ones_make() {
    let folder = folder();
    for method in ["tyndall", "jarosz08"] {
        let options = format!("--quiet --error 0.4 --method {method}");
        succeed(
            &folder,
            &format!("render room.ron {options} -o fresh.exr --cache-out room.cache"),
        );
        succeed(
            &folder,
            &format!("render room.ron {options} -o kept.exr --cache-in room.cache"),
        );
        let [fresh, kept] = ["fresh.exr", "kept.exr"].map(|name| pixels(&folder, name));
        assert!(fresh == kept, "{method}");
    }
}

/// Renders a frame of `size` pixels whole and in parts, each part from the cache file that the whole left.
fn tiles_make_up(size: [usize; 2], error: f32, crops: &[[usize; 4]]) {
    let folder = folder();
    let [width, height] = size;
    let frame =
        format!("render room.ron --quiet --error {error} --width {width} --height {height}");
    succeed(
        &folder,
        &format!("{frame} --cache-out room.cache -o whole.exr"),
    );
    let whole = pixels(&folder, "whole.exr");
    for &[x, y, w, h] in crops {
        let crop = format!("--crop {x},{y},{w},{h}");
        succeed(
            &folder,
            &format!("{frame} --cache-in room.cache {crop} -o tile.exr"),
        );
        let tile = pixels(&folder, "tile.exr");
        for (name, values) in &tile.samples {
            for (i, value) in values.iter().enumerate() {
                let (column, row) = (x + i % w, y + i / w);
                let expected = whole.samples[name][row * width + column];
                assert_eq!(*value, expected, "{name} {column} {row}");
            }
        }
    }
}

#[test]
fn tiles_from_one_cache_file_make_up_the_whole_frame() {
    // Borders within blocks of pixels, and beside them.
    let crops = [[0, 0, 9, 18], [9, 0, 13, 7], [9, 7, 13, 11], [21, 17, 1, 1]];
    tiles_make_up([22, 18], 0.2, &crops);
}

#[test]
fn tiles_make_up_frames_whose_pilot_looks_at_a_part() {
    // More tiles than a pilot has, in few pixels.
    tiles_make_up([3100, 4], 0.5, &[[31, 0, 50, 4], [3001, 1, 99, 2]]);
}

#[test]
fn a_file_that_is_not_the_scenes_whole_cache_is_refused() {
    let folder = folder();
    let file = |name: &str| folder.path().join(name);
    succeed(
        &folder,
        "render room.ron --quiet --cache-out room.cache --fill-only",
    );
    let whole = fs::read(file("room.cache")).unwrap();
    let refused = |scene: &str, bytes: &[u8], message: &str, options: &str| {
        fs::write(file("other.cache"), bytes).unwrap();
        let command = format!("render {scene} --quiet -o x.exr --cache-in other.cache{options}");
        let (status, stderr) = ends(folder.path(), &command);
        assert_eq!(status, Some(2), "{message}: {stderr}");
        assert!(stderr.contains(message), "{message}: {stderr}");
        assert!(!file("x.exr").exists());
    };
    let flipped = |at: usize| {
        let mut bytes = whole.clone();
        bytes[at] ^= 0x10;
        bytes
    };
    for (at, message) in [
        (0, "not a cache file"),
        (8, "version"),
        // The length grows where the bit was not set, and shrinks where it was.
        (
            12,
            if whole[12] & 0x10 == 0 {
                "cut short"
            } else {
                "damaged"
            },
        ),
        (19, "cut short"),
        (20, "damaged"),
        (whole.len() / 2, "damaged"),
        (whole.len() - 1, "damaged"),
    ] {
        refused("room.ron", &flipped(at), message, "");
    }
    for n in [0, 5, 19, 20, whole.len() / 2, whole.len() - 1] {
        let message = if n == 0 {
            "not a cache file"
        } else {
            "cut short"
        };
        refused("room.ron", &whole[..n], message, "");
    }
    refused("room.ron", &[&whole[..], &[0]].concat(), "damaged", "");
    refused("room.ron", &whole, "--max-depth none", " --max-depth 5");
    refused("room.ron", &whole, "--method tyndall", " --method jarosz08");
    fs::write(
        file("dimmer.ron"),
        ROOM.replace("4.0, 3.0, 2.0", "4.0, 3.0, 1.9"),
    )
    .unwrap();
    refused("dimmer.ron", &whole, "another scene", "");
    let lower = room().replace("1.2", "1.1");
    fs::write(file("room.gltf"), lower).unwrap();
    refused("room.ron", &whole, "another scene", "");
}

#[test]
fn frames_do_not_depend_on_how_they_are_divided() {
    let folder = folder();
    let moving = ROOM.replace(
        "LookAt(eye: (0.0, 1.0, 4.0), target: (0.0, 1.0, 0.0), vfov: 45.0)",
        "Path([
            Key(frame: 0, eye: (0.0, 1.0, 4.0), target: (0.0, 1.0, 0.0), vfov: 45.0),
            Key(frame: 3, eye: (1.5, 1.2, 3.5), target: (0.0, 1.0, 0.0), vfov: 45.0),
        ])",
    );
    fs::write(folder.path().join("walk.ron"), moving).unwrap();
    let options = "--quiet --spp 2";
    succeed(
        &folder,
        &format!("render walk.ron {options} --frames 0..4 --cache-out walk.cache -o one.##.exr"),
    );
    succeed(
        &folder,
        &format!("render walk.ron {options} --frames 0..2 --cache-in walk.cache -o two.##.exr"),
    );
    succeed(
        &folder,
        &format!("render walk.ron {options} --frames 2..=3 --cache-in walk.cache -o two.##.exr"),
    );
    for frame in 0..4 {
        let [one, two] =
            ["one", "two"].map(|name| pixels(&folder, &format!("{name}.0{frame}.exr")));
        assert!(one == two, "frame {frame}");
    }
    assert!(
        pixels(&folder, "one.00.exr") != pixels(&folder, "one.03.exr"),
        "the camera moves"
    );
}

#[test]
fn filling_that_the_time_limit_ends_is_gone_on_with() {
    let folder = folder();
    let records = |options: &str| {
        let (status, stderr) = ends(
            folder.path(),
            &format!("render room.ron --error 0.05 {options}"),
        );
        assert_eq!(status, Some(0), "{stderr}");
        let output = run_line(folder.path(), "info room.cache --json");
        let info: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
        let count = info["records"]["surface"]["count"].as_u64().unwrap_or(0);
        (count, info["views"].as_u64().unwrap())
    };
    let (first, views) = records("--fill-only --cache-out room.cache --time-limit 0.2");
    assert_eq!(views, 0, "the view lacks records");
    let (second, views) = records("--fill-only --cache-in room.cache --cache-out room.cache");
    assert!(second > first, "{first} {second}");
    assert_eq!(views, 1);
}

#[test]
fn a_crop_without_time_shows_something() {
    let folder = folder();
    succeed(
        &folder,
        "render room.ron --quiet --cache-out room.cache --fill-only",
    );
    for y in [0, 9, 11] {
        let crop = format!("--crop 0,{y},22,5 --time-limit 0");
        succeed(
            &folder,
            &format!("render room.ron --quiet --cache-in room.cache {crop} -o x.exr"),
        );
        let image = pixels(&folder, "x.exr");
        assert!(image.samples["G"].iter().sum::<f32>() > 0.0, "{y}");
    }
}

#[test]
fn places_far_apart_do_not_share_light() {
    let folder = folder();
    // Cells of both balls have the same coordinates but for a multiple of 2 to the 17th.
    let ball = |x: f32| {
        format!(
            "Medium(region: Sphere(center: ({x:?}, 0, 0), radius: 1), sigma_t: (1, 1, 1), albedo: (0.9, 0.9, 0.9))"
        )
    };
    let lamp = |x: f32| format!("Point(position: ({x:?}, 1.5, 0), intensity: (1, 1, 1))");
    let key = |frame: u32, x: f32| {
        format!("Key(frame: {frame}, eye: ({x:?}, 0, 3), target: ({x:?}, 0, 0), vfov: 45)")
    };
    let (a, b) = (-8192.0, 8192.0);
    let scene = format!(
        "Scene(camera: Path([{}, {}]), film: Film(width: 8, height: 8), lights: [{}, {}], media: [{}, {}])",
        key(0, a),
        key(1, b),
        lamp(a),
        lamp(b),
        ball(a),
        ball(b)
    );
    fs::write(folder.path().join("far.ron"), scene).unwrap();
    succeed(
        &folder,
        "render far.ron --quiet --error 0.2 --spp 2 --frames 0..2 -o far.#.exr",
    );
}

#[test]
fn a_sequence_needs_a_name_for_each_frame() {
    let folder = folder();
    let (status, stderr) = ends(folder.path(), "render room.ron --frames 0..2 -o x.exr");
    assert_eq!(status, Some(2));
    assert!(stderr.contains("####"), "{stderr}");
}

#[test]
fn a_cache_file_tells_what_it_holds() {
    let folder = folder();
    succeed(
        &folder,
        "render room.ron --quiet --cache-out room.cache --fill-only",
    );
    assert!(!Path::new(&folder.path().join("room-render.exr")).exists());
    let output = run_line(folder.path(), "info room.cache --json");
    let info: serde_json::Value = serde_json::from_slice(&output.stdout).unwrap();
    assert_eq!(info["views"], 1);
    assert!(
        info["records"]["surface"]["count"].as_u64().unwrap() > 0,
        "{info}"
    );
    let [least, median, most] =
        [0, 1, 2].map(|i| info["records"]["surface"]["radius_m"][i].as_f64().unwrap());
    assert!(0.0 < least && least <= median && median <= most);
}

#[test]
fn each_frame_has_records_in_fog_that_scatters_forward() {
    let folder = folder();
    // The last two are seen from one place.
    let keys = "camera: Path([
        Key(frame: 0, eye: (0.0, 1.0, 4.0), target: (0.0, 1.0, 0.0), vfov: 45.0),
        Key(frame: 1, eye: (0.6, 1.2, 3.8), target: (0.0, 1.0, 0.0), vfov: 45.0),
        Key(frame: 2, eye: (0.6, 1.2, 3.8), target: (-1.0, 1.0, 0.0), vfov: 45.0),
    ]),";
    let still = "camera: LookAt(eye: (0.0, 1.0, 4.0), target: (0.0, 1.0, 0.0), vfov: 45.0),";
    for g in [0.3, 0.9] {
        let albedo = "albedo: (0.9, 0.9, 0.9),";
        let phase = format!("{albedo} phase: HenyeyGreenstein(g: {g}),");
        let walk = ROOM.replace(still, keys).replace(albedo, &phase);
        fs::write(folder.path().join("walk.ron"), walk).unwrap();
        let options = "--quiet --spp 4 --width 11 --height 9";
        let missed = |frame: u32, more: &str| {
            succeed(
                &folder,
                &format!("render walk.ron {options} -o w.#.exr --stats w.#.json{more}"),
            );
            let stats = folder.path().join(format!("w.{frame}.json"));
            let stats: serde_json::Value =
                serde_json::from_str(&fs::read_to_string(stats).unwrap()).unwrap();
            stats["lookups_missed"].as_f64().unwrap()
        };
        missed(0, " --frames 0..1 --cache-out one.cache");
        for frame in 0..3 {
            let alone = missed(frame, &format!(" --frames {frame}..={frame}"));
            for more in [" --frames 0..3", " --frames 0..3 --cache-in one.cache"] {
                let in_walk = missed(frame, more);
                assert!(
                    in_walk < 1.5 * alone + 20.0,
                    "g {g}, frame {frame},{more}: {in_walk}, alone {alone}"
                );
            }
        }
    }
}
