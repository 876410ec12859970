//! Development commands of Tyndall: `cargo xtask assets|render-all|golden|report|test`. Plain cargo and nothing else is
//! needed.

#![allow(clippy::print_stdout, reason = "a command line program")]

mod assets;
mod cargo;
mod golden;
mod render_all;
mod report;
mod test;

use anyhow::Result;
use clap::{Parser, Subcommand};

#[derive(Parser)]
#[command(name = "cargo xtask", about = "Development commands of Tyndall")]
struct Arguments {
    #[command(subcommand)]
    command: Command,
}

#[derive(Subcommand)]
enum Command {
    /// Write the scenes that Tyndall ships into `assets/`
    Assets,
    /// Render every scene of `assets/` into `out/` and print the path of each image
    RenderAll(render_all::Options),
    /// Compare small renders with the golden images in `tests/golden`
    Golden(golden::Options),
    /// Compute a figure with its numbers and write both into `out/report/`
    Report(report::Options),
    /// Run all that CI runs, stopping at the first failure
    Test,
}

fn main() -> Result<()> {
    match Arguments::parse().command {
        Command::Assets => assets::run(),
        Command::RenderAll(options) => render_all::run(&options),
        Command::Golden(options) => golden::run(&options),
        Command::Report(options) => report::run(&options),
        Command::Test => test::run(),
    }
}
