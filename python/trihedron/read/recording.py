"""Reads one or two files to one audited recording; composes the other modules of this package."""

import hashlib
import os
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType
from typing import Any

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.channel_facts import facts_in
from trihedron.channel_facts.limits import Extremes
from trihedron.channel_facts.quiet import Windows, look
from trihedron.channel_facts.turning import turning_of, turns_with
from trihedron.read.audit.invalid import without_invalid
from trihedron.read.audit.motionless import audit_motionless_accelerometer, audit_motionless_gyro
from trihedron.read.audit.orientation import audit_orientation
from trihedron.read.audit.readings import audit_readings
from trihedron.read.audit.timing import audit_counter, audit_pace, audit_timing
from trihedron.read.clock.rate import mean_rate_hz
from trihedron.read.clock.unit import was_weighed, with_gyro
from trihedron.read.columns import Sensor
from trihedron.read.devices import by_sensor, one_beside
from trihedron.read.errors import ReadError, errors_of_system
from trihedron.read.in_turn import by_rows
from trihedron.read.memory import table_of
from trihedron.read.merge import merge_sensors
from trihedron.read.sensing import WHOLE, Judged, judge_accelerometer, judge_gyroscope
from trihedron.read.sensors import Sensors, sensors_of, settled
from trihedron.read.source import read_tables
from trihedron.read.table import Options
from trihedron.read.temperature import temperature_of
from trihedron.records import Finding, Progress, Recording
from trihedron.units import AccelerationUnit, RateUnit

TIMESTAMPS = "logged time after the first [s]"
"""Auxiliary column with the logged timestamps, where an even clock replaces them."""


# Squares of absurd readings (1e300) overflow; such readings then fail every plausibility test, as they should.
@np.errstate(over="ignore", invalid="ignore")
def read_recording(
    path: Any = None,
    *,
    accelerometer_path: str | os.PathLike[str] | None = None,
    gyroscope_path: str | os.PathLike[str] | None = None,
    columns: str | None = None,
    rate_hz: float | None = None,
    accelerometer_unit: str | AccelerationUnit | None = None,
    gyroscope_unit: str | RateUnit | None = None,
    time_unit: str | None = None,
    topic: str | None = None,
    instance: int | str | None = None,
    progress: Progress | None = None,
) -> Recording:
    """Read and audit a log: one file, or one file per sensor; the parameters are those of ``trihedron.read``.

    Raises
    ------
    ReadError
        (a ``ValueError``) the message names file, line and remedy in one sentence.
    """
    if rate_hz is not None and not (np.isfinite(rate_hz) and 0 < rate_hz < 1e7):
        raise ReadError(f"the rate must be a positive number of samples per second, got {rate_hz}.")
    options = Options(columns, rate_hz, time_unit, topic, None if instance is None else str(instance), progress)
    named: tuple[tuple[Any, Sensor | None], ...]
    named = ((path, None), (accelerometer_path, "accelerometer"), (gyroscope_path, "gyroscope"))
    logs = [(log, sensor) for log, sensor in named if log is not None]
    if path is not None and len(logs) > 1:
        raise ReadError("give one log, or one file per sensor (--accel FILE --gyro FILE).")
    if not logs:
        raise ReadError("no log was named; give a file, or one file per sensor.")
    each = [_of_log(log, sensor, options) for log, sensor in logs]
    source = " + ".join(str(log) if isinstance(log, str | os.PathLike) else "memory" for log, _ in logs)
    digests = "".join(one.table.sha256 for one in each)
    sha256 = digests if len(each) == 1 else hashlib.sha256(digests.encode()).hexdigest()
    sensors = each[0] if len(each) == 1 else merge_sensors(*each)
    return _audited(sensors, source, sha256, (accelerometer_unit, gyroscope_unit), progress)


def _of_log(log: Any, sensor: Sensor | None, options: Options) -> Sensors:
    """The sensors of a file or of data in memory: of one table, or of two (accelerometer, gyro) merged; only
    ``sensor``, if given."""
    if isinstance(log, str | os.PathLike):
        # Errors before a format's reader is called: a name that is too long, a folder without permission.
        with errors_of_system(Path(log)):
            tables = read_tables(Path(log), options)
    else:
        tables = (table_of(log),)
    if len(tables) == 1:
        tables = by_sensor(tables[0])
    if len(tables) == 1 and options.columns is None and not tables[0].is_chosen:
        tables = (one_beside(tables[0], options.instance),)
    if len(tables) == 1:
        tables = by_rows(tables[0], options.columns, sensor)
    if len(tables) == 1:
        return sensors_of(tables[0], sensor, options)
    if sensor is not None:
        return sensors_of(next(table for table in tables if table.sensor == sensor), sensor, options)
    return merge_sensors(*(sensors_of(table, table.sensor, options) for table in tables))


def _accounted(sensors: Sensors, findings: list[Finding]) -> None:
    """Add a finding if some rows of the file are neither readings nor counted in a finding as excluded."""
    reported = round(sum(finding.numbers.get("rows_left_out", 0.0) for finding in findings))
    missing = sensors.rows_in_file - sensors.rows_read - reported
    if missing:
        findings.append(
            Finding.of(
                "rows-unaccounted",
                in_file=sensors.rows_in_file,
                read=sensors.rows_read,
                reported=reported,
                count=missing,
            )
        )


def _audited(
    sensors: Sensors,
    source: str,
    sha256: str,
    units: tuple[str | AccelerationUnit | None, str | RateUnit | None],
    progress: Progress | None,
) -> Recording:
    """The recording, with units determined (or as given), clock and readings audited, and all rows accounted for."""
    sensors = settled(sensors)
    rate = _rate_hz(sensors)
    of_clock = audit_timing(sensors, rate) + audit_pace(sensors) if sensors.has_clock else []
    counter = sensors.columns.counter
    if counter is not None:
        of_clock += audit_counter(sensors.column(counter), sensors.table.label(counter), sensors.place)
    sensors, invalid = without_invalid(sensors, rate)
    findings = [*sensors.findings, *invalid]
    _accounted(sensors, findings)
    time_s = sensors.time_s
    present = sensors.triads
    extremes = {name: _finite_extremes(triad) for name, triad in present.items()}
    windows = look(present, rate)
    acc_unit, gyr_unit = AccelerationUnit.M_S2, RateUnit.RAD_S
    if sensors.accelerometer is not None:
        judged = judge_accelerometer(sensors.accelerometer, windows, sensors.columns.accelerometer_unit, units[0])
        acc_unit = AccelerationUnit(judged.unit)
        findings += [*judged.findings, *_unnamed_gyro(sensors, rate)]
    turned = sensors if any(one.code == "clock-jumped" for one in of_clock) else _with_lost_turns(sensors, rate)
    if sensors.gyroscope is not None:
        judged = _judged_gyro(sensors, turned, rate, windows, units[1], extremes["gyroscope"])
        gyr_unit = RateUnit(judged.unit)
        findings = with_gyro(findings, judged.confirms_clock) + list(judged.findings)
    changes = audit_orientation(turned, rate)
    del turned  # a copy of all rates where samples were lost
    if changes:
        # A scale or axes that change have no one unit.
        findings = [*changes, *(one for one in findings if one.code != "unit-contradicted")]
    findings += of_clock
    facts = facts_in(present, windows, extremes)
    for done, (name, triad) in enumerate(present.items()):
        if progress is not None:
            progress((done + 1) / (len(present) + 1), f"checking the {name}")
        findings += audit_readings(name, triad, facts.of(name), windows, sensors.place)
        if name == "accelerometer" and all(one.code != "gravity-missing" for one in findings):
            findings += audit_motionless_accelerometer(windows, facts.of(name).step)
    if progress is not None:
        progress(1.0, f"read {len(time_s)} samples")
    temperature_degc, of_temperature = temperature_of(sensors)
    findings += of_temperature
    supply = sensors.columns.supply
    for array in (time_s, *present.values()):
        array.setflags(write=False)
        if isinstance(array.base, np.ndarray):
            array.base.setflags(write=False)
    return Recording(
        time_s=time_s,
        accelerometer=sensors.accelerometer,
        gyroscope=sensors.gyroscope,
        rate_hz=rate,
        accelerometer_unit=acc_unit,
        gyroscope_unit=gyr_unit,
        temperature_degc=temperature_degc,
        supply_v=None if supply is None else sensors.column(supply),
        start_epoch_s=sensors.start_s,
        source=source,
        sha256=sha256,
        findings=tuple(findings),
        sampling=sensors.sampling,
        auxiliary=MappingProxyType(_auxiliary(sensors)),
        onboard=sensors.table.onboard,
        rows_in_file=sensors.rows_in_file,
        rows_read=sensors.rows_read,
    ).with_facts(facts)


LONGEST_TURN_S = 0.1
"""Longest time for which one reading stands where those behind it are lost: a hand turns at another rate later."""


def _with_lost_turns(sensors: Sensors, rate_hz: float) -> Sensors:
    """Sensors whose gyro readings are multiplied by the samples that each stands for, half of the lost ones beside it:
    summed over rows they are the rotation."""
    lost, rates = sensors.lost_behind, sensors.gyroscope
    if rates is None or lost is None or not lost.any():
        return sensors
    half = 0.5 * np.minimum(lost, LONGEST_TURN_S * rate_hz)
    return replace(sensors, gyroscope=rates * (1.0 + np.append(half, 0.0) + np.append(0.0, half))[:, None])


def _judged_gyro(
    sensors: Sensors,
    turned: Sensors,
    rate_hz: float,
    windows: Windows | None,
    given: str | RateUnit | None,
    extremes: Extremes,
) -> Judged:
    """The gyro's unit, with findings from the rotation of gravity about the unit and the axes; ``turned`` are the
    sensors with the turns of lost samples."""
    assert sensors.gyroscope is not None
    acc = sensors.accelerometer
    turning = None if acc is None or turned.gyroscope is None else turning_of(acc, turned.gyroscope, rate_hz)
    if turning is not None:
        turning = replace(turning, clock_is_weighed=any(was_weighed(one) for one in sensors.findings))
    clear = turning if turning is not None and turning.is_clear else None
    judged = judge_gyroscope(sensors.gyroscope, clear, windows, sensors.columns.gyroscope_unit, given, extremes)
    if turning is None:
        return Judged(judged.unit, (*judged.findings, *_exchanged(sensors, rate_hz)))
    is_stated = given is not None or sensors.columns.gyroscope_unit not in {"", "raw", WHOLE}
    fits = (
        is_stated and clear is not None and judged.unit is not RateUnit.COUNTS and turning.fits(RateUnit(judged.unit))
    )
    changed = _exchanged(sensors, rate_hz) if clear is None else []
    if clear is not None and clear.motionless:
        is_one_file = sensors.columns.gyroscope is not None
        without_gyro = replace(sensors.columns, gyroscope=None).mapping() if is_one_file else ""
        changed += audit_motionless_gyro(clear.motionless, without_gyro)
    return Judged(judged.unit, (*judged.findings, *changed), fits)


def _exchanged(sensors: Sensors, rate_hz: float) -> list[Finding]:
    """A finding where the readings named gyro turn, as gravity does, by those named accelerometer."""
    if sensors.accelerometer is None or sensors.gyroscope is None:
        return []
    if not turns_with(sensors.gyroscope, sensors.accelerometer, rate_hz):
        return []
    columns = sensors.columns
    swapped = replace(columns, accelerometer=columns.gyroscope, gyroscope=columns.accelerometer)
    mapping = "" if columns.gyroscope is None else swapped.mapping()
    return [Finding.of("sensors-exchanged", is_one_file=bool(mapping), mapping=mapping)]


def _finite_extremes(triad: FloatArray) -> Extremes:
    """Extremes of a triad (n, 3); infinite readings are set to NaN in it."""
    extremes = _core.triad_extremes(triad)
    if any(np.isinf(value) for low, _, high, _ in extremes for value in (low, high)):
        triad[np.isinf(triad)] = np.nan
        return _core.triad_extremes(triad)
    return extremes


def _rate_hz(sensors: Sensors) -> float:
    """Samples per second: from the even clock's period where losses are counted on it or it is used, else from rows."""
    sampling = sensors.sampling
    if sampling.period_s > 0.0 and (sampling.counts_losses or sampling.is_even):
        return 1.0 / sampling.period_s
    return mean_rate_hz(sensors.time_s)


def _auxiliary(sensors: Sensors) -> dict[str, FloatArray]:
    used = sensors.columns.used()
    table = sensors.table
    out: dict[str, FloatArray] = {}
    for i, values in enumerate(table.columns):
        if i in used or not len(values):
            continue
        name = table.names[i] if table.names and table.names[i] else f"column {i + 1}"
        key = name if name not in out else f"{name} ({i + 1})"
        out[key] = np.array(sensors.column(i))
    if sensors.timestamps_s is not None:
        out[TIMESTAMPS] = np.array(sensors.timestamps_s)
    for values in out.values():
        values.setflags(write=False)
    return out


# Columns without a role whose readings rotate as gravity does: a gyro with an unknown name.


def _unnamed_gyro(sensors: Sensors, rate_hz: float) -> tuple[Finding, ...]:
    """A warning for each triad of columns with unknown names, which differ only in one letter (``x``, ``y``, ``z``),
    whose readings rotate as the accelerometer's gravity does.

    Only where no gyro is recognised; gravity's change in blocks is compared with ``-ω × a`` (``turning_of``).
    """
    accelerometer, table, columns = sensors.accelerometer, sensors.table, sensors.columns
    if accelerometer is None or sensors.gyroscope is not None or columns.accelerometer is None or table.names is None:
        return ()
    taken = {i for i, c in enumerate(table.columns) if not len(c)} | columns.used()
    left = {name.strip().lower(): i for i, name in enumerate(table.names) if i not in taken}
    found = []
    for name in left:
        for k in (k for k, letter in enumerate(name) if letter == "x"):
            x, y, z = (left.get(f"{name[:k]}{axis}{name[k + 1 :]}") for axis in "xyz")
            if x is None or y is None or z is None:
                continue
            rates = np.stack([sensors.column(column) for column in (x, y, z)], axis=1)
            if turns_with(accelerometer, rates, rate_hz):
                listed = " ".join(table.label(column) for column in (x, y, z))
                mapping = replace(columns, gyroscope=(x, y, z)).mapping()
                found.append(Finding.of("columns-assumed", "unnamed-gyro", taken=listed, mapping=mapping))
    return tuple(found)
