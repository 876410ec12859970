//! `cargo xtask test`: everything CI runs, in order, each step with its heading and its time, stopping at the first
//! failure.

use crate::cargo::{cargo, packages, run as run_command};
use anyhow::{Context, Result};
use std::process::Command;
use std::time::Instant;

pub(crate) fn run() -> Result<()> {
    let begin = Instant::now();
    step("format", &mut cargo("fmt --all --check"))?;
    step(
        "clippy",
        &mut cargo("clippy --workspace --all-targets -- -D warnings"),
    )?;
    // A failing snapshot is told, and not written into the source folders.
    step(
        "tests, doc tests and golden images",
        cargo("test --workspace").env("INSTA_UPDATE", "no"),
    )?;
    step(
        "documentation",
        cargo("doc --workspace --no-deps").env("RUSTDOCFLAGS", "-D warnings"),
    )?;
    for (package, example) in examples()? {
        step(
            &format!("example {example} of {package}"),
            // Not of one package: its libraries would be built once more, with the features that it alone asks for.
            &mut cargo(&format!("run --quiet --example {example}")),
        )?;
    }
    println!("\nall passed in {:.0} s", begin.elapsed().as_secs_f64());
    Ok(())
}

fn step(heading: &str, command: &mut Command) -> Result<()> {
    println!("\n== {heading}");
    let begin = Instant::now();
    run_command(command).with_context(|| format!("step `{heading}`"))?;
    println!("== {heading}: {:.0} s", begin.elapsed().as_secs_f64());
    Ok(())
}

/// Package and name of every example in the workspace.
fn examples() -> Result<Vec<(String, String)>> {
    let mut found = Vec::new();
    for package in packages()? {
        for target in package["targets"].as_array().into_iter().flatten() {
            let kinds = target["kind"].as_array();
            if kinds.is_some_and(|kinds| kinds.iter().any(|kind| kind == "example")) {
                let name = |value: &serde_json::Value| value["name"].as_str().map(str::to_owned);
                found.push(
                    name(&package)
                        .zip(name(target))
                        .context("a target without a name")?,
                );
            }
        }
    }
    Ok(found)
}
