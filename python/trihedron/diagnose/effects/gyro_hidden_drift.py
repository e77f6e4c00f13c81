"""Gyro bias that drifts in time; no logged channel explains it."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Variant, per_axis, rate_only
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.drift_shapes import drift_variants, is_possible_drift, warm_up_variant
from trihedron.diagnose.session.observations import FloatArray
from trihedron.diagnose.zeros.curve import DriftCurve, smooth_curve
from trihedron.diagnose.zeros.of_session import SessionEvidence, gyro_evidence, share_of_curve, walk_of_noise
from trihedron.records.diagnosis import EffectParameter
from trihedron.units import degrees_from_radians

AXES = ("x", "y", "z")
FEWEST_POSES = 15
"""A free curve is told from scatter with this many poses."""
BEYOND_NOISE = 3.0
"""Range of the curve over the largest rms that the noise identified in the holds could walk in such a session."""


class GyroHiddenDrift(DirectEffect):
    """Warm-up exponential, straight line or slow curve per axis; where none of them fits, a free smooth curve."""

    id = "gyro-hidden-drift"
    mechanism = "gyro bias drifts smoothly in time though no logged channel explains it"
    experiment = "log the temperature, or let the sensor warm up and repeat the first poses at the end"
    is_late = True
    is_proof = True

    def unavailable(self, context: Context) -> str | None:
        if context.obs.raw_rate is None:
            return "the log has no gyro"
        return "fewer than six still poses" if context.obs.n_holds < 6 else None

    def variants(self, context: Context) -> list[Variant]:
        return drift_variants(context, context.on_gyros, rate_only, "rad/s")

    def reshaped(self, context: Context, variant: Variant, value: float) -> Variant | None:
        if variant.label != "warm-up":
            return None
        return warm_up_variant(context, context.on_gyros, rate_only, "rad/s", value)

    def is_plausible_variant(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:  # noqa: ARG002
        return is_possible_drift(variant, value)

    def made_again(self, context: Context, variant: Variant) -> Variant | None:
        if variant.label != "smooth":
            return super().made_again(context, variant)
        found = gyro_evidence(context)
        return None if found is None else _variant(context, _curve(context, found))

    def find(self, context: Context) -> Evidence | None:
        found = gyro_evidence(context)
        if found is None or found.evidence.n_poses < FEWEST_POSES or not found.evidence.kind:
            return None
        curve = _curve(context, found)
        if (curve.rms < BEYOND_NOISE * walk_of_noise(context)).all():
            return None
        spans = ", ".join(f"{degrees_from_radians(r):.2g}" for r in curve.range)
        parameters = tuple(
            EffectParameter(f"range_{axis}", float(r), float(np.hypot(s[v.argmax()], s[v.argmin()])), "rad/s")
            for axis, r, v, s in zip(AXES, curve.range, curve.values, curve.sigma, strict=True)
        )
        told = {"drift": "smoothly", "walk": "as a walk, beyond its noise", "slow": "slowly"}[found.evidence.kind]
        return Evidence(
            found.evidence.p_slow, 0.0, parameters,
            f"The gyro's zero drifts {told} through {spans} °/s (x, y, z); no logged channel explains it.",
            "static-gyro", variant=_variant(context, curve), share=share_of_curve(found, curve.rms),
            series={
                "time_s": curve.time_s.tolist(), "value": curve.values.tolist(), "sigma": curve.sigma.tolist(),
                "unit": "rad/s",
            },
        )  # fmt: skip


def _curve(context: Context, found: SessionEvidence) -> DriftCurve:
    readings = found.zeros.readings
    every = list(range(readings.design.shape[1]))
    return smooth_curve(found.evidence.process, every, found.evidence.sigma, context.obs.hold_time_s)


def _variant(context: Context, curve: DriftCurve) -> Variant:
    """The curve itself, one column an axis: its factor is 1 where session and poses agree."""
    values = np.stack([np.interp(context.time_s, curve.time_s, v) for v in curve.values], axis=1)
    return Variant(rate_only(context.on_gyros(values)), per_axis("curve"), ("1",) * 3, label="smooth")
