"""A given model compared with a recording: parameters and noise that differ, and prediction errors by stage."""

import re
from collections.abc import Sequence

from trihedron.arrays import TINY
from trihedron.records.diagnosis import RELATIVE, Diagnosis, NoiseDifference, ParameterDifference, Stage
from trihedron.records.sessions import GEOMETRY, ONE_UNIT
from trihedron.report.axes import BIAS, TRIAD
from trihedron.report.document import Block, Facts, Paragraph, Table
from trihedron.report.findings import ranged
from trihedron.report.names import MEANING, id_in_print, label_of, term_in_print
from trihedron.report.numbers import (
    MINUS,
    capital,
    decimals_of,
    how_many,
    plain_number,
    shown,
    unit_in_print,
    with_sigma,
    with_unit,
)

CLEAR_SIGMAS = 3.0
"""Components of a differing group count for its size from this many σ; the most significant always does."""
MOST_NUMBERS, MOST_NOISE = 3, 2
"""Most clauses about parameters and about noise in a headline; a table lists all."""
LOGS = (".csv", ".npz", ".parquet")
"""Endings of a simulated log."""
_SENTENCES_FIRST = ("unit", "frame", "range", "rate")
"""Errors of every reading of a sensor, which come before its noise."""
_SIZE = re.compile(r"(?<![\w.])\d[\d.]*(?:e[+−-]?\d+)?")
_HEAD = ("parameter", "model", "recording", "recording − model", "p of its group")


def differing_blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    """The parameters that differ as a table; likely mistakes, and noise that differs, as sentences."""
    differing = [p for p in diagnosis.parameters if p.significant]
    rows = tuple(map(_row, differing))
    sentences = [*dict.fromkeys(p.remark for p in differing if p.remark), *differing_noise(diagnosis)]
    if not rows and not sentences:
        return (Paragraph("None of the given parameters differs beyond both uncertainties and bias drift."),)
    blocks: list[Block] = []
    if rows:
        blocks.append(Table(_HEAD, rows, f"Parameters of the groups that differ; {_defined(diagnosis)}"))
    if sentences:
        blocks.append(Facts(tuple(("", one) for one in sentences)))
    return tuple(blocks)


def differing_in_short(diagnosis: Diagnosis) -> list[str]:
    """Differences for one sentence: groups of parameters and noise, the most significant first, others counted."""
    # A sentence about noise as a clause is cut at its first semicolon.
    clauses = {
        said: (together[0].lower() + together[1:]).split("; ")[0].rstrip(".")
        for said, together in _noise_in_words(diagnosis).items()
    }
    whole = [clauses[_sentence(n)] for n in _noise_that_differs(diagnosis) if n.term in _SENTENCES_FIRST]
    noise = list(dict.fromkeys([*whole, *clauses.values()]))
    numbers = groups_in_short(diagnosis.parameters)
    # Together with parameters, only noise terms that affect every reading of a sensor are listed.
    named = (whole if numbers else noise)[:MOST_NOISE]
    left, quieter = len(numbers) - MOST_NUMBERS, len(noise) - len(named)
    more = [f"{left} more"] if left > 0 else []
    more += [f"{how_many(quieter, 'figure')} of noise and sampling"] if quieter else []
    return [*numbers[:MOST_NUMBERS], *named, *more]


def of_another_device(diagnosis: Diagnosis, model: str) -> str:
    """Advice where a calibration file, the ``model``, or a log made with one differs in what one unit keeps."""
    off = [p for p in diagnosis.parameters if p.significant] if model.endswith((".json", *LOGS)) else []
    why = "its axes have other directions" if any(p.id in GEOMETRY for p in off) else ""
    if not why and any(p.id.endswith("-scale") and abs(p.difference) > ONE_UNIT for p in off):
        why = f"scales of one unit repeat within {100.0 * ONE_UNIT:g} %"
    which = "Check that the" if model.endswith(".json") else "If it is a digital twin, check that its"
    return f"{which} calibration is of this sensor: {why}. " if why else ""


def groups_in_short(parameters: Sequence[ParameterDifference]) -> list[str]:
    """Groups that differ, the most significant first, each with the largest of its components that clearly do."""
    groups: dict[str, list[ParameterDifference]] = {}
    for p in sorted(parameters, key=lambda p: p.p_value):
        if p.significant:
            groups.setdefault(p.id, []).append(p)
    said = []
    for name, members in groups.items():
        least = min(CLEAR_SIGMAS, max(map(_in_sigmas, members)))
        largest = max((p for p in members if _in_sigmas(p) >= least), key=lambda p: abs(p.difference))
        scale, unit = in_print(largest)
        size = with_unit(plain_number(abs(scale * largest.difference), 2), unit)
        said.append(f"{id_in_print(name)} by {'up to ' if len(members) > 1 else ''}{size}")
    return said


def _in_sigmas(p: ParameterDifference) -> float:
    return abs(p.difference) / max(p.std, TINY)


def _noise_that_differs(diagnosis: Diagnosis) -> list[NoiseDifference]:
    return [n for n in diagnosis.noise_compared if n.significant]


def _sentence(n: NoiseDifference) -> str:
    said = n.remark or f"{_sensor(n)} {term_in_print(n.term)} is {_ratio(n)} times the recording's"
    return capital(said).rstrip(".") + "."


def differing_noise(diagnosis: Diagnosis) -> list[str]:
    """One sentence per figure of noise or sampling that differs; axes that differ in size only are merged."""
    return list(dict.fromkeys(_noise_in_words(diagnosis).values()))


def _noise_in_words(diagnosis: Diagnosis) -> dict[str, str]:
    """For every sentence the merged one of all sentences that differ from it in a single number."""
    alike: dict[str, list[str]] = {}
    for said in dict.fromkeys(map(_sentence, _noise_that_differs(diagnosis))):
        # Sentences with several numbers state a band or an interval, and are not merged.
        alike.setdefault(_SIZE.sub("", said) if len(_SIZE.findall(said)) == 1 else said, []).append(said)
    return {said: ranged(same) or said for same in alike.values() for said in same}


def numbers_blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    """The parameters of the model that agree with the recording's; the others have a table of their own."""
    agreeing = sorted((p for p in diagnosis.parameters if not p.significant), key=lambda p: (p.p_value, p.id))
    if not agreeing:
        return ()
    return (Table(_HEAD, tuple(map(_row, agreeing)), f"Parameters of the groups that agree; {_defined(diagnosis)}"),)


def _defined(diagnosis: Diagnosis) -> str:
    """Sign of a bias, meaning of the triad alignment, unit of the scales of each sensor."""
    sensors = (
        ("accelerometer", "m/s²", diagnosis.baseline.accelerometer),
        ("gyro", "rad/s", diagnosis.baseline.gyroscope),
    )
    raws = [(name, si, unit_in_print(model["raw_unit"])) for name, si, model in sensors if model is not None]
    units = [f"{name} scale {'dimensionless' if raw == si else f'in {raw} per {si}'}" for name, si, raw in raws]
    return f"a bias is {BIAS}; {TRIAD}; {', '.join(units)}"


def _row(p: ParameterDifference) -> tuple[str, ...]:
    values = (_value(p, p.model), _value(p, p.recording), _difference(p))
    return label_of(p.id, p.name), *values, plain_number(p.p_value, 2)


def noise_blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    """Noise and sampling of the model beside the recording's."""
    rows = tuple(
        (
            f"{_sensor(n)} {n.axis.upper()}".strip(),
            f"{n.band_hz[0]:g} to {n.band_hz[1]:g} Hz" if n.band_hz else term_in_print(n.term),
            _ratio(n),
            "differs" if n.significant else "agrees",
            *("–" if value is None else plain_number(value) for value in (n.model, n.recording)),
            unit_in_print(n.unit),
        )
        for n in diagnosis.noise_compared
    )
    head = ("sensor", "term", "ratio (interval)", "judged", "model", "recording", "unit")
    return (Table(head, rows, "Noise and sampling of the model and of the recording"),)


def stages_blocks(diagnosis: Diagnosis) -> tuple[Block, ...]:
    """Prediction errors by stage: one equal to the one before has no column, a domain that none changes no row."""
    stages = [one for k, one in enumerate(diagnosis.stages) if not k or one.domains != diagnosis.stages[k - 1].domains]
    units = {d.domain: shown(d.unit)[1] for stage in stages for d in stage.domains}
    cells = {domain: [_stage(stage, domain) for stage in stages] for domain in units}
    changed = [d for d in units if len(stages) == 1 or len(set(cells[d])) > 1]
    rows = tuple((f"{MEANING[d]} [{units[d]}]", *cells[d]) for d in changed)
    if not rows:
        return (Paragraph("No stages: the model was fitted to this recording."),)
    kept = {stage.stage for stage in stages}
    same = [stage.stage for stage in diagnosis.stages if stage.stage not in kept]
    caption = (
        "Cross-validated rms after each stage, in brackets predictive χ²/dof by the noise that each stage's own model "
    )
    caption += "needs (1 by it and uncertainty alone)"
    caption += f"; stages without change: {', '.join(same)}" if same else ""
    unchanged = [MEANING[d] for d in units if d not in changed]
    caption += f"; the same in every stage: {', '.join(unchanged)}" if unchanged else ""
    return (Table(("rms", *(stage.stage.replace("-", " ") for stage in stages)), rows, caption),)


def _stage(stage: Stage, domain: str) -> str:
    for d in stage.domains:
        if d.domain == domain:
            rms = plain_number(shown(d.unit)[0] * d.rms)
            return rms if d.chi2_per_dof is None else f"{rms} ({plain_number(d.chi2_per_dof)})"
    return "–"


def in_print(p: ParameterDifference) -> tuple[float, str]:
    """Factor from SI and unit for differences of this kind."""
    return _unit(p, is_difference=True)


def _difference(p: ParameterDifference) -> str:
    scale, unit = in_print(p)
    text = with_sigma(scale * p.difference, scale * p.std)
    return with_unit(("" if text.startswith(MINUS) else "+") + text, unit)


def _value(p: ParameterDifference, value: float) -> str:
    scale, unit = _unit(p, is_difference=False)
    sigma = p.std * abs(value) if p.id in RELATIVE else scale * p.std
    if not 0.0 < sigma < float("inf"):
        # Exact.
        return with_unit(plain_number(scale * value, 6), unit)
    places = decimals_of(sigma)
    # Adding 0.0 turns -0.0 into 0.0.
    return with_unit(f"{round(scale * value, places) + 0.0:.{places}f}".replace("-", MINUS), unit)


def _unit(p: ParameterDifference, *, is_difference: bool) -> tuple[float, str]:
    """Factor from SI and customary unit for a parameter of this kind."""
    is_relative = is_difference and p.id in RELATIVE
    return (1.0, "") if p.unit == "1" and not is_relative else shown(p.unit)


def _sensor(n: NoiseDifference) -> str:
    return {"gyroscope": "gyro", "both": "sampling"}.get(n.sensor, n.sensor)


def _ratio(n: NoiseDifference) -> str:
    if n.ratio is None:
        return "–"
    words = plain_number(n.ratio)
    return words if n.interval is None else f"{words} ({plain_number(n.interval[0])} to {plain_number(n.interval[1])})"
