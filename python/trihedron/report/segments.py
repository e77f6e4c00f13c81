"""Reports of a recording and of its poses and moves, with the charts of its signals."""

from collections.abc import Iterable
from functools import partial
from typing import Any

import numpy as np

from trihedron.arrays import AXES, XYZ, FloatArray
from trihedron.records import Finding, Pose, Recording, Segments, Truth
from trihedron.records.channel_facts import Limit, LowPass
from trihedron.records.noise import least_length_s
from trihedron.report.chart import AXIS_COLOURS, Chart, Colour, Level, Line, Panel, Scale, Span
from trihedron.report.document import Document, Facts, Picture, Section, Table
from trihedron.report.drawn import envelope
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.numbers import MINUS, duration, each_with_sigma, how_many, plain_number, unit_in_print
from trihedron.units import RateUnit

SHAKEN = "moved or vibrated"


def segments_report(segments: Segments, recording: Recording | None = None) -> Document:
    """Lay out poses and moves, with properties, times and units of the recording where that is given."""
    findings = segments.findings if recording is None else (*recording.findings, *segments.findings)
    found = f"{how_many(segments.n_poses, 'pose')}, {how_many(len(segments.moves), 'move')}"
    still = f"{duration(_still_s(segments))} in all"
    is_long = recording is not None and _is_of_noise(segments, recording)
    if is_long:
        found += f", {duration(_still_s(segments))} static: a log for noise or temperature, not for S and b"
    facts = (("found", f"{found}, {still} static"),) if recording is None else recording_facts(recording, segments)
    return Document(
        title="Poses and moves",
        subtitle="" if recording is None else recording.source,
        verdict=verdict_of(findings, f"{found}.", found, "NOT FIT"),
        sections=(
            Section("Result", (Facts(facts),)),
            Section("Findings", (findings_block(findings),)),
            Section("Poses", (pose_table(segments, recording),)),
        ),
        lead=None if recording is None else signals_picture(recording, segments),
        next_step="For noise: `trihedron allan LOG`; for drift and temperature: `trihedron diagnose LOG`."
        if is_long
        else "Is every pose found? Then see what the log is fit for: `trihedron check LOG`.",
    )


def _is_of_noise(segments: Segments, recording: Recording) -> bool:
    """Whether a log has too few poses for S and b, and these are as long as a log for noise."""
    has_few = any(one.code == "few-poses" for one in segments.findings)
    return has_few and _still_s(segments) >= segments.n_poses * least_length_s(recording.rate_hz)


def recording_facts(recording: Recording, segments: Segments | None = None) -> tuple[tuple[str, str], ...]:
    """Length, rate, sensors with unit; with segments also noise, and the number of poses and moves."""
    facts = [("length", f"{duration(recording.duration_s)}, {recording.n_samples} samples")]
    facts.append(("rate", f"{rate_in_words(recording.rate_hz, recording.findings, 5)}{scale_by_rate(recording)}"))
    for name in ("accelerometer", "gyroscope"):
        readings, unit = getattr(recording, name), unit_in_print(getattr(recording, f"{name}_unit").value)
        sigma = None if segments is None else getattr(segments, f"{name}_sigma")
        words = "not in the log" if readings is None else f"in {unit}"
        if readings is not None and sigma is not None and np.all(np.isfinite(sigma)):
            words += f"; noise of one sample {', '.join(plain_number(float(s), 2) for s in sigma)} {unit}"
        facts.append((name, words))
    if segments is not None:
        poses, moves = how_many(segments.n_poses, "pose"), how_many(len(segments.moves), "move")
        facts.append(("found", f"{poses} ({duration(_still_s(segments))} in all), {moves}"))
    return tuple(facts)


def rate_in_words(rate_hz: float, findings: Iterable[Finding], digits: int) -> str:
    """The sampling rate, and whether it was assumed: times and lengths follow from it."""
    is_assumed = any(one.code == "rate-assumed" for one in findings)
    return f"{plain_number(rate_hz, digits)} Hz{' (assumed)' if is_assumed else ''}"


def scale_by_rate(recording: Recording) -> str:
    """What a wrong sampling rate would do unseen: the scale of a gyro in counts rests on it."""
    is_open = recording.gyroscope is not None and recording.gyroscope_unit is RateUnit.COUNTS
    return "; the gyro's scale rests on it: in counts a wrong rate shows nowhere else" if is_open else ""


def _still_s(segments: Segments) -> float:
    return float(np.sum(segments.duration_s)) if segments.n_poses else 0.0


def pose_table(segments: Segments, recording: Recording | None = None) -> Table:
    """Every pose with its means; with the recording also start, end and units."""
    times = {"middle [s]": segments.time_mid_s, "length [s]": segments.duration_s}
    columns = {name: [f"{t:.1f}" for t in of] for name, of in times.items()}
    if recording is not None:
        ends = {"from [s]": [p.start for p in segments.poses], "to [s]": [p.stop - 1 for p in segments.poses]}
        columns = {name: [f"{recording.time_s[at]:.2f}" for at in of] for name, of in ends.items()}
    for letter, sensor in (("a", "accelerometer"), ("w", "gyroscope")):
        mean, sigma = getattr(segments, f"{sensor}_mean"), getattr(segments, f"{sensor}_sigma_mean")
        unit = "" if recording is None else f" [{unit_in_print(getattr(recording, f'{sensor}_unit').value)}]"
        if mean is not None:
            sigma = np.full(mean.shape, np.nan) if sigma is None else sigma
            columns |= {
                f"{letter}′_{axis}{unit}": each_with_sigma(of, error)
                for axis, of, error in zip(AXES, mean.T, sigma.T, strict=True)
            }
    rows = tuple((str(k + 1), *(cells[k] for cells in columns.values())) for k in range(segments.n_poses))
    words = "Mean readings ± their standard error; disturbed intervals excluded"
    return Table(("pose", *columns), rows, words if recording else f"{words}; in the unit of the log")


def signals_picture(recording: Recording, segments: Segments) -> Picture:
    """The signals with the poses shaded."""
    caption, is_shaken = "The recording; shaded where the sensor was static", any(p.is_unsteady for p in segments.poses)
    caption += ", darker where it moved or vibrated throughout a pose" if is_shaken else ""
    caption += ", orange where a pose was disturbed." if any(pose.disturbed for pose in segments.poses) else "."
    return Picture("signals", caption, partial(signals_chart, recording, segments))


def signals_chart(recording: Recording, segments: Segments | None = None) -> Chart:
    """Both sensors over time; with segments, poses are shaded and disturbances marked."""
    poses = () if segments is None else segments.poses
    spans = [_span(recording, pose.start, pose.stop - 1) for pose in poses if not pose.is_unsteady]
    spans += [_span(recording, pose.start, pose.stop - 1, SHAKEN, "soft") for pose in poses if pose.is_unsteady]
    disturbed = [_span(recording, *part, "disturbed, excluded", "warn") for pose in poses for part in pose.disturbed]
    return _signals(recording, (*spans, *disturbed))


def state_of(pose: Pose) -> str:
    """What disturbed a pose, in words; empty for a static one."""
    return SHAKEN if pose.is_unsteady else "disturbed" if pose.disturbed else ""


def pose_lines(segments: Segments | None, at: FloatArray | None = None) -> tuple[Level, ...]:
    """Upright lines ``at`` (n,) the poses that were not static throughout, by default at their numbers."""
    if segments is None:
        return ()
    places = np.arange(1.0, segments.n_poses + 1.0) if at is None else at
    return tuple(
        Level(x=float(x), name=state, colour="soft" if state == SHAKEN else "warn", is_dashed=True)
        for x, pose in zip(places, segments.poses, strict=True)
        if (state := state_of(pose))
    )


def _span(recording: Recording, first: int, last: int, name: str = "pose", colour: Colour = "shade") -> Span:
    end = recording.n_samples - 1
    start_s, stop_s = (float(recording.time_s[min(at, end)]) for at in (first, last))
    return Span(start_s, stop_s, name, colour)


def truth_chart(recording: Recording, truth: Truth) -> Chart:
    """Both sensors of a simulation over time, with the true static intervals shaded."""
    return _signals(recording, tuple(_span(recording, pose.start, pose.stop - 1) for pose in truth.poses))


def _signals(recording: Recording, spans: tuple[Span, ...]) -> Chart:
    panels = []
    limits = (float(recording.time_s[0]), float(recording.time_s[-1]) or 1.0)
    for name, readings, unit in logged_sensors(recording):
        lines = [
            Line(*envelope(recording.time_s, readings[:, k]), XYZ[k], AXIS_COLOURS[k], is_thin=True) for k in range(3)
        ]
        printed = unit_in_print(unit)
        y = Scale(f"{name}  [{printed}]", printed)
        panels.append(Panel(Scale("time [s]", "s", limits=limits), y, (*spans, *lines), height_px=190))
    return Chart(tuple(panels), is_linked=True)


def recording_summary(recording: Recording) -> Document:
    """Length, rate, sensors and rows of a log, with its audit."""
    facts = recording_facts(recording)
    if recording.rows_in_file:
        rows = f"{recording.rows_in_file} in the file, {recording.rows_read} read, {recording.rows_reported} reported"
        facts = (*facts, ("rows", rows))
    return Document(
        title="Recording",
        subtitle=recording.source,
        verdict=verdict_of(recording.findings, "OK: no problems found.", "Read", "DOUBTFUL"),
        sections=(
            Section("Recording", (Facts(facts),)),
            Section("Findings", (findings_block(recording.findings),)),
            Section("Figures", (Picture("signals", "The recording.", partial(signals_chart, recording)),)),
        ),
    )


# Resolution, range limits reached, and bandwidth of a log's channels.

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
