//! `cargo xtask golden`: small renders against the images in `tests/golden`. The comparison itself is the test
//! `golden` of the package `tyndall-tests`.

use crate::cargo::{cargo, run as run_command};
use anyhow::Result;

#[derive(clap::Args)]
pub(crate) struct Options {
    /// Replace the golden images by what is rendered now
    #[arg(long)]
    bless: bool,
    /// Only goldens whose name contains this
    filter: Option<String>,
}

pub(crate) fn run(options: &Options) -> Result<()> {
    let mut command = cargo("test --package=tyndall-tests --test=golden --");
    command.args(&options.filter);
    if options.bless {
        command.env("TYNDALL_BLESS", "1");
    }
    run_command(&mut command)
}
