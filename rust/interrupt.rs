//! A person's wish that a long computation end: kernels look between blocks of work and stop early.
//!
//! What a stopped kernel returns is worthless; whoever called [`request`] must not use it.

use std::cell::Cell;
use std::sync::atomic::{AtomicUsize, Ordering};

static REQUESTS: AtomicUsize = AtomicUsize::new(0);
static PENDING: AtomicUsize = AtomicUsize::new(0);

/// How many requests there were so far: a kernel during which this number grew was stopped.
#[must_use]
pub fn requests() -> usize {
    REQUESTS.load(Ordering::SeqCst)
}

/// Ask every running kernel to stop, until the answer is dropped.
#[must_use]
pub fn request() -> Request {
    PENDING.fetch_add(1, Ordering::SeqCst);
    REQUESTS.fetch_add(1, Ordering::SeqCst);
    Request(())
}

thread_local! {
    static WATCH: Cell<Option<fn() -> bool>> = const { Cell::new(None) };
}

/// Whether somebody waits for the running kernels to stop.
#[inline]
#[must_use]
pub fn is_requested() -> bool {
    PENDING.load(Ordering::Relaxed) > 0 || WATCH.get().is_some_and(|look| look())
}

/// Have this thread's kernels look for such a wish themselves, until the answer is dropped: nobody else does.
#[must_use]
pub fn watch(look: fn() -> bool) -> Watch {
    Watch(WATCH.replace(Some(look)))
}

/// A thread that looks for itself as long as this lives.
#[derive(Debug)]
pub struct Watch(Option<fn() -> bool>);

impl Drop for Watch {
    fn drop(&mut self) {
        WATCH.set(self.0);
    }
}

/// A request that stands as long as this lives.
#[derive(Debug)]
pub struct Request(());

impl Drop for Request {
    fn drop(&mut self) {
        PENDING.fetch_sub(1, Ordering::SeqCst);
    }
}
