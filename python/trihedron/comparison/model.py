"""A given model against a recording: both fitted freely, then compared; physics competes on top of freed numbers."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.diagnose.against.as_read import as_read
from trihedron.diagnose.against.fitted import model_of_calibration, model_of_diagnosis
from trihedron.diagnose.against.mechanisms import FREE_CURVES, compare_effects, left_open_by
from trihedron.diagnose.against.numbers import SPREAD_DOF, CommonFactor, compare_numbers
from trihedron.estimate.verification import verify_calibration
from trihedron.probability import f_upper
from trihedron.records import Calibration, Recording, Segments
from trihedron.records.diagnosis import (
    AcceptedEffect,
    Diagnosis,
    NoiseDifference,
    ParameterDifference,
    Stage,
    StageDomain,
    Verdict,
)
from trihedron.records.domains import DomainTest, Where


def compared(
    found: Diagnosis,
    given: Calibration,
    simulated: tuple[Diagnosis, Recording] | None,
    noise: tuple[NoiseDifference, ...],
    recording: Recording,
    segments: Segments,
    alpha: float,
) -> Diagnosis:
    """The free diagnosis of a recording as the answer to: where does the given model differ?

    ``simulated`` is the user's simulated log with its free diagnosis, where that is the model; else ``given`` is.
    ``noise`` is what was compared of noise and sampling beside it.
    """
    own = model_of_diagnosis(found)
    model = model_of_calibration(given) if simulated is None else model_of_diagnosis(simulated[0])
    given_effects = () if simulated is None else _without_walk(simulated[0].effects, noise)
    unexplained = {test.domain for test in found.remaining if test.disagrees}
    effects = compare_effects(
        given_effects, found.effects, found.candidates, alpha=alpha, unexplained=unexplained,
        misses={test.domain: test.rms for test in found.domains},
        freedom={test.domain: test.dof for test in found.domains},
        tried_on_model=() if simulated is None else simulated[0].candidates,
    )  # fmt: skip
    numbers = compare_numbers(
        model,
        own,
        alpha=alpha,
        # A linear calibration was fitted beside effects that it does not know: it is also held against such a fit.
        linear=model_of_diagnosis(found, with_effects=False) if simulated is None and found.effects else None,
        left_open=left_open_by((*found.effects, *given_effects), _span_k(recording, simulated)),
    )
    parameters = (*numbers.parameters, *effects.parameters)
    noise = (*noise, *(_factor(one) for one in numbers.factors))
    differ = any(p.significant for p in parameters) or any(n.significant for n in noise)
    verdict: Verdict = found.verdict
    if found.verdict not in ("unexplained", "not-testable"):
        verdict = "parameters-differ" if differ else "consistent"
        if effects.differ:
            verdict = "missing-physics"
    elif found.verdict == "unexplained" and effects.surplus:
        verdict = "missing-physics"
    if found.effects and simulated is not None and not effects.missing:
        found = _with_shared_effects(found)
    return replace(
        found,
        verdict=verdict,
        # Effects that the model has too are no disagreement with it.
        domains=(*(found.domains if effects.missing else found.remaining), _numbers_test(parameters)),
        effects=effects.in_order,
        parameters=parameters,
        noise_compared=noise,
        stages=(_as_given(as_read(given, own), recording, segments), *found.stages),
    )


def _with_shared_effects(found: Diagnosis) -> Diagnosis:
    """Stages and residuals of a recording whose effects the model has all: new numbers take none of them away."""
    with_effects = next((stage.domains for stage in found.stages if stage.stage == "effects"), ())
    return replace(
        found,
        stages=tuple(replace(one, domains=with_effects) if with_effects else one for one in found.stages),
        residuals=tuple(
            replace(one, time_before_s=one.time_after_s, before=one.after, sigma_before=one.sigma_after)
            for one in found.residuals
        ),
    )


def _without_walk(
    effects: tuple[AcceptedEffect, ...], noise: tuple[NoiseDifference, ...]
) -> tuple[AcceptedEffect, ...]:
    """Effects of a simulation less a free curve through zeros of a sensor whose slow noise is larger: that draws it."""
    drawn = set()
    for sensor, drift in (("gyroscope", "gyro-bias-drift"), ("accelerometer", "accel-bias-drift")):
        slow = [n.ratio for n in noise if n.significant and n.sensor == sensor and n.term in ("B", "K") and n.ratio]
        if slow and min(slow) >= 1.0:
            drawn.add(drift)
    return tuple(e for e in effects if e.id not in drawn or e.model.get("variant") not in FREE_CURVES)


def _span_k(recording: Recording, simulated: tuple[Diagnosis, Recording] | None) -> float | None:
    """From the lowest to the highest temperature of both logs [K]; ``None`` where one has none."""
    logs = (recording,) if simulated is None else (recording, simulated[1])
    seen = [log.temperature_degc[np.isfinite(log.temperature_degc)] for log in logs if log.temperature_degc is not None]
    if simulated is None or len(seen) < len(logs) or not all(len(one) for one in seen):
        return None
    every = np.concatenate(seen)
    return float(every.max() - every.min())


def _numbers_test(parameters: tuple[ParameterDifference, ...]) -> DomainTest:
    """All groups as one domain: the largest squared deviation per degree of freedom and its group's p."""
    worst = min(parameters, key=lambda p: p.p_value)
    members = [p for p in parameters if p.id == worst.id]
    n = len(members)
    significant = [p for p in parameters if p.significant]
    channels = tuple(dict.fromkeys(f"{p.id} {p.name}" for p in significant))
    return DomainTest(
        "numbers",
        f_upper(n, SPREAD_DOF, max(worst.p_value, 1e-300)),
        float(n),
        worst.p_value,
        bool(significant),
        Where(channels),
    )


def _factor(one: CommonFactor) -> NoiseDifference:
    ratio = 1.0 / one.factor
    name = "gyro" if one.sensor == "gyroscope" else one.sensor
    if not one.written:
        remark = f"The {name} of the model counts {ratio:g} times as many per unit: another range of the part."
        return NoiseDifference(one.sensor, "", "range", None, None, ratio, None, "1", None, True, remark)
    remark = f"The {name} of the model reads {ratio:.4g} times the recording's"
    if one.side:
        remark += f": the {one.side} writes {one.written} where it says {one.taken}."
    else:
        remark += f", the ratio of {one.taken} to {one.written}: one of the two is in the wrong unit."
    return NoiseDifference(one.sensor, "", "unit", None, None, ratio, None, "1", None, True, remark)


def _as_given(given: Calibration, recording: Recording, segments: Segments) -> Stage:
    """The given numbers with one bias for the session, nothing fitted: what the recording looks like to them."""
    checked = verify_calibration(given, recording, segments, given.gravity_m_s2, given.gravity_source)
    domains = [
        StageDomain(
            "static-accel",
            float(np.sqrt(np.mean(checked.norm_error**2))),
            float(np.mean((checked.norm_error / checked.norm_noise) ** 2)),
            "m/s^2",
        )
    ]
    if len(checked.rest_rate):
        domains.append(StageDomain("static-gyro", float(np.sqrt(np.mean(checked.rest_rate**2))), None, "rad/s"))
    if len(checked.angle_deg):
        domains.append(
            StageDomain(
                "moves",
                float(np.sqrt(np.mean(checked.angle_deg**2))),
                float(np.mean((checked.angle_deg / checked.angle_noise_deg) ** 2)),
                "deg",
            )
        )
    return Stage("as-given", tuple(domains))
