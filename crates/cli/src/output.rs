//! Standard output for results, standard error for everything said along the way.

use crate::error::CliError;
use std::collections::BTreeSet;
use std::fmt::Display;
use std::io::{ErrorKind, Write};

/// Prints a result. A reader that has gone away (`| head`) is no error.
pub(crate) fn print(text: &str) -> Result<(), CliError> {
    let mut out = std::io::stdout().lock();
    match writeln!(out, "{text}").and_then(|()| out.flush()) {
        Err(error) if error.kind() != ErrorKind::BrokenPipe => Err(CliError::Output(error)),
        _ => Ok(()),
    }
}

/// Prints JSON as a result.
pub(crate) fn print_json(value: &impl serde::Serialize) -> Result<(), CliError> {
    let text =
        serde_json::to_string_pretty(value).map_err(|e| CliError::Internal(e.to_string()))?;
    print(&text)
}

/// Says a line on standard error; nobody may be listening there.
pub(crate) fn say(line: &str) {
    let _ = writeln!(std::io::stderr(), "{line}");
}

/// Says each different warning once.
pub(crate) fn warn<W: Display>(warnings: impl IntoIterator<Item = W>) {
    let mut said = BTreeSet::new();
    for warning in warnings {
        let text = warning.to_string();
        if said.insert(text.clone()) {
            say(&format!("warning: {text}"));
        }
    }
}
