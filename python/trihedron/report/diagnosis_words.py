"""A diagnosis in words: the verdict, where it disagrees, and residuals in the units that people use."""

from __future__ import annotations

from trihedron.records.diagnosis import Diagnosis
from trihedron.records.domains import DomainTest
from trihedron.records.finding import FindingCode
from trihedron.report.diagnosis_numbers import differing_in_short
from trihedron.report.numbers import listed, plain_number, unit_in_print, with_sigma
from trihedron.units import degrees_from_radians, mm_s2_from_m_s2, ms_from_s

MEANING = {
    "static-accel": "gravity at rest",
    "static-gyro": "gyro at rest",
    "moves": "gravity after a move",
    "dynamics": "velocity over a move",
    "within-static": "inside poses",
    "timing": "sampling instants",
    "numbers": "numbers of the model",
    "noise": "noise and sampling",
}
MOST_NAMED = 4


def verdict_in_words(diagnosis: Diagnosis) -> str:
    """The verdict and what carries it, in one sentence."""
    off: list[str] = [d.domain for d in diagnosis.domains if d.disagrees]
    left: list[str] = [d.domain for d in diagnosis.remaining if d.disagrees]
    numbers = differing_in_short(diagnosis)
    if diagnosis.verdict == "consistent":
        return (
            "CONSISTENT: the model and its noise account for this recording; nothing is missing that it could show"
            f"{_footnotes(diagnosis)}{_not_compared(diagnosis)}."
        )
    if diagnosis.verdict == "unexplained":
        named = list(dict.fromkeys(effect.id for effect in diagnosis.effects if effect.side == "recording"))
        off = left if named else off
        verbs = "are there too, and explain" if len(named) > 1 else "is there too, and explains"
        beside = f" ({listed(named)} {verbs} little)" if named else ""
        return (
            f"UNEXPLAINED: {listed(off) if off else 'the recording'} "
            f"{'disagree' if len(off) > 1 else 'disagrees'} with the model, and no known effect accounts for it{beside}"
            + (f"; numbers differ too ({listed(numbers)})." if numbers else ".")
        )
    if diagnosis.verdict == "not-testable":
        tested = listed([d.domain for d in diagnosis.domains]) if diagnosis.domains else "nothing"
        return (
            f"NOT TESTABLE: this recording does not carry the question ({tested} looked at, nothing named); hold 18 or "
            "more poses of 3 to 5 s in different directions."
        )
    if diagnosis.verdict == "parameters-differ":
        beside = _footnotes(diagnosis) + _not_compared(diagnosis)
        return f"PARAMETERS DIFFER: {listed(numbers)}; nothing else, no physics is missing{beside}."
    missing = list(dict.fromkeys(effect.id for effect in diagnosis.effects if effect.side == "recording"))
    surplus = list(dict.fromkeys(effect.id for effect in diagnosis.effects if effect.side == "model"))
    tail = (
        f"; {listed(left)} still {'disagree' if len(left) > 1 else 'disagrees'}."
        if left
        else "; nothing else disagrees."
    )
    said = []
    if missing:
        said.append(f"{listed(missing)} {'was' if len(missing) == 1 else 'were'} excluded from the model")
    if surplus:
        said.append(f"the model has {listed(surplus)}, which the recording lacks")
    if numbers:
        said.append(f"numbers differ ({listed(numbers)})")
    return f"MISSING PHYSICS: {'; '.join(said)}{tail}"


def _not_compared(diagnosis: Diagnosis) -> str:
    """A gyro that one side lacks is no agreement."""
    found = getattr(diagnosis, "findings", ())
    is_out = any(f.code is FindingCode.GYROSCOPE_LEFT_OUT for f in found)
    return "; the gyro was not compared" if is_out else ""


def _footnotes(diagnosis: Diagnosis) -> str:
    """What was found and is no physics of the model: a pose that was pushed, a faint line."""
    named = list(dict.fromkeys(effect.id for effect in diagnosis.effects))
    return f" (beside: {listed(named)})" if named else ""


def rms_in_words(test: DomainTest) -> str:
    return size_in_words(test.rms, test.unit) if test.unit else "–"


def size_in_words(value: float, unit: str) -> str:
    """A residual in the unit that people use for errors of this kind."""
    if unit == "m/s^2":
        return f"{plain_number(mm_s2_from_m_s2(value))} mm/s²"
    if unit == "rad/s":
        return f"{plain_number(degrees_from_radians(value))} °/s"
    if unit == "s":
        return f"{plain_number(ms_from_s(value))} ms"
    return plain_number(value) + ("" if unit in ("", "1", "raw") else f" {printed_unit(unit)}")


def printed_unit(unit: str) -> str:
    return {"deg": "°", "1": ""}.get(unit, unit_in_print(unit))


def p_in_words(p: float) -> str:
    return "< 1e−99" if p < 1e-99 else plain_number(p, 2)


def where_in_words(test: DomainTest) -> str:
    """Channels, poses or moves, times and frequencies that carry a disagreement."""
    where = test.where
    parts = []
    if where.channels:
        parts.append("channel " + ", ".join(where.channels))
    if where.segments:
        spans = [f"{plain_number(a, 4)}–{plain_number(b, 4)} s" for a, b in where.times_s]
        named = [
            f"{name} ({span})"
            for name, span in zip(where.segments, spans + [""] * len(where.segments), strict=False)
            if span
        ] or list(where.segments)
        parts.append("most in " + ", ".join(named[:MOST_NAMED]))
    elif where.times_s:
        spans = [f"{plain_number(a, 4)}–{plain_number(b, 4)} s" for a, b in where.times_s]
        parts.append("at " + ", ".join(spans[:MOST_NAMED]))
    if where.frequencies_hz:
        parts.append("at " + ", ".join(f"{plain_number(f, 4)} Hz" for f in where.frequencies_hz))
    return "; ".join(parts)


def value_in_words(value: float, sigma: float) -> str:
    return with_sigma(value, sigma) if sigma > 0.0 else plain_number(value, 4)
