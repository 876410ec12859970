//! `cargo xtask render-all`: builds `tyndall`, renders every scene of `assets/` into `out/`, and prints the path of each
//! image last.

use crate::cargo::{build_tyndall, workspace};
use anyhow::{Context, Result, ensure};
use std::fs;
use std::path::{Path, PathBuf};
use std::process::Command;
use std::time::Instant;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Only the scene of this name
    #[arg(long)]
    only: Option<String>,
    /// Error of the images to aim for
    #[arg(long, default_value_t = 0.03)]
    error: f64,
    /// Seconds after which each image is kept as good as it then is
    #[arg(long, default_value_t = 60.0)]
    time_limit: f64,
    /// `cache` or `path`
    #[arg(long)]
    integrator: Option<String>,
}

pub(crate) fn run(options: &Options) -> Result<()> {
    let root = workspace();
    let scenes = scenes(&root, options.only.as_deref())?;
    let out = root.join("out");
    fs::create_dir_all(&out)?;
    let tyndall = build_tyndall()?;

    let mut images = Vec::new();
    let mut failed = Vec::new();
    for scene in &scenes {
        let name = scene.file_stem().unwrap_or_default().to_string_lossy();
        let outputs = ["exr", "png"].map(|extension| out.join(format!("{name}.{extension}")));
        println!("== {name}");
        let begin = Instant::now();
        let mut command = Command::new(&tyndall);
        command.arg("render").arg(scene).current_dir(&root);
        for output in &outputs {
            command.arg("-o").arg(output);
        }
        command.arg("--error").arg(options.error.to_string());
        command
            .arg("--time-limit")
            .arg(options.time_limit.to_string());
        if let Some(integrator) = &options.integrator {
            command.args(["--integrator", integrator]);
        }
        let status = command.status().context("tyndall could not be started")?;
        println!("== {name}: {:.1} s", begin.elapsed().as_secs_f64());
        if status.success() {
            images.extend(outputs);
        } else {
            failed.push(format!("{name} ({status})"));
        }
    }
    for image in images {
        println!("{}", image.display());
    }
    ensure!(failed.is_empty(), "not rendered: {}", failed.join(", "));
    Ok(())
}

/// The scene files `assets/*/*.ron`, sorted.
fn scenes(root: &Path, only: Option<&str>) -> Result<Vec<PathBuf>> {
    let mut scenes = Vec::new();
    for folder in fs::read_dir(root.join("assets"))? {
        let folder = folder?.path();
        if !folder.is_dir() {
            continue;
        }
        for file in fs::read_dir(folder)? {
            let file = file?.path();
            let name = file.file_stem().unwrap_or_default();
            if file.extension().is_some_and(|e| e == "ron") && only.is_none_or(|only| name == only)
            {
                scenes.push(file);
            }
        }
    }
    scenes.sort();
    ensure!(
        !scenes.is_empty(),
        "no scene of that name in assets/; `cargo xtask assets` writes them"
    );
    Ok(scenes)
}
