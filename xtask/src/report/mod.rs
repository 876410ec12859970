//! `cargo xtask report`: figures of what the method promises, with their numbers, computed anew. The same files come out
//! on every run.

mod axis;
mod derivatives;
mod plot;
mod radius;
mod table;

use crate::cargo::workspace;
use anyhow::{Context, Result};
use std::fs;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// What to report
    what: What,
    /// Write into `docs/`, where the project keeps its figures, and not into `out/report/`
    #[arg(long)]
    docs: bool,
}

#[derive(Clone, Copy, clap::ValueEnum)]
enum What {
    /// Gradients and Hessians of gathered light near silhouettes, by the number of gather directions
    Derivatives,
    /// Rules for a record's radius against the best radius, between two point lights in fog
    Radius,
}

impl What {
    fn report(self) -> Result<Report> {
        match self {
            Self::Derivatives => derivatives::report(),
            Self::Radius => radius::report(),
        }
    }
}

/// What a report says.
struct Report {
    /// Lines for the terminal.
    summary: String,
    files: Vec<File>,
}

struct File {
    name: &'static str,
    text: String,
}

pub(crate) fn run(options: &Options) -> Result<()> {
    let folder = workspace().join(if options.docs { "docs" } else { "out/report" });
    fs::create_dir_all(&folder).with_context(|| format!("could not make {}", folder.display()))?;
    let report = options.what.report()?;
    println!("{}", report.summary);
    for File { name, text } in report.files {
        let path = folder.join(name);
        fs::write(&path, text).with_context(|| format!("could not write {}", path.display()))?;
        println!("{}", path.display());
    }
    Ok(())
}
