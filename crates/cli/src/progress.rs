//! Progress on a terminal: phase, percent, time left, records so far.

use crate::signals::Signals;
use indicatif::{ProgressBar, ProgressDrawTarget, ProgressStyle};
use std::io::{IsTerminal, stderr};
use std::sync::{Mutex, PoisonError};
use tyndall_render::options::{Phase, Progress};

/// Steps of a full bar.
const STEPS: u64 = 1000;

/// One line on standard error that is drawn anew, or nothing where that is no terminal. Signals end what it shows.
pub(crate) struct Bar {
    bar: ProgressBar,
    signals: Signals,
    /// The phase shown and the most records seen.
    shown: Mutex<(Option<Phase>, usize)>,
}

impl Bar {
    /// A bar that is hidden when `quiet` or when standard error is no terminal.
    pub(crate) fn new(quiet: bool, signals: &Signals) -> Self {
        let visible = !quiet && stderr().is_terminal();
        let target = if visible {
            ProgressDrawTarget::stderr_with_hz(5)
        } else {
            ProgressDrawTarget::hidden()
        };
        let style = ProgressStyle::with_template("{msg}  {percent:>3} %  [{bar:30}]  {eta} left");
        let bar = ProgressBar::with_draw_target(Some(STEPS), target);
        Self {
            bar: bar.with_style(style.unwrap_or_else(|_| ProgressStyle::default_bar())),
            signals: signals.clone(),
            shown: Mutex::default(),
        }
    }

    /// Takes the line away.
    pub(crate) fn finish(&self) {
        self.bar.finish_and_clear();
    }
}

impl Progress for Bar {
    fn update(&self, phase: Phase, fraction: f32, records: usize) {
        if self.bar.is_hidden() {
            return;
        }
        let mut shown = self.shown.lock().unwrap_or_else(PoisonError::into_inner);
        if shown.0 != Some(phase) {
            shown.0 = Some(phase);
            // The time left is told from the speed of this phase alone.
            self.bar.reset();
        }
        shown.1 = shown.1.max(records);
        let message = match shown.1 {
            0 => phase.name().to_owned(),
            n => format!("{}, {n} records", phase.name()),
        };
        self.bar.set_message(message);
        self.bar
            .set_position((fraction.clamp(0.0, 1.0) * STEPS as f32) as u64);
    }

    fn is_cancelled(&self) -> bool {
        self.signals.last().is_some()
    }
}
