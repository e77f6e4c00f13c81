"""A diagnosis in words: the verdict, where it disagrees, and residuals in customary units."""

import numpy as np

from trihedron.records import Calibration, Finding, Severity
from trihedron.records.diagnosis import AcceptedEffect, Diagnosis
from trihedron.records.domains import DOMAINS, DomainTest, HeldOut, not_explained
from trihedron.records.sessions import GEOMETRY
from trihedron.report.diagnosis_numbers import differing_in_short
from trihedron.report.document import Level
from trihedron.report.findings.wording import opening
from trihedron.report.names import MEANING, channel_in_print, id_in_print, variable_in_print
from trihedron.report.numbers import (
    engineering_exponent,
    listed,
    plain_number,
    shown,
    unit_in_print,
    unit_with_power,
    with_sigma,
    with_unit,
)
from trihedron.report.verification import imprecise
from trihedron.units import STANDARD_GRAVITY_M_S2, degrees_from_radians

LEVELS: dict[str, Level] = {
    "consistent": "good",
    "parameters-differ": "usable",
    "missing-physics": "usable",
    "not-testable": "usable",
    "unexplained": "bad",
}
"""Colour of each verdict: good only if consistent, bad if the disagreement has no explanation."""

_CHANNELS = {"a": "accelerometer ", "g": "gyro "}
_PLAIN = {"1": "", "raw": "", "sigma": "σ"}
"""Units without another one in print."""
MOSTLY = 0.5
"""Share of the misfit from which an effect is not of little effect."""
MOST_NAMED = 4
IN_FULL = ("axis-handedness",)
"""Effects whose statement names what is wrong in the log: a verdict states it."""
STATED = (*IN_FULL, "disturbed-pose", "dropped-samples", "earth-rate")
"""Effects that a verdict states by their statement: it says where in the log, or that the log lacks them."""
NOT_JUDGED = "not judged"
LACKS = "lacks effect"
OF_SAMPLES = ("within-static", "timing", "rate")
"""Domains that need no poses."""


def whole_verdict(diagnosis: Diagnosis) -> str:
    """The verdict, after the first serious finding of the log's own calibration, which the diagnosis began with."""
    serious, said = own_serious(diagnosis), verdict_in_words(diagnosis)
    if serious is None:
        return said
    whose = "log's own calibration" if getattr(diagnosis, "model_is_given", False) else "calibration without effects"
    if diagnosis.verdict == "not-testable":
        return f"{said} The {whose} is not to be trusted: {opening(serious.seen)}."
    # A fit that is not to be trusted may agree with its own poses.
    said = "No missing effect is detectable." if diagnosis.verdict == "consistent" else said
    return f"NOT TO BE TRUSTED, by the {whose}: {opening(serious.seen)}. {said}"


def verdict_in_words(diagnosis: Diagnosis) -> str:
    """The verdict and its reasons in one sentence."""
    off: list[str] = [MEANING[d.domain] for d in diagnosis.domains if d.disagrees]
    ends = {MEANING[d.domain]: follows(diagnosis, d) for d in diagnosis.remaining if d.disagrees}
    left = [name for name, followed in ends.items() if not followed]
    numbers = differing_in_short(diagnosis)
    missing = [*dict.fromkeys(_sized(e) for e in diagnosis.effects if e.side == "recording" and e.id not in STATED)]
    if diagnosis.verdict == "consistent":
        beside = " with a reference that is not independent of this gyro" if dependent(diagnosis) else ""
        but = "".join(f"; but {_clause(opening(one.seen))}" for one in imprecise(findings_of(diagnosis))[:1])
        return (
            f"CONSISTENT{beside}: the model and its noise explain this recording; no missing effect is detectable"
            f"{_footnotes(diagnosis)}{_not_compared(diagnosis)}{but}."
        )
    if diagnosis.verdict == "unexplained":
        named = named_effects(diagnosis, "recording")
        return _unexplained(diagnosis, (list(ends) or off) if named else off, named)
    if diagnosis.verdict == "not-testable":
        searched = "; no effect was found in what it shows" if diagnosis.domains else ""
        return f"NOT TESTABLE: this recording has too few poses for a diagnosis{searched}."
    if diagnosis.verdict == "parameters-differ":
        beside = _footnotes(diagnosis) + _not_compared(diagnosis)
        return f"PARAMETERS DIFFER: {listed(numbers)}; no effect is missing{beside}."
    surplus = named_effects(diagnosis, "model")
    still = [f"{listed(left)} still {_disagree(left)}"] if left else []
    still += [
        f"{name} agrees by χ², yet {followed} (empirical relation)" for name, followed in ends.items() if followed
    ]
    tail = "".join(f"; {one}" for one in still) or _untested(diagnosis) or _else(diagnosis)
    is_other = any(p.significant and p.id in GEOMETRY for p in diagnosis.parameters)
    said = [_clause(opening(effect.statement)) for effect in diagnosis.effects if effect.id in STATED]
    if missing:
        said.append(f"the model lacks {listed(missing)}{_temperatures(diagnosis)}")
    if surplus:
        said.append(f"the model has {listed(surplus)}, which the recording lacks")
    if numbers:
        # What the package fixes differs before all else: a calibration of another device has any effect missing.
        said = [listed(numbers), *said] if is_other else [*said, f"parameters differ ({listed(numbers)})"]
    return f"{'PARAMETERS DIFFER AND PHYSICS IS MISSING' if is_other else 'MISSING PHYSICS'}: {'; '.join(said)}{tail}."


def poses_disagree(diagnosis: Diagnosis) -> bool:
    """Whether poses or rotations disagree with the model without effects."""
    return any(d.disagrees for d in diagnosis.domains if d.domain not in OF_SAMPLES)


def may_be_used(diagnosis: Diagnosis) -> bool:
    """Whether S and b fitted to the log alone are as good as its noise, whatever effects were found in it."""
    is_of_log = not getattr(diagnosis, "model_is_given", False) and not diagnosis.parameters
    return is_of_log and not poses_disagree(diagnosis)


def _else(diagnosis: Diagnosis) -> str:
    """What agrees: S and b too where poses and rotations do without the effects."""
    return "; errors of poses and rotations are within noise" if may_be_used(diagnosis) else "; nothing else disagrees"


def _temperatures(diagnosis: Diagnosis) -> str:
    """Between which temperatures a thermal effect was seen; empty without one."""
    recording = getattr(diagnosis, "recording", None)
    degc = None if recording is None else recording.temperature_degc
    if degc is None or not any("thermal" in effect.id for effect in diagnosis.effects):
        return ""
    return f", between {plain_number(float(np.nanmin(degc)), 2)} and {plain_number(float(np.nanmax(degc)), 2)} °C"


def _sized(effect: AcceptedEffect) -> str:
    """An effect by name with its largest parameter."""
    name = id_in_print(effect.id)
    alike = [p.value for p in effect.parameters if p.unit == effect.parameters[0].unit]
    if not alike:
        return name
    largest = alike[0] if len(alike) == 1 else max(map(abs, alike))
    scale, unit = parameter_unit(effect.parameters[0].unit, abs(largest))
    if unit.startswith("10"):
        scale, unit = parameter_unit(effect.parameters[0].unit, 1.0)
    return f"{name} ({'up to ' if len(alike) > 1 else ''}{with_unit(plain_number(scale * largest), unit)})"


def _unexplained(diagnosis: Diagnosis, off: list[str], named: list[str]) -> str:
    """The verdict on residuals ``off`` that the effects ``named`` do not explain."""
    at = next((one.where.segments for one in diagnosis.remaining if one.disagrees and one.where.segments), ())
    most_in = f" (most in {listed([*at])})" if 0 < len(at) < MOST_NAMED else ""
    text = f"UNEXPLAINED: {listed(off) if off else 'the recording'} {_disagree(off)} with the model{most_in}, and no "
    text += "known effect explains"
    if named:
        shares = [one.share for one in diagnosis.effects if one.side in ("", "recording") and one.share is not None]
        most = sum(shares) if len(shares) == len(named) else 0.0
        whole, size = ("all of it", "most of the misfit") if most > MOSTLY else ("it", "of little effect")
        text += f" {whole} (found, {size}: {listed(named)})"
    else:
        text += " it"
    if diagnosis.relations:
        # Those of the largest relation first.
        names = list(dict.fromkeys(variable_in_print(name) for one in diagnosis.relations for name in one.depends_on))
        more = f" and {len(names) - MOST_NAMED} more" if len(names) > MOST_NAMED else ""
        text += f": the misfit follows {listed(names[:MOST_NAMED])}{more}"
    numbers = differing_in_short(diagnosis)
    return text + (f"; parameters differ too ({listed(numbers)})." if numbers else ".")


def named_effects(diagnosis: Diagnosis, side: str = "") -> list[str]:
    """Effects of one ``side``, or of both, in words and each once."""
    return list(dict.fromkeys(id_in_print(one.id) for one in diagnosis.effects if side in ("", one.side)))


def _untested(diagnosis: Diagnosis) -> str:
    """A remark where the poses do not determine the model, so that little can disagree with it; else empty."""
    own = getattr(diagnosis, "calibration", None)
    seen = None if own is None or own.accelerometer is None else own.accelerometer.observability
    is_open = seen is not None and seen.rank < seen.n_parameters and not getattr(diagnosis, "model_is_given", False)
    return "; the poses are too few to test the rest" if is_open else ""


def _clause(sentence: str) -> str:
    return sentence[:1].lower() + sentence[1:]


def _disagree(subjects: list[str]) -> str:
    return "disagree" if len(subjects) > 1 else "disagrees"


def level_of(diagnosis: Diagnosis) -> Level:
    """The colour of the verdict: bad where the log's own calibration is not to be trusted; consistency is not good
    where the reference was computed from these readings, or where the given calibration is imprecise."""
    if own_serious(diagnosis) is not None:
        return "bad"
    is_weak = bool(dependent(diagnosis) or imprecise(findings_of(diagnosis)))
    return "usable" if diagnosis.verdict == "consistent" and is_weak else LEVELS[diagnosis.verdict]


def findings_of(diagnosis: Diagnosis) -> tuple[Finding, ...]:
    """Findings beside a diagnosis; empty where it is the record alone."""
    return getattr(diagnosis, "findings", ())


def dependent(diagnosis: Diagnosis) -> str:
    """The action for a reference that is not independent; empty where it is or there is none."""
    return next((str(f.action) for f in findings_of(diagnosis) if f.code == "reference-not-independent"), "")


def own_serious(diagnosis: Diagnosis) -> Finding | None:
    """The first serious finding of the calibration that the log itself gives, unless the effects explain it."""
    name = "updated" if getattr(diagnosis, "model_is_given", False) else "calibration"
    return serious_beside(diagnosis, getattr(diagnosis, name, None))


def serious_beside(diagnosis: Diagnosis, own: Calibration | None) -> Finding | None:
    """The first serious finding of a log's ``own`` calibration that the effects of its diagnosis do not explain."""
    findings = () if own is None else own.findings
    if diagnosis.verdict == "missing-physics" and not getattr(diagnosis, "model_is_given", False):
        findings = not_explained(findings, diagnosis.remaining)
    return next((one for one in findings if one.severity is Severity.SERIOUS), None)


def _not_compared(diagnosis: Diagnosis) -> str:
    """A remark where the gyro was not compared; else empty."""
    found = findings_of(diagnosis)
    is_out = any(f.code == "gyroscope-left-out" for f in found)
    return "; the gyro was not compared" if is_out else ""


def _footnotes(diagnosis: Diagnosis) -> str:
    """A remark on minor effects: a disturbed pose, a weak spectral line."""
    named = named_effects(diagnosis)
    return f" (also found: {listed(named)})" if named else ""


def quantity(held: HeldOut) -> str:
    """The quantity of a cross-validated figure; effects on the acceleration during rotations are judged by that."""
    is_acceleration = (held.domain, held.unit) == ("dynamics", "m/s^2")
    return "acceleration during rotations" if is_acceleration else MEANING[held.domain]


def judged_in_words(diagnosis: Diagnosis, test: DomainTest) -> str:
    """Whether a domain agrees; in a log of too few poses χ² of poses is searched for effects, not judged."""
    is_open = diagnosis.verdict == "not-testable" and test.domain not in OF_SAMPLES
    # A domain of samples agrees by an effect, which the model may have too, where its own test does not.
    is_by_effect = test.domain in OF_SAMPLES and test.p_value < diagnosis.alpha / len(DOMAINS)
    # χ² of a whole domain may agree though an effect improves its prediction, as where few poses are disturbed.
    named = {one.held_out[0].domain for one in diagnosis.effects if one.held_out and one.side != "model"}
    agrees = "explained" if is_by_effect else LACKS if test.domain in named else "agrees"
    return "disagrees" if test.disagrees else NOT_JUDGED if is_open else agrees


def follows(diagnosis: Diagnosis, after: DomainTest) -> str:
    """What a domain follows by an empirical relation where χ² itself agrees with noise; else empty."""
    if not after.disagrees or after.limit is not None or after.domain in OF_SAMPLES:
        return ""
    alike = [one for one in diagnosis.relations if one.held_out and one.held_out.domain == after.domain]
    names = dict.fromkeys(variable_in_print(name) for one in alike for name in one.depends_on)
    return f"follows {listed(list(names))}" if names else ""


def is_explained(before: DomainTest, after: DomainTest) -> bool:
    """Whether an effect explains a residual that it leaves unchanged: disturbed poses, a spectral line."""
    return before.disagrees and not after.disagrees and after.chi2_per_dof == before.chi2_per_dof


def rms_in_words(test: DomainTest) -> str:
    return size_in_words(test.rms, test.unit) if test.unit else "–"


def size_in_words(value: float, unit: str) -> str:
    """A residual in the customary unit of its kind."""
    factor, printed = (1.0, _PLAIN[unit]) if unit in _PLAIN else shown(unit)
    return with_unit(plain_number(factor * value), printed)


def parameter_unit(unit: str, largest: float) -> tuple[float, str]:
    """Factor and unit for parameters of an effect whose largest is ``largest``: rates in °/s, a power of ten where
    numbers are small or large."""
    factor, printed = 1.0, {"deg": "°", "1": ""}.get(unit, unit_in_print(unit))
    if unit.startswith(("rad/s", "(rad/s)")):
        factor, printed = degrees_from_radians(1.0), printed.replace("rad", "°", 1)
    if unit == "(rad/s)/(m/s^2)":
        factor, printed = factor * STANDARD_GRAVITY_M_S2, "°/s/g"  # as data sheets state a g-sensitivity
    exponent = engineering_exponent(factor * largest)
    if printed == "°" or -3 < exponent <= 3 or (printed in ("°/s", "°/s/g") and exponent == -3):
        exponent = 0
    return factor * 10.0**-exponent, unit_with_power(exponent, printed)


def parameter_in_words(value: float, unit: str) -> str:
    """One parameter of an effect in its printed unit."""
    scale, printed = parameter_unit(unit, abs(value))
    return f"{plain_number(scale * value, 2)} {printed}".rstrip()


def p_in_words(p: float) -> str:
    return "< 1e−99" if p < 1e-99 else plain_number(p, 2)


def where_in_words(test: DomainTest) -> str:
    """Channels, poses or moves, times and frequencies of a disagreement."""
    where = test.where
    parts = []
    if where.channels:
        parts.append(", ".join(_CHANNELS.get(c[:-1], "") + channel_in_print(c) for c in where.channels))
    spans = [f"{a:.1f}–{b:.1f} s" for a, b in where.times_s]
    if where.segments:
        named = [f"{name} ({span})" for name, span in zip(where.segments, spans, strict=False)]
        parts.append("most in " + ", ".join((named or where.segments)[:MOST_NAMED]))
    elif spans:
        parts.append("at " + ", ".join(spans[:MOST_NAMED]))
    if where.frequencies_hz:
        parts.append("at " + ", ".join(f"{plain_number(f, 4)} Hz" for f in where.frequencies_hz))
    return "; ".join(parts)


def value_in_words(value: float, sigma: float) -> str:
    return with_sigma(value, sigma) if sigma > 0.0 else plain_number(value, 4)
