"""The noise of a recording's holds as a given model and as its other half predict it: one figure for every stage."""

from __future__ import annotations

import math
from collections.abc import Sequence

from trihedron.comparison.noise import Sampled, Sensor, sampled
from trihedron.diagnose.against.fitted import FittedModel
from trihedron.records import Recording, Segments
from trihedron.records.diagnosis import NoiseDifference, Stage, StageDomain
from trihedron.records.pose_noise import PoseNoise

DECIBEL = 20.0 / math.log(10.0)
FEWEST_POSES = 4
"""Two holds for either half."""
NOISE_IN_POSES = frozenset({"N", "B", "Q", "octave", "bandwidth", "resolution", "line"})
"""Terms of the comparison that change what the octaves of a pose show."""


def with_noise_stage(
    stages: Sequence[Stage],
    model: Sampled,
    recording: Recording,
    segments: Segments,
    fit: FittedModel,
    compared: Sequence[NoiseDifference],
) -> tuple[Stage, ...]:
    """The stages with the misfit of the noise in each, and the stage ``noise`` after ``numbers``.

    Every second hold is predicted: by the given model until its noise is replaced, from then on by the recording's
    other poses. A model whose noise differs nowhere in ``compared`` keeps it: half the poses know it less well. The
    misfit is the rms over sensors, axes and octaves of 20 log10 of the ratio of densities [dB]; a stage has none where
    that is no number, as of a model without any noise.
    """
    given = own = None
    if segments.n_poses >= FEWEST_POSES:
        taught, seen = (sampled(recording, segments.poses[first::2], fit) for first in (0, 1))
        given, own = _misfit(model, seen), _misfit(taught, seen)
    if given is not None and not any(one.significant and one.term in NOISE_IN_POSES for one in compared):
        own = given
    out: list[Stage] = []
    for stage in stages:
        misfit = given if stage.stage in ("as-given", "numbers") else own
        out.append(_with(stage, misfit))
        if stage.stage == "numbers":
            out.append(_with(Stage("noise", stage.domains), own))
    return tuple(out)


def _with(stage: Stage, misfit: float | None) -> Stage:
    if misfit is None:
        return stage
    return Stage(stage.stage, (*stage.domains, StageDomain("noise", misfit, None, "dB")))


def _misfit(model: Sampled, seen: Sampled) -> float | None:
    """Rms of the logarithm of all densities that both sides have, in dB."""
    sensors: tuple[Sensor, ...] = ("accelerometer", "gyroscope")
    squares = [
        (DECIBEL * math.log(ratio)) ** 2
        for sensor in sensors
        for m, r in zip(model.noise.get(sensor, ()), seen.noise.get(sensor, ()), strict=False)
        for ratio in _ratios(m, r)
    ]
    return math.sqrt(sum(squares) / len(squares)) if squares else None


def _ratios(model: PoseNoise, seen: PoseNoise) -> list[float]:
    """Root of the ratio of densities, octave by octave."""
    by_low = {octave.low_hz: octave.density.value for octave in model.octaves}
    return [
        math.sqrt(by_low[octave.low_hz] / octave.density.value)
        for octave in seen.octaves
        if by_low.get(octave.low_hz, 0.0) > 0.0 and octave.density.value > 0.0
    ]
