//! Small sound files, changed at random: every reader answers, and neither panics, nor hangs, nor takes memory without bounds.
//!
//! Each test takes about a second; `TYNDALL_MUTATION_SECONDS` makes it longer. Bytes that a reader fails on are left in cargo's folder for
//! temporary files.

#![allow(clippy::unwrap_used, reason = "tests")]

#[path = "../../crates/scene/tests/volumes/vdb_writer.rs"]
mod vdb_writer;

use glam::{IVec3, Vec3};
use std::fs;
use std::io::Cursor;
use std::panic::catch_unwind;
use std::path::Path;
use std::sync::atomic::{AtomicU32, Ordering};
use std::time::{Duration, Instant};
use tempfile::TempDir;
use tyndall_render::Renderer;
use tyndall_render::options::{Method, MultipleFrom, Phase, Progress, RenderOptions};
use tyndall_render::stats::peak_rss_mib;
use tyndall_scene::{LoadOptions, load_str};
use tyndall_tests::image::Image;
use tyndall_tests::program::workspace;
use tyndall_tests::readers;

/// Longest time that one file may take: none of the sound ones takes more than some milliseconds.
const LONGEST: Duration = Duration::from_secs(10);
/// Most memory of this process, with all tests at once, MiB: readers may take what an image of some hundred megabytes takes.
const MOST_MIB: f64 = 2048.0;
/// Values of bytes and words that readers may stumble over.
const WORDS: [u32; 8] = [
    0,
    1,
    0x7f,
    0xff,
    0x7fff_ffff,
    0x8000_0000,
    0xffff_ffff,
    0x7fc0_0000,
];
/// Text that parsers may stumble over.
const TOKENS: [&str; 12] = [
    "NaN",
    "inf",
    "1e39",
    "-1",
    "0",
    "99999999999999999999",
    "(",
    ")",
    "[",
    "\"",
    "null",
    "None",
];

/// A number below `n` that looks random, from its predecessor (Knuth's multiplicative congruence for 64 bits).
fn below(n: usize, state: &mut u64) -> usize {
    *state = state
        .wrapping_mul(6_364_136_223_846_793_005)
        .wrapping_add(1_442_695_040_888_963_407);
    (*state >> 33) as usize % n.max(1)
}

/// One to four changes to a file.
fn mutated(seed: &[u8], other: &[u8], state: &mut u64) -> Vec<u8> {
    let mut bytes = seed.to_vec();
    for _ in 0..=below(4, state) {
        let at = below(bytes.len(), state);
        let until = (at + 1 + below(16, state)).min(bytes.len());
        match below(9, state) {
            0 if at < bytes.len() => bytes[at] ^= 1 << below(8, state),
            1 if at < bytes.len() => bytes[at] = WORDS[below(WORDS.len(), state)] as u8,
            2 => {
                let word = WORDS[below(WORDS.len(), state)].to_le_bytes();
                for (to, from) in bytes.iter_mut().skip(at).zip(word) {
                    *to = from;
                }
            }
            3 => drop(bytes.drain(at..until)),
            4 => {
                let again = bytes[at..until].to_vec();
                bytes.splice(at..at, again);
            }
            5 => bytes.truncate(at),
            6 => {
                let token = TOKENS[below(TOKENS.len(), state)];
                bytes.splice(at..until, token.bytes());
            }
            7 => {
                let from = below(other.len(), state);
                let piece = &other[from..(from + 64).min(other.len())];
                bytes.splice(at..until, piece.iter().copied());
            }
            // Numbers of texts, made another by one digit.
            _ => {
                if let Some(digit) = bytes.iter_mut().skip(at).find(|b| b.is_ascii_digit()) {
                    *digit = b'0' + below(10, state) as u8;
                }
            }
        }
    }
    bytes
}

/// Hands changed files to a reader for about a second.
fn run(name: &str, seeds: &[Vec<u8>], read: fn(&[u8])) {
    let seconds = std::env::var("TYNDALL_MUTATION_SECONDS");
    let seconds = seconds.ok().and_then(|text| text.parse().ok()).unwrap_or(1);
    let end = Instant::now() + Duration::from_secs(seconds);
    let state = &mut 1;
    let mut n = 0_u64;
    for seed in seeds {
        read(seed);
    }
    while Instant::now() < end {
        let [seed, other] = [0, 0].map(|_| &seeds[below(seeds.len(), state)]);
        let bytes = mutated(seed, other, state);
        let begun = Instant::now();
        let failed = catch_unwind(|| read(&bytes)).is_err() || begun.elapsed() > LONGEST;
        n += 1;
        if failed {
            let left = Path::new(env!("CARGO_TARGET_TMPDIR")).join(format!("{name}-{n}"));
            fs::write(&left, &bytes).unwrap();
            panic!(
                "{name}, file {n}, after {:?}: {}",
                begun.elapsed(),
                left.display()
            );
        }
    }
    let peak = peak_rss_mib().unwrap_or(0.0);
    assert!(peak < MOST_MIB, "{name}: {peak} MiB");
    assert!(n > 0, "{name}: the sound files alone take too long");
    eprintln!("{name}: {n} files, {peak:.0} MiB");
}

#[test]
fn scene_files() {
    let path = "Scene(camera: Path([Key(frame: 0, eye: (0, 0, 4), target: (0, 0, 0), vfov: 40), \
        Key(frame: 3, eye: (1, 0, 4), target: (0, 0, 0), vfov: 50)]), film: Film(width: 8, height: 6, fps: 24),
        lights: [Spot(position: (0, 2, 0), direction: (0, -1, 0), intensity: (5, 5, 5), inner_cone: 10, outer_cone: 20),
            Directional(direction: (0.3, -1, 0.2), irradiance: (1, 1, 1)), Sky(radiance: (0.1, 0.1, 0.2))],
        media: [Medium(name: \"fog\", region: Sphere(center: (0, 0, 0), radius: 2), density: Height(base: 0, scale_height: 2),
            sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9), phase: Mixture([(0.8, HenyeyGreenstein(g: 0.8)), (0.2, Rayleigh)]),
            emission: (0, 0, 1))],
        render: Render(error: 0.03, max_depth: None, exposure: 0))";
    let seeds = [readers::LAMP, path].map(|text| text.as_bytes().to_vec());
    run("scene", &seeds, readers::scene);
}

#[test]
fn gltf_files() {
    let folder = workspace().join("assets/cornell_box");
    let json = fs::read_to_string(folder.join("cornell_box.gltf")).unwrap();
    let buffer = fs::read(folder.join("cornell_box.bin")).unwrap();
    let mut value: serde_json::Value = serde_json::from_str(&json).unwrap();
    value["buffers"][0].as_object_mut().unwrap().remove("uri");
    let mut text = value.to_string();
    while !text.len().is_multiple_of(4) {
        text.push(' ');
    }
    let word = |n: usize| (n as u32).to_le_bytes();
    let padded = buffer.len().next_multiple_of(4);
    let mut binary = [*b"glTF", word(2), word(28 + text.len() + padded)].concat();
    binary.extend([&word(text.len())[..], b"JSON", text.as_bytes()].concat());
    binary.extend([&word(padded)[..], b"BIN\0", &buffer].concat());
    binary.resize(28 + text.len() + padded, 0);
    let hex: String = buffer.iter().map(|byte| format!("%{byte:02x}")).collect();
    value["buffers"][0]["uri"] = format!("data:application/octet-stream,{hex}").into();
    let seeds = [value.to_string().into_bytes(), binary];
    run("gltf", &seeds, readers::gltf);
}

#[test]
fn volume_files() {
    let voxels = || (0..600).map(|i| (IVec3::new(i % 10, i / 10 % 10, i / 100), 1.5));
    let codecs = [
        vdb_writer::Codec::None,
        vdb_writer::Codec::Zip,
        vdb_writer::Codec::Blosc,
    ];
    let mut seeds: Vec<Vec<u8>> = codecs
        .into_iter()
        .map(|codec| {
            vdb_writer::file(&[vdb_writer::Grid {
                codec,
                voxels: voxels().collect(),
                ..vdb_writer::Grid::default()
            }])
        })
        .collect();
    let mut vol = b"VOL\x03".to_vec();
    vol.extend([1, 3, 2, 2, 1].iter().flat_map(|n: &i32| n.to_le_bytes()));
    let corners = [0.0_f32, 0.0, 0.0, 1.0, 1.0, 1.0];
    vol.extend(
        corners
            .iter()
            .chain(&[0.5; 12])
            .flat_map(|x| x.to_le_bytes()),
    );
    seeds.push(vol);
    run("volume", &seeds, readers::volume);
}

/// Cancels a render in its samples.
struct Rows(AtomicU32);

impl Progress for Rows {
    fn update(&self, phase: Phase, _fraction: f32, _records: usize) {
        if phase == Phase::Render {
            self.0.fetch_add(1, Ordering::Relaxed);
        }
    }

    fn is_cancelled(&self) -> bool {
        self.0.load(Ordering::Relaxed) > 8
    }
}

#[test]
fn checkpoints() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("x.checkpoint");
    let (scene, options) = readers::lamp();
    let rows = Rows(AtomicU32::new(0));
    let mut renderer = Renderer::new(&scene, &options, &rows).unwrap();
    let hour = Duration::from_secs(3600);
    renderer
        .keep_checkpoints(&path, hour, &[scene.camera])
        .unwrap();
    assert!(renderer.render(&scene.camera, 0).unwrap().cancelled);
    run(
        "checkpoint",
        &[fs::read(&path).unwrap()],
        readers::checkpoint,
    );
}

#[test]
fn cache_files() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("x.cache");
    // Fog that is small from where it is seen has few cells and records.
    let medium = "region: Sphere(center: (0, 0, 0), radius: 0.3), sigma_t:";
    let small = readers::LAMP.replace("sigma_t:", medium);
    let scene = load_str(&small, Path::new("."), &LoadOptions::default()).unwrap();
    let seeds = [Method::Tyndall, Method::Jarosz08].map(|method| {
        let options = RenderOptions {
            method: Some(method),
            multiple: match method {
                Method::Tyndall => MultipleFrom::Records,
                Method::Jarosz08 => MultipleFrom::Auto,
            },
            error: Some(0.5),
            ..RenderOptions::default()
        };
        let mut renderer = Renderer::new(&scene, &options, &()).unwrap();
        renderer.fill(&[scene.camera]);
        renderer.write_cache(&path).unwrap();
        fs::read(&path).unwrap()
    });
    run("cache", &seeds, readers::cache);
}

#[test]
fn images() {
    let folder = TempDir::new().unwrap();
    let path = folder.path().join("x.exr");
    let pixels: Vec<Vec3> = (0..128).map(|i| Vec3::splat(i as f32)).collect();
    Image {
        size: [16, 8],
        pixels,
    }
    .write_exr(&path)
    .unwrap();
    let mut seeds = vec![fs::read(&path).unwrap()];
    let rgb = image::RgbImage::from_fn(16, 8, |x, y| image::Rgb([x as u8, y as u8, 200]));
    for format in [image::ImageFormat::Png, image::ImageFormat::Jpeg] {
        let mut bytes = Cursor::new(Vec::new());
        rgb.write_to(&mut bytes, format).unwrap();
        seeds.push(bytes.into_inner());
    }
    let hdr = [image::Rgb([1.0_f32, 0.5, 0.25]); 128];
    let mut bytes = Vec::new();
    image::codecs::hdr::HdrEncoder::new(&mut bytes)
        .encode(&hdr, 16, 8)
        .unwrap();
    seeds.push(bytes);
    run("image", &seeds, readers::image);
}
