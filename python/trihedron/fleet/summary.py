"""Summary of a fleet from the rows of all logs: spreads, outliers, shared effects, changes of single devices."""

from __future__ import annotations

import io
from collections import Counter
from collections.abc import Sequence
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Any

import numpy as np

from trihedron.arrays import TINY, FloatArray, sigmas_of
from trihedron.defaults import FALSE_ALARM
from trihedron.estimate.sessions.changes import changes_among, of_another_unit
from trihedron.estimate.sessions.spread import repeated_parameters
from trihedron.files.output import write_whole
from trihedron.probability import betaincinv, fdtrc
from trihedron.records.fleet import EffectCount, FleetLog, FleetSummary, MixedLogs, Outlier
from trihedron.records.sessions import PARAMETERS, Change, Session
from trihedron.sanitise import escaped

if TYPE_CHECKING:
    import polars

MOST_NAMED = 4
"""Most logs that are named among those that were not compared."""
FEWEST = 4
"""Fewest devices for outliers: with three, the spread of the others would be from two."""


@dataclass(frozen=True, eq=False, repr=False)
class FleetResult:
    """The result of every log (``rows``, plain types), the summary, and the folder with table and page."""

    folder: Path
    rows: tuple[dict[str, Any], ...]
    summary: FleetSummary

    @property
    def n_done(self) -> int:
        """Logs that were calibrated."""
        return sum(row["status"] == "done" for row in self.rows)

    def to_dataframe(self) -> Any:
        """One row per log (polars)."""
        return frame_of(self.rows)

    def __repr__(self) -> str:
        return f"<FleetResult of {len(self.rows)} logs, {self.n_done} calibrated: {self.folder}>"

    def __str__(self) -> str:
        from trihedron.report.fleet import fleet_report
        from trihedron.report.text import to_text

        return to_text(fleet_report(self.summary))


def summarise(rows: Sequence[dict[str, Any]], folder: Path, n_before: int = 0) -> FleetResult:
    """The rows of one run as a result."""
    logs = tuple(_log(row) for row in rows)
    comparable, passed_over = _comparable(rows)
    sessions = [_session(row) for row in comparable]
    by_device: dict[str, list[Session]] = {}
    for session in sessions:
        by_device.setdefault(session.group, []).append(session)
    changes = changes_among(list(by_device.values()), alpha=FALSE_ALARM)
    mixed = _not_one_unit(by_device, changes)
    if mixed:
        for one in mixed:
            del by_device[one.serial]
        sessions = [session for group in by_device.values() for session in group]
        changes = tuple(change for change in changes if change.group in by_device)
        more = f"{sum(one.n_logs for one in mixed)} of which it is not known which device they are of"
        passed_over = f"{passed_over} and {more}" if passed_over else more
    repeated = repeated_parameters(sessions) if len(sessions) > 1 else ()
    outliers, farthest = _outliers(by_device)
    diagnosed = [row for row in rows if row.get("diagnosis")]
    summary = FleetSummary(
        logs,
        n_before,
        len(diagnosed),
        len({row["serial"] for row in diagnosed}),
        repeated,
        changes,
        outliers,
        _shared(diagnosed),
        passed_over,
        mixed,
        farthest,
        len(sessions),
        len(by_device),
    )
    return FleetResult(folder, tuple(rows), summary)


def _log(row: dict[str, Any]) -> FleetLog:
    diagnosis, covariance = row.get("diagnosis") or {}, row.get("covariance")
    return FleetLog(
        name=row["name"],
        serial=row["serial"],
        status=row["status"],
        reason=row.get("reason", ""),
        verdict=diagnosis.get("verdict", ""),
        effects=tuple(effect["id"] for effect in diagnosis.get("effects", ())),
        serious=tuple(row.get("serious", ())),
        is_trustworthy=bool(row.get("is_trustworthy", False)),
        n_poses=row.get("n_poses"),
        held_out_rms_m_s2=row.get("held_out_rms_m_s2"),
        numbers=None if covariance is None else np.array(row["parameters"], dtype=np.float64),
        std=None if covariance is None else sigmas_of(np.array(covariance, dtype=np.float64)),
        reread=row.get("reread", ""),
        warned=tuple(row.get("warnings", ())),
    )


def _comparable(rows: Sequence[dict[str, Any]]) -> tuple[list[dict[str, Any]], str]:
    """Trustworthy calibrations with the commonest units and sensors, in order of time; and why others are excluded."""
    sound = [row for row in rows if row["status"] == "done" and row.get("is_trustworthy")]
    kinds = [(row["accelerometer_unit"], row["gyroscope_unit"], len(row["parameters"])) for row in sound]
    if not kinds:
        return [], ""
    chosen = Counter(kinds).most_common(1)[0][0]
    taken = [row for row, kind in zip(sound, kinds, strict=True) if kind == chosen]
    doubtful = [row for row in rows if row["status"] == "done" and not row.get("is_trustworthy")]
    unlike = [row for row in sound if row not in taken]
    words = []
    if doubtful:
        words.append(f"{len(doubtful)} whose own calibration is not to be trusted ({_names(doubtful)})")
    if unlike:
        words.append(f"{len(unlike)} in other units or without the same sensors ({_names(unlike)})")
    order = sorted(range(len(taken)), key=lambda k: (taken[k].get("start_epoch_s") or 0.0, k))
    return [taken[k] for k in order], " and ".join(words)


def _names(rows: Sequence[dict[str, Any]]) -> str:
    """``unit3: log1.csv, unit4: log0.csv, ...``."""
    more = ", ..." if len(rows) > MOST_NAMED else ""
    return ", ".join(f"{row['serial']}: {row['name']}" for row in rows[:MOST_NAMED]) + more


def _session(row: dict[str, Any]) -> Session:
    numbers = np.array(row["parameters"], dtype=np.float64)
    return Session(
        row["name"],
        row["serial"],
        numbers,
        np.array(row["covariance"], dtype=np.float64),
        np.array(row["bias_drift_variance"], dtype=np.float64),
        row.get("start_epoch_s") or 0.0,
    )


def _outliers(by_device: dict[str, list[Session]]) -> tuple[tuple[Outlier, ...], Outlier | None]:
    """Outlying devices, and the farthest of the others (None with too few): moderated deleted residual of each mean,
    Bonferroni-corrected over devices and parameters.

    One at a time, the farthest first, each excluded before the next test, so that two outliers do not mask each other.
    """
    if len(by_device) < FEWEST:
        return (), None
    names = list(by_device)
    means = np.array([np.mean([s.numbers for s in by_device[name]], axis=0) for name in names])
    own = np.array([np.mean([np.diag(s.covariance) for s in group], axis=0) for group in by_device.values()])
    prior, prior_dof = _spread_of_axes(means)
    n_tests = means.size
    found: list[Outlier] = []
    within: list[Outlier] = []
    for k in range(means.shape[1]):
        kept = list(range(len(names)))
        while len(kept) >= FEWEST:
            column = means[kept, k]
            worst = int(np.argmax(np.abs(column - np.median(column))))
            others = np.delete(column, worst)
            dof = len(others) - 1
            variance = (prior_dof * prior[k] + dof * float(others.var(ddof=1))) / (prior_dof + dof)
            # Allow for a device that was measured less accurately than the others.
            worse = max(own[kept[worst], k] - float(np.delete(own[kept, k], worst).mean()), 0.0)
            spread = float(np.sqrt(variance * (1.0 + 1.0 / len(others)) + worse))
            sigmas = float(column[worst] - others.mean()) / max(spread, TINY)
            p = min(1.0, fdtrc(1, prior_dof + dof, sigmas**2) * n_tests)
            away = float(column[worst] - np.median(others))
            one = Outlier(names[kept[worst]], PARAMETERS[k], away, sigmas, p)
            if p >= FALSE_ALARM:
                within.append(one)
                break
            found.append(one)
            kept.pop(worst)
    farthest = max(within, key=lambda one: abs(one.sigmas), default=None)
    return tuple(sorted(found, key=lambda one: one.p_adjusted)), farthest


def _spread_of_axes(means: FloatArray) -> tuple[FloatArray, float]:
    """Prior of each parameter's variance (k,) from the other axes of its triad, and its degrees of freedom.

    Few devices determine the spread of one axis poorly; the axes of one triad have similar spreads. How similar is
    estimated from the differences of their variances over all kinds of parameters (after Smyth 2004, moderated t).
    """
    n, k = means.shape
    log = (np.log(np.maximum(means.var(axis=0, ddof=1), TINY)) + _log_bias(n - 1)).reshape(-1, 3)
    # The median is robust against an outlying device; for χ² with two degrees of freedom it is ln 2 times the mean.
    of_axes = float(np.median(log.var(axis=1, ddof=1))) / np.log(2.0)
    apart = max(of_axes - _log_variance(n - 1), 0.0)
    # Variance of the mean of two other axes: half of their sampling variance, 1.5 times the variance between axes.
    variance = 0.5 * _log_variance(n - 1) + 1.5 * apart
    dof = (1.0 + np.sqrt(1.0 + 2.0 * variance)) / variance
    others = (log.sum(axis=1, keepdims=True) - log) / 2.0
    return np.exp(others.reshape(k) - _log_bias(dof)), float(dof)


def _log_variance(dof: float) -> float:
    """Variance of the logarithm of a variance estimate: trigamma(d/2)."""
    return 2.0 / dof + 2.0 / dof**2 + 4.0 / (3.0 * dof**3)


def _log_bias(dof: float) -> float:
    """Bias of the logarithm of a variance estimate (too small by): log(d/2) less digamma(d/2)."""
    return 1.0 / dof + 1.0 / (3.0 * dof**2)


def _not_one_unit(by_device: dict[str, list[Session]], changes: Sequence[Change]) -> tuple[MixedLogs, ...]:
    """Groups of logs that are not of one device, with the most significant difference."""
    mixed = []
    for serial, sessions in by_device.items():
        found = of_another_unit(sessions, [change for change in changes if change.group == serial])
        apart = {change.where if change.kind == "apart" else "" for change in found}
        for change in found[:1]:
            k = int(np.argmax(np.abs(change.size)))
            parameter = next(one for one in PARAMETERS if (one.id, one.name) == (change.id, change.names[k]))
            odd = apart.pop() if len(apart) == 1 and len(sessions) > 2 else ""
            mixed.append(MixedLogs(serial, len(sessions), parameter, abs(change.size[k]), odd))
    return tuple(mixed)


def _shared(diagnosed: Sequence[dict[str, Any]]) -> tuple[EffectCount, ...]:
    """Every effect found, the commonest first; Clopper-Pearson interval of the fraction of devices."""
    logs: Counter[str] = Counter()
    devices: dict[str, set[str]] = {}
    for row in diagnosed:
        for name in {effect["id"] for effect in row["diagnosis"]["effects"]}:
            logs[name] += 1
            devices.setdefault(name, set()).add(row["serial"])
    n = len({row["serial"] for row in diagnosed})
    out = []
    for name, count in logs.most_common():
        k = len(devices[name])
        low = betaincinv(k, n - k + 1, 0.025) if k else 0.0
        high = betaincinv(k + 1, n - k, 0.975) if k < n else 1.0
        out.append(EffectCount(name, count, k, low, high))
    return tuple(out)


# The fleet as a table: one row per log.

PLAIN = (
    *("path", "serial", "status", "reason", "verdict", "effects", "warnings", "serious", "is_trustworthy"),
    *("n_samples", "duration_s", "rate_hz", "n_poses", "start_epoch_s", "temperature_degc", "gravity_m_s2"),
    *("accelerometer_unit", "gyroscope_unit", "static_rms_m_s2", "held_out_rms_m_s2", "seconds"),
    *("sha256", "version", "key"),
)


def write_tables(rows: Sequence[dict[str, Any]], summary: FleetSummary, folder: Path) -> None:
    """Write ``fleet.parquet``, ``fleet.csv`` and ``fleet.html`` to the folder; those of an earlier run are replaced."""
    from trihedron.report.fleet import fleet_report
    from trihedron.report.page import to_html

    frame = frame_of(rows)
    buffer = io.BytesIO()
    frame.write_parquet(buffer)
    write_whole(folder / "fleet.parquet", buffer.getvalue(), overwrite=True)
    write_whole(folder / "fleet.csv", frame.write_csv(), overwrite=True)
    write_whole(folder / "fleet.html", to_html(fleet_report(summary)), overwrite=True)


def frame_of(rows: Sequence[dict[str, Any]]) -> polars.DataFrame:
    """One row per log: its name, its result, and the 21 parameters with their standard errors (units in the names).

    Control characters in names are escaped, since a table is shown on terminals.
    """
    import polars

    text = {"path", "serial", "status", "reason", "verdict", "effects", "warnings", "serious"}
    text |= {"accelerometer_unit", "gyroscope_unit", "sha256", "version", "key"}
    columns: dict[str, list[Any]] = {name: [_cell(row, name) for row in rows] for name in PLAIN}
    numbers = [row.get("parameters") or () for row in rows]
    std = [sigmas_of(np.array(row.get("covariance") or np.zeros((0, 0)))) for row in rows]
    for k, parameter in enumerate(PARAMETERS):
        name = f"{parameter.id}_{parameter.name}".replace("-", "_")
        unit = {"m/s^2": "_m_s2", "rad/s": "_rad_s", "rad": "_rad", "1": "_ln_raw_per_si"}[parameter.unit]
        columns[name + unit] = [one[k] if k < len(one) else None for one in numbers]
        columns[f"{name}_std"] = [float(one[k]) if k < len(one) else None for one in std]
    kinds: dict[str, Any] = {name: polars.String if name in text else polars.Float64 for name in columns}
    kinds |= {"is_trustworthy": polars.Boolean, "n_samples": polars.Int64, "n_poses": polars.Int64}
    return polars.DataFrame(columns, schema=kinds, strict=False)


def _cell(row: dict[str, Any], name: str) -> Any:
    diagnosis = row.get("diagnosis") or {}
    if name == "verdict":
        return diagnosis.get("verdict", "")
    if name == "effects":
        return " ".join(effect["id"] for effect in diagnosis.get("effects", ()))
    if name in ("warnings", "serious"):
        return " ".join(row.get(name) or ())
    value = row.get(name)
    return escaped(value) if isinstance(value, str) else value
