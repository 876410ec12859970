//! Where files are read from and written to: what is wrong with a place is told before the render starts, and what goes wrong later
//! leaves nothing half written.

#![cfg(unix)]
#![allow(clippy::unwrap_used, reason = "tests")]

use std::fs;
use std::os::unix::fs::{PermissionsExt, symlink};
use std::path::Path;
use std::process::{Command, Stdio};
use tempfile::TempDir;
use tyndall_tests::program::{ends, succeed, told, tyndall};

/// A scene without records: its images take no time.
const SCENE: &str = "Scene(
    camera: LookAt(eye: (0, 0, 4), target: (0, 0, 0), vfov: 40),
    film: Film(width: 40, height: 30),
    lights: [Point(position: (0, 1, 0), intensity: (1, 1, 1))],
    media: [Medium(sigma_t: (0.5, 0.5, 0.5), albedo: (0.9, 0.9, 0.9))],
    render: Render(max_depth: Some(1)),
)";

fn folder() -> TempDir {
    let folder = TempDir::new().unwrap();
    fs::write(folder.path().join("scene.ron"), SCENE).unwrap();
    folder
}

/// Runs `tyndall` where files may grow to so many blocks; tells exit status and standard error.
fn on_full_disk(folder: &Path, blocks: u32, line: &str) -> (Option<i32>, String) {
    // The signal that would end the program for it is ignored: writes fail as on a full disk.
    let limited = format!(
        "trap '' XFSZ; ulimit -f {blocks}; exec {} {line}",
        tyndall().display()
    );
    let mut command = Command::new("sh");
    command.args(["-c", &limited]).current_dir(folder);
    told(command.stdin(Stdio::null()).output().unwrap())
}

/// The names of what is in a folder.
fn names(folder: &Path) -> Vec<String> {
    let entries = fs::read_dir(folder).unwrap();
    let mut names: Vec<String> = entries
        .map(|entry| entry.unwrap().file_name().into_string().unwrap())
        .collect();
    names.sort();
    names
}

#[test]
fn places_that_cannot_be_written_to_are_refused_before_the_scene_is_read() {
    let folder = folder();
    let at = |name: &str| folder.path().join(name);
    for name in ["folder.exr", "s.json", "c.cache", "taken.exr.checkpoint"] {
        fs::create_dir(at(name)).unwrap();
    }
    fs::create_dir(at("sealed")).unwrap();
    fs::set_permissions(at("sealed"), fs::Permissions::from_mode(0o555)).unwrap();
    symlink("/dev/full", at("full.exr")).unwrap();
    symlink("gone/x.exr", at("dangling.exr")).unwrap();
    // Root may write anywhere.
    let is_root = fs::write(at("sealed/x"), "").is_ok();
    let _ = fs::remove_file(at("sealed/x"));
    let before = names(folder.path());
    for (line, message) in [
        ("-o gone/x.exr", "choose a folder that exists"),
        ("-o scene.ron/x.exr", "choose a folder that exists"),
        ("-o folder.exr", "a folder of that name stands there"),
        ("-o full.exr", "a device, pipe or socket"),
        ("-o taken.exr", "a folder of that name stands there"),
        ("-o x.exr --stats s.json", "a folder of that name"),
        ("-o x.exr --stats gone/s.json", "choose a folder"),
        ("-o x.exr --cache-out c.cache", "a folder of that name"),
        ("-o x.exr --cache-out gone/c", "choose a folder"),
        ("-o x.exr -o gone/x.png", "choose a folder"),
        ("-o sealed/x.exr", "may be written to"),
    ] {
        if is_root && line.contains("sealed") {
            continue;
        }
        // A scene that is not there would be told of later.
        let (status, stderr) = ends(folder.path(), &format!("render gone.ron {line}"));
        assert_eq!(status, Some(2), "{line}: {stderr}");
        assert!(stderr.contains(message), "{line}: {stderr}");
    }
    assert_eq!(names(folder.path()), before);
}

#[test]
fn a_full_disk_leaves_what_was_there_and_nothing_half_written() {
    let folder = folder();
    let render = "render scene.ron --spp 2 --quiet";
    succeed(folder.path(), &format!("{render} -o x.exr -o x.png"));
    let before = names(folder.path());
    let kept = |name: &str| fs::read(folder.path().join(name)).unwrap();
    let old = kept("x.exr");
    for outputs in [
        "-o x.exr",
        "-o x.png --width 400 --height 300",
        "-o new.exr",
        "-o x.exr --cache-out new.cache --max-depth none --error 0.5",
    ] {
        let line = format!("{render} --seed 1 {outputs}");
        let (status, stderr) = on_full_disk(folder.path(), 1, &line);
        assert_eq!(status, Some(1), "{outputs}: {stderr}");
        assert!(stderr.contains("writing failed"), "{outputs}: {stderr}");
        assert!(stderr.contains("untouched"), "{outputs}: {stderr}");
        assert_eq!(names(folder.path()), before, "{outputs}");
    }
    assert!(kept("x.exr") == old);
}

#[test]
fn a_checkpoint_that_cannot_be_written_is_a_warning() {
    let folder = folder();
    let line = "render scene.ron --spp 600 -o x.png --checkpoint-interval 0";
    let (status, stderr) = on_full_disk(folder.path(), 60, line);
    assert_eq!(status, Some(0), "{stderr}");
    assert!(stderr.contains("no checkpoint can be kept"), "{stderr}");
    assert_eq!(names(folder.path()), ["scene.ron", "x.png"]);
}

#[test]
fn every_kind_of_file_that_a_scene_names_is_sought_in_its_folder_alone() {
    let folder = TempDir::new().unwrap();
    let at = |name: &str| folder.path().join(name);
    fs::create_dir(at("scenes")).unwrap();
    fs::write(at("secret"), "root:x:0:0").unwrap();
    symlink("../secret", at("scenes/link")).unwrap();
    symlink("..", at("scenes/up")).unwrap();
    let absolute = at("secret").display().to_string();
    let outside = "refers outside the scene's folder";
    let names = [
        ("link", outside),
        ("up/secret", outside),
        ("../secret", outside),
        ("./a/../../secret", outside),
        (absolute.as_str(), outside),
        ("file:///etc/passwd", "is an address (file:)"),
        ("http://example.org/x", "is an address (http:)"),
        ("HTTPS://example.org/x", "is an address (HTTPS:)"),
    ];
    let camera = "camera: LookAt(eye: (0, 0, 4), target: (0, 0, 0), vfov: 40)";
    let with_gltf = |json: String| {
        fs::write(at("scenes/mesh.gltf"), json).unwrap();
        format!("Scene({camera}, gltf: \"mesh.gltf\")")
    };
    let medium = "sigma_t: (1, 1, 1), albedo: (0, 0, 0)";
    for (name, message) in names {
        for kind in ["gltf", "environment", "grid", "buffer", "image"] {
            let scene = match kind {
                "gltf" => format!("Scene({camera}, gltf: \"{name}\")"),
                "environment" => {
                    format!("Scene({camera}, lights: [Environment(file: \"{name}\")])")
                }
                "grid" => format!(
                    "Scene({camera}, media: [Medium({medium}, density: Grid(file: \"{name}\"))])"
                ),
                "buffer" => with_gltf(mesh(&format!("\"uri\": \"{name}\","), "{}")),
                _ => with_gltf(mesh(TRIANGLE, &format!("{{\"uri\": \"{name}\"}}"))),
            };
            fs::write(at("scenes/scene.ron"), scene).unwrap();
            let (status, stderr) = ends(folder.path(), "render scenes/scene.ron -o x.exr --spp 1");
            assert_eq!(status, Some(2), "{kind} {name}: {stderr}");
            assert!(stderr.contains(message), "{kind} {name}: {stderr}");
            assert!(!stderr.contains("root:x"), "{kind} {name}: {stderr}");
        }
    }
    assert!(!at("x.exr").exists());
}

/// Nine numbers: the corners of a triangle.
const TRIANGLE: &str = "\"uri\": \"data:application/octet-stream;base64,AAAAAAAAAAAAAAAAAACAPwAAAAAAAAAAAAAAAAAAgD8AAAAA\",";

/// A glTF file of one triangle, with what names its buffer's and its image's bytes.
fn mesh(buffer: &str, image: &str) -> String {
    format!(
        r#"{{"asset": {{"version": "2.0"}}, "scene": 0, "scenes": [{{"nodes": [0]}}], "nodes": [{{"mesh": 0}}],
        "meshes": [{{"primitives": [{{"attributes": {{"POSITION": 0, "TEXCOORD_0": 1}}, "material": 0}}]}}],
        "materials": [{{"pbrMetallicRoughness": {{"baseColorTexture": {{"index": 0}}}}}}],
        "textures": [{{"source": 0}}], "images": [{image}],
        "accessors": [
            {{"bufferView": 0, "componentType": 5126, "type": "VEC3", "count": 3, "min": [0, 0, 0], "max": [1, 1, 0]}},
            {{"componentType": 5126, "type": "VEC2", "count": 3}}],
        "bufferViews": [{{"buffer": 0, "byteLength": 36}}],
        "buffers": [{{{buffer} "byteLength": 36}}]}}"#
    )
}
