//! Everything that reads files from elsewhere, as functions of bytes: whatever these are, a reader answers, with an error or without.
//!
//! Tests mutate small sound files for them, and the targets in `fuzz/` hand them what a fuzzer finds.

use std::io::Cursor;
use std::path::{Path, PathBuf};
use std::time::Duration;
use tempfile::TempDir;
use tyndall_render::image_file::read_image;
use tyndall_render::options::{Depth, RenderOptions};
use tyndall_render::{CacheInfo, Renderer};
use tyndall_scene::lights::read_environment;
use tyndall_scene::volume_file::{inspect_from, read_from};
use tyndall_scene::{LoadOptions, Scene, gltf, load_str};
use xxhash_rust::xxh3::xxh3_128;

/// What a grid may take, in bytes.
const LIMIT: u64 = 1 << 24;
/// Bytes of a sealed file's magic, version and length, and of its checksum.
const SEAL: (usize, usize) = (20, 16);

/// A lamp in fog, of whose image a checkpoint is kept.
pub const LAMP: &str = "Scene(
    camera: LookAt(eye: (0, 0, 4), target: (0, 0, 0), vfov: 40),
    film: Film(width: 8, height: 6),
    lights: [Point(position: (0, 1, 0), intensity: (1, 1, 1))],
    media: [Medium(sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9))],
)";

/// Scene files, with the views of cameras that move.
pub fn scene(bytes: &[u8]) {
    let path = Path::new("scene.ron");
    let Ok(text) = std::str::from_utf8(bytes) else {
        assert!(tyndall_scene::scene_file::parse(bytes, path).is_err());
        return;
    };
    let options = LoadOptions {
        max_grid_bytes: Some(LIMIT),
        ..LoadOptions::default()
    };
    if let Ok(scene) = load_str(text, Path::new(env!("CARGO_MANIFEST_DIR")), &options) {
        for frame in [-1.0, 0.0, 0.5, 7.0, 1e9, f32::MAX] {
            let _: bool = scene.camera_at(frame).is_ok();
        }
    }
}

/// glTF files, as text or binary.
pub fn gltf(bytes: &[u8]) {
    let name = if bytes.starts_with(b"glTF") {
        "x.glb"
    } else {
        "x.gltf"
    };
    with_file(name, bytes, |path| {
        let _: bool = gltf::read(path, &gltf::ReadOptions::default()).is_ok();
    });
}

/// OpenVDB and `.vol` files.
pub fn volume(bytes: &[u8]) {
    let _: bool = inspect_from(Cursor::new(bytes), LIMIT).is_ok();
    let _: bool = read_from(Cursor::new(bytes), None, LIMIT).is_ok();
}

/// Cache files.
pub fn cache(bytes: &[u8]) {
    for bytes in [bytes, &sealed(bytes)] {
        with_file("x.cache", bytes, |path| {
            let _: bool = CacheInfo::of(path).is_ok();
        });
    }
}

/// Checkpoints of [`lamp`]'s image.
pub fn checkpoint(bytes: &[u8]) {
    let (scene, options) = lamp();
    for bytes in [bytes, &sealed(bytes)] {
        with_file("x.checkpoint", bytes, |path| {
            let Ok(mut renderer) = Renderer::new(&scene, &options, &()) else {
                return;
            };
            let hour = Duration::from_secs(3600);
            let kept = renderer.keep_checkpoints(path, hour, &[scene.camera]);
            if kept.is_ok() && renderer.resume().is_ok() {
                let _: bool = renderer.render(&scene.camera, 0).is_ok();
            }
        });
    }
}

/// Images to compare, and images that light scenes.
pub fn image(bytes: &[u8]) {
    let name = match bytes {
        [0x76, 0x2f, 0x31, 0x01, ..] => "x.exr",
        [0x89, b'P', ..] => "x.png",
        [b'#', b'?', ..] => "x.hdr",
        _ => "x.jpg",
    };
    with_file(name, bytes, |path| {
        let _: bool = read_image(path).is_ok();
        let _: bool = read_environment(path).is_ok();
    });
}

/// The scene and the options of [`checkpoint`].
///
/// # Panics
/// If the scene does not load.
pub fn lamp() -> (Scene, RenderOptions) {
    let scene = load_str(LAMP, Path::new("."), &LoadOptions::default());
    let options = RenderOptions {
        threads: Some(1),
        max_depth: Some(Depth::Limit(1)),
        spp: Some(8),
        ..RenderOptions::default()
    };
    (scene.expect("the lamp loads"), options)
}

/// Bytes with the length and the checksum that a sealed file of such contents has, so that changed contents are looked at.
fn sealed(bytes: &[u8]) -> Vec<u8> {
    let (header, checksum) = SEAL;
    let mut sealed = bytes[..bytes.len().saturating_sub(checksum)].to_vec();
    if sealed.len() < header {
        return sealed;
    }
    let length = (sealed.len() - header) as u64;
    sealed[header - 8..header].copy_from_slice(&length.to_le_bytes());
    sealed.extend(xxh3_128(&sealed).to_le_bytes());
    sealed
}

fn with_file(name: &str, bytes: &[u8], read: impl FnOnce(&Path)) {
    let folder = TempDir::new().expect("there is room for a folder");
    let path: PathBuf = folder.path().join(name);
    std::fs::write(&path, bytes).expect("there is room for a file");
    read(&path);
}
