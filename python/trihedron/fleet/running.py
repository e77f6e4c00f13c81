"""Runs logs on workers and stores each result as it arrives, so that an interrupted run continues."""

from __future__ import annotations

import json
import os
import re
from collections.abc import Iterator, Mapping, Sequence
from contextlib import contextmanager
from importlib import import_module
from pathlib import Path
from typing import Any, Literal

from trihedron.errors import InputError
from trihedron.files.calibration import plain
from trihedron.files.output import write_whole
from trihedron.fleet.logs import Job, find_jobs
from trihedron.fleet.summary import FleetResult, summarise, write_tables
from trihedron.fleet.work import Row, work
from trihedron.records import Progress

RESULTS = "results"
DEATHS = 3
"""Number of workers killed by one log after which it is given up: one may be chance, three are the log."""
By = Literal["session", "date"]


def fleet(
    logs: str | os.PathLike[str] | Sequence[str | os.PathLike[str]],
    out: str | os.PathLike[str],
    *,
    scheduler: str | None = None,
    workers: int | None = None,
    diagnose: bool = True,
    serial: str | None = None,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
    columns: str | None = None,
    rate_hz: float | None = None,
    accelerometer_unit: str | None = None,
    gyroscope_unit: str | None = None,
    progress: Progress | None = None,
) -> FleetResult:
    """Calibrate and diagnose every log; write tables, a page and each calibration into ``out``.

    Parameters
    ----------
    logs : folder, pattern, file, or a list of them
        An archive of several devices is one log per device.
    out : folder
        Where results go. Logs with a result there (same bytes, options and version) are not processed again.
    scheduler : str, optional
        Address of a Dask scheduler, ``tcp://host:8786``: its workers must see the same paths and have trihedron.
    workers : int, optional
        Processes of the local cluster, by default one per processor; 0 works in this process, without Dask.
    diagnose : bool
        Without it logs are calibrated only, which is several times faster.
    serial : str, optional
        Regular expression whose group names the device in a log's path; else archives number them, else folders do.
    gravity_m_s2 or latitude_deg, height_m, columns, rate_hz, accelerometer_unit, gyroscope_unit
        As for :func:`trihedron.calibrate` and :func:`trihedron.read`; the same for all logs.
    progress : callable
        Called with the share done (0 to 1) and what is being done.

    Returns
    -------
    FleetResult
        One row per log (``rows``, ``to_dataframe``) and the ``summary`` over devices.

    Raises
    ------
    ValueError
        When there is no log, Dask is needed and not installed, or its scheduler does not answer.

    Examples
    --------
    >>> trihedron.fleet("logs", "results", latitude_deg=50.1).summary  # doctest: +SKIP

    Notes
    -----
    A script that calls this with a local cluster needs ``if __name__ == "__main__":`` around it, as every use of
    processes in Python does.
    """
    folder = Path(out)
    options = {
        "gravity_m_s2": gravity_m_s2,
        "latitude_deg": latitude_deg,
        "height_m": height_m,
        "columns": columns,
        "rate_hz": rate_hz,
        "accelerometer_unit": accelerometer_unit,
        "gyroscope_unit": gyroscope_unit,
        "diagnose": diagnose,
    }
    notify = progress or (lambda _fraction, _text: None)
    notify(0.0, "looking at logs")
    jobs = find_jobs(logs, options, serial=serial, apart_from=folder)
    if folder.exists() and not folder.is_dir():
        raise InputError(f"{folder}: this is a file; name a folder for the results.")
    (folder / RESULTS).mkdir(parents=True, exist_ok=True)
    rows = {job.key: kept for job in jobs if (kept := _kept(folder, job)) is not None}
    todo = list({job.key: job for job in jobs if job.key not in rows}.values())
    n_before = len(rows)
    for done, (job, row) in enumerate(_results(todo, options, scheduler, workers), 1):
        # One file per result, written atomically: a killed run leaves no partial result.
        write_whole(folder / RESULTS / f"{job.key}.json", json.dumps(plain(row), allow_nan=False), overwrite=True)
        rows[job.key] = _of_table(row)
        notify(done / len(todo), f"{n_before + done} of {n_before + len(todo)} logs")
    made = [{"path": job.path, "name": job.name, "serial": job.serial, "key": job.key} | rows[job.key] for job in jobs]
    notify(1.0, "writing the table and the page")
    result = summarise(made, folder, n_before)
    write_tables(result.rows, result.summary, folder)
    write_calibrations(jobs, folder / RESULTS, folder)
    return result


def _of_table(row: Row) -> Row:
    """A result without its calibration, to save memory with thousands of logs."""
    return {name: value for name, value in row.items() if name != "calibration"}


def _kept(folder: Path, job: Job) -> Row | None:
    """The result of an earlier run; None for one that crashed, which is tried again."""
    path = folder / RESULTS / f"{job.key}.json"
    try:
        row: Row = json.loads(path.read_text(encoding="utf-8"))
    except (OSError, ValueError):
        return None
    return None if row.get("status") == "crashed" else _of_table(row)


def _results(
    jobs: Sequence[Job], options: Mapping[str, Any], scheduler: str | None, workers: int | None
) -> Iterator[tuple[Job, Row]]:
    if not jobs:
        return
    if workers == 0 and scheduler is None:
        for job in jobs:
            yield job, work(job.path, job.device, options)
        return
    with _client(scheduler, workers) as client:
        futures = {}
        for job in jobs:
            path = str(Path(job.path).resolve())
            future = client.submit(work, path, job.device, dict(options), key=f"trihedron-{job.key}", pure=False)
            futures[future] = job
        for future in import_module("distributed").as_completed(futures, loop=client.loop):
            job = futures[future]
            error = future.exception() if future.status == "error" else None
            if error is None and future.status == "finished":
                row = future.result()
            else:
                row = {"status": "crashed", "reason": _why(error), "seconds": None}
            future.release()
            yield job, row


def _why(error: BaseException | None) -> str:
    if type(error).__name__ == "KilledWorker":
        return f"it ended {DEATHS} workers, one after the other: most likely there was not enough memory for this log"
    return f"the cluster gave it up ({type(error).__name__}: {error})"


@contextmanager
def _client(scheduler: str | None, workers: int | None) -> Iterator[Any]:
    """A Dask client of the given scheduler, or of a cluster of processes on this machine.

    Raises ``InputError`` when Dask is not installed, or the scheduler does not answer.
    """
    try:
        dask, distributed = import_module("dask"), import_module("distributed")
    except ModuleNotFoundError:
        raise InputError(
            "several workers need Dask, which is not installed: pip install 'trihedron[fleet]', or say --workers 0 to "
            "do one log after the other in this process."
        ) from None
    # One log is one task on one thread: further threads of the linear algebra would compete for processors.
    settings = {
        "distributed.scheduler.allowed-failures": DEATHS - 1,
        "distributed.admin.tick.limit": "60s",
        # Dask's profiler samples every process a hundred times a second, which costs too much on two processors.
        "distributed.worker.profile.enabled": False,
        "distributed.admin.system-monitor.interval": "5s",
        "distributed.admin.system-monitor.gil.enabled": False,
        "distributed.admin.tick.interval": "500ms",
        "distributed.scheduler.active-memory-manager.start": False,
        "distributed.worker.memory.monitor-interval": "500ms",
    }
    with dask.config.set(settings):
        if scheduler is not None:
            if re.search(r"(^\w+://.|:\d+$)", scheduler) is None:
                raise InputError(f"{scheduler}: this is no address of a Dask scheduler; say tcp://HOST:8786.")
            try:
                client = distributed.Client(scheduler, timeout="15s", set_as_default=False)
            except (OSError, TimeoutError, ValueError) as error:
                raise InputError(f"{scheduler}: no Dask scheduler answers there ({error}).") from None
            with client:
                yield client
            return
        environment = dict.fromkeys(("OPENBLAS_NUM_THREADS", "OMP_NUM_THREADS", "RAYON_NUM_THREADS"), "1")
        cluster = distributed.LocalCluster(
            n_workers=workers or os.cpu_count() or 1,
            threads_per_worker=1,
            processes=True,
            dashboard_address=None,
            silence_logs=50,
            env=environment,
        )
        with cluster, distributed.Client(cluster, set_as_default=False) as client:
            yield client


# The calibration of every log of a fleet as its own file, for `export`, `verify` and `apply`.

CALIBRATIONS = "calibrations"


def write_calibrations(jobs: Sequence[Job], results: Path, folder: Path) -> None:
    """Write ``DEVICE_LOG_KEY.json`` for every log with a calibration in ``results``; existing files are kept."""
    target = folder / CALIBRATIONS
    for job in jobs:
        path = target / f"{_plain(job.serial)}_{_plain(Path(job.path).stem)}_{job.key[:6]}.json"
        if path.exists():
            continue
        document = json.loads((results / f"{job.key}.json").read_text(encoding="utf-8")).get("calibration")
        if document is not None:
            target.mkdir(exist_ok=True)
            write_whole(path, json.dumps(document, indent=2, allow_nan=False) + "\n", overwrite=True)


def _plain(name: str) -> str:
    """A name in characters that every file system accepts."""
    return re.sub(r"[^\w.-]+", "-", name) or "log"
