//! Panics become one readable paragraph.
//!
//! A panic is a bug of ours; its message and place go to whoever reports it, and a backtrace to nobody.

use crate::error::CliError;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::{Mutex, PoisonError};

/// Message and place of the last panic of any thread.
static LAST_PANIC: Mutex<Option<String>> = Mutex::new(None);

/// Stops panics from printing; [`catch`] tells those that nobody else caught.
pub(crate) fn keep_panics_quiet() {
    std::panic::set_hook(Box::new(|panic| {
        let payload = panic.payload();
        let text = payload.downcast_ref::<&str>().copied();
        let text = text.or_else(|| payload.downcast_ref::<String>().map(String::as_str));
        let message = text.unwrap_or("a panic without a message");
        let place = panic
            .location()
            .map(|at| format!(" ({}:{})", at.file(), at.line()));
        let line = format!("{message}{}", place.unwrap_or_default()).replace('\n', " ");
        *LAST_PANIC.lock().unwrap_or_else(PoisonError::into_inner) = Some(line);
    }));
}

/// Runs `work`; a panic in it or in its threads is an internal error.
pub(crate) fn catch(work: impl FnOnce() -> Result<(), CliError>) -> Result<(), CliError> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|_| {
        let last = LAST_PANIC
            .lock()
            .unwrap_or_else(PoisonError::into_inner)
            .take();
        Err(CliError::Internal(last.unwrap_or_default()))
    })
}

#[cfg(test)]
mod tests {
    #![allow(clippy::unwrap_used, reason = "tests")]
    use super::*;

    #[test]
    fn a_panic_in_a_thread_is_one_line_with_its_place() {
        keep_panics_quiet();
        let result = catch(|| {
            std::thread::scope(|scope| {
                scope
                    .spawn(|| panic!("two\nlines"))
                    .join()
                    .map_err(std::panic::resume_unwind)
            })
            .ok();
            Ok(())
        });
        let message = result.unwrap_err().to_string();
        assert!(
            message.contains("two lines") && message.contains("failure.rs"),
            "{message}"
        );
        assert!(!message.contains('\n'));
    }
}
