"""Resolution, range limits reached, and bandwidth of a log's channels."""

from typing import Any

from trihedron.arrays import AXES, FloatArray
from trihedron.records import Recording
from trihedron.records.channel_facts import Limit, LowPass
from trihedron.report.document import Table
from trihedron.report.numbers import MINUS, plain_number, unit_in_print

UNKNOWN = "not known"
CHANNELS = "The channels; bandwidth in the quietest intervals of the whole log"


def channels_table(recording: Recording) -> Table:
    """A row per axis, or one per sensor where its axes are equal."""
    rows: list[tuple[str, ...]] = []
    for name, _, raw_unit in logged_sensors(recording):
        unit = unit_in_print(raw_unit)
        facts, filters = recording.facts.of(name), recording.low_passes.get(name)
        cells = [
            (
                f"{plain_number(float(facts.step[k]))} {unit}" if facts.step[k] else "not visible",
                _ends([limit for limit in facts.limits if limit.axis == k], unit),
                UNKNOWN if filters is None else _filter(filters[k], 0.5 * recording.rate_hz),
            )
            for k in range(3)
        ]
        if len(set(cells)) == 1:
            rows.append((name, *cells[0]))
        else:
            rows += [(f"{name} {axis.upper()}", *cell) for axis, cell in zip(AXES, cells, strict=True)]
    return Table(("", "resolution (LSB)", "range limits met", "-3 dB bandwidth"), tuple(rows), CHANNELS)


def channels_record(recording: Recording) -> dict[str, Any]:
    """For JSON: ``resolution`` (3,), ``range_limits`` and ``low_pass`` of every axis, raw units and Hz."""
    out: dict[str, Any] = {}
    for name, *_ in logged_sensors(recording):
        facts, filters = recording.facts.of(name), recording.low_passes.get(name)
        out[name] = {
            "resolution": facts.step,
            "range_limits": [{"axis": AXES[one.axis], "value": one.value, "count": one.count} for one in facts.limits],
            "low_pass": None if filters is None else [_filter_record(one) for one in filters],
        }
    return out


def logged_sensors(recording: Recording) -> list[tuple[str, FloatArray, str]]:
    """Name, readings (n, 3) and raw unit of the sensors that the log contains."""
    both = (
        ("accelerometer", recording.accelerometer, recording.accelerometer_unit.value),
        ("gyroscope", recording.gyroscope, recording.gyroscope_unit.value),
    )
    return [(name, readings, unit) for name, readings, unit in both if readings is not None]


def _ends(limits: list[Limit], unit: str) -> str:
    values = [plain_number(one.value, 4).replace("-", MINUS) for one in sorted(limits, key=lambda one: one.value)]
    return f"{' and '.join(values)} {unit}" if values else "none"


def _filter(one: LowPass, nyquist_hz: float) -> str:
    """In words; no frequency above Nyquist is stated, where a log shows nothing."""
    corner = one.corner_hz
    if corner is None:
        return f"none below {plain_number(min(one.above_hz, nyquist_hz), 2)} Hz"
    if corner.value > nyquist_hz:
        return f"above {plain_number(min(corner.lower, nyquist_hz), 2)} Hz"
    low, high = (plain_number(value, 2) for value in (corner.lower, corner.upper))
    kind = "Gaussian" if one.shape == 0 else f"order {one.shape}"
    return f"{plain_number(corner.value, 2)} Hz ({low} to {high}), {kind}"


def _filter_record(one: LowPass) -> dict[str, Any]:
    corner = one.corner_hz
    if corner is None:
        return {"corner_hz": None, "above_hz": one.above_hz}
    ends = {"lower_hz": corner.lower, "upper_hz": corner.upper}
    return {"corner_hz": corner.value, **ends, "order": one.shape or None}
