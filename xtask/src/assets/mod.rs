//! `cargo xtask assets`: the scenes that Tyndall ships, written from code. The same files come out on every run; a test
//! holds the committed ones against them.

mod cloud;
mod cornell_box;
mod gltf;
mod hall;
mod lamp;
mod mesh;
mod smoke;
mod street;
mod volume;

use crate::cargo::workspace;
use anyhow::{Context, Result};
use gltf::Document;
use std::fs;
use std::path::PathBuf;

/// One scene: `assets/<name>/<name>.ron`, with its glTF beside it where it has geometry, and a `.vol` where its density is from voxels.
struct Asset {
    name: &'static str,
    ron: String,
    gltf: Option<Document>,
    /// Further scene files of the same geometry, `assets/<name>/<variant>.ron`.
    variants: Vec<(&'static str, String)>,
    volume: Option<Vec<u8>>,
}

pub(crate) fn run() -> Result<()> {
    for (path, bytes) in files()? {
        let path = workspace().join(path);
        fs::create_dir_all(path.parent().context("an asset outside any folder")?)?;
        fs::write(&path, bytes).with_context(|| format!("could not write {}", path.display()))?;
        println!("{}", path.display());
    }
    Ok(())
}

/// Every file with its path from the workspace root.
fn files() -> Result<Vec<(PathBuf, Vec<u8>)>> {
    let mut files = Vec::new();
    for asset in [
        cornell_box::asset(),
        lamp::asset(),
        hall::asset(),
        street::asset(),
        smoke::asset(),
        cloud::asset(),
    ] {
        let stem = PathBuf::from("assets").join(asset.name).join(asset.name);
        files.push((stem.with_extension("ron"), asset.ron.into()));
        for (variant, ron) in asset.variants {
            files.push((
                stem.with_file_name(variant).with_extension("ron"),
                ron.into(),
            ));
        }
        if let Some(document) = asset.gltf {
            let bin = format!("{}.bin", asset.name);
            files.push((stem.with_extension("gltf"), document.json(&bin)?));
            files.push((stem.with_extension("bin"), document.into_buffer()));
        }
        if let Some(volume) = asset.volume {
            files.push((stem.with_extension("vol"), volume));
        }
    }
    Ok(files)
}

#[cfg(test)]
#[allow(clippy::unwrap_used, reason = "tests")]
mod tests {
    use super::*;

    #[test]
    fn committed_assets_are_what_the_code_writes() {
        for (path, bytes) in files().unwrap() {
            let shown = path.display();
            let committed = fs::read(workspace().join(&path)).unwrap_or_default();
            assert!(
                committed == bytes,
                "{shown} differs; run `cargo xtask assets` and commit the result"
            );
        }
    }

    #[test]
    fn the_same_bytes_are_written_on_every_run() {
        assert_eq!(files().unwrap(), files().unwrap());
    }
}
