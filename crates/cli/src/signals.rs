//! What the signals that ask a program to end do: SIGINT, as Ctrl-C sends it, and SIGTERM.
//!
//! They end the program at once until somebody who has something to save [defers](Signals::defer) them; then the first one is only
//! noted, and the second one ends the program.

use signal_hook::consts::{SIGINT, SIGTERM};
use signal_hook::flag;
use std::io::Error;
use std::sync::Arc;
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

/// Exit statuses after a signal are this and its number, as shells have it.
const STATUS: i32 = 128;

/// Listens to signals.
#[derive(Clone)]
pub(crate) struct Signals {
    /// Number of the last signal that came; 0 for none.
    last: Arc<AtomicUsize>,
    /// Whether the next signal ends the program at once.
    is_next_last: Arc<AtomicBool>,
}

/// A signal that asked the program to end.
#[derive(Clone, Copy, Debug, PartialEq, Eq)]
pub(crate) enum Signal {
    Interrupt,
    Terminate,
}

impl Signals {
    /// Starts to listen; until they are deferred, signals end the program at once.
    pub(crate) fn listen() -> Result<Self, Error> {
        let signals = Self {
            last: Arc::default(),
            is_next_last: Arc::new(AtomicBool::new(true)),
        };
        for signal in [SIGINT, SIGTERM] {
            // What a signal does is done in this order: the second one finds what the first has left.
            let is_last = &signals.is_next_last;
            flag::register_conditional_shutdown(signal, STATUS + signal, is_last.clone())?;
            flag::register(signal, is_last.clone())?;
            flag::register_usize(signal, signals.last.clone(), signal as usize)?;
        }
        Ok(signals)
    }

    /// From now on the first signal is only noted.
    pub(crate) fn defer(&self) {
        self.is_next_last.store(false, Ordering::SeqCst);
    }

    /// The signal that came since they are deferred.
    pub(crate) fn last(&self) -> Option<Signal> {
        match self.last.load(Ordering::Relaxed) as i32 {
            SIGINT => Some(Signal::Interrupt),
            SIGTERM => Some(Signal::Terminate),
            _ => None,
        }
    }
}

impl Signal {
    pub(crate) fn name(self) -> &'static str {
        match self {
            Self::Interrupt => "SIGINT",
            Self::Terminate => "SIGTERM",
        }
    }

    /// The exit status of a program that ends because of it.
    pub(crate) fn status(self) -> u8 {
        match self {
            Self::Interrupt => (STATUS + SIGINT) as u8,
            Self::Terminate => (STATUS + SIGTERM) as u8,
        }
    }
}
