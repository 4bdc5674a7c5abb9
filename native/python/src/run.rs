//! Runs work on threads of its own without the GIL, and lets Python watch and cancel it.

use std::sync::mpsc::{RecvTimeoutError, channel};
use std::sync::{Arc, Mutex, PoisonError};
use std::thread::Builder;
use std::time::Duration;

use meniscus_core::error::{Error, Result};
use meniscus_core::job::{Job, guarded};
use pyo3::exceptions::{PyMemoryError, PyRuntimeError, PyValueError};
use pyo3::prelude::*;
use rayon::{ThreadPool, ThreadPoolBuilder};

/// How often Python is asked whether the user gave up; Blender's interface feels immediate below 50 ms.
const WATCH_INTERVAL: Duration = Duration::from_millis(20);

/// More threads than any processor has cores are a mistake.
const MAX_THREADS: usize = 1024;

/// Runs `work` on `threads` threads (0: one for each core) without the GIL.
///
/// `watch` is called at once and then every now and then with the share of the work that is done, 0 to 1, on the calling
/// thread; what it raises cancels the work and is raised here.
pub fn run<T: Send>(
    python: Python<'_>,
    threads: usize,
    watch: Option<&Bound<'_, PyAny>>,
    work: impl FnOnce(&Job) -> Result<T> + Send,
) -> PyResult<T> {
    let pool = pool(threads).map_err(python_error)?;
    if let Some(watch) = watch {
        watch.call1((0.0,))?;
    }
    let job = Job::default();
    let work = || guarded(|| pool.install(|| work(&job)));
    let (outcome, raised) = match watch {
        None => (python.detach(work), None),
        Some(watch) => watched(python, watch, &job, work),
    };
    match raised {
        Some(raised) => Err(raised),
        None => outcome.map_err(python_error),
    }
}

/// The Python exception of an error.
pub fn python_error(error: Error) -> PyErr {
    let sentence = error.to_string();
    match error {
        Error::InvalidInput(_) => PyValueError::new_err(sentence),
        Error::OutOfMemory(_) => PyMemoryError::new_err(sentence),
        Error::Cancelled | Error::Defect(_) => PyRuntimeError::new_err(sentence),
    }
}

/// Does `work` on a thread of its own, so that this one can hold the GIL now and then.
fn watched<T: Send>(
    python: Python<'_>,
    watch: &Bound<'_, PyAny>,
    job: &Job,
    work: impl FnOnce() -> Result<T> + Send,
) -> (Result<T>, Option<PyErr>) {
    std::thread::scope(|scope| {
        let (finished, is_finished) = channel();
        let started = Builder::new().spawn_scoped(scope, move || {
            let outcome = work();
            // The receiver lives as long as the scope.
            let _ = finished.send(());
            outcome
        });
        let worker = match started {
            Ok(worker) => worker,
            Err(error) => return (Err(Error::InvalidInput(format!("a thread cannot be started: {error}"))), None),
        };
        let is_finished = Mutex::new(is_finished);
        let mut raised = None;
        while raised.is_none() && python.detach(|| still_runs(&is_finished)) {
            raised = watch.call1((job.progress(),)).err();
        }
        if raised.is_some() {
            job.cancel();
        }
        let outcome = python.detach(|| worker.join());
        (outcome.unwrap_or_else(|panic| std::panic::resume_unwind(panic)), raised)
    })
}

fn still_runs(is_finished: &Mutex<std::sync::mpsc::Receiver<()>>) -> bool {
    let receiver = is_finished.lock().unwrap_or_else(PoisonError::into_inner);
    receiver.recv_timeout(WATCH_INTERVAL) == Err(RecvTimeoutError::Timeout)
}

/// A pool, the process that it belongs to, and the number of threads asked for.
struct KeptPool {
    process: u32,
    threads: usize,
    pool: Arc<ThreadPool>,
}

/// The pool of so many threads. One is kept from call to call; a forked process has none of its parent's threads.
fn pool(threads: usize) -> Result<Arc<ThreadPool>> {
    static KEPT: Mutex<Option<KeptPool>> = Mutex::new(None);
    if threads > MAX_THREADS {
        return Err(Error::InvalidInput(format!("threads must be at most {MAX_THREADS}, not {threads}")));
    }
    let process = std::process::id();
    let mut kept = KEPT.lock().unwrap_or_else(PoisonError::into_inner);
    if let Some(kept) = kept.as_ref().filter(|kept| kept.process == process && kept.threads == threads) {
        return Ok(kept.pool.clone());
    }
    let built = ThreadPoolBuilder::new().num_threads(threads).thread_name(|index| format!("meniscus {index}")).build();
    let pool = Arc::new(built.map_err(|error| Error::InvalidInput(format!("{threads} threads cannot be started: {error}")))?);
    *kept = Some(KeptPool { process, threads, pool: pool.clone() });
    Ok(pool)
}
