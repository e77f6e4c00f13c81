//! Interruption of a long computation by the user: kernels check between blocks of work and stop early.
//!
//! The result of a stopped kernel is invalid; the caller of [`request`] must not use it.

use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

static REQUESTS: AtomicUsize = AtomicUsize::new(0);
static PENDING: AtomicUsize = AtomicUsize::new(0);

/// Number of requests so far: a kernel during which it grew was stopped.
#[must_use]
pub fn requests() -> usize {
    REQUESTS.load(Ordering::SeqCst)
}

/// Asks every running kernel to stop, until the returned value is dropped.
#[must_use]
pub fn request() -> Request {
    PENDING.fetch_add(1, Ordering::SeqCst);
    REQUESTS.fetch_add(1, Ordering::SeqCst);
    Request(())
}

thread_local! {
    static WATCH: Cell<Option<fn() -> bool>> = const { Cell::new(None) };
}

/// Whether a request to stop the running kernels is pending.
#[inline]
#[must_use]
pub fn is_requested() -> bool {
    PENDING.load(Ordering::Relaxed) > 0 || WATCH.get().is_some_and(|look| look())
}

/// Makes the kernels of this thread, and of no other, poll `look` until the returned value is dropped.
#[must_use]
pub fn watch(look: fn() -> bool) -> Watch {
    Watch(WATCH.replace(Some(look)))
}

/// Polling on this thread, for as long as this lives.
#[derive(Debug)]
pub struct Watch(Option<fn() -> bool>);

impl Drop for Watch {
    fn drop(&mut self) {
        WATCH.set(self.0);
    }
}

/// A request, pending for as long as this lives.
#[derive(Debug)]
pub struct Request(());

impl Drop for Request {
    fn drop(&mut self) {
        PENDING.fetch_sub(1, Ordering::SeqCst);
    }
}
