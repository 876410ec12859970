//! One module per command.

mod compare;
mod info;
mod probe;
mod render;
mod verify;

use crate::args::{Command, SourceArgs};
use crate::error::CliError;
use crate::signals::Signals;
use tyndall_scene::LoadOptions;

/// Does what the command line asks for.
pub(crate) fn run(command: &Command, signals: &Signals) -> Result<(), CliError> {
    match command {
        Command::Render(args) => render::run(args, signals),
        Command::Compare(args) => compare::run(args),
        Command::Info(args) => info::run(args),
        Command::Probe(args) => probe::run(args),
        Command::Verify(args) => verify::run(args),
    }
}

impl SourceArgs {
    fn load_options(&self) -> LoadOptions {
        LoadOptions {
            allow_external: self.allow_external,
            fog: self.fog,
            max_grid_bytes: self.max_grid_memory,
            ..LoadOptions::default()
        }
    }
}
