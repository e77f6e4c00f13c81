"""From files to one audited recording: the composition of the room."""

from __future__ import annotations

import hashlib
import os
from dataclasses import dataclass, field
from pathlib import Path
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from trihedron.read.archive import read_npy, read_npz
from trihedron.read.audit import audit_counter, audit_readings, audit_timing
from trihedron.read.clock import Clock, build_clock, mean_rate_hz
from trihedron.read.columns import Columns, Sensor, find_columns
from trihedron.read.errors import ReadError, check_readable, from_os_error
from trihedron.read.merge import merge
from trihedron.read.parquet import read_parquet
from trihedron.read.rest import look
from trihedron.read.sensing import judge_accelerometer, judge_gyroscope, order_of_triads
from trihedron.read.table import FloatArray, Progress, Table
from trihedron.read.text import TextReader, compression_of
from trihedron.records import Finding, FindingCode, Recording, Severity
from trihedron.units import AccelerationUnit, RateUnit

ASSUMED_RATE_HZ = 100.0
_RATE_KEYS = frozenset(
    f"{a}{b}"
    for a in ("fs", "rate", "sampling rate", "sample rate", "sampling frequency", "frequency", "update rate")
    for b in ("", " hz", " [hz]", " (hz)")
)
_REFUSED = {
    b"\x89HDF": "an HDF5 (or MATLAB 7.3) file",
    b"MATLAB": "a MATLAB file",
    b"#ROSBA": "a ROS bag",
    b"\x89MCAP": "an MCAP file",
    b"ULog": "a ULog file",
    b"SQLite": "a database (or ROS 2 bag)",
    b"%PDF": "a PDF document",
    b"\x28\xb5\x2f\xfd": "zstd-compressed",
    b"\x89PNG": "a picture",
}


@dataclass(frozen=True, eq=False)
class _Sensors:
    """Both triads on one time base, and where each sample stood in the file."""

    time_s: FloatArray
    start_s: float
    accelerometer: FloatArray | None
    gyroscope: FloatArray | None
    table: Table
    columns: Columns
    rows: npt.NDArray[np.int64] | None
    offset: int
    has_clock: bool
    gyroscope_unit: str = ""
    findings: tuple[Finding, ...] = field(default=())

    def row(self, sample: int) -> int:
        """Row of the base table that holds a sample."""
        at = sample + self.offset
        return int(self.rows[at]) if self.rows is not None else at

    def place(self, sample: int) -> str:
        """A sample's number, file line and time, for people."""
        return f"sample {sample}, {self.table.place(self.row(sample))}, {self.time_s[sample]:.3f} s"


def read_table(path: Path, device: int | None = None, progress: Progress | None = None) -> Table:
    """Any supported file as a table of numbers; the format is told by its first bytes, not by its name.

    Raises
    ------
    ReadError
        When the file cannot be read or is no log.
    """
    size = check_readable(path)
    try:
        with path.open("rb") as stream:
            magic = stream.read(8)
    except OSError as error:
        raise from_os_error(path, error) from None
    if magic.startswith(b"\x93NUMPY"):
        return read_npy(path)
    if magic.startswith(b"PK\x03\x04"):
        return read_npz(path, device)
    if device is not None:
        raise ReadError(f"{path}: a device was asked for but this is not an .npz archive; leave --device out.")
    if magic.startswith(b"PAR1"):
        return read_parquet(path)
    for start, kind in _REFUSED.items():
        if magic.startswith(start):
            raise ReadError(f"{path}: this is {kind}, which is not read here; export the log as CSV or Parquet.")
    return TextReader(path, compression_of(magic), size, progress).read()


def read_recording(
    path: str | os.PathLike[str] | None = None,
    *,
    accelerometer_path: str | os.PathLike[str] | None = None,
    gyroscope_path: str | os.PathLike[str] | None = None,
    columns: str | None = None,
    rate_hz: float | None = None,
    accelerometer_unit: str | AccelerationUnit | None = None,
    gyroscope_unit: str | RateUnit | None = None,
    time_unit: str | None = None,
    device: int | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Read and audit a log: one file, or one file per sensor.

    Parameters
    ----------
    path : file
        Text (CSV, TSV, blanks; gzip, bzip2, xz), ``.npz``, ``.npy`` or Parquet, told by content; or
    accelerometer_path, gyroscope_path : file
        one file per sensor, each with its own clock; they are merged on a common base. One alone is read alone.
    columns : str
        ``"time=t,ax=3,ay=4,az=5"`` (names, or numbers from 1), or roles in file order ``"t,ax,ay,az,-,gx,gy,gz"``;
        ``time=none`` ignores a time column.
    rate_hz : float
        Sampling rate [Hz] of a log without a time column. A time column wins; a rate that contradicts it is a finding.
    accelerometer_unit, gyroscope_unit, time_unit : str
        Units, where what is detected from names and readings is wrong.
    device : int
        Which device (from 1) of an archive ``counts`` (n, devices, 6).
    progress : callable
        Called with (done fraction, text).

    Raises
    ------
    ReadError
        (a ``ValueError``) one sentence naming file, line and remedy.

    Notes
    -----
    See ``docs/reading.md``. Without time column and rate, 100 Hz is assumed and reported: serious with a gyro, whose
    scale is inversely proportional to the rate.
    """
    if rate_hz is not None and not (np.isfinite(rate_hz) and 0 < rate_hz < 1e7):
        raise ReadError(f"the rate must be a positive number of samples per second, got {rate_hz}.")
    options = _Options(columns, rate_hz, time_unit, device, progress)
    if path is not None and (accelerometer_path is not None or gyroscope_path is not None):
        raise ReadError("give either one log or one file per sensor, not both.")
    if path is not None:
        sensors = _read_one(Path(path), None, options)
        source, sha256 = str(path), sensors.table.sha256
    elif accelerometer_path is not None and gyroscope_path is not None:
        accelerometer = _read_one(Path(accelerometer_path), "accelerometer", options)
        gyroscope = _read_one(Path(gyroscope_path), "gyroscope", options)
        sensors = _merge(accelerometer, gyroscope)
        source = f"{accelerometer_path} + {gyroscope_path}"
        sha256 = hashlib.sha256((accelerometer.table.sha256 + gyroscope.table.sha256).encode()).hexdigest()
    elif accelerometer_path is not None or gyroscope_path is not None:
        only: Sensor = "accelerometer" if accelerometer_path is not None else "gyroscope"
        one = Path(accelerometer_path if accelerometer_path is not None else gyroscope_path or "")
        sensors = _read_one(one, only, options)
        source, sha256 = str(one), sensors.table.sha256
    else:
        raise ReadError("no log was named; give a file, or one file per sensor.")
    return _audited(sensors, source, sha256, accelerometer_unit, gyroscope_unit, progress)


@dataclass(frozen=True)
class _Options:
    columns: str | None
    rate_hz: float | None
    time_unit: str | None
    device: int | None
    progress: Progress | None


def _triad(table: Table, triad: tuple[int, int, int] | None, rows: npt.NDArray[np.int64] | None) -> FloatArray | None:
    if triad is None:
        return None
    out = np.empty((table.n_rows if rows is None else len(rows), 3))
    for k, column in enumerate(triad):
        values = table.columns[column]
        if not len(values):
            raise ReadError(
                f"{table.path}: column {table.label(column)} holds words, not numbers; name another column."
            )
        out[:, k] = values if rows is None else values[rows]
    return out


def _read_one(path: Path, sensor: Sensor | None, options: _Options) -> _Sensors:
    table = read_table(path, options.device, options.progress)
    chosen = find_columns(table, options.columns, sensor)
    if table.n_rows < 2:
        raise ReadError(f"{path}: the file holds one row of numbers only ({table.place(0)}); a recording needs many.")
    findings = [*table.findings, *chosen.findings]
    clock, rate = _time_base(table, chosen, options, findings)
    accelerometer = _triad(table, chosen.accelerometer, clock.rows)
    gyroscope = _triad(table, chosen.gyroscope, clock.rows)
    if sensor == "accelerometer":
        gyroscope = None
    elif sensor == "gyroscope":
        accelerometer = None
    if accelerometer is None and gyroscope is None:
        raise ReadError(f"{path}: the {sensor} is not among its columns; the other sensor is: swap the two files.")
    if chosen.positional and accelerometer is not None and gyroscope is not None:
        accelerometer, gyroscope = _settle_order(accelerometer, gyroscope, rate, findings)
    for name, triad, where in (
        ("accelerometer", accelerometer, chosen.accelerometer),
        ("gyroscope", gyroscope, chosen.gyroscope),
    ):
        if triad is not None and where is not None:
            _refuse_constant(table, name, triad, where)
    return _Sensors(
        clock.time_s,
        clock.start_s,
        accelerometer,
        gyroscope,
        table,
        chosen,
        clock.rows,
        0,
        chosen.time is not None,
        chosen.gyroscope_unit,
        tuple(findings),
    )


def _refuse_constant(table: Table, name: str, triad: FloatArray, where: tuple[int, int, int]) -> None:
    for k, column in enumerate(where):
        finite = triad[np.isfinite(triad[:, k]), k]
        if len(finite) == 0:
            raise ReadError(f"{table.path}: column {table.label(column)} of the {name} holds no finite number.")
        if finite[0] == finite[-1] and np.all(finite == finite[0]):
            raise ReadError(
                f"{table.path}: column {table.label(column)} of the {name} is {finite[0]:.6g} in all {len(finite)} "
                f"rows from {table.place(0)} on: a dead channel, or the wrong column; name the columns with --columns."
            )


def _settle_order(
    first: FloatArray, second: FloatArray, rate_hz: float, findings: list[Finding]
) -> tuple[FloatArray, FloatArray]:
    """(accelerometer, gyro) of two unnamed triads."""
    is_first, why = order_of_triads(first, second, rate_hz)
    if is_first is None:
        seen = f"Six columns without names were taken as ax ay az gx gy gz, but {why}."
        severity = Severity.SERIOUS
    elif is_first:
        seen = f"Six columns without names: the first three are the accelerometer, because {why}."
        severity = Severity.NOTE
    else:
        seen = (
            f"Six columns without names: the first three are the gyro, the last three the accelerometer, because {why}."
        )
        severity = Severity.WARNING
    findings.append(
        Finding(
            FindingCode.COLUMNS_ASSUMED,
            severity,
            seen,
            "A log without a header.",
            "Name them with --columns, for example --columns ax,ay,az,gx,gy,gz.",
        )
    )
    return (second, first) if is_first is False else (first, second)


def _stated_rate(table: Table) -> float | None:
    for key, text in table.metadata.items():
        if key.strip().lower().replace("_", " ") in _RATE_KEYS:
            try:
                rate = float(text.split()[0].lower().removesuffix("hz"))
            except (ValueError, IndexError):
                continue
            if 0 < rate < 1e7:
                return rate
    return None


def _time_base(table: Table, chosen: Columns, options: _Options, findings: list[Finding]) -> tuple[Clock, float]:
    if chosen.time is not None:
        clock = build_clock(table, chosen.time, chosen.time_unit, options.time_unit)
        findings += clock.findings
        rate = mean_rate_hz(clock.time_s)
        told = options.rate_hz if options.rate_hz is not None else _stated_rate(table)
        if told is not None and abs(rate / told - 1.0) > 0.01:
            findings.append(
                Finding(
                    FindingCode.RATE_CONTRADICTED,
                    Severity.WARNING,
                    f"The rate was given as {told:.6g} Hz but the time column runs at {rate:.6g} Hz; "
                    "the column was used.",
                    "A nominal rate, or a clock that is wrong.",
                    "To use the given rate, read with --columns time=none.",
                    MappingProxyType({"given_hz": told, "clock_hz": rate}),
                )
            )
        return clock, rate
    stated = _stated_rate(table)
    if options.rate_hz is not None:
        rate = float(options.rate_hz)
        findings.append(_rate_stated(rate, "as you said"))
    elif stated is not None:
        rate = stated
        findings.append(_rate_stated(rate, "as the file states above its numbers or beside them"))
    else:
        rate = ASSUMED_RATE_HZ
        severe = chosen.gyroscope is not None
        findings.append(
            Finding(
                FindingCode.RATE_ASSUMED,
                Severity.SERIOUS if severe else Severity.WARNING,
                f"The log has no time column and no rate; {rate:g} Hz was assumed.",
                "Only readings were logged.",
                "Give --rate HZ."
                + (" Gyro scale is inversely proportional to it: 1 % of rate is 1 % of scale." if severe else ""),
                MappingProxyType({"rate_hz": rate}),
            )
        )
    return Clock(np.arange(table.n_rows) / rate, 0.0, None, ()), rate


def _rate_stated(rate: float, source: str) -> Finding:
    return Finding(
        FindingCode.RATE_STATED,
        Severity.NOTE,
        f"No time column; the rate is {rate:.6g} Hz {source}.",
        numbers=MappingProxyType({"rate_hz": rate}),
    )


def _merge(accelerometer: _Sensors, gyroscope: _Sensors) -> _Sensors:
    assert accelerometer.accelerometer is not None
    assert gyroscope.gyroscope is not None
    if accelerometer.has_clock != gyroscope.has_clock:
        blind = gyroscope if accelerometer.has_clock else accelerometer
        raise ReadError(f"{blind.table.path}: this file has no time column and the other one has; log both alike.")
    if not accelerometer.has_clock and len(accelerometer.time_s) != len(gyroscope.time_s):
        raise ReadError(
            f"{accelerometer.table.path}: {len(accelerometer.time_s)} rows here and {len(gyroscope.time_s)} in "
            f"{gyroscope.table.path.name}, and no time column to match them by; log both with time stamps."
        )
    merged = merge(
        accelerometer.accelerometer,
        accelerometer.time_s,
        accelerometer.start_s,
        gyroscope.gyroscope,
        gyroscope.time_s,
        gyroscope.start_s,
        f"{accelerometer.table.path} and {gyroscope.table.path.name}",
    )
    base = accelerometer if merged.base == "accelerometer" else gyroscope
    seen = {(f.code, f.seen) for f in accelerometer.findings}
    extra = [f for f in gyroscope.findings if (f.code, f.seen) not in seen]
    return _Sensors(
        merged.time_s,
        merged.start_s,
        merged.accelerometer,
        merged.gyroscope,
        base.table,
        Columns(
            time=base.columns.time,
            accelerometer=accelerometer.columns.accelerometer if base is accelerometer else None,
            gyroscope=gyroscope.columns.gyroscope if base is gyroscope else None,
            temperature=base.columns.temperature,
            supply=base.columns.supply,
            counter=base.columns.counter,
            accelerometer_unit=accelerometer.columns.accelerometer_unit,
        ),
        base.rows,
        merged.first,
        base.has_clock,
        gyroscope.gyroscope_unit,
        (*accelerometer.findings, *extra, *merged.findings),
    )


def _audited(
    sensors: _Sensors,
    source: str,
    sha256: str,
    accelerometer_unit: str | AccelerationUnit | None,
    gyroscope_unit: str | RateUnit | None,
    progress: Progress | None,
) -> Recording:
    findings = list(sensors.findings)
    time_s, table = sensors.time_s, sensors.table
    n = len(time_s)
    rate = mean_rate_hz(time_s)
    present = {
        name: triad
        for name, triad in (("accelerometer", sensors.accelerometer), ("gyroscope", sensors.gyroscope))
        if triad is not None
    }
    for triad in present.values():
        triad[np.isinf(triad)] = np.nan
    windows = look(present, rate)
    acc_unit, gyr_unit = AccelerationUnit.M_S2, RateUnit.RAD_S
    if sensors.accelerometer is not None:
        judged = judge_accelerometer(
            sensors.accelerometer, windows, sensors.columns.accelerometer_unit, accelerometer_unit
        )
        acc_unit = AccelerationUnit(judged.unit)
        findings += judged.findings
    if sensors.gyroscope is not None:
        judged = judge_gyroscope(
            sensors.gyroscope,
            sensors.accelerometer is not None,
            time_s,
            windows,
            sensors.gyroscope_unit,
            gyroscope_unit,
        )
        gyr_unit = RateUnit(judged.unit)
        findings += judged.findings
    if sensors.has_clock:
        findings += audit_timing(time_s, rate, sensors.place)
    counter = sensors.columns.counter
    if counter is not None:
        findings += audit_counter(_kept(sensors, counter, n), table.label(counter), sensors.place)
    for done, (name, triad) in enumerate(present.items()):
        if progress is not None:
            progress((done + 1) / (len(present) + 1), f"checking the {name}")
        findings += audit_readings(name, triad, windows, sensors.place)
    if progress is not None:
        progress(1.0, f"read {n} samples")
    temperature, supply = sensors.columns.temperature, sensors.columns.supply
    for triad in present.values():
        triad.setflags(write=False)
    time_s.setflags(write=False)
    return Recording(
        time_s=time_s,
        accelerometer=sensors.accelerometer,
        gyroscope=sensors.gyroscope,
        rate_hz=rate,
        accelerometer_unit=acc_unit,
        gyroscope_unit=gyr_unit,
        temperature_degc=None if temperature is None else _kept(sensors, temperature, n),
        supply_v=None if supply is None else _kept(sensors, supply, n),
        start_epoch_s=sensors.start_s,
        source=source,
        sha256=sha256,
        findings=tuple(findings),
        auxiliary=MappingProxyType(_auxiliary(sensors, n)),
    )


def _kept(sensors: _Sensors, column: int, n: int) -> FloatArray:
    values = sensors.table.columns[column]
    if sensors.rows is not None:
        values = values[sensors.rows]
    return values[sensors.offset : sensors.offset + n]


def _auxiliary(sensors: _Sensors, n: int) -> dict[str, FloatArray]:
    used = sensors.columns.used()
    table = sensors.table
    out: dict[str, FloatArray] = {}
    for i, values in enumerate(table.columns):
        if i in used or not len(values):
            continue
        name = table.names[i] if table.names and table.names[i] else f"column {i + 1}"
        key = name if name not in out else f"{name} ({i + 1})"
        kept = np.array(_kept(sensors, i, n))
        kept.setflags(write=False)
        out[key] = kept
    return out
