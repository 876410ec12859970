//! The reader on many real files, where they are at hand: each loads or gives a clear error.

use std::path::{Path, PathBuf};
use tyndall_scene::gltf::{ReadOptions, read};

/// Files that must be refused, each with a part of the message; all others must load.
const REFUSED: [(&str, &str); 24] = [
    (
        "assimp/draco/2CylinderEngine.gltf",
        "requires KHR_draco_mesh_compression",
    ),
    (
        "milk_truck_draco.glb",
        "requires KHR_draco_mesh_compression",
    ),
    ("milk_truck_meshopt.glb", "requires EXT_meshopt_compression"),
    ("milk_truck_webp.glb", "requires EXT_texture_webp"),
    (
        "pmndrs_draco/bunny.glb",
        "requires KHR_draco_mesh_compression",
    ),
    (
        "pmndrs_draco/pmndrs.glb",
        "requires KHR_draco_mesh_compression",
    ),
    (
        "pmndrs_draco/suzi.glb",
        "requires KHR_draco_mesh_compression",
    ),
    (
        "techniqueWebGL/BoxTextured.gltf",
        "requires KHR_technique_webgl",
    ),
    ("BoxWithInfinites.glb", "positions must be finite"),
    ("IncorrectVertexArrays/Cube.gltf", "35 is not allowed here"),
    ("AllIndicesOutOfRange.gltf", "is out of range"),
    ("IndexOutOfRange.gltf", "is out of range"),
    ("MissingBin/BoxTextured.gltf", "BoxTextured0.bin"),
    ("RecursiveNodes.gltf", "reached twice"),
    ("sceneWrongType.gltf", "is not valid glTF"),
    ("NoScene.gltf", "the file has no scene"),
    ("SceneWithoutNodes.gltf", "missing field `nodes`"),
    ("gltf1_milk_truck/CesiumMilkTruck.gltf", "this is glTF 1,"),
    ("badArray.gltf", "is not valid glTF"),
    ("badExtension.gltf", "is not valid glTF"),
    ("badNumber.gltf", "is not valid glTF"),
    ("badObject.gltf", "is not valid glTF"),
    ("badString.gltf", "is not valid glTF"),
    ("badUint.gltf", "is not valid glTF"),
];

fn gltf_files(folder: &Path, found: &mut Vec<PathBuf>) {
    let Ok(entries) = std::fs::read_dir(folder) else {
        return;
    };
    for path in entries.flatten().map(|entry| entry.path()) {
        let is_gltf = |end: &std::ffi::OsStr| end == "gltf" || end == "glb";
        if path.is_dir() {
            gltf_files(&path, found);
        } else if path.extension().is_some_and(is_gltf) {
            found.push(path);
        }
    }
}

#[test]
fn every_shared_file_loads_or_gives_its_error() {
    let assets = Path::new(env!("CARGO_MANIFEST_DIR")).join("../../../shared/assets");
    let mut files = Vec::new();
    for folder in ["scenes", "conformance", "invalid"] {
        gltf_files(&assets.join(folder), &mut files);
    }
    files.sort();
    let mut faults = Vec::new();
    for file in &files {
        let name = file.to_string_lossy();
        let expected = REFUSED.iter().find(|(end, _)| name.ends_with(end));
        match (read(file, &ReadOptions::default()), expected) {
            (Ok(_), None) => {}
            (Ok(_), Some((_, part))) => faults.push(format!("{name} loads, not \"{part}\"")),
            (Err(error), Some((_, part))) if error.to_string().contains(part) => {}
            (Err(error), _) => faults.push(format!("{name}: {error}")),
        }
    }
    assert!(faults.is_empty(), "{}", faults.join("\n"));
}
