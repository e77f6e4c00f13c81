//! Running a kernel: without the interpreter lock, on existing threads, interruptible by Ctrl-C, its panics not
//! printed.

use std::any::Any;
use std::cell::{Cell, OnceCell, RefCell};
use std::panic::{AssertUnwindSafe, catch_unwind, resume_unwind};
use std::sync::atomic::{AtomicPtr, AtomicU32, Ordering};
use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Mutex, PoisonError};
use std::time::{Duration, Instant};

use pyo3::exceptions::{PyKeyboardInterrupt, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

use crate::error::Result as KernelResult;
use crate::interrupt;

/// Interval at which a long kernel checks for signals.
const PATIENCE: Duration = Duration::from_millis(50);

/// Location of the last panic, for a bug report; it is not printed.
static PANIC: Mutex<String> = Mutex::new(String::new());

/// Runs a kernel without holding the interpreter; its error becomes a `ValueError` with the kernel's text.
pub(crate) fn run<T: Send>(
    py: Python<'_>,
    kernel: impl FnOnce() -> KernelResult<T> + Send,
) -> PyResult<T> {
    let before = interrupt::requests();
    let out = py.detach(|| guarded(kernel, Threads::Shared));
    finish(out, before)
}

/// As [`run`], for kernels that may take seconds: signals are checked while it works, and end it between blocks.
pub(crate) fn run_long<T: Send>(
    py: Python<'_>,
    kernel: impl FnOnce() -> KernelResult<T> + Send,
) -> PyResult<T> {
    let before = interrupt::requests();
    if is_alone() {
        return run_watched(py, kernel, before);
    }
    std::thread::scope(|scope| {
        let (done, mut waiting) = channel::<()>();
        let worker = std::thread::Builder::new().spawn_scoped(scope, move || {
            let out = guarded(kernel, Threads::Own);
            // This fails only when nobody waits any more, which cannot happen before the thread is joined.
            let _ = done.send(());
            out
        });
        let worker = worker.map_err(|error| no_threads(&error))?;
        let mut stopped = None;
        loop {
            let waiting = &mut waiting;
            match py.detach(move || waiting.recv_timeout(PATIENCE)) {
                Err(RecvTimeoutError::Timeout) if stopped.is_none() => {
                    // Runs the handlers of Python where this is its main thread, and does nothing elsewhere.
                    if let Err(signal) = py.check_signals() {
                        stopped = Some((signal, interrupt::request()));
                    }
                }
                Err(RecvTimeoutError::Timeout) => {}
                Ok(()) | Err(RecvTimeoutError::Disconnected) => break,
            }
        }
        let out = match py.detach(move || worker.join()) {
            Ok(out) => out,
            Err(panic) => resume_unwind(panic),
        };
        match stopped {
            Some((signal, _request)) => Err(signal),
            None => finish(out, before),
        }
    })
}

thread_local! {
    static LOOKED: Cell<Option<Instant>> = const { Cell::new(None) };
    static STOPPED: RefCell<Option<(PyErr, interrupt::Request)>> = const { RefCell::new(None) };
}

/// As [`run_long`] where the caller's thread is the only one: it computes itself and checks for signals between blocks.
fn run_watched<T: Send>(
    py: Python<'_>,
    kernel: impl FnOnce() -> KernelResult<T> + Send,
    before: usize,
) -> PyResult<T> {
    LOOKED.set(Some(Instant::now()));
    let out = py.detach(|| {
        let _watch = interrupt::watch(look_for_signals);
        guarded(kernel, Threads::Shared)
    });
    match STOPPED.take() {
        Some((signal, _request)) => Err(signal),
        None => finish(out, before),
    }
}

/// Whether a signal ends the work of this thread; the interpreter is queried once per interval.
fn look_for_signals() -> bool {
    let now = Instant::now();
    if LOOKED.get().is_some_and(|last| now - last < PATIENCE) {
        return false;
    }
    LOOKED.set(Some(now));
    // Runs the handlers of Python where this is its main thread, and does nothing elsewhere.
    #[expect(
        clippy::redundant_closure_for_method_calls,
        reason = "the method is of one lifetime"
    )]
    let Err(signal) = Python::attach(|py| py.check_signals()) else {
        return false;
    };
    STOPPED.set(Some((signal, interrupt::request())));
    true
}

type Guarded<T> = Result<KernelResult<T>, Failure>;

enum Failure {
    Threads(String),
    Panic,
}

/// Threads on which a kernel runs where rayon has only one.
#[derive(Clone, Copy, PartialEq)]
enum Threads {
    /// Those of all callers, or the caller's own: a short kernel ends before another thread would begin.
    Shared,
    /// One that no other caller uses.
    Own,
}

fn guarded<T: Send>(kernel: impl FnOnce() -> KernelResult<T> + Send, on: Threads) -> Guarded<T> {
    // The kernel owns its data, so that nothing half-changed outlives a panic.
    match catch_unwind(AssertUnwindSafe(|| with_threads(kernel, on))) {
        Ok(out) => out.map_err(Failure::Threads),
        Err(payload) => {
            forget(payload);
            Err(Failure::Panic)
        }
    }
}

fn forget(payload: Box<dyn Any + Send>) {
    // Dropping the payload may panic again.
    std::mem::forget(payload);
}

pyo3::create_exception!(
    trihedron._core,
    InputError,
    PyValueError,
    "An error about the input: a log, a value or a request that allows no result.

The message names the cause and the remedy; it is never a defect of the program.

Examples
--------
>>> issubclass(trihedron.InputError, ValueError)
True"
);

fn finish<T>(out: Guarded<T>, requests_before: usize) -> PyResult<T> {
    if interrupt::requests() != requests_before {
        return Err(PyKeyboardInterrupt::new_err(
            "another thread was interrupted",
        ));
    }
    match out {
        Ok(answer) => answer.map_err(|error| InputError::new_err(error.to_string())),
        Err(Failure::Threads(why)) => Err(no_threads(&why)),
        Err(Failure::Panic) => Err(PyRuntimeError::new_err(format!(
            "the numerical core failed on this input ({}); this is a defect of trihedron, please report it",
            PANIC.lock().unwrap_or_else(PoisonError::into_inner)
        ))),
    }
}

fn no_threads(why: &impl ToString) -> PyErr {
    PyValueError::new_err(format!(
        "the system gives this process no threads to compute with ({}); raise its limits of processes or memory",
        why.to_string()
    ))
}

/// The process in which rayon's own threads live; 0 before the first kernel.
static HOME: AtomicU32 = AtomicU32::new(0);
/// No process: the system refused rayon's own threads, and every kernel requests a pool of its own.
const NOWHERE: u32 = u32::MAX;
/// The threads of a forked child, made when its first kernel runs.
static CHILD: AtomicPtr<Child> = AtomicPtr::new(std::ptr::null_mut());

struct Child {
    process: u32,
    pool: ThreadPool,
}

/// Runs on threads of this process: a fork does not inherit those of its parent.
fn with_threads<T: Send>(kernel: impl FnOnce() -> T + Send, on: Threads) -> Result<T, String> {
    let here = std::process::id();
    match HOME.load(Ordering::Acquire) {
        home if home == here && on == Threads::Own && rayon::current_num_threads() == 1 => {
            on_one_thread(kernel)
        }
        home if home == here => {
            is_alone();
            Ok(kernel())
        }
        0 => {
            // Created here, where a system without threads can be reported; rayon would panic at its first use.
            let made = ThreadPoolBuilder::new().build_global();
            let failed = made.is_err_and(|error| std::error::Error::source(&error).is_some());
            // A failure without an error of the system as its source means that another thread was first.
            HOME.store(if failed { NOWHERE } else { here }, Ordering::Release);
            if failed {
                return Ok(pool_of_child(here)?.install(kernel));
            }
            Ok(kernel())
        }
        _ => Ok(pool_of_child(here)?.install(kernel)),
    }
}

/// Most callers' threads that may work for themselves: rayon's data of each (some kilobytes) remain when it ends.
const SETTLED: u32 = 256;
static FREE_TO_SETTLE: AtomicU32 = AtomicU32::new(SETTLED);
thread_local! {
    static HERE: OnceCell<Option<ThreadPool>> = const { OnceCell::new() };
}

/// Where rayon has one thread only: makes the caller's own thread rayon's for this caller, and returns whether it did.
/// No work is handed over, which cost two concurrent callers a third of their time, and neither waits for the other.
fn is_alone() -> bool {
    if HOME.load(Ordering::Acquire) != std::process::id() || rayon::current_num_threads() > 1 {
        return false;
    }
    HERE.with(|pool| {
        let here = pool.get_or_init(|| {
            let taken = FREE_TO_SETTLE.fetch_update(Ordering::Relaxed, Ordering::Relaxed, |free| {
                free.checked_sub(1)
            });
            taken.ok()?;
            let here = ThreadPoolBuilder::new().num_threads(1).use_current_thread();
            here.build().ok()
        });
        here.is_some()
    })
}

/// Idle pools of one thread each.
static IDLE: Mutex<Vec<ThreadPool>> = Mutex::new(Vec::new());

/// Runs on a thread that no other caller uses: of two callers sharing the only one, the second would wait for the
/// first. A forked child never calls this, so the lock may be held when a process is forked.
fn on_one_thread<T: Send>(kernel: impl FnOnce() -> T + Send) -> Result<T, String> {
    let idle = IDLE.lock().unwrap_or_else(PoisonError::into_inner).pop();
    let pool = match idle {
        Some(pool) => pool,
        None => ThreadPoolBuilder::new()
            .num_threads(1)
            .build()
            .map_err(|error| error.to_string())?,
    };
    let out = pool.install(kernel);
    IDLE.lock()
        .unwrap_or_else(PoisonError::into_inner)
        .push(pool);
    Ok(out)
}

fn pool_of_child(here: u32) -> Result<&'static ThreadPool, String> {
    // Without a lock: one held when the process was forked would stay held for ever.
    let known = CHILD.load(Ordering::Acquire);
    // SAFETY: the stored pointer was leaked below and lives as long as the process.
    if let Some(child) = unsafe { known.as_ref() }
        && child.process == here
    {
        return Ok(&child.pool);
    }
    let pool = ThreadPoolBuilder::new()
        .build()
        .map_err(|error| error.to_string())?;
    let made = Box::into_raw(Box::new(Child {
        process: here,
        pool,
    }));
    let kept = match CHILD.compare_exchange(known, made, Ordering::AcqRel, Ordering::Acquire) {
        Ok(_) => made,
        // Another thread of the child was first; its pool serves both.
        Err(theirs) => theirs,
    };
    // SAFETY: as above.
    Ok(unsafe { &(*kept).pool })
}

/// Keeps panics off the screen: they are reported as an exception, with their location.
pub(super) fn keep_panics_quiet() {
    std::panic::set_hook(Box::new(|info| {
        if let (Some(place), Ok(mut last)) = (info.location(), PANIC.try_lock()) {
            *last = format!("{}:{}", place.file(), place.line());
        }
    }));
}
