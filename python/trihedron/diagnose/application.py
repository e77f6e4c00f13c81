"""Compensation of accepted effects in another recording of the same sensor, sample by sample.

The effects' own forward models (``variants``) are evaluated with every sample as a point. The motion is the sensor's
own reading, corrected by S and b.
"""

from collections.abc import Mapping, Sequence
from dataclasses import dataclass, field
from functools import cached_property
from types import MappingProxyType, SimpleNamespace
from typing import Any, cast

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.candidates import N_ROUNDS
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import by_id
from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.session.solve import Fit
from trihedron.errors import InputError
from trihedron.records import Recording
from trihedron.records.words import words

CHANNELS = {"temperature_degc": "temperature", "supply_v": "supply voltage"}


class SignalMissing(InputError):
    """The recording lacks a channel that an effect depends on."""


@dataclass(frozen=True, eq=False)
class SampleContext(Context):
    """Context of an effect that is compensated: every sample is a point; poses and moves are not known."""

    reference: Mapping[str, float] = field(kw_only=True)

    @cached_property
    def angular_acceleration(self) -> FloatArray:
        if self.obs.raw_rate is None:
            raise SignalMissing("this recording has no gyroscope")
        return self.derivative(self.rate)

    def at_points(self, samples: FloatArray) -> FloatArray:
        return samples

    @property
    def references(self) -> Mapping[str, float]:
        return self.reference

    def _logged(self, name: str) -> FloatArray | None:
        logged, words = super()._logged(name), CHANNELS[name]
        if logged is None:
            raise SignalMissing(f"this recording has no {words}")
        if name not in self.reference:
            raise SignalMissing(f"the calibration does not say at which {words} it holds")
        return logged


@dataclass(frozen=True, eq=False)
class Compensated:
    """Raw readings (n, 3) with effects compensated, or ``None``; ``left_out`` id of others → reason."""

    accelerometer: FloatArray | None
    gyroscope: FloatArray | None
    left_out: MappingProxyType[str, str]


def compensate(
    recording: Recording,
    effects: Sequence[Mapping[str, Any]],
    references: Mapping[str, float],
    accelerometer: tuple[FloatArray, FloatArray],
    gyroscope: tuple[FloatArray, FloatArray] | None,
) -> Compensated:
    """Compensate accepted effects in raw readings: ``a' − S⁻¹ D(f) p``, with f the motion without them (eq. 11.3).

    ``effects`` and ``references`` are those of a diagnosis (``Diagnosis.to_dict``), ``accelerometer`` and
    ``gyroscope`` the extended model's ``(S, b)``. Effects that cannot be compensated are listed in ``left_out``.

    Refused when an effect is not written as a diagnosis writes it.
    """
    S_f, b_f = accelerometer
    S_w, b_w = gyroscope if gyroscope is not None else (np.eye(3), np.zeros(3))
    raw_f, raw_w = recording.accelerometer, recording.gyroscope if gyroscope is not None else None
    zero = np.zeros((recording.n_samples, 3))
    read_f = zero if raw_f is None else raw_f @ S_f.T + b_f
    read_w = zero if raw_w is None else raw_w @ S_w.T + b_w
    t, none = recording.time_s, SimpleNamespace(poses=())
    obs = SimpleNamespace(
        recording=recording, segments=none, time_s=t, pose_time_s=t[:0], raw_rate=raw_w, raw_force=raw_f, n_poses=0,
        move_ranges=((0, len(t)),),
    )  # fmt: skip
    state = SimpleNamespace(accel_S=S_f, gyro_S=S_w)
    left_out: dict[str, str] = {}
    force, rate = read_f, read_w
    for _ in range(N_ROUNDS):
        core = SimpleNamespace(path=lambda moved=(rate, force, None): moved)
        context = SampleContext(cast(Fit, SimpleNamespace(core=core, state=state, obs=obs)), reference=references)
        force, rate = read_f, read_w
        for entry in effects:
            variant = _variant(entry, context, left_out)
            if variant is None:
                continue
            values = np.asarray(entry["model"]["values"], dtype=np.float64)
            sides = (force, variant.distortion.force), (rate, variant.distortion.rate)
            force, rate = (read if of is None else read - of @ values for read, of in sides)
    return Compensated(
        None if raw_f is None else raw_f + np.linalg.solve(S_f, (force - read_f).T).T,
        recording.gyroscope if raw_w is None else raw_w + np.linalg.solve(S_w, (rate - read_w).T).T,
        MappingProxyType(left_out),
    )


def _variant(entry: Mapping[str, Any], context: SampleContext, left_out: dict[str, str]) -> Variant | None:
    effect_id = str(entry.get("id", ""))
    model = entry.get("model")
    if not isinstance(model, Mapping) or "values" not in model or "variant" not in model:
        raise InputError(f"effect {effect_id!r} has no model with its variant and values")
    effect = by_id().get(effect_id)
    if effect is None:
        left_out[effect_id] = words("effect-unknown")
    elif not effect.applies_elsewhere:
        left_out[effect_id] = words("effect-of-session")
    else:
        label, n = model["variant"], len(model["values"])
        try:
            found = next(v for v in effect.variants(context) if v.label == label and v.distortion.n_parameters == n)
            shape = [float(model["shape"][name]) for name in found.shape]
            return effect.reshaped(context, found, *shape) if shape else found
        except SignalMissing as missing:
            left_out[effect_id] = words("because", sentence=missing)
        except (StopIteration, KeyError):
            raise InputError(f"effect {effect_id!r} has no variant {label!r} of {n} values with its shape") from None
    return None
