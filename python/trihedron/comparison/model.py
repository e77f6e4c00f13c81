"""A given model against a recording: both are fitted freely, then compared; effects beside free parameters."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from trihedron.arrays import TINY, FloatArray, rms_of
from trihedron.comparison.effects import FREE_CURVES, compare_effects, left_open_by
from trihedron.comparison.fitted import FittedModel, model_of_calibration, model_of_diagnosis
from trihedron.comparison.noise import Sampled, sampled
from trihedron.comparison.parameters import CommonFactor, compare_numbers
from trihedron.comparison.rows import SENSORS, difference
from trihedron.probability import f_upper
from trihedron.records import Calibration, Recording, Segments, Verification
from trihedron.records.diagnosis import (
    AcceptedEffect,
    Diagnosis,
    NoiseDifference,
    ParameterDifference,
    Stage,
    StageDomain,
    Verdict,
)  # fmt: skip
from trihedron.records.domains import Domain, DomainTest, Where
from trihedron.records.pose_noise import PoseNoise
from trihedron.records.words import words
from trihedron.session.noise import NOISE_DOF

DECIBEL = 20.0 / math.log(10.0)
FEWEST_POSES = 4
"""Two poses in either half."""
NOISE_IN_POSES = frozenset({"N", "B", "Q", "octave", "bandwidth", "resolution"})
"""Noise terms that change the octaves of a pose."""


def with_noise_stage(
    stages: Sequence[Stage],
    model: Sampled,
    recording: Recording,
    segments: Segments,
    fit: FittedModel,
    compared: Sequence[NoiseDifference],
) -> tuple[Stage, ...]:
    """The stages with the misfit of the noise in each, and the stage ``noise`` after ``parameters``.

    Every second pose is predicted: by the given model until its noise is replaced, then by the recording's other poses.
    A model whose noise differs nowhere in ``compared`` keeps it, because half of the poses determine it less well. The
    misfit is the rms over sensors, axes and octaves of 20 log10 of the ratio of densities [dB]; a stage has none where
    it is not finite, as for a model without noise.
    """
    given = own = None
    if segments.n_poses >= FEWEST_POSES:
        taught, seen = (sampled(recording, segments.poses[first::2], fit) for first in (0, 1))
        given, own = _misfit(model, seen), _misfit(taught, seen)
    if given is not None and not any(one.significant and one.term in NOISE_IN_POSES for one in compared):
        own = given
    out: list[Stage] = []
    for stage in stages:
        misfit = given if stage.stage in ("as-given", "parameters") else own
        out.append(_with(stage, misfit))
        if stage.stage == "parameters":
            out.append(_with(Stage("noise", stage.domains), own))
    return tuple(out)


def _with(stage: Stage, misfit: float | None) -> Stage:
    if misfit is None:
        return stage
    return Stage(stage.stage, (*stage.domains, StageDomain("noise", misfit, None, "dB")))


def _misfit(model: Sampled, seen: Sampled) -> float | None:
    """Rms of 20 log10 of the ratio of all densities that both sides have, in dB."""
    squares = [
        (DECIBEL * math.log(ratio)) ** 2
        for sensor in SENSORS
        for m, r in zip(model.noise.get(sensor, ()), seen.noise.get(sensor, ()), strict=False)
        for ratio in _ratios(m, r)
    ]
    return math.sqrt(sum(squares) / len(squares)) if squares else None


def _ratios(model: PoseNoise, seen: PoseNoise) -> list[float]:
    """Square root of the ratio of power densities, octave by octave."""
    by_low = {octave.low_hz: octave.density.value for octave in model.octaves}
    return [
        math.sqrt(by_low[octave.low_hz] / octave.density.value)
        for octave in seen.octaves
        if by_low.get(octave.low_hz, 0.0) > 0.0 and octave.density.value > 0.0
    ]


def compared(
    found: Diagnosis,
    given: Calibration,
    simulated: tuple[Diagnosis, Recording] | None,
    noise: tuple[NoiseDifference, ...],
    recording: Recording,
    checked: Verification,
    alpha: float,
) -> Diagnosis:
    """The diagnosis of a recording, extended by its differences to the given model.

    ``simulated`` is the user's simulated log with its own diagnosis, where that is the model; otherwise ``given`` is.
    ``noise`` are the differences of noise and sampling; ``checked`` is the model on the recording, nothing fitted.
    """
    own = model_of_diagnosis(found)
    model = model_of_calibration(given) if simulated is None else model_of_diagnosis(simulated[0])
    given_effects = () if simulated is None else _without_walk(simulated[0].effects, noise)
    tried_on_model = () if simulated is None else simulated[0].candidates
    has_motion = simulated is not None
    effects = compare_effects(given_effects, found, alpha=alpha, tried_on_model=tried_on_model, has_motion=has_motion)
    numbers = compare_numbers(
        model,
        own,
        alpha=alpha,
        # A linear calibration absorbs effects that it does not contain: it is compared with a fit without effects too.
        linear=model_of_diagnosis(found, with_effects=False) if simulated is None and found.effects else None,
        left_open=left_open_by((*found.effects, *given_effects), _span_k(recording, simulated)),
    )
    parameters = (*numbers.parameters, *effects.parameters)
    noise = (*noise, *(_factor(one) for one in numbers.factors))
    differ = any(p.significant for p in parameters) or any(n.significant for n in noise)
    verdict: Verdict = found.verdict
    if found.verdict != "unexplained":
        agreed: Verdict = "not-testable" if found.verdict == "not-testable" else "consistent"
        verdict = "parameters-differ" if differ else agreed
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
        stages=(_as_given(checked), *found.stages),
    )


def _with_shared_effects(found: Diagnosis) -> Diagnosis:
    """Stages and residuals of a recording whose effects the model has too: every stage includes these effects."""
    with_effects = next((stage.domains for stage in found.stages if stage.stage == "effects"), ())
    return replace(
        found,
        stages=tuple(replace(one, domains=with_effects) if with_effects else one for one in found.stages),
        residuals=tuple(
            replace(
                one,
                time_before_s=one.time_after_s,
                before=one.after,
                sigma_before=one.sigma_after,
                names_before=one.names_after,
            )
            for one in found.residuals
        ),
    )


def _without_walk(
    effects: tuple[AcceptedEffect, ...], noise: tuple[NoiseDifference, ...]
) -> tuple[AcceptedEffect, ...]:
    """Effects of a simulation, less a free curve through biases of a sensor whose larger slow noise explains it."""
    drawn = set()
    for sensor, drift in zip(SENSORS, ("accel-bias-drift", "gyro-bias-drift"), strict=True):
        slow = [n.ratio for n in noise if n.significant and n.sensor == sensor and n.term in ("B", "K") and n.ratio]
        if slow and min(slow) >= 1.0:
            drawn.add(drift)
    return tuple(e for e in effects if e.id not in drawn or e.model.get("variant") not in FREE_CURVES)


def _span_k(recording: Recording, simulated: tuple[Diagnosis, Recording] | None) -> float | None:
    """Range of the temperatures of both logs [K]; ``None`` where one has none."""
    logs = (recording,) if simulated is None else (recording, simulated[1])
    seen = [log.temperature_degc[np.isfinite(log.temperature_degc)] for log in logs if log.temperature_degc is not None]
    if simulated is None or len(seen) < len(logs) or not all(len(one) for one in seen):
        return None
    every = np.concatenate(seen)
    return float(every.max() - every.min())


def _numbers_test(parameters: tuple[ParameterDifference, ...]) -> DomainTest:
    """All groups as one domain: F of the most significant group, per degree of freedom, and its p-value."""
    worst = min(parameters, key=lambda p: p.p_value)
    members = [p for p in parameters if p.id == worst.id]
    n = len(members)
    significant = [p for p in parameters if p.significant]
    channels = tuple(dict.fromkeys(f"{p.id} {p.name}" for p in significant))
    chi2 = f_upper(n, NOISE_DOF, max(worst.p_value, TINY))
    return DomainTest("parameters", chi2, float(n), worst.p_value, bool(significant), Where(channels))


def _factor(one: CommonFactor) -> NoiseDifference:
    ratio = 1.0 / one.factor
    name = "gyro" if one.sensor == "gyroscope" else one.sensor
    units = {"side": one.side, "written": one.written, "taken": one.taken}
    case = "range-ratio" if not one.written else "unit-of-side" if one.side else "unit-ratio"
    remark = words(case, sensor=name, ratio=ratio, **units)
    return difference(one.sensor, "unit" if one.written else "range", (None, None), "1", remark, ratio=ratio)


def _as_given(checked: Verification) -> Stage:
    """Errors of the given parameters with one bias for the session, nothing fitted."""

    def of(domain: Domain, error: FloatArray, noise: FloatArray | None, unit: str) -> list[StageDomain]:
        if not len(error):
            return []
        chi2 = None if noise is None else float(np.mean((error / noise) ** 2))
        return [StageDomain(domain, rms_of(error), chi2, unit)]

    return Stage(
        "as-given",
        (
            *of("static-accel", checked.norm_error, checked.norm_noise, "m/s^2"),
            *of("static-gyro", checked.static_rate, None, "rad/s"),
            *of("moves", checked.angle_deg, checked.angle_noise_deg, "deg"),
        ),
    )
