"""Effects of the recording against those of the given model: missing, surplus, or common with other parameters."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType
from typing import Literal

import numpy as np

from trihedron.diagnose.accepted import place
from trihedron.diagnose.effects import by_id, catalogue
from trihedron.probability import ndtr
from trihedron.records.diagnosis import AcceptedEffect, Candidate, Diagnosis, EffectParameter, ParameterDifference
from trihedron.records.words import effect_words
from trihedron.units import STANDARD_GRAVITY_M_S2

FRAME_TOLERANCE = 0.03
"""Relative difference of parameters that is ignored: each side states them along the axes of its own fit, and
the angle between the two frames and the first order of the mechanisms make up to 3 %."""

FREE_CURVES = ("curve", "step")
"""Variants of a drift without a mechanism: cosines over a session, a step. Those of two sessions have no comparable
parameters."""

CODE = "raw_"
"""Prefix of a parameter that states another one as an exact ADC code."""

FAINT = 1.0 - 1.0 / 1.05**2
"""Share of the variance inside poses: such a line raises their scatter by 5 %, as 30 K raise white noise."""

LARGEST_READ: Mapping[str, float] = MappingProxyType({"accel-bias": STANDARD_GRAVITY_M_S2, "gyro-bias": 1.0})
"""Largest reading that a thermal scale multiplies, where it acts like a bias: gravity; a rotation by hand [rad/s]."""


SENSORS: Mapping[str, Literal["accelerometer", "gyroscope", "both"]] = MappingProxyType(
    {"accel": "accelerometer", "gyro": "gyroscope"}
)


def left_open_by(effects: Iterable[AcceptedEffect], span_k: float | None = None) -> dict[str, float]:
    """Ids of parameters whose reference point these effects leave undefined, and by how much (SI).

    ``effects`` are those of both sides: two sessions at other temperatures, or started at another state of warm-up,
    refer one and the same effect to different points. The size is that of the effect's parameters, those per kelvin
    times ``span_k`` (all temperatures of both logs), each with two standard uncertainties added, summed over one axis
    (the cosines of a curve can add up at its start); infinite where it is not known. An effect that both sides have
    counts once, with its larger size.
    """
    by_effect: dict[tuple[str, str], float] = {}
    for effect in effects:
        for number in by_id()[effect.id].confounded_with if effect.id in by_id() else ():
            unit = {"accel-bias": "m/s^2", "gyro-bias": "rad/s"}.get(number, "1")
            by_axis: dict[str, float] = {}
            for parameter in effect.parameters:
                moved = _moved(parameter, number, unit, span_k)
                if moved is not None:
                    axis = parameter.name.rpartition("_")[2]
                    by_axis[axis] = by_axis.get(axis, 0.0) + moved
            size = max(by_axis.values(), default=math.inf)
            by_effect[number, effect.id] = max(by_effect.get((number, effect.id), 0.0), size)
    out: dict[str, float] = {}
    for (number, _), size in by_effect.items():
        out[number] = out.get(number, 0.0) + size
    return out


def _moved(parameter: EffectParameter, number: str, unit: str, span_k: float | None) -> float | None:
    """Change of a parameter in ``unit`` caused by one parameter of an effect; ``None`` where it has none."""
    size = abs(parameter.value) + 2.0 * abs(parameter.std)
    if parameter.unit == unit:
        return size
    per = {"1/K": LARGEST_READ.get(number), f"{unit}/K^2": span_k, f"{unit}/K": 1.0}.get(parameter.unit)
    return None if span_k is None or per is None else size * span_k * per


@dataclass(frozen=True)
class ComparedEffects:
    """``missing`` from the model, ``surplus`` in it, and the parameters of those that both have.

    ``differ``: whether the two differ in more than minor effects.
    """

    missing: tuple[AcceptedEffect, ...]
    surplus: tuple[AcceptedEffect, ...]
    parameters: tuple[ParameterDifference, ...]
    differ: bool

    @property
    def in_order(self) -> tuple[AcceptedEffect, ...]:
        """Missing before surplus; last those that are no mechanism of an instrument (a scatter, a disturbed pose)."""
        return tuple(sorted((*self.missing, *self.surplus), key=place))


def compare_effects(
    model: Sequence[AcceptedEffect],
    found: Diagnosis,
    *,
    alpha: float,
    tried_on_model: Sequence[Candidate] = (),
    has_motion: bool = True,
) -> ComparedEffects:
    """Pair the effects of a model with those ``found`` in a recording, by id or by what was confounded with them.

    An effect of one side alone is missing or surplus where the other side's own estimate of it excludes its size;
    ``tried_on_model`` are the candidates of the simulation's own diagnosis. A model without motion (a calibration) has
    no arm that could be another one. What a recording cannot show is not surplus
    there, unless it would be seen as a drift; nor is an effect of one session (a disturbed pose, a table that was not
    level, the arm to the centre of rotation), nor one that shows in a domain in which the recording has unexplained
    misfit: it may be hidden there.
    """
    of_session = {effect.id for effect in catalogue() if effect.of_session is None or effect.is_of_motion}
    pairs: list[tuple[AcceptedEffect, AcceptedEffect]] = []
    missing: list[AcceptedEffect] = []
    left = list(model)
    for effect in found.effects:
        as_one = {effect.id, *effect.confounded_with}
        partner = next((m for m in left if m.id in as_one or effect.id in m.confounded_with), None)
        if partner is not None:
            left.remove(partner)
            pairs.append((partner, effect))
        elif _is_excluded(effect, tried_on_model, alpha, if_not_tried=True):
            missing.append(effect)
    unexplained = {test.domain for test in found.remaining if test.disagrees}
    surplus = [
        replace(effect, side="model", share=None, statement=_only_there(effect, found.candidates))
        for effect in left
        if effect.id not in of_session
        and (_is_excluded(effect, found.candidates, alpha, if_not_tried=False) or _would_drift(effect, found))
        and not {seen.domain for seen in effect.held_out[:1]} & unexplained
    ]
    alike = [
        (m, r) for m, r in pairs if m.id == r.id and m.id not in of_session and not _is_free(m) and not _is_free(r)
    ]
    parameters = [p for m, r in alike for p in _parameters(m.id, m.parameters, r.parameters, alpha)]
    differ = bool(surplus) or not all(is_footnote(effect, has_motion) for effect in missing)
    return ComparedEffects(tuple(missing), tuple(surplus), tuple(parameters), differ)


def is_footnote(effect: AcceptedEffect, has_motion: bool) -> bool:
    """Whether an effect of the recording is not counted as missing from its model.

    These are a disturbed pose, which belongs to the session and not to the instrument; an arm of the motion that
    explains no misfit, or beside a model that has no motion; and a line that adds less to the scatter inside poses than
    noise varies between parts.
    """
    of = by_id()[effect.id]
    share = effect.share or 0.0
    return of.is_local or (of.is_of_motion and not (has_motion and share)) or (of.is_of_samples and share < FAINT)


def _only_there(effect: AcceptedEffect, candidates: Sequence[Candidate]) -> str:
    reasons = [c.reason for c in candidates if c.id == effect.id and not c.applicable]
    return effect_words(
        effect.id, "only-model", statement=effect.statement, has_reason=bool(reasons), reason="".join(reasons[:1])
    )


def _is_excluded(effect: AcceptedEffect, tried: Sequence[Candidate], alpha: float, *, if_not_tried: bool) -> bool:
    """Whether a log's own estimate of an effect excludes its size; by the p-value where that has no size.

    Parameters that its best shape lacks (rows of a matrix) are 0 there, as uncertain as those that it has.
    """
    applicable = [c for c in tried if c.applicable]
    one = next((c for c in applicable if c.id == effect.id), None)
    if one is None:
        return if_not_tried
    if not one.size:
        return one.p_value is None or len(applicable) * one.p_value > alpha
    sigma = {p.unit: max(q.std for q in one.size if q.unit == p.unit) for p in one.size}
    names = {p.name for p in one.size}
    zeros = [EffectParameter(p.name, 0.0, sigma[p.unit], p.unit) for p in effect.parameters
             if p.unit in sigma and p.name not in names]  # fmt: skip
    differences = _parameters(effect.id, effect.parameters, (*one.size, *zeros), alpha)
    return not differences or any(p.significant for p in differences)


def _would_drift(effect: AcceptedEffect, found: Diagnosis) -> bool:
    """Whether an effect of a channel that the recording did not log, there a drift of the bias, would make more than
    all of its residuals, and it does not drift."""
    if all(one.applicable for one in found.candidates if one.id == effect.id):
        return False
    drift = f"{effect.id.partition('-')[0]}-bias-drift"
    misses = {test.domain: test.rms for test in found.domains}
    return drift not in {one.id for one in found.effects} and any(
        seen.rms_before**2 - seen.rms_after**2 > misses.get(seen.domain, 0.0) ** 2 for seen in effect.held_out[:1]
    )


def _is_free(effect: AcceptedEffect) -> bool:
    return effect.model.get("variant") in FREE_CURVES


def _parameters(
    effect_id: str, model: Iterable[EffectParameter], recording: Iterable[EffectParameter], alpha: float
) -> list[ParameterDifference]:
    sensor = SENSORS.get(effect_id.partition("-")[0], "both")
    given = {p.name: p for p in model if p.name not in (by_id()[effect_id].of_session or ())}
    shared = [(given[p.name], p) for p in recording if p.name in given and p.unit == given[p.name].unit]
    # A parameter without uncertainty on either side counts events of its session, or is an ADC code. Where the codes
    # beneath a parameter are equal, its difference in SI is that of the scales, which are compared by themselves.
    codes = {r.name for m, r in shared if r.name.startswith(CODE) and m.value == r.value}
    shared = [(m, r) for m, r in shared if (m.std > 0.0 or r.std > 0.0) and CODE + r.name not in codes]
    if not shared:
        return []
    largest = {p.unit: max(abs(q.value) for _, q in shared if q.unit == p.unit) for p, _ in shared}
    sigma = [float(np.hypot(m.std, r.std)) for m, r in shared]
    beyond = [
        max(abs(r.value - m.value) - FRAME_TOLERANCE * largest[r.unit], 0.0) / s
        for (m, r), s in zip(shared, sigma, strict=True)
    ]
    p_value = min(1.0, 2.0 * len(shared) * ndtr(-max(beyond)))
    return [
        ParameterDifference(
            effect_id, sensor, r.name, m.value, r.value, r.value - m.value, s, r.unit, p_value, p_value < alpha / 2.0
        )
        for (m, r), s in zip(shared, sigma, strict=True)
    ]
