"""Effects of the recording against those of the given model: missing, surplus, or the same with other values."""

from __future__ import annotations

import math
from collections.abc import Collection, Iterable, Sequence
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np
from scipy.stats import norm

from trihedron.diagnose.effects import catalogue
from trihedron.records.diagnosis import AcceptedEffect, Candidate, ParameterDifference
from trihedron.records.domains import Domain

FRAME_TOLERANCE = 0.03
"""Parameters of one effect are stated along the axes of each side's own fit: 3 % (the angle between the two frames and
the first order of the mechanisms) is no difference."""


def left_open_by(effects: Iterable[AcceptedEffect]) -> dict[str, float]:
    """Ids of numbers that these effects leave open, and by how much (SI): where they are counted from is a convention.

    The size is that of the effect's own parameters where they are of the number's unit, else not known: infinite.
    """
    named = {effect.id: effect.leaves_open for effect in catalogue()}
    out: dict[str, float] = {}
    for effect in effects:
        for number in named.get(effect.id, ()):
            unit = {"accel-zero": "m/s^2", "gyro-zero": "rad/s"}.get(number, "")
            size = max((abs(p.value) for p in effect.parameters if p.unit == unit), default=math.inf)
            out[number] = out.get(number, 0.0) + size
    return out


@dataclass(frozen=True)
class ComparedEffects:
    """``missing`` from the model, ``surplus`` in it, and the parameters of those that both have."""

    missing: tuple[AcceptedEffect, ...]
    surplus: tuple[AcceptedEffect, ...]
    parameters: tuple[ParameterDifference, ...]


def compare_effects(
    model: Sequence[AcceptedEffect],
    recording: Sequence[AcceptedEffect],
    candidates: Sequence[Candidate],
    *,
    alpha: float,
    unexplained: Collection[Domain] = (),
) -> ComparedEffects:
    """Pair the effects of both sides by name, or by what neither recording could tell apart.

    Effects of one session (a pushed pose, a table that was not level) belong to that session: they are never surplus.
    Nor is an effect that would show in a domain of which the recording leaves more ``unexplained`` than its noise:
    it may be there, and hidden.
    """
    of_session = {effect.id for effect in catalogue() if effect.is_of_session}
    # What the recording's own test calls likely is not lacking, even where it did not earn its place there.
    excluded = {c.id for c in candidates if c.applicable and (c.p_value is None or c.p_value > alpha)}
    pairs: list[tuple[AcceptedEffect, AcceptedEffect]] = []
    missing: list[AcceptedEffect] = []
    left = list(model)
    for effect in recording:
        partner = next((m for m in left if _are_one(m, effect)), None)
        if partner is None:
            missing.append(effect)
        else:
            left.remove(partner)
            pairs.append((partner, effect))
    surplus = [
        replace(effect, side="model", share=None, statement=f"Only the model has it: {effect.statement}")
        for effect in left
        if effect.id not in of_session
        and effect.id in excluded
        and not {seen.domain for seen in effect.held_out[:1]} & set(unexplained)
    ]
    parameters = [p for m, r in pairs if m.id == r.id and m.id not in of_session for p in _parameters(m, r, alpha)]
    return ComparedEffects(tuple(missing), tuple(surplus), tuple(parameters))


def _are_one(a: AcceptedEffect, b: AcceptedEffect) -> bool:
    return a.id == b.id or a.id in b.confounded_with or b.id in a.confounded_with


def _parameters(model: AcceptedEffect, recording: AcceptedEffect, alpha: float) -> list[ParameterDifference]:
    sensor: Literal["accelerometer", "gyroscope", "both"] = "both"
    if model.id.startswith("accel-"):
        sensor = "accelerometer"
    elif model.id.startswith("gyro-"):
        sensor = "gyroscope"
    given = {p.name: p for p in model.parameters}
    shared = [(given[p.name], p) for p in recording.parameters if p.name in given and p.unit == given[p.name].unit]
    if not shared:
        return []
    largest = {p.unit: max(abs(q.value) for _, q in shared if q.unit == p.unit) for p, _ in shared}
    sigma = [float(np.hypot(m.std, r.std)) for m, r in shared]
    beyond = [
        max(abs(r.value - m.value) - FRAME_TOLERANCE * largest[r.unit], 0.0) / max(s, 1e-300)
        for (m, r), s in zip(shared, sigma, strict=True)
    ]
    has_error = any(s > 0.0 for s in sigma)
    p_value = min(1.0, 2.0 * len(shared) * float(norm.sf(max(beyond)))) if has_error else 1.0
    return [
        ParameterDifference(
            model.id, sensor, r.name, m.value, r.value, r.value - m.value, s, r.unit, p_value, p_value < alpha / 2.0
        )
        for (m, r), s in zip(shared, sigma, strict=True)
    ]
