"""Report of filter noise."""

from typing import Any

from trihedron.arrays import XYZ
from trihedron.records.filter_noise import RANKED_S, Bounded, FilterNoise, IntervalCheck, SensorFilterNoise, Share
from trihedron.records.plain import as_plain
from trihedron.report.document import Block, Document, Facts, Section, Table, action_in_words
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.frames import Columns, of_rows
from trihedron.report.numbers import capital, how_many, listed, plain_number, unit_in_print, with_unit
from trihedron.sanitise import escaped
from trihedron.units import degrees_from_radians

OF_SENSOR = {
    "gyroscope": (degrees_from_radians(1.0), "°", "attitude error"),
    "accelerometer": (1.0, "m/s", "velocity error"),
}
NEXT = "Put these values into your filter: add `--to kalibr -o imu.yaml` (other targets: `trihedron noise --help`)."
OF_ONE = (
    "Put N and K of the table into your filter; for a file of both sensors (`trihedron noise --help`) give a reference "
    "with positions."
)
"""Targets need both sensors; a reference of attitudes shows the gyro alone."""
CAUSE_WORDS = {
    "static": ("static noise", "a better sensor; nothing else"),
    "vibration": ("vibration", "dampers at the mount, a low-pass filter on the sensor, a higher rate"),
    "bias": ("bias random walk", "warm up; log the temperature and calibrate it"),
    "temperature": ("temperature", "trihedron calibrate with a logged temperature: none of it goes into N or K"),
    "calibration": ("residual calibration error", "trihedron calibrate: none of it goes into N or K"),
    "g-sensitivity": ("g-sensitivity", "trihedron calibrate with known motion: none of it goes into N or K"),
    "reference": ("error of the reference", "a better reference: none of it goes into N or K"),
}
"""Words for every cause, and measures that reduce its share."""
OWN_REST = "the longest static interval of this log"
TERMS = {"N": "white noise N", "K": "bias random walk K"}


def filter_noise_report(found: FilterNoise) -> Document:
    """Lay out filter noise: values, shares, the cross-validation on the other half."""
    tables: list[Block] = [values_table(found)]
    tables += [Facts(facts)] if (facts := _facts(found)) else []
    sections = [Section("N and K", tuple(tables))]
    shares: list[Block] = [block for one in found.sensors if one.shares for block in _shares(one)]
    if shares:
        sections.append(Section("What the error is made of", tuple(shares)))
    tested = [one for one in found.sensors if one.consistency]
    if tested:
        heading = "Cross-validation: the second half predicted from the first"
        sections.append(Section(heading, tuple(map(_tested, tested))))
    sections.append(Section("Findings", (findings_block(found.findings),)))
    # Where a calibration removes most of the error, it comes first.
    uncalibrated = (action_in_words(f) for f in found.findings if f.code == "filter-noise-uncalibrated")
    return Document(
        title="Noise for your filter",
        subtitle=escaped(found.source),
        verdict=verdict_of(found.findings, _good(found), "Usable" + _predicted(found), "NOT TO BE TRUSTED"),
        sections=tuple(sections),
        next_step=next(uncalibrated, NEXT if len(found.sensors) == 2 else OF_ONE) if found.is_trustworthy else "",
    )


def _good(found: FilterNoise) -> str:
    """The largest cause of each sensor's error, where no problem was found."""
    largest = [
        f"{CAUSE_WORDS[share.cause][0]} is {plain_number(100.0 * share.share.value, 2)} % of the {one.sensor}'s error "
        f"over {share.horizon_s:g} s"
        for one in found.sensors
        if one.shares and not (share := _ranked(one)[0]).share.is_limit
    ]
    return f"OK: no problems found; {listed(largest)}." if largest else "OK: no problems found."


def _predicted(found: FilterNoise) -> str:
    """How well N and K predict each sensor's error over the longest horizon; empty without a cross-validation."""
    said = []
    for one in (sensor for sensor in found.sensors if sensor.consistency):
        last, (factor, unit, what) = one.consistency[-1], OF_SENSOR[one.sensor]
        sizes = [with_unit(plain_number(factor * size, 2), unit) for size in (last.predicted, last.actual)]
        said.append(f"{what} over {last.horizon_s:g} s predicted {sizes[0]}, was {sizes[1]}")
    own = " (the reference's own error included)" if any(one.reference is not None for one in found.sensors) else ""
    return f": {'; '.join(said)}{own}" if said else ""


def _terms(one: SensorFilterNoise) -> tuple[tuple[str, str, Bounded, Bounded | None], ...]:
    """Name and unit of N and K, their values for the filter and in static poses."""
    static = one.static
    return (
        ("N", "/√Hz", one.N, None if static is None else static.N),
        ("K", "/√s", one.K, None if static is None else static.K),
    )


def values_table(found: FilterNoise) -> Table:
    """N and K of each sensor, static values and the factor between them."""
    rows = []
    for one in found.sensors:
        unit = unit_in_print(one.unit)
        for name, per, value, static in _terms(one):
            beside = "–" if static is None else _number(static)
            label = f"{one.sensor} {name} [{unit}{per}]"
            rows.append((label, _number(value), _interval(value), beside, _factor(value, static)))
        rows += [
            (f"{one.sensor} N, {axis} [{unit}/√Hz]", _number(n), _interval(n), "–", "–")
            for axis, n in zip(XYZ, one.axes_N, strict=False)
        ]
    head = ("", "for the filter", "95 % interval", "static", "factor")
    caption = "White density N, random walk K; the files of --to hold the column 'for the filter'"
    by_axis = ", N by axis where their format has one" if any(one.axes_N for one in found.sensors) else ""
    return Table(head, tuple(rows), caption + by_axis)


def _number(one: Bounded) -> str:
    return f"below {plain_number(one.upper)}" if one.is_limit else plain_number(one.value)


def _interval(one: Bounded) -> str:
    return "–" if one.is_limit else f"{plain_number(one.lower)} … {plain_number(one.upper)}"


def _factor(value: Bounded, static: Bounded | None) -> str:
    if static is None or static.is_limit or value.is_limit or static.value <= 0.0:
        return "–"
    return plain_number(value.value / static.value)


def _facts(found: FilterNoise) -> tuple[tuple[str, str], ...]:
    # Without a reference the values are those of the log's rest.
    part = "" if found.reference_source else "the longest static interval of "
    facts = [("for the filter", f"from {part}{escaped(found.source)}{_of_static(found)}")]
    if any(one.static is not None for one in found.sensors):
        facts.append(("static", f"from {escaped(found.static_source) or OWN_REST}"))
    if found.reference_source:
        facts.append(("reference", escaped(found.reference_source)))
    for one in found.sensors:
        if one.bias.kind == "gauss-markov":
            sigma, tau = plain_number(one.bias.sigma), plain_number(one.bias.correlation_time_s)
            facts.append((f"{one.sensor} bias", f"Gauss-Markov, σ {sigma} {unit_in_print(one.unit)}, τ {tau} s"))
        if one.reference is not None:
            slow = degrees_from_radians(one.reference.slow.filter_value)
            word = "below " if one.reference.slow.is_limit else ""
            said = f"drifts by {word}{plain_number(slow, 2)}° within {plain_number(one.reference.slow_s, 2)} s"
            facts.append((f"its error, seen by the {one.sensor}", said))
    if found.tilt is not None:
        tilt = found.tilt
        actual, predicted = (plain_number(degrees_from_radians(v), 2) for v in (tilt.actual, tilt.predicted))
        said = (
            f"{actual}° rms over {how_many(tilt.n, 'move')}; static noise predicts {predicted}° (residual calibration "
        )
        said += "error, vibration and bias are in the difference; the heading is not seen)"
        facts.append(("tilt error after a rotation", said))
    if found.intervals is not None:
        gyro = found.sensor("gyroscope")
        is_limit = gyro is not None and gyro.static is not None and gyro.static.K.is_limit
        facts += _of_intervals(found.intervals, is_limit=is_limit)
    return tuple(facts)


def _of_static(found: FilterNoise) -> str:
    """Whose K comes from the static log, whose interval bounds it better than that of this log."""
    named: list[str] = [one.sensor for one in found.sensors if one.static and one.K == one.static.K]
    return f"; K of the {listed(named)} from {escaped(found.static_source)}" if named and found.static_source else ""


def _of_intervals(intervals: IntervalCheck, *, is_limit: bool) -> list[tuple[str, str]]:
    change, predicted = (plain_number(degrees_from_radians(v), 2) for v in (intervals.bias_change, intervals.predicted))
    spread = plain_number(100.0 * intervals.gravity_spread, 2)
    bias = f"changes by {change} °/s rms; static N and K predict {'at most ' if is_limit else ''}{predicted} °/s "
    bias += "(temperature and g-sensitivity are in the difference)"
    gravity = f"differs by {spread} % rms over {intervals.n} (residual calibration error of the accelerometer)"
    return [("bias between static intervals", bias), ("gravity in static intervals", gravity)]


def _shares(one: SensorFilterNoise) -> tuple[Table, Facts]:
    horizons = sorted({share.horizon_s for share in one.shares})
    by = {(share.cause, share.horizon_s): share.share for share in one.shares}
    ranked = _ranked(one)
    rows = tuple((CAUSE_WORDS[s.cause][0], *(_percent(by[s.cause, h]) for h in horizons)) for s in ranked)
    head = (f"share of the {one.sensor}'s error", *(f"{plain_number(h)} s [%]" for h in horizons))
    # Measures that reduce the three largest shares.
    named = (CAUSE_WORDS[share.cause] for share in ranked[:3] if share.share.upper > 0.0)
    advice = Facts(tuple((f"less {cause}", action) for cause, action in named))
    caption = f"Shares of the mean square error with 95 % intervals, the largest over {ranked[0].horizon_s:g} s first; "
    caption += "each is estimated by itself: they need not add up to 100 %"
    return Table(head, rows, caption), advice


def _percent(one: Bounded) -> str:
    if one.upper == 0.0:
        return "none"
    value, lower, upper = (plain_number(100 * share, 2) for share in (one.value, one.lower, one.upper))
    return f"below {upper}" if one.is_limit else f"{value} ({lower} … {upper})"


def _ranked(one: SensorFilterNoise) -> list[Share]:
    """Shares at ``RANKED_S`` (or the nearest horizon), the largest first, upper limits last."""
    near = min({share.horizon_s for share in one.shares}, key=lambda h: abs(h - RANKED_S))
    return sorted(
        (s for s in one.shares if s.horizon_s == near), key=lambda s: (s.share.is_limit, -s.share.filter_value)
    )


def _tested(one: SensorFilterNoise) -> Block:
    factor, unit, what = OF_SENSOR[one.sensor]
    rows = tuple(
        (
            plain_number(c.horizon_s), str(c.n_apart), plain_number(c.nees, 2),
            plain_number(factor * c.predicted), plain_number(factor * c.actual),
            "–" if c.static_nees is None else plain_number(c.static_nees, 2),
            "–" if c.static_predicted is None else plain_number(factor * c.static_predicted),
        )
        for c in one.consistency
    )  # fmt: skip
    effective = ("horizon [s]", "stretches", "NEES", f"predicted [{unit}]", f"actual [{unit}]")
    head = (*effective, "NEES, static", f"static [{unit}]")
    caption = f"{capital(what)}. NEES, its square over the predicted variance, is 3 where N and K are right"
    has_static = any(c.static_nees is not None for c in one.consistency)
    caption += "; static: static N and K, reference taken as exact" if has_static else ""
    return Table(head, rows, caption)


def filter_noise_record(found: FilterNoise) -> dict[str, Any]:
    """The content of the report for JSON, in SI."""
    return {
        "source": found.source,
        "reference": found.reference_source,
        **{name: getattr(found, name) for name in ("rate_hz", "band_hz", "duration_s")},
        "sensors": [as_plain(one) for one in found.sensors],
        "tilt": None if found.tilt is None else as_plain(found.tilt),
        "intervals": None if found.intervals is None else as_plain(found.intervals),
        "findings": [finding.to_dict() for finding in found.findings],
    }


def filter_noise_columns(found: FilterNoise) -> Columns:
    """A row per sensor and term: value for the filter, interval, whether it is a limit, static value, unit."""
    rows = []
    for one in found.sensors:
        for term, per, value, static in _terms(one):
            sizes = (value.filter_value, value.lower, value.upper, value.is_limit)
            rows.append((one.sensor, term, *sizes, None if static is None else static.filter_value, one.unit + per))
    return of_rows(("sensor", "term", "value", "lower", "upper", "is_limit", "static", "unit"), rows)
