"""Report of a calibration tested on another recording."""

from collections.abc import Sequence
from functools import partial

import numpy as np

from trihedron.arrays import XYZ, BoolArray, FloatArray, rms_of
from trihedron.probability import chdtri
from trihedron.records import Finding, Recording, Segments, Severity, Verification
from trihedron.report.axes import TRIAD
from trihedron.report.calibration_charts import LIMIT_SIGMAS, mm_s2
from trihedron.report.chart import Band, Bars, Chart, Colour, Level, Mark, Panel, Points, Scale
from trihedron.report.document import Block, Document, Facts, Picture, Section, Table
from trihedron.report.drawn import said
from trihedron.report.findings import findings_block, likely, verdict_of
from trihedron.report.findings.wording import opening
from trihedron.report.names import label_of
from trihedron.report.numbers import each_with_sigma, how_many, in_mm_s2, listed, plain_number, shown, with_unit
from trihedron.report.segments import signals_picture
from trihedron.units import degrees_from_radians, mm_s2_from_m_s2

_ABOVE_NOISE = {
    "residual-above-noise": "gravity error in static poses",
    "held-out-worse": "tilt error after a rotation",
    "static-rate-above-noise": "gyro rate in static poses",
}
USES = "`trihedron apply FILE LOG -o corrected.csv`, `trihedron export FILE --to c -o calibration.h`"
"""What a calibration is for, in the next steps of reports."""
ALLOWED = "3 σ of noise and calibration uncertainty"
WITH_DRIFT = "X, Y, Z, ± 1 σ with the drift between sessions"
LIMIT_RMS = float(np.sqrt(-np.log(0.0027)))
"""Limit of the length of a two-component Gaussian error, over its rms, with the probability of 3σ (0.27 %)."""

LIMIT_OF_THREE = float(np.sqrt(chdtri(3, 0.0027) / 3.0))
"""The same of a three-component error."""


def verification_report(
    verification: Verification, segments: Segments | None = None, recording: Recording | None = None
) -> Document:
    v = verification
    made_from = f"calibration of {v.calibration_source}" if v.calibration_source else "calibration of another program"
    caption = "Gravity error and change of the gyro rate in every pose, tilt error after every rotation, beside what "
    caption += "noise and uncertainty allow: one in 370 is beyond it by chance. χ²/dof, each weighted by its "
    caption += "uncertainty, judges them together; an rms can exceed the expected one by a single uncertain pose."
    sections = [
        Section("Result", (Facts(facts_of(verification)),)),
        Section("Findings", (findings_block(sorted(v.findings, key=lambda one: one.code not in _ABOVE_NOISE)),)),
        Section("Parameters", (parameters_table(verification),)),
        Section("Poses and moves", tuple(_tables(verification, segments))),
    ]
    if segments is not None and recording is not None:
        sections.append(Section("Figures", (signals_picture(recording, segments),)))
    return Document(
        title="Verification",
        subtitle=f"{made_from}, tested on {v.source}",
        verdict=verified_in_words(v),
        sections=tuple(sections),
        lead=Picture("errors", caption, partial(verification_chart, v)),
        next_step=use_in_words(v, "the calibration"),
    )


def above_noise(v: Verification) -> list[Finding]:
    """Findings about errors beyond noise and uncertainty."""
    return [finding for finding in v.findings if finding.code in _ABOVE_NOISE]


def imprecise(findings: Sequence[Finding]) -> list[Finding]:
    """Findings that a calibration is less certain than the log's own."""
    return [finding for finding in findings if finding.code == "calibration-imprecise"]


def verified_in_words(v: Verification) -> str:
    """The verdict in one sentence: errors beyond noise and uncertainty, else parameters that differ from the file."""
    beyond = above_noise(v)
    above = [f"{_ABOVE_NOISE[f.code]} {plain_number(f.numbers['times'], 2)} times" for f in beyond]
    word = "Not contradicted" if imprecise(v.findings) or _is_untested(v) else "Verified"
    usable = f"{word}: errors are within noise and uncertainty"
    if above:
        usable = f"Doubtful: {listed(above)} what noise and uncertainty allow"
    elif beyond := _shifts(v):
        (shift,) = beyond
        doubtful = f"Doubtful: errors are within noise and uncertainty, but {opening(shift.seen)}"
        seen = f"{shift.seen[:1].lower()}{opening(shift.seen)[1:]}"
        alone = (
            f"{word} with the gyro bias measured anew at rest: {seen}; other errors are within noise and uncertainty"
        )
        usable = doubtful if shift.numbers["n_others"] else alone
    others = [one for one in v.findings if one not in beyond or one.severity is Severity.SERIOUS]
    said = verdict_of(others, f"{usable}.", usable, "NOT VERIFIED")
    return f"{said} {likely(beyond[0].cause)}" if beyond and said.startswith(usable) else said


def _shifts(v: Verification) -> list[Finding]:
    """The finding that parameters differ from the file; they may where the errors agree."""
    return [one for one in v.findings if one.code == "calibration-shift" and "n_others" in one.numbers]


def _is_untested(v: Verification) -> bool:
    return any(finding.code == "not-tested" for finding in v.findings)


def use_in_words(v: Verification, what: str) -> str:
    """Advice about errors above noise; else to use the calibration, unless it is rejected."""
    above = above_noise(v)
    if any(one.code == "effect-not-applied" and one.severity is Severity.WARNING for one in v.findings):
        return ""  # errors are those of an effect that this log lacks the channel for
    use = f"Use {what}: {USES}." if v.is_passed and not _is_untested(v) else ""
    shifts = _shifts(v)
    above += [*imprecise(v.findings), *(one for one in shifts if one.numbers["n_others"])]
    if not above and use:
        return " ".join([*(one.action for one in shifts), use])
    if above and v.is_passed:
        return f"{above[0].action} Where the errors are acceptable it may be used as it is."
    return above[0].action if above else use


def _errors(v: Verification) -> list[tuple[str, str, str, str, str, str]]:
    """Gravity error in static poses, tilt error after rotations, change of the static rate: name, rms, its unit, over
    how many, the expected rms with χ²/dof, the worst."""
    k, of = int(np.argmax(np.abs(v.norm_error))), how_many(len(v.norm_error), "pose")
    expected, worst = rms_of(v.norm_sigma), f"{in_mm_s2(float(v.norm_error[k]))} in pose {k + 1}"
    allowed = f"{in_mm_s2(expected)}, χ²/dof {plain_number(v.norm_chi2_per_dof, 2)}"
    rms = plain_number(mm_s2_from_m_s2(v.norm_rms))
    out = [("gravity error in static poses", rms, "mm/s²", of, allowed, worst)]
    if len(v.angle_deg):
        k, of = int(np.argmax(v.angle_deg)), how_many(len(v.angle_deg), "move")
        without = ", ".join(str(one + 1) for one in v.moves_left_out)
        worst = f"{plain_number(float(v.angle_deg[k]))}° in move {v.moves[k] + 1}"
        worst += f"; without move {without}, where the gyro was at its limit" if without else ""
        allowed = f"{plain_number(v.angle_expected_deg)}°, χ²/dof {plain_number(v.angle_chi2_per_dof, 2)}"
        out.append(("tilt error after a rotation", plain_number(v.angle_rms_deg), "°", of, allowed, worst))
    change, sigma = np.degrees(v.static_rate_change), np.degrees(v.static_rate_sigma)
    if len(change) > 1:
        k, axis = divmod(int(np.argmax(np.abs(change))), 3)
        of = f"{how_many(len(change), 'pose')}, about its mean"
        chi2 = float(np.sum((change / sigma) ** 2)) / (change.size - 3)
        worst = f"{plain_number(float(change[k, axis]))} °/s ({XYZ[axis]}) in pose {k + 1}"
        allowed = f"{plain_number(rms_of(sigma))} °/s, χ²/dof {plain_number(chi2, 2)}"
        out.append(("gyro rate in static poses", plain_number(rms_of(change)), "°/s", of, allowed, worst))
    return out


def facts_of(v: Verification) -> tuple[tuple[str, str], ...]:
    """The errors with their expected size, and the change of the gyro's bias."""
    facts = [("gravity", f"{v.gravity_m_s2:.5f} m/s², {v.gravity_source}")]
    for what, rms, unit, of, allowed, worst in _errors(v):
        facts.append((what, f"{with_unit(rms, unit)} rms over {of}, worst {worst}"))
        facts.append(("  expected", f"{allowed}, from noise and calibration uncertainty"))
    facts += [("gyro bias", f"changed by {changes} °/s, {WITH_DRIFT}") for changes in _bias_changes(v)]
    return tuple(facts)


def _bias_changes(v: Verification) -> list[str]:
    """Log minus file of the gyro's bias along X, Y, Z; empty without a gyro."""
    biases = [one for one in v.parameters if one.id == "gyro-bias" and np.isfinite(one.sigma)]
    differences, sigmas = [-one.difference for one in biases], [one.sigma for one in biases]
    changed = each_with_sigma(differences, sigmas, degrees_from_radians(1.0))
    return [", ".join(changed)] if changed else []


def parameters_table(v: Verification) -> Table:
    """Every parameter: log minus file, both uncertainties, and whether the log determines it."""
    rows = []
    for one in v.parameters:
        scale, unit = shown(one.unit)
        sigma = plain_number(scale * one.sigma_log, 2) if np.isfinite(one.sigma_log) else "unknown"
        stated = plain_number(scale * one.sigma_file, 2) if one.sigma_file > 0.0 else "not stated"
        differs = plain_number(-scale * one.difference, 3) if np.isfinite(one.difference) else ""
        times = plain_number(-one.times_sigma, 2) if one.is_judged and np.isfinite(one.times_sigma) else ""
        judged = times if one.is_judged else "not judged by this log"
        rows.append((label_of(one.id, one.name), unit, differs, sigma, stated, judged))
    head = ("parameter", "unit", "log − file", "σ of the log", "σ of the file", "in σ")
    caption = "Parameters that do not depend on the frame, against this log's own calibration; σ of a bias includes "
    return Table(head, tuple(rows), f"{caption}its drift between sessions; {TRIAD}")


def _tables(v: Verification, segments: Segments | None) -> list[Block]:
    errors = each_with_sigma(v.norm_error, v.norm_sigma, mm_s2_from_m_s2(1.0))
    rows: tuple[tuple[str, ...], ...] = tuple(
        (
            str(k + 1),
            "" if segments is None else plain_number(float(segments.time_mid_s[k]), 4),
            error,
            plain_number(float(v.norm_error[k] / v.norm_sigma[k]), 2),
        )
        for k, error in enumerate(errors)
    )
    head = ("pose", "mid [s]", "|f| − |g| [mm/s²]", "in σ")
    blocks: list[Block] = [Table(head, rows, "Gravity error of every pose ± noise and the calibration's uncertainty")]
    if len(v.angle_deg):
        columns = zip(v.angle_deg, v.angle_noise_deg, v.angle_sigma_deg, strict=True)
        moves = zip(v.moves, columns, strict=True)
        rows = tuple((str(k + 1), *(plain_number(float(angle), 2) for angle in angles)) for k, angles in moves)
        head = ("move", "tilt error [°]", "noise alone [°]", "noise and uncertainty [°]")
        caption = "Tilt error after every rotation: gravity predicted with the gyro against gravity measured"
        blocks.append(Table(head, rows, caption))
    return blocks


def verification_chart(verification: Verification) -> Chart:
    """Gravity error and rate of every pose and tilt error after every move, with their expected size."""
    v = verification
    pose, error, sigma = np.arange(1.0, len(v.norm_error) + 1.0), mm_s2(v.norm_error), mm_s2(v.norm_sigma)
    pairs = enumerate(zip(error, sigma, strict=True), start=1)
    tips = [said(f"pose {k}", e, f"mm/s² ({e / s:+.1f}σ)".replace("-", "−")) for k, (e, s) in pairs]
    limit = LIMIT_SIGMAS * sigma
    panels = [_panel(("pose", pose), Scale("|f| − |g|  [mm/s²]", "mm/s²"), (error, -limit, limit), tips)]
    if len(v.angle_deg):
        limit, scale = LIMIT_RMS * v.angle_sigma_deg, Scale("tilt error  [°]", "°", includes=(0.0,))
        tips = [said(f"move {k + 1}", a, "°") for k, a in zip(v.moves, v.angle_deg, strict=True)]
        panels.append(
            _panel(("move", v.moves.astype(np.float64) + 1.0), scale, (v.angle_deg, 0.0 * limit, limit), tips)
        )
    if len(v.static_rate) > 1:
        size, limit = (np.linalg.norm(x, axis=1) for x in (v.static_rate_change, v.static_rate_sigma))
        size, limit = np.degrees(size), LIMIT_OF_THREE * np.degrees(limit)
        tips = [said(f"pose {k}", a, "°/s") for k, a in enumerate(size, start=1)]
        scale = Scale("gyro rate change  [°/s]", "°/s", includes=(0.0,))
        panels.append(_panel(("pose", pose), scale, (size, 0.0 * limit, limit), tips))
    return Chart(tuple(panels), columns=len(panels))


def _panel(at: tuple[str, FloatArray], y: Scale, values: tuple[FloatArray, ...], tips: list[str]) -> Panel:
    """Errors at places ``at`` (dots; bars from 0 where they have no sign) with their lower and upper limits, those
    beyond in another colour."""
    (name, x), (error, low, high) = at, values
    edge, is_signed = np.column_stack([x - 0.5, x + 0.5]).ravel(), bool(np.any(low))
    marks: list[Mark] = [Band(edge, np.repeat(low, 2), np.repeat(high, 2), ALLOWED), Level(y=0.0)]
    for part, words, colour in _parted((error < low) | (error > high)):
        named = [tip for tip, is_in in zip(tips, part, strict=True) if is_in]
        bars = Bars(x[part], error[part], 0.7, named, words, colour)
        marks.append(Points(x[part], error[part], named, None, words, colour) if is_signed else bars)
    return Panel(Scale(name, limits=(0.3, float(x[-1]) + 0.7), whole=True), y, tuple(marks))


def _parted(is_beyond: BoolArray) -> list[tuple[BoolArray, str, Colour]]:
    """Masks, names and colours of the points within and beyond the 3 σ band, without empty ones."""
    parts: list[tuple[BoolArray, str, Colour]] = [(~is_beyond, "within 3 σ", "c1"), (is_beyond, "beyond 3 σ", "accent")]
    return [part for part in parts if part[0].any()]
