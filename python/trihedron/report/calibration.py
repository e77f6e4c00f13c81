"""The calibration as a laboratory report: result, findings, properties of the axes, residuals, uncertainty."""

from typing import NamedTuple

import numpy as np

from trihedron.arrays import AXES, TINY, XYZ, FloatArray
from trihedron.records import Calibration, FitQuality, Recording, Segments, SensorCalibration, Severity
from trihedron.records.published import AFTER_MOVES, AT_REST, HELD_OUT, IN_SAMPLE
from trihedron.report.axes import Axes, axes_of
from trihedron.report.calibration_charts import (
    before_words,
    correlations,
    excluded_moves,
    figure_blocks,
    lead_picture,
    strong_correlations,
    uncalibrated_error,
)
from trihedron.report.calibration_fit import angles_of, fit_in_words, move_floor, residual_tables
from trihedron.report.document import USE_IT, WITHIN, Block, Document, Facts, Paragraph, Section, Table
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.findings.wording import opening
from trihedron.report.numbers import (
    capital,
    duration,
    each_with_sigma,
    engineering_exponent,
    how_many,
    in_mm_s2,
    listed,
    one_of,
    plain_number,
    power_of_ten,
    unit_in_print,
    with_unit,
)
from trihedron.report.segments import rate_in_words, scale_by_rate
from trihedron.report.verification import USES
from trihedron.units import degrees_from_radians, mm_s2_from_m_s2, mrad_from_radians

FRAMES = {"lower": "lower-triangular (X along accelerometer X)", "symmetric": "symmetric", "case": "case"}
"""Printed names of the frames."""
NEXT = f"Test the calibration on another recording: `trihedron verify FILE OTHER_LOG`.{USE_IT}{USES}."
DRIFTS = "bias-drift", "gyro-bias-drift"
"""Findings that say which bias the stated one is; the verdict says so too."""
SYMBOLS = {"accelerometer": ("f", "a"), "gyroscope": ("ω", "w")}


def calibration_report(
    calibration: Calibration,
    segments: Segments | None = None,
    recording: Recording | None = None,
    errors_beside: str = "",
) -> Document:
    """Lay out a calibration; with its segments and recording also their tables and figures. ``errors_beside`` are the
    errors in words of one whose fit is to a reference."""
    sections = [
        Section("Result", _result(calibration, segments, recording, has_reference=bool(errors_beside))),
        Section("Findings", (findings_block(calibration.findings),)),
    ]
    figures = tuple(figure_blocks(calibration, segments, recording))
    if figures:
        sections.append(Section("Figures", figures))
    axes = tuple(_axes_block(name, sensor) for name, sensor in calibration.sensors)
    sections += [Section("Axes", axes), Section("Uncertainty", tuple(_certainty(calibration)))]
    residuals = tuple(residual_tables(calibration, segments))
    if residuals:
        sections.append(Section("Residuals", residuals))
    return Document(
        title="Calibration",
        subtitle=calibration.recording_source or "no recording named",
        verdict=verdict(calibration, errors_beside),
        sections=tuple(sections),
        lead=lead_picture(calibration, segments),
        next_step=NEXT if calibration.is_trustworthy else "",
    )


def _drift(calibration: Calibration) -> str:
    """How far the bias of the gyro moves within the recording, where it does: b is then its mean."""
    moved = [f.numbers for f in calibration.findings if f.code == "gyro-bias-drift" and f.numbers]
    sizes = [plain_number(degrees_from_radians(one["change_rad_s"]), 2) for one in moved]
    return "".join(f"; it changes by up to {size} °/s" for size in sizes)


class StatedError(NamedTuple):
    """An error of the fit: ``beside`` is how it was found, and the error of noise alone."""

    what: str
    value: str
    unit: str
    beside: str


def errors_of(calibration: Calibration) -> list[tuple[StatedError, float, bool]]:
    """Gravity and tilt error and static rate, in times the noise alone, and whether they are cross-validated."""
    out = []
    quality = calibration.accelerometer.quality
    if quality is not None:
        is_held = quality.held_out_rms is not None
        rms = quality.rms if quality.held_out_rms is None else quality.held_out_rms
        beside = f"rms, {_kind(quality, is_held=is_held)}, {AT_REST}; noise alone {in_mm_s2(quality.floor)}"
        value = plain_number(mm_s2_from_m_s2(rms))
        line = StatedError("gravity error in static poses", value, "mm/s²", beside)
        out.append((line, rms / max(quality.floor, TINY), is_held))
    moved = None if calibration.gyroscope is None else calibration.gyroscope.quality
    angles = [] if moved is None else angles_of(moved)
    if moved is not None and angles:
        is_held, floor, rms = len(angles) > 1, move_floor(moved), angles[-1][1]
        beside = f"rms, {_kind(moved, is_held=is_held)}, {AFTER_MOVES}{_drift(calibration)}; "
        beside += f"noise alone {plain_number(floor)}°"
        is_out = excluded_moves(moved)
        beside += f"; {is_out.sum()} of {how_many(len(is_out), 'move')} excluded" if is_out.any() else ""
        line = StatedError("tilt error after a rotation", plain_number(rms), "°", beside)
        out.append((line, rms / max(floor, TINY), is_held))
    if moved is not None and moved.static_rate_rms is not None and moved.static_rate_floor is not None:
        rms, floor = moved.static_rate_rms, moved.static_rate_floor
        beside = f"rms, {HELD_OUT}, {AT_REST}; noise alone {plain_number(degrees_from_radians(floor))} °/s"
        line = StatedError("gyro rate in static poses", plain_number(degrees_from_radians(rms)), "°/s", beside)
        out.append((line, rms / max(floor, TINY), True))
    return out


def _kind(quality: FitQuality, *, is_held: bool) -> str:
    return HELD_OUT if is_held else f"{IN_SAMPLE} only ({how_many(quality.dof, 'degree')} of freedom)"


def errors_in_words(calibration: Calibration) -> str:
    """Cross-validated errors, and how many times the noise they are, and what is not tested; empty without any."""
    errors = [one for one in errors_of(calibration) if one[1] < 1.0 / TINY]
    lone = None if calibration.accelerometer.quality is None else calibration.accelerometer.quality.lone_pose
    mostly = "" if lone is None else f", most of it in pose {lone + 1}, which the others hardly determine"
    said = [
        f"{line.what} {with_unit(line.value, line.unit)} ({plain_number(times, 2)} times the noise"
        f"{mostly if line is errors[0][0] else ''})"
        for line, times, is_held in errors
        if is_held
    ]
    open_ones = [line.what for line, _, is_held in errors if not is_held]
    untested = f"; untested: {listed(open_ones)}" if open_ones else ""
    return f"{listed(said)}, {HELD_OUT}{untested}" if said else ""


def verdict(calibration: Calibration, errors_beside: str = "") -> str:
    """The verdict: usable or not, how far beyond noise, a gyro bias that drifts, the effects of an extended one."""
    said = errors_in_words(calibration) or errors_beside
    above = f"{WITHIN}{said}" if said else "Usable"
    if any(f.code == "gyroscope-left-out" for f in calibration.findings):
        above += ", for the accelerometer alone"
    if any(f.code == "accelerometer-nominal" for f in calibration.findings):
        above += ", for the gyro alone"
    modelled = (f for f in calibration.findings if f.code == "effects-modelled")
    effects = [f.seen for f in modelled if f.severity is not Severity.SERIOUS]
    whole = verdict_of(calibration.findings, "OK: no problems found.", above, "NOT TO BE TRUSTED")
    warned = [f for f in calibration.findings if f.severity is Severity.WARNING]
    drifts = [f"{capital(opening(f.seen))}." for f in warned if f.code in DRIFTS]
    return " ".join([whole, *drifts, *effects])


def _result(
    calibration: Calibration, segments: Segments | None, recording: Recording | None, *, has_reference: bool
) -> tuple[Block, ...]:
    facts = []
    if recording is not None:
        rate = rate_in_words(recording.rate_hz, recording.findings, 4)
        alone = "" if has_reference else scale_by_rate(recording)
        facts.append(("recording", f"{duration(recording.duration_s)} at {rate}{alone}"))
    if segments is not None:
        facts.append(("motion", f"{how_many(segments.n_poses, 'pose')}, {how_many(len(segments.moves), 'move')}"))
    facts.append(("gravity", f"{calibration.gravity_m_s2:.5f} m/s², {calibration.gravity_source}"))
    facts.append(("frame", FRAMES[calibration.frame]))
    blocks: list[Block] = [Facts(tuple(facts))]
    errors = [line for line, _, _ in errors_of(calibration)]
    for name, sensor in calibration.sensors:
        rows = fit_in_words(sensor)
        own = (line for line in errors if line.what.startswith("gravity") == (name == "accelerometer"))
        rows += [(line.what, f"{with_unit(line.value, line.unit)} {line.beside}") for line in own]
        if name == "accelerometer" and segments is not None:
            rows += _before_in_words(calibration, segments)
        blocks += [parameter_table(name, sensor), Facts(tuple(rows))]
    return tuple(blocks)


def _before_in_words(calibration: Calibration, segments: Segments) -> list[tuple[str, str]]:
    """The gravity error of the same poses without this calibration."""
    means = segments.accelerometer_mean
    if means is None or len(means) == 0:
        return []
    rms = float(np.sqrt(np.nanmean(uncalibrated_error(calibration, means) ** 2)))
    return [("  before calibration", f"{in_mm_s2(rms)} rms, {before_words(calibration)}")]


def shared_power(values: FloatArray) -> tuple[float, str]:
    """Factor that shortens all of the values, and the power of ten that then stands beside them."""
    exponent = engineering_exponent(float(np.abs(values).max()))
    return 10.0**-exponent, f" × {power_of_ten(exponent)}" if exponent else ""


def parameter_table(name: str, sensor: SensorCalibration) -> Table:
    """S and b with their standard errors, with a common power of ten where it shortens the numbers."""
    true, raw = SYMBOLS[name]
    unit = unit_in_print(sensor.si_unit)
    scale, times = shared_power(sensor.S)
    head = ("", *(f"{raw}′_{j}{times}" for j in AXES), f"b [{unit}]")
    value = np.column_stack([scale * sensor.S, sensor.b])
    sigma = np.column_stack([scale * sensor.sigma_S, sensor.sigma_b])
    rows = [
        row
        for i in range(3)
        for row in (
            (f"{true}_{AXES[i]} =", *each_with_sigma(value[i], sigma[i])),
            ("", *(_percent(v, s) for v, s in zip(value[i], sigma[i], strict=True))),
        )
    ]
    of_S = "S dimensionless" if sensor.raw_unit == sensor.si_unit else f"S in {unit} per {one_of(sensor.raw_unit)}"
    caption = f"{name.capitalize()}: {true} = S {raw}′ + b, with the reading {raw}′ in {unit_in_print(sensor.raw_unit)}"
    caption += f", {of_S}"
    if not np.any(sigma):
        return Table(head, tuple(rows[::2]), caption)
    caption += "; value ± standard uncertainty (1 σ), and σ in % of the value where below 100 %"
    return Table(head, tuple(rows), caption)


def _percent(value: float, sigma: float) -> str:
    """σ in per cent of the value; empty where σ is 0 or not below the value."""
    return f"± {plain_number(100.0 * sigma / abs(value), 2)} %" if 0.0 < sigma < abs(value) else ""


def _axes_block(name: str, sensor: SensorCalibration) -> Block:
    try:
        return axes_table(name, sensor, axes_of(sensor))
    except ValueError:
        return Paragraph(f"The {name}'s S is singular: its axes have no meaning of their own.")


def axes_table(name: str, sensor: SensorCalibration, axes: Axes) -> Table:
    raw, si = unit_in_print(sensor.raw_unit), unit_in_print(sensor.si_unit)
    head = ("", "scale (sensitivity)" if raw == si else f"scale (sensitivity) [{raw} per {si}]", "relative σ [%]")
    scale = each_with_sigma(axes.sensitivity, axes.sigma_sensitivity)
    columns = (XYZ, scale, [plain_number(100.0 * sigma, 2) for sigma in axes.scale_sigma])
    skew = each_with_sigma(axes.skew_rad, axes.sigma_skew_rad, mrad_from_radians(1.0))
    beyond = ", ".join(f"{pair} {angle} mrad" for pair, angle in zip(("X-Y", "X-Z", "Y-Z"), skew, strict=True))
    caption = f"{name.capitalize()} axes; angles between axes exceed 90° by {beyond}"
    return Table(head, tuple(zip(*columns, strict=True)), caption)


def next_pose(calibration: Calibration) -> str:
    """The pose that would lower uncertainties most; empty where a finding names the poses to add."""
    sensor = calibration.accelerometer
    advice = () if sensor is None or sensor.observability is None else sensor.observability.advice[:1]
    return next((pose for pose in advice if not any(pose in one.action for one in calibration.findings)), "")


def _certainty(calibration: Calibration) -> list[Block]:
    blocks: list[Block] = []
    for name, sensor in calibration.sensors:
        seen = sensor.observability
        if seen is None:
            continue
        determined = f"{seen.rank} of {seen.n_parameters} parameters determined"
        rows = [(name, f"{determined}, condition {plain_number(seen.condition)}")]
        if seen.weakest:
            rows.append(("least certain", seen.weakest))
        if name == "accelerometer" and (pose := next_pose(calibration)):
            rows.append(("most useful next pose", pose))
        if sensor.quality is not None and sensor.quality.dof > 0:
            per_dof = sensor.quality.chi2 / sensor.quality.dof
            rows.append(("χ² per dof", f"{plain_number(per_dof)} over {sensor.quality.dof} degrees of freedom"))
        blocks.append(Facts(tuple(rows)))
    strong, n = strong_correlations(calibration), len(correlations(calibration)[0])
    if strong:
        caption = f"Correlations above 0.5; the other {n * (n - 1) // 2 - len(strong)} pairs lie below"
        pairs = tuple((a, b, plain_number(r, 2)) for a, b, r in strong)
        blocks.append(Table(("parameter", "with", "correlation"), pairs, caption))
    return blocks
