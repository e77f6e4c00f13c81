"""Report sections of the fit to a reference, and charts of its error and of the residual rate."""

from collections.abc import Sequence
from dataclasses import replace
from functools import partial

import numpy as np

from trihedron.arrays import AXES, XYZ, sigmas_of
from trihedron.records import Calibration
from trihedron.records.published import HELD_OUT
from trihedron.records.reference import NAMED_FROM, AgainstReference, Estimate, FitToReference, ReferenceError
from trihedron.report.calibration import calibration_report, shared_power
from trihedron.report.chart import AXIS_COLOURS, TWO_SIGMA, Band, Chart, Level, Line, Mark, Panel, Scale, Span
from trihedron.report.document import Block, Document, Facts, Picture, Section, Table
from trihedron.report.names import axis_in_print, id_in_print
from trihedron.report.numbers import (
    capital,
    each_with_sigma,
    engineering_exponent,
    in_mm_s2,
    listed,
    plain_number,
    power_of_ten,
    with_sigma,
)
from trihedron.sanitise import escaped
from trihedron.units import degrees_from_radians, mm_s2_from_m_s2, ms_from_s

SECONDS_PER_HOUR = 3600.0
DEGREES = degrees_from_radians(1.0)
_SHEET = {"gyro-g-sensitivity": (0.1, "°/s/g"), "gyro-scale-nonlinearity": (0.1, "% of ±250 °/s")}
"""Data-sheet sizes in printed units."""
_SIGNS = {
    "quieter-than-gyro": "the difference between the two is quieter than the static gyro",
    "mounted-without-error": "it lies along the gyro's own axes",
}


def reference_blocks(found: AgainstReference) -> tuple[Block, ...]:
    """Clocks, mounting, lever arm, both sensors, effects and the replay."""
    signs = "; ".join(_SIGNS[sign.kind] for sign in found.error.signs)
    facts = [
        ("reference", f"{found.kind}: {found.source}"),
        ("shared motion", f"{found.overlap_s:.1f} s, correlation of the turning rates {found.correlation:.3f}"),
        ("its error", _error(found)),
        *([("independent", f"no: {signs}")] if signs else []),
        ("clock", _clock(found)),
        ("mounting", f"rotation vector {_vector(found.mounting, DEGREES)}° (log's gyro → reference)"),
    ]
    if found.lever_arm is not None:
        length = 1000.0 * float(np.linalg.norm(found.lever_arm.value))
        arm = f"{_vector(found.lever_arm, 1000.0)} mm, {length:.1f} mm long (reference → accelerometer)"
        facts.append(("lever arm", arm))
    if found.vertical is not None:
        facts.append(("up", f"{_vector(found.vertical, 1.0)} in the reference's world"))
    if found.earth_rate is not None:
        rate = _vector(found.earth_rate, degrees_from_radians(SECONDS_PER_HOUR))
        facts.append(("Earth's rate", f"{rate} °/h along the axes of the reference's world"))
    facts.append(("gyro bias", _bias(found)))
    if found.accelerometer is not None:
        facts.append(("accelerometer", _left(found.accelerometer, mm_s2_from_m_s2(1.0), "mm/s²")))
    for r in found.replay:
        error, many = plain_number(degrees_from_radians(r.error_rad)), "once" if r.n == 1 else f"{r.n} times"
        words = f"{error}° after {r.horizon_s:g} s by the gyro alone, cross-validated ({many})"
        facts.append((f"attitude, {r.stage}", words))
    blocks: list[Block] = [Facts(tuple(facts)), _matrix("Gyro", "ω", "rad/s", found.gyroscope)]
    if found.accelerometer is not None:
        blocks.append(_matrix("Accelerometer", "f", "m/s²", found.accelerometer))
    return (*blocks, *(_effect(ident, one) for ident, one in found.effects.items()))


def errors_beside(references: Sequence[AgainstReference]) -> str:
    """The largest cross-validated errors of both sensors beside references, in words; empty without any."""
    said = []
    replays = [one.replay[-1] for one in references if one.replay]
    if replays:
        worst = max(replays, key=lambda one: one.error_rad)
        angle = plain_number(degrees_from_radians(worst.error_rad))
        said.append(f"attitude {angle}° after {worst.horizon_s:g} s by the gyro alone")
    elif rates := [one.gyroscope.rms_held_out for one in references if np.isfinite(one.gyroscope.rms_held_out)]:
        said.append(f"rate in motion {plain_number(degrees_from_radians(max(rates)), 3)} °/s")
    forces = [one.accelerometer.rms_held_out for one in references if one.accelerometer is not None]
    if forces:
        said.append(f"acceleration in motion {in_mm_s2(max(forces))}")
    return f"{listed(said)}, {HELD_OUT}" if said else ""


def references_report(calibration: Calibration, references: tuple[AgainstReference, ...]) -> Document:
    """Lay out one unit with several references: the shared calibration, then the results of each recording."""
    document = calibration_report(calibration, errors_beside=errors_beside(references))
    own = Table(
        ("reference", "its slow error", "gyro bias [°/s]", "clock rate [ppm]"),
        tuple(
            (
                escaped(one.source),
                _slow(one.error) + (", not independent" if one.error.signs else ""),
                ", ".join(each_with_sigma(-one.bias.value.mean(axis=0), one.bias.sigma.mean(axis=0), DEGREES)),
                "–" if one.clock_rate_ppm is None else with_sigma(*one.clock_rate_ppm),
            )
            for one in references
        ),
        "S and effects are shared; bias (g-sensitivity at the mean force in it) and clock are each recording's own",
    )
    effects = tuple(_effect(ident, one) for ident, one in references[0].effects.items())
    drawn = [error_picture(one, f"reference-error-{k}") for k, one in enumerate(references, 1)]
    pictures = [
        replace(picture, caption=f"{escaped(one.source)}. {picture.caption}")
        for picture, one in zip(drawn, references, strict=True)
        if picture is not None
    ]
    sections = (document.sections[0], Section("References", (own, *effects, *pictures[1:])), *document.sections[1:])
    subtitle = f"{len(references)} recordings beside references"
    return replace(document, subtitle=subtitle, sections=sections, lead=next(iter(pictures), document.lead))


def beside_reference(document: Document, found: AgainstReference | None, place: int = 0) -> Document:
    """The report of one recording with the section on its reference inserted at ``place``."""
    if found is None:
        return document
    section = Section("Against the reference", reference_blocks(found))
    return replace(
        document,
        subtitle=f"{document.subtitle} beside {escaped(found.source)}",
        sections=(*document.sections[:place], section, *document.sections[place:]),
        lead=error_picture(found) or document.lead,
    )


def beside_model(document: Document, found: AgainstReference) -> Document:
    """The report against a simulated log, whose motion is that of the recording, the motions compared at its end."""
    section = Section("Its motion", (*reference_blocks(found), *filter(None, (error_picture(found),))))
    return replace(document, sections=(*document.sections, section))


def _slow(error: ReferenceError) -> str:
    return f"{plain_number(degrees_from_radians(error.slow_rad[0]), 2)}° in {plain_number(error.slow_s, 2)} s"


def hidden_by(found: AgainstReference | None) -> str:
    """What a reference that agrees is by itself wrong by, in a sentence; empty without one."""
    if found is None:
        return ""
    drift = _error(found).partition(";")[0].partition(",")[0]
    return f" The reference by itself {drift}; a smaller misfit of the log does not show."


def _error(found: AgainstReference) -> str:
    """The reference's own error in words."""
    error = found.error
    size, low, high = (plain_number(degrees_from_radians(v), 2) for v in error.slow_rad)
    where = "in the body frame" if error.is_of_body else "in the world frame"
    text = f"drifts by {size}° ({low} to {high}) within {plain_number(error.slow_s, 2)} s, mostly {where}"
    text += f"; {plain_number(degrees_from_radians(error.white_rad), 2)}° white (means of a second)"
    if error.gaps_s:
        longest = max(end - start for start, end in error.gaps_s)
        text += f"; {len(error.gaps_s)} gap{'s' * (len(error.gaps_s) > 1)}, the longest {plain_number(longest, 2)} s"
    if error.rows_left_out:
        text += f"; {error.rows_left_out} of {error.rows + error.rows_left_out} rows excluded as outliers"
    return text


def _bias(found: AgainstReference) -> str:
    """The bias in this recording, the reading without input as of a calibration: at its middle, and its change."""
    bias = found.bias
    k = len(bias.value) // 2
    middle = ", ".join(each_with_sigma(-bias.value[k], bias.sigma[k], DEGREES))
    moved = plain_number(degrees_from_radians(float(np.ptp(bias.value, axis=0).max())), 2)
    return (
        f"[{middle}] °/s at {bias.time_s[k]:.0f} s, moves by up to {moved} °/s (g-sensitivity at the mean force in it)"
    )


def _clock(found: AgainstReference) -> str:
    offset, sigma = found.clock_offset_s
    where = f"at {found.clock_middle_s:.1f} s of the log"
    way = "ahead of" if offset >= 0.0 else "behind"
    size = abs(offset)
    if not np.isfinite(sigma):
        return (
            f"the reference's is {size:.2f} s {way} the log's, to about a sample: commands do not determine it better"
        )
    far = size > 100.0
    digits = f"{size:.4f} s" if far else f"{with_sigma(ms_from_s(size), ms_from_s(sigma))} ms"
    text = f"the reference's is {digits} {way} the log's {where}"
    text += f" (± {plain_number(ms_from_s(sigma), 2)} ms)" if far else ""
    if found.clock_rate_ppm is not None:
        rate, error = found.clock_rate_ppm
        text += f", and runs {with_sigma(abs(rate), error)} ppm {'fast' if rate >= 0.0 else 'slow'}"
    return text


def _vector(one: Estimate, scale: float) -> str:
    return f"[{', '.join(each_with_sigma(one.value, one.std, scale))}]"


def _left(fit: FitToReference, scale: float, unit: str) -> str:
    text = f"{plain_number(scale * fit.rms)} {unit} rms unexplained, up to {plain_number(fit.band_hz, 2)} Hz"
    text += f", {plain_number(scale * fit.rms_held_out)} {unit} cross-validated over 16 parts of the log"
    if fit.n_left_out:
        text += f"; {fit.n_left_out} of {fit.n_rows} windows excluded"
    return text


def _matrix(name: str, symbol: str, unit: str, fit: FitToReference) -> Table:
    scale, times = shared_power(fit.S)
    sigma = sigmas_of(fit.covariance)
    raw = "w" if symbol == "ω" else "a"
    rows = tuple(
        (
            f"{symbol}_{AXES[i]} =",
            *each_with_sigma(fit.S[i], sigma[3 * i : 3 * i + 3], scale),
            with_sigma(fit.b[i], sigma[9 + i]),
        )
        for i in range(3)
    )
    head = ("", *(f"{raw}′_{j}{times}" for j in AXES), f"b [{unit}]")
    return Table(head, rows, f"{name} in the reference's body: {symbol} = S {raw}′ + b")


def _effect(ident: str, one: Estimate) -> Table:
    per = 3
    rows = []
    for k in range(0, len(one.names), per):
        exponent = engineering_exponent(float(np.abs(one.value[k : k + per]).max()))
        scale = 10.0**-exponent
        units = one.unit.split(", ")
        unit = units[min(k // per, len(units) - 1)]
        cells = each_with_sigma(one.value[k : k + per], one.std[k : k + per], scale)
        printed = f"{power_of_ten(exponent)} {unit.replace('^2', '²')}".strip()
        rows.append((", ".join(map(axis_in_print, one.names[k : k + per])), *cells, printed))
    title = capital(id_in_print(ident))
    if one.score is not None:
        title += f": score {plain_number(one.score, 3)}, accepted from {NAMED_FROM:g}{_shown_from(ident, one)}"
    return Table(("", "", "", "", ""), tuple(rows), title)


def _shown_from(ident: str, one: Estimate) -> str:
    """The detection limit of an effect with this reference."""
    if one.shown_from is None:
        return ""
    if not np.isfinite(one.shown_from):
        return "; this reference drifts too much to show any"
    size, unit = _SHEET[ident]
    return f" (detectable here: about {plain_number(size * one.shown_from, 2)} {unit})"


def error_picture(found: AgainstReference, name: str = "reference-error") -> Picture | None:
    """The reference's error over time; ``None`` where it has no rows."""
    if not np.isfinite(found.apart.angle).any():
        return None
    caption = "Slow error of the reference's attitude along the axes of its world, smoothed. Band: its ± 2 σ."
    if found.error.apart_s:
        caption += " Orange: where it differs from the other windows."
    caption += " Grey: gaps." if found.error.gaps_s else ""
    return Picture(name, caption, partial(error_chart, found))


def error_chart(found: AgainstReference) -> Chart:
    """Three angles over the log's time, with the size of the slow error, gaps, and outlying intervals."""
    apart, error = found.apart, found.error
    ends = np.array([apart.time_s[0], apart.time_s[-1]])
    reach = np.full(2, TWO_SIGMA * DEGREES * error.slow_rad[0])
    marks: list[Mark] = [Level(y=0.0), Band(ends, -reach, reach, "2 σ of its slow error")]
    marks += [Span(first, last, "gap", "grey") for first, last in error.gaps_s]
    marks += [Span(first, last, "differs from the others", "warn") for first, last in error.apart_s]
    for k, colour in enumerate(AXIS_COLOURS):
        marks.append(Line(apart.time_s, DEGREES * apart.angle[:, k], XYZ[k], colour))
    x = Scale("time [s]", "s", limits=(float(ends[0]), float(ends[1])))
    return Chart((Panel(x, Scale("error of the reference [°]", "°"), tuple(marks), height_px=240),))
