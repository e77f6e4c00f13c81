"""The sensors of one table on the table's clock, with units and order of samples."""

import re
from dataclasses import dataclass, field, replace

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.read.clock.base import Clock, build_clock
from trihedron.read.clock.rate import mean_rate_hz, usual_step
from trihedron.read.clock.settle import settle_clock
from trihedron.read.clock.unit import TICKS, Witness, counts_rows
from trihedron.read.columns import Columns, Sensor, find_columns, statement
from trihedron.read.devices import one_device
from trihedron.read.errors import ReadError
from trihedron.read.names import is_rate
from trihedron.read.repeated_rows import without_repeated_rows
from trihedron.read.sensing import order_of_triads
from trihedron.read.table import Options, Table
from trihedron.read.time_column import agreed_unit, reject_unread_time, summed_steps, with_arrivals
from trihedron.records import Finding, Sampling, Severity
from trihedron.records.sampling import UNJUDGED
from trihedron.records.words import Words, words

ASSUMED_RATE_HZ = 100.0
WITNESS_ROWS = 200_000
LONGEST_MTI_STEP = 5000.0
"""Steps of 100 µs between samples at 2 Hz, below an MTi's usual rates; a DOT's samples are at least 8333 µs apart."""


@dataclass(frozen=True, eq=False)
class Sensors:
    """Both triads on one time base, and the row of each sample in the file.

    After the clock is settled: ``sampling``, ``lost_behind`` (n - 1,), and ``timestamps_s`` (n,) if they were replaced.
    """

    time_s: FloatArray
    start_s: float
    accelerometer: FloatArray | None
    gyroscope: FloatArray | None
    table: Table
    columns: Columns
    rows: npt.NDArray[np.signedinteger] | None
    offset: int
    has_clock: bool
    sampling: Sampling = UNJUDGED
    lost_behind: IntArray | None = None
    timestamps_s: FloatArray | None = None
    findings: tuple[Finding, ...] = field(default=())
    rows_in_file: int = 0
    rows_read: int = 0

    @property
    def triads(self) -> dict[str, FloatArray]:
        """Readings (n, 3) of the sensors present."""
        both = {"accelerometer": self.accelerometer, "gyroscope": self.gyroscope}
        return {name: triad for name, triad in both.items() if triad is not None}

    @property
    def logged_s(self) -> FloatArray:
        """(n,) timestamps as they were logged."""
        return self.time_s if self.timestamps_s is None else self.timestamps_s

    def row(self, sample: int) -> int:
        """Row of the base table that contains a sample."""
        at = sample + self.offset
        return int(self.rows[at]) if self.rows is not None else at

    def column(self, number: int) -> FloatArray:
        """(n,) one column of the table in the order of the samples; empty for words."""
        values = self.table.columns[number]
        values = values if self.rows is None or not len(values) else values[self.rows]
        return values[self.offset : self.offset + len(self.time_s)]

    def place(self, sample: int) -> Words:
        """A sample's number, file line and time, for messages."""
        return words("sample", sample=sample, row=self.table.place(self.row(sample)), time_s=self.time_s[sample])


def _triad(
    table: Table, triad: tuple[int, int, int] | None, rows: npt.NDArray[np.signedinteger] | None
) -> FloatArray | None:
    if triad is None:
        return None
    axes = [table.columns[column] for column in triad]
    for column, values in zip(triad, axes, strict=True):
        if not len(values):
            raise ReadError(
                f"{table.path}: column {table.label(column)} contains words, not numbers; name another column."
            )
    shared = axes[0].base
    # Axes that the reader wrote side by side are the triad; an array of the user's is not changed, but copied.
    if rows is None and table.first_line and isinstance(shared, np.ndarray) and shared.shape[1:] == (3,):
        block: FloatArray = shared[: table.n_rows]
        if [values.ctypes.data for values in axes] == [axis.ctypes.data for axis in block.T]:
            return block
    out = _core.new_array(table.n_rows if rows is None else len(rows), 3)
    for k, values in enumerate(axes):
        out[:, k] = values if rows is None else values[rows]
    return out


def sensors_of(table: Table, sensor: Sensor | None, options: Options) -> Sensors:
    """One table's sensors (only ``sensor``, if given) on the table's clock.

    Raises ``ReadError`` when the table cannot become readings on a time base.
    """
    path = table.path
    chosen = find_columns(table, options.columns, sensor or table.sensor)
    if not table.is_chosen:
        table = one_device(table, options, chosen)
    if table.n_rows < 2:
        raise ReadError(
            f"{path}: the file contains one row of numbers only ({table.place(0)}); a recording needs many."
        )
    if chosen.time is None and options.columns is None and options.rate_hz is None:
        table, chosen = summed_steps(table, chosen)
    findings = [*table.findings, *chosen.findings]
    if chosen.time is None:
        reject_unread_time(table, chosen, options.columns, options.rate_hz or _stated_rate(table))
    clock, rate = _time_base(table, chosen, options, findings)
    clock = without_repeated_rows(table, chosen, clock, findings)
    accelerometer = None if sensor == "gyroscope" else _triad(table, chosen.accelerometer, clock.rows)
    gyroscope = None if sensor == "accelerometer" else _triad(table, chosen.gyroscope, clock.rows)
    if accelerometer is None and gyroscope is None:
        raise ReadError(f"{path}: the {sensor} is not among its columns; the other sensor is: swap the two files.")
    if chosen.positional and accelerometer is not None and gyroscope is not None:
        is_first, why = order_of_triads(accelerometer, gyroscope, rate)
        if is_first is False:
            accelerometer, gyroscope = gyroscope, accelerometer
            chosen = replace(chosen, accelerometer=chosen.gyroscope, gyroscope=chosen.accelerometer)
        order = why if is_first is None else f"{why}-{'accelerometer' if is_first else 'gyro'}"
        findings.append(Finding.of("columns-assumed", f"six-{order}", mapping=chosen.mapping()))
    findings.insert(len(table.findings), statement(table, chosen, path.name if sensor else ""))
    for name, triad in (("accelerometer", accelerometer), ("gyroscope", gyroscope)):
        if triad is not None:
            _reject_constant(table, name, triad, getattr(chosen, name))
    kept = {chosen.temperature, chosen.supply, chosen.counter}
    return Sensors(
        clock.time_s,
        clock.start_s,
        accelerometer,
        gyroscope,
        # Without the columns that were copied to the time base, to save memory for a long log.
        table.without({c for c in (chosen.time, *chosen.readings) if c not in kept and c is not None}),
        chosen,
        clock.rows,
        0,
        chosen.time is not None,
        findings=tuple(findings),
        rows_in_file=table.n_in_file,
        rows_read=len(clock.time_s),
    )


def _witness(table: Table, chosen: Columns) -> Witness:
    """Readings that limit the time between rows, in file order (the first part of a long log)."""
    axes = [table.columns[c][:WITNESS_ROWS] for c in chosen.accelerometer or ()]
    readings = np.stack(axes, axis=1) if axes and all(map(len, axes)) else None
    return Witness(readings, None if chosen.temperature is None else table.columns[chosen.temperature])


def settled(sensors: Sensors) -> Sensors:
    """The sensors on the clock that timestamps, counter and motion determine; unchanged if that is done already."""
    if not sensors.has_clock or sensors.sampling is not UNJUDGED:
        return sensors
    counter = sensors.columns.counter
    numbers = None if counter is None else sensors.column(counter)
    found = settle_clock(sensors.time_s, sensors.start_s, sensors.triads, numbers)
    return replace(
        sensors,
        time_s=found.time_s,
        start_s=found.start_s,
        sampling=found.sampling,
        lost_behind=found.lost_behind,
        timestamps_s=sensors.time_s if found.sampling.is_even else None,
        findings=(*sensors.findings, *found.findings),
    )


def _stated_rate(table: Table) -> float | None:
    if table.clock.rate_hz is not None:
        return table.clock.rate_hz
    for key, text in table.metadata.items():
        # Only a number, or one in Hz: fs may also mean full scale.
        value = re.fullmatch(r"(\d+\.?\d*(?:e\d+)?)\s*(?:(k?)hz\b.*)?", text.strip().lower()) if is_rate(key) else None
        if value and 0.0 < (rate := float(value[1]) * (1e3 if value[2] else 1.0)) < 1e7:
            return rate
    return None


def _time_base(table: Table, chosen: Columns, options: Options, findings: list[Finding]) -> tuple[Clock, float]:
    is_given = options.rate_hz is not None
    told = options.rate_hz if is_given else _stated_rate(table)
    stated = [Finding.of("rate-stated", rate_hz=told, is_given=is_given)] if told is not None else []
    if chosen.time is None:
        rate, has_gyro = told or ASSUMED_RATE_HZ, chosen.gyroscope is not None
        assumed = Finding.of(
            "rate-assumed", severity=Severity.SERIOUS if has_gyro else Severity.WARNING, has_gyro=has_gyro,
            rate_hz=rate,
        )  # fmt: skip
        findings += stated or [assumed]
        return Clock(np.arange(table.n_rows) / rate, 0.0, None, ()), rate
    named, given = chosen.time_unit, options.time_unit
    if told is not None and given is None and named in {"", TICKS} and counts_rows(table.columns[chosen.time]):
        # A counter of samples named as time: as a clock with one tick per sample it also shows losses.
        given = f"{told!r} Hz"
        findings += stated
    if named == "100us" and not table.clock.unit:
        named = _sample_time_fine(table, chosen.time, findings)
    if not table.clock.unit and given is None:
        named, said = agreed_unit(table, chosen.time, named)
        findings += said
    timed = with_arrivals(table, chosen.time)
    clock = build_clock(timed, chosen.time, named, given, chosen.nanoseconds, _witness(table, chosen))
    findings += clock.findings
    rate = mean_rate_hz(clock.time_s)
    if told is not None and abs(rate / told - 1.0) > 0.01:
        findings.append(Finding.of("rate-contradicted", given_hz=told, clock_hz=rate))
    return clock, rate


def _sample_time_fine(table: Table, column: int, findings: list[Finding]) -> str:
    """Unit of ``SampleTimeFine``: 100 µs in Xsens MTi and MTw logs, 1 µs in those of Xsens (Movella) DOT.

    A DOT sends at most 120 samples a second (8333 µs apart), an MTi at least one (10 000 steps of 100 µs); its usual
    rates are far above 2 Hz (5000 steps), so the step identifies the unit, which a finding states.
    """
    usual = usual_step(table.columns[column])
    unit = "us" if usual >= LONGEST_MTI_STEP else "100us"
    findings.append(Finding.of("time-unit-detected", "sample-time", step=usual, is_us=unit == "us"))
    return unit


# Channels that are constant throughout.

TOO_FEW_TO_JUDGE = 20
"""Number of rows below which a working channel may be constant."""


def _reject_constant(table: Table, name: str, triad: FloatArray, where: tuple[int, int, int]) -> None:
    """Reject readings (n, 3), from columns ``where``, of which an axis is constant."""
    for k, column in enumerate(where):
        head = triad[:1000, k]
        if np.isfinite(head[0]) and np.any(np.isfinite(head) & (head != head[0])):
            continue  # not constant: the other rows need no check
        finite = triad[np.isfinite(triad[:, k]), k]
        if len(finite) == 0:
            raise ReadError(f"{table.path}: column {table.label(column)} of the {name} contains no finite number.")
        if finite[0] == finite[-1] and np.all(finite == finite[0]):
            if table.n_rows < TOO_FEW_TO_JUDGE:
                raise ReadError(
                    f"{table.path}: the file contains {table.n_rows} rows of numbers only, too few for a recording; "
                    "log for a minute or more."
                )
            raise ReadError(
                f"{table.path}: column {table.label(column)} of the {name} is {finite[0]:.6g} in all {len(finite)} "
                f"rows from {table.place(0)} on: a dead channel, or the wrong column; name the columns with --columns."
            )
