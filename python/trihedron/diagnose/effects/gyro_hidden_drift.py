"""Gyro bias that drifts in time; no logged channel explains it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Variant, per_axis, rate_only
from trihedron.diagnose.effects.hidden_drift import HiddenDrift
from trihedron.diagnose.session.twin import Distortion
from trihedron.diagnose.zeros.curve import DriftCurve
from trihedron.diagnose.zeros.evidence import beats_walk
from trihedron.diagnose.zeros.of_session import SessionEvidence, gyro_evidence, share_of_curve, walk_of_noise
from trihedron.records.words import why_not


class GyroHiddenDrift(HiddenDrift):
    """Of the gyro: what its readings at rest show from pose to pose."""

    id = "gyro-hidden-drift"
    leaves_open = ("gyro-zero",)
    is_proof = True
    sensor = 1
    domain, unit = "static-gyro", "rad/s"
    fewest_poses = 15

    def unavailable(self, context: Context) -> str | None:
        return why_not("no-gyro") if context.obs.raw_rate is None else super().unavailable(context)

    def on_axes(self, context: Context) -> Callable[[FloatArray], FloatArray]:
        return context.on_gyros

    def only(self, columns: FloatArray) -> Distortion:
        return rate_only(columns)

    def evidence(self, context: Context) -> SessionEvidence | None:
        return gyro_evidence(context)

    def is_beyond_noise(self, context: Context, found: SessionEvidence, curve: DriftCurve) -> bool:  # noqa: ARG002
        return beats_walk(found.evidence, walk_of_noise(context))

    def share(self, found: SessionEvidence, curve: DriftCurve) -> float:
        return share_of_curve(found, curve.rms)

    def curve_variant(self, context: Context, curve: DriftCurve) -> Variant:
        values = np.stack([np.interp(context.time_s, curve.time_s, v) for v in curve.values], axis=1)
        return Variant(rate_only(context.on_gyros(values)), per_axis("curve"), ("1",) * 3, label="smooth")
