//! The `tyndall` command: arguments in, progress and readable errors out.
//!
//! All rendering is in `tyndall-render`; this crate only talks to people.

mod args;
mod commands;
mod error;
mod failure;
mod output;
mod progress;
mod signals;
mod value;

use clap::Parser;
use std::process::ExitCode;

fn main() -> ExitCode {
    failure::keep_panics_quiet();
    let cli = match args::Cli::try_parse() {
        Ok(cli) => cli,
        // Prints help on standard output and ends with 0, or a usage error on standard error and ends with 2.
        Err(message) => message.exit(),
    };
    let signals = match signals::Signals::listen() {
        Ok(signals) => signals,
        Err(error) => {
            output::say(&format!("error: cannot listen to signals: {error}"));
            return ExitCode::FAILURE;
        }
    };
    match failure::catch(|| commands::run(&cli.command, &signals)) {
        Ok(()) => ExitCode::SUCCESS,
        Err(error::CliError::Interrupted(signal)) => ExitCode::from(signal.status()),
        Err(error) => {
            output::say(&format!("error: {error}"));
            ExitCode::from(error.status())
        }
    }
}
