//! Starting cargo, and where the workspace lies. Every command runs at the workspace root with the cargo that started
//! this program.

use anyhow::{Context, Result, bail, ensure};
use serde_json::Value;
use std::env;
use std::ffi::OsString;
use std::path::PathBuf;
use std::process::{Command, Stdio};

/// The workspace root: that of the cargo which started this program, as a program built elsewhere may be left in a shared
/// target folder.
pub(crate) fn workspace() -> PathBuf {
    let manifest = env::var_os("CARGO_MANIFEST_DIR")
        .map_or_else(|| PathBuf::from(env!("CARGO_MANIFEST_DIR")), PathBuf::from);
    manifest.parent().unwrap_or(&manifest).to_path_buf()
}

/// A cargo command at the workspace root, its arguments separated by spaces.
pub(crate) fn cargo(arguments: &str) -> Command {
    let program = env::var_os("CARGO").unwrap_or_else(|| OsString::from("cargo"));
    let mut command = Command::new(program);
    command.args(arguments.split(' ')).current_dir(workspace());
    command
}

/// Runs `command`, its output going to the terminal; an error unless it succeeds.
pub(crate) fn run(command: &mut Command) -> Result<()> {
    let shown = shown(command);
    let status = command
        .status()
        .with_context(|| format!("`{shown}` could not be started"))?;
    ensure!(status.success(), "`{shown}` failed: {status}");
    Ok(())
}

/// Packages of the workspace as `cargo metadata` describes them.
pub(crate) fn packages() -> Result<Vec<Value>> {
    let metadata: Value = serde_json::from_str(&stdout(&mut cargo(
        "metadata --no-deps --format-version=1",
    ))?)?;
    let packages = metadata["packages"].as_array();
    Ok(packages
        .context("`cargo metadata` lists no packages")?
        .clone())
}

/// Builds the `tyndall` program for release and returns its path.
pub(crate) fn build_tyndall() -> Result<PathBuf> {
    let messages = stdout(&mut cargo(
        "build --release --package=tyndall-cli --message-format=json-render-diagnostics",
    ))?;
    let executable = messages.lines().find_map(|line| {
        let message: Value = serde_json::from_str(line).ok()?;
        Some(PathBuf::from(message["executable"].as_str()?))
    });
    executable.context("`cargo build` named no executable")
}

fn stdout(command: &mut Command) -> Result<String> {
    let shown = shown(command);
    let output = command
        .stderr(Stdio::inherit())
        .output()
        .with_context(|| format!("`{shown}` could not be started"))?;
    if !output.status.success() {
        bail!("`{shown}` failed: {}", output.status);
    }
    Ok(String::from_utf8(output.stdout)?)
}

fn shown(command: &Command) -> String {
    let words = [command.get_program()]
        .into_iter()
        .chain(command.get_args());
    let words: Vec<_> = words.map(|word| word.to_string_lossy()).collect();
    words.join(" ")
}
