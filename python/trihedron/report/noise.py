"""Reports of noise and of an Allan curve: terms in SI and customary units, best averaging time, the Allan plot."""

import math
from collections.abc import Mapping, Sequence
from functools import partial

import numpy as np

from trihedron.records import AllanCurve, Finding, Noise, NoiseAxis, NoiseTerm, TermName
from trihedron.records.noise import of_axes
from trihedron.report.chart import Band, Chart, Colour, Line, Mark, Panel, Points, Scale, Span
from trihedron.report.document import Block, Code, Document, Facts, Paragraph, Picture, Section, Table
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.names import axis_in_print
from trihedron.report.noise_units import IN_SLOW_NOISE, TERM_WORDS, customary, term_in_words, unit_of
from trihedron.report.numbers import duration, how_many, plain_number, unit_in_print, with_sigma_and_power
from trihedron.report.segments import rate_in_words
from trihedron.units import micro_g_from_m_s2

_NO_UNIT = """The unit of the log is not known: give --gyro-unit and --accel-unit, or the size of a count with \
--gyro-lsb and --accel-lsb."""
LINES = "(section Kalibr, in --full and in --report)"
NEXT = f"Take N and K into a filter {LINES}; average for no longer than the best averaging time."
LONGER = "Record a static log of an hour or more for B and K; of this one take N alone."
SAY_COUNTS = """State the size of a count, for terms in SI: `--gyro-lsb SIZE --accel-lsb SIZE`, such \
as "0.05 deg/s" and "3.33 mg" from the data sheet of this part at its range, or --calibration FILE."""
BEYOND = "beyond the log"
"""An averaging time at which the fitted sum still falls."""


def noise_report(
    noise: Noise, lengths: Mapping[str, Mapping[TermName, float | None]] | None = None, accuracy: float = 0.1
) -> Document:
    """Lay out the noise of one log; ``lengths`` are recording times [s] per axis and term for ``accuracy``."""
    findings = all_findings(noise)
    length = noise.curve.n_samples / noise.curve.rate_hz
    rate = rate_in_words(noise.curve.rate_hz, findings, 5)
    facts = [("length", f"{duration(length)}, {noise.curve.n_samples} samples at {rate}")]
    if noise.excluded_s:
        total = sum(stop - start for start, stop in noise.excluded_s)
        facts.append(("excluded", f"{how_many(len(noise.excluded_s), 'interval')}, {duration(total)}"))
    facts += _filtered(noise)
    groups = _groups(noise)
    tables = [table for unit, axes in groups for table in (_terms_table(axes, unit), _answers_table(axes, unit))]
    return Document(
        title="Noise of a static log",
        subtitle=noise.source,
        verdict=verdict_of(findings, _good(noise), _usable(noise), "NOT TO BE TRUSTED"),
        stated_level="usable" if noise.shows_white_alone else None,
        lead=noise_picture(noise) if groups else None,
        next_step=_next(noise) if noise.is_trustworthy else "",
        sections=(
            Section("Result", (Facts(tuple(facts)), *tables)),
            Section("Findings", (findings_block(findings),)),
            Section("Data sheet", tuple(dict.fromkeys(b for unit, axes in groups for b in _customary(axes, unit)))),
            Section("Intervals", tuple(_intervals_table(axes, unit) for unit, axes in groups)),
            *([Section("How long to record", (_lengths_table(noise, lengths, accuracy),))] if lengths else []),
            Section("Kalibr", _kalibr(noise)),
        ),
    )


def _good(noise: Noise) -> str:
    """The verdict without warnings."""
    if not noise.shows_white_alone:
        return "OK: a sum of noise terms fits the whole spectrum."
    return f"{_usable(noise)}: B and K do not show in {duration(noise.curve.n_samples / noise.curve.rate_hz)}."


def _usable(noise: Noise) -> str:
    """The verdict with warnings: how far white noise is determined, on the worst axis."""
    white = [axis.terms[TermName.WHITE] for axis in noise.axes]
    sigma = max((one.sigma / one.value for one in white if one.is_present), default=0.0)
    causes = " and ".join(words for code, words in IN_SLOW_NOISE.items() if any(f.code == code for f in noise.findings))
    alone = " alone," if causes or noise.shows_white_alone else ""
    said = f"white noise N{alone} to ± {plain_number(100.0 * sigma, 2)} % (1 σ, worst axis)"
    return "Usable" + (f": {said}" if sigma else "") + (f": B, K and R contain {causes}" if causes else "")


def _next(noise: Noise) -> str:
    """Use of the terms; what is missing for terms in SI, or for those of slow noise."""
    longer = [LONGER] if noise.shows_white_alone else []
    if not all(customary(TermName.WHITE, axis.unit) for axis in noise.axes):
        return " ".join([*longer, SAY_COUNTS])
    if (actions := [f.action for f in noise.findings if f.code in IN_SLOW_NOISE]) or longer:
        return " ".join(longer or [f"Take N alone into a filter {LINES}.", *actions])
    has_walk = any(axis.terms[TermName.RATE_RANDOM_WALK].is_present for axis in noise.axes)
    return NEXT if has_walk else f"Take N into a filter {LINES}, for K its upper limit: a longer log measures it."


def _kalibr(noise: Noise) -> tuple[Block, ...]:
    """Kalibr's imu.yaml."""
    rows = kalibr_rows(noise)
    if len(rows) < 2:
        return (Paragraph(_NO_UNIT),)
    lines = ["# Kalibr's imu.yaml: one number for the axes of a sensor, their root mean square"]
    for key, words in rows.items():
        value, _, rest = words.partition("  ")
        lines.append(f"{key}: {value}  {rest if rest.startswith('#') else '# ' + rest.replace('  # ', ', ')}")
    return (Code("\n".join(lines)),)


def all_findings(noise: Noise) -> tuple[Finding, ...]:
    """Findings of the log, then those of each axis with its name."""
    named = [
        Finding(f.code, f.severity, f"{axis_in_print(axis.name)}: {f.seen}", f.cause, f.action, f.numbers)
        for axis in noise.axes
        for f in axis.findings
    ]
    return (*noise.findings, *named)


def _filtered(noise: Noise) -> list[tuple[str, str]]:
    """Upper end of the fit band, where a low-pass filter limits it."""
    limits = [
        f"{axis_in_print(axis.name)} {plain_number(axis.highest_hz, 3)} Hz"
        for axis in noise.axes
        for finding in axis.findings
        if finding.code == "spectrum-low-pass"
    ]
    return [("low-pass filtered", f"above {', '.join(limits)}; terms fitted below")] if limits else []


def _groups(noise: Noise) -> list[tuple[str, list[NoiseAxis]]]:
    """Axes by unit, in the order of the log."""
    groups: dict[tuple[str, str], list[NoiseAxis]] = {}
    for axis in noise.axes:
        groups.setdefault((axis.unit, axis.name.split()[0]), []).append(axis)
    return [(unit, axes) for (unit, _), axes in groups.items()]


def _value(term: NoiseTerm, factor: float = 1.0) -> str:
    if not term.is_present:
        return f"< {plain_number(factor * term.limit, 2)}"
    return with_sigma_and_power(factor * term.value, factor * term.sigma)


def _label(term: TermName, unit: str) -> str:
    return f"{term.value}  {term_in_words(term, unit)} [{unit_of(term, unit)}]"


def _terms_table(axes: list[NoiseAxis], unit: str) -> Table:
    rows = [(_label(term, unit), *(_value(axis.terms[term]) for axis in axes)) for term in TermName]
    processes = [axis.gauss_markov for axis in axes]
    if any(processes):
        sigmas = ("–" if p is None else with_sigma_and_power(p.sigma_process, p.sigma) for p in processes)
        times = ("–" if p is None else plain_number(p.correlation_time_s, 2) for p in processes)
        rows.append((f"   Gauss-Markov σ [{unit_in_print(unit)}]", *sigmas))
        rows.append(("   … correlation time [s]", *times))
    return _by_axis(axes, rows, "Noise terms ± standard uncertainty (1 σ); <: not seen, at most this (95 %)")


def _by_axis(axes: Sequence[NoiseAxis], rows: Sequence[tuple[str, ...]], caption: str) -> Table:
    """A column per axis."""
    return Table(("", *(axis_in_print(axis.name) for axis in axes)), tuple(rows), caption)


def _intervals_table(axes: list[NoiseAxis], unit: str) -> Table:
    terms = {term: [axis.terms[term] for axis in axes] for term in TermName}
    rows = [
        (_label(term, unit), *(f"{plain_number(one.lower)} … {plain_number(one.upper)}" for one in found))
        for term, found in terms.items()
    ]
    if any(axis.is_slow_noise_unresolved for axis in axes):
        words = ("not both 0" if axis.is_slow_noise_unresolved else "" for axis in axes)
        rows.append(("   B and K together", *words))
    caption = "95 % intervals with every other term free; they are valid whether a term is named or not"
    return _by_axis(axes, rows, caption)


def _answers_table(axes: list[NoiseAxis], unit: str) -> Table:
    printed = unit_in_print(unit)
    found = [axis.optimal_averaging() for axis in axes]
    rows = (
        ("best averaging time [s]", *(BEYOND if one is None else plain_number(one[0]) for one in found)),
        ("   95 % interval", *(_range_of(*axis.averaging_ends_s) for axis in axes)),
        (f"bias uncertainty then [{printed}]", *("–" if one is None else plain_number(one[1]) for one in found)),
        *(
            (
                f"σ of a mean of {window:g} s [{printed}]",
                *(
                    plain_number(math.sqrt(a.variance_of_mean(window)), 3) if window >= a.shortest_described_s else "–"
                    for a in axes
                ),
            )
            for window in (1.0, 10.0)
        ),
        ("longest averaging time with 25 % uncertainty [s]", *(plain_number(axis.longest_tau_s, 3) for axis in axes)),
        ("fit band [Hz]", *(f"{plain_number(a.lowest_hz, 2)} … {plain_number(a.highest_hz, 3)}" for a in axes)),
    )
    return _by_axis(axes, rows, "How long to average")


def _range_of(lower: float, upper: float) -> str:
    if math.isinf(upper):
        return f"above {plain_number(lower, 2)}" if math.isfinite(lower) else "–"
    return f"{plain_number(lower, 2)} … {plain_number(upper, 2)}"


def _lengths_table(noise: Noise, lengths: Mapping[str, Mapping[TermName, float | None]], accuracy: float) -> Table:
    def cell(axis: NoiseAxis, term: TermName) -> str:
        if not axis.terms[term].is_present:
            return "absent"
        seconds = lengths[axis.name][term]
        return "over a month" if seconds is None else duration(seconds)

    rows = tuple(
        (f"{term.value}  {TERM_WORDS[term]}", *(cell(axis, term) for axis in noise.axes))
        for term in TermName
        if any(axis.terms[term].is_present for axis in noise.axes)
    )
    caption = f"Recording length for an uncertainty of {100 * accuracy:g} % (1 σ)"
    return _by_axis(noise.axes, rows, caption)


def _customary(axes: list[NoiseAxis], unit: str) -> list[Block]:
    rows = []
    for term in TermName:
        found = customary(term, unit)
        if found is None:
            return [Paragraph(_NO_UNIT)]
        name, printed, factor = found
        rows.append((f"{term.value}  {name} [{printed}]", *(_value(axis.terms[term], factor) for axis in axes)))
        if term is TermName.WHITE and unit == "m/s^2":
            density = (_value(axis.terms[term], micro_g_from_m_s2(1.0)) for axis in axes)
            rows.append((f"{term.value}  noise density [µg/√Hz]", *density))
        if term is TermName.BIAS_INSTABILITY:
            # σ(τ) of flicker noise is sqrt(2 ln 2 / π) B at its minimum.
            scale = factor / math.sqrt(2 * math.log(2) / math.pi)
            lowest = (axis.optimal_averaging() for axis in axes)
            cells = ("–" if one is None else plain_number(scale * one[1]) for one in lowest)
            rows.append((f"   lowest deviation / 0.664 [{printed}]", *cells))
    return [_by_axis(axes, rows, f"{axes[0].name.rsplit(' ', 1)[0]}: IEEE 952 names, units of data sheets")]


def kalibr_rows(noise: Noise) -> dict[str, str]:
    """Kalibr's names with value and unit, one value per sensor."""
    rows: dict[str, str] = {}
    for unit, sensor, square in (("m/s^2", "accelerometer", "m/s²"), ("rad/s", "gyroscope", "rad/s")):
        axes = [axis for axis in noise.axes if axis.unit == unit]
        if not axes:
            continue
        for key, term, per in (
            ("noise_density", TermName.WHITE, "/√Hz"),
            ("random_walk", TermName.RATE_RANDOM_WALK, "/√s"),
        ):
            value, is_limit = of_axes([axis.terms[term] for axis in axes])
            if is_limit:
                per += ", upper limit on an axis"
            elif term is TermName.RATE_RANDOM_WALK and not noise.has_slow_noise_only:
                per += ", upper limit: it contains temperature or a turn"
            rows[f"{sensor}_{key}"] = f"{value:.{2 if is_limit else 4}g}  # {square}{per}"
    rows["update_rate"] = f"{noise.curve.rate_hz:.6g}  # Hz"
    return rows


def noise_picture(noise: Noise) -> Picture:
    """All curves of a log in one figure, a row for each sensor."""
    caption = "Allan deviation with its 95 % interval and the fitted sum (dashed) of the noise terms (thin): N is its "
    caption += "line at 1 s, K at 3 s, B 1.5 times its flat line. A mean is no better beyond the smallest deviation."
    return Picture("allan", caption, partial(allan_chart, noise.curve, _groups(noise)))


LEAST_SHARE = 1e-3
"""Smallest share of the variance, at any τ, of a part that is drawn: less is not visible in the sum."""
PARTS: dict[str, Colour] = {"Q": "warn", "N": "c1", "B": "c2", "K": "c3", "R": "accent"}
"""Colours of the terms; of other parts of the sum: soft."""


def allan_chart(curve: AllanCurve, groups: Sequence[tuple[str, Sequence[NoiseAxis]]]) -> Chart:
    """Curves of the sensors, unit and axes of each: a row of panels per sensor, one per axis with equal scales."""
    rows = [_panels(curve, unit, axes) for unit, axes in groups]
    return Chart(tuple(panel for row in rows for panel in row), columns=max(len(row) for row in rows))


def _panels(curve: AllanCurve, unit: str, axes: Sequence[NoiseAxis]) -> list[Panel]:
    chosen = [curve.names.index(axis.name) for axis in axes]
    seen = curve.deviation[:, chosen]
    low, high = float(np.nanmin(seen)), float(np.nanmax(seen))
    last_s = float(curve.tau_s[-1]) * 1.4
    x = Scale("averaging time τ [s]", "s", is_log=True, limits=(float(curve.tau_s[0]) / 1.4, last_s))
    printed = unit_in_print(unit)
    label = f"Allan deviation [{printed}]" if printed else "Allan deviation"
    y = Scale(label, printed, is_log=True, limits=(low / 2.5, high * 2.0) if high > low > 0 else None)
    return [
        Panel(x, y, _marks(curve, c, axis, last_s), title=axis_in_print(axis.name), height_px=270)
        for axis, c in zip(axes, chosen, strict=True)
    ]


def _marks(curve: AllanCurve, c: int, axis: NoiseAxis, last_s: float) -> tuple[Mark, ...]:
    good = np.isfinite(curve.deviation[:, c])
    tau = curve.tau_s[good]
    marks: list[Mark] = []
    if 0 < axis.longest_tau_s < last_s:
        marks.append(Span(axis.longest_tau_s, last_s, "uncertainty above 25 %", "grey"))
    marks.append(Band(tau, curve.lower[good, c], curve.upper[good, c], f"{100 * curve.confidence:g} % interval"))
    marks.append(Line(tau, curve.deviation[good, c], "Allan deviation", "ink"))
    if axis.sample_sigma > 0:
        marks += _parts(axis, curve)
    return tuple(marks)


def _parts(axis: NoiseAxis, curve: AllanCurve) -> list[Mark]:
    """Every visible part of the sum, the sum, and its smallest deviation."""
    tau = np.geomspace(curve.tau_s[0], curve.tau_s[-1], 240)
    total = axis.allan_variance(tau)
    marks: list[Mark] = [
        Line(tau, np.sqrt(variance), name, PARTS.get(name, "soft"), is_thin=True)
        for name, variance in axis.allan_parts(tau).items()
        if np.max(variance / total) >= LEAST_SHARE
    ]
    marks.append(Line(tau, np.sqrt(total), "their sum", "ink", is_dashed=True, is_thin=True))
    best = axis.optimal_averaging()
    if best is not None:
        tip = f"best averaging time {plain_number(best[0])} s: {plain_number(best[1])} {unit_in_print(axis.unit)}"
        marks.append(Points(np.array([best[0]]), np.array([best[1]]), [tip], None, "smallest deviation", "accent"))
    return marks
