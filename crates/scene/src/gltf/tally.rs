//! Small faults of one kind, counted so that each kind gives one warning.

use crate::error::Warning;
use std::collections::BTreeMap;

/// What was repaired or left out, how often, and where first.
#[derive(Debug, Default)]
pub(super) struct Tally {
    faults: BTreeMap<&'static str, (usize, String)>,
}

impl Tally {
    /// Counts one fault; `what` reads on from a number, as in "nodes are left out".
    pub(super) fn note(&mut self, what: &'static str, pointer: &str) {
        let (count, _) = self
            .faults
            .entry(what)
            .or_insert_with(|| (0, pointer.into()));
        *count += 1;
    }

    /// One warning for each kind.
    pub(super) fn into_warnings(self) -> impl Iterator<Item = Warning> {
        self.faults
            .into_iter()
            .map(|(what, (count, pointer))| Warning::Gltf {
                problem: format!("{count} {what}"),
                pointer,
            })
    }
}
