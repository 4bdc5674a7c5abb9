//! A running computation: how far it is, and whether the user gave up.

use std::any::Any;
use std::panic::{AssertUnwindSafe, catch_unwind};
use std::sync::atomic::{AtomicBool, AtomicUsize, Ordering};

use crate::error::{Error, Result};

/// Shared by the threads that work and the one that watches them.
#[derive(Debug, Default)]
pub struct Job {
    is_cancelled: AtomicBool,
    done: AtomicUsize,
    total: AtomicUsize,
}

impl Job {
    /// Asks the work to stop.
    pub fn cancel(&self) {
        self.is_cancelled.store(true, Ordering::Relaxed);
    }

    /// Says that `count` more pieces of work lie ahead.
    pub fn expect(&self, count: usize) {
        self.total.fetch_add(count, Ordering::Relaxed);
    }

    /// Says that `count` pieces of work are done.
    ///
    /// # Errors
    /// `Cancelled` where the user gave up; call it often.
    pub fn advance(&self, count: usize) -> Result<()> {
        self.done.fetch_add(count, Ordering::Relaxed);
        if self.is_cancelled.load(Ordering::Relaxed) { Err(Error::Cancelled) } else { Ok(()) }
    }

    /// The share of the work that is done, 0 to 1.
    pub fn progress(&self) -> f64 {
        let total = self.total.load(Ordering::Relaxed);
        if total == 0 { 0.0 } else { (self.done.load(Ordering::Relaxed) as f64 / total as f64).min(1.0) }
    }
}

/// Does `work`, on whatever threads; where it panics the process goes on, and what `work` had begun to write is unfinished.
///
/// # Errors
/// Those of `work`, and `Defect` for a panic.
pub fn guarded<T>(work: impl FnOnce() -> Result<T>) -> Result<T> {
    catch_unwind(AssertUnwindSafe(work)).unwrap_or_else(|panic| Err(Error::Defect(panic_text(panic.as_ref()))))
}

fn panic_text(panic: &(dyn Any + Send)) -> String {
    let text = panic.downcast_ref::<String>().map(String::as_str).or_else(|| panic.downcast_ref::<&str>().copied());
    text.unwrap_or("no message").into()
}

#[cfg(test)]
mod tests {
    use rayon::prelude::*;

    use super::*;

    #[test]
    fn a_panic_is_an_error_with_its_text() {
        let index = [0, 3];
        let outside = guarded(|| Ok([1, 2][index[1]]));
        assert_eq!(outside, Err(Error::Defect("index out of bounds: the len is 2 but the index is 3".into())));
        assert_eq!(guarded::<()>(|| std::panic::panic_any(1)), Err(Error::Defect("no message".into())));
        assert!(Error::Defect("x".into()).to_string().ends_with("has a defect, please report it: x"));
    }

    #[test]
    #[cfg_attr(miri, ignore = "rayon's threads outlive the test")]
    fn a_panic_on_another_thread_too_and_the_next_call_works() {
        let sum = |limit: usize| {
            guarded(|| {
                Ok((0..100usize).into_par_iter().map(|n| if n < limit { n } else { panic!("{n} is too much") }).sum::<usize>())
            })
        };
        assert_eq!(sum(99), Err(Error::Defect("99 is too much".into())));
        assert_eq!(sum(100), Ok(4950));
    }

    #[test]
    fn errors_pass_through() {
        assert_eq!(guarded::<()>(|| Err(Error::Cancelled)), Err(Error::Cancelled));
    }
}
