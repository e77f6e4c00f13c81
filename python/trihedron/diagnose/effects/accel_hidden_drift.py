"""Accel bias that drifts in time; no logged channel explains it."""

from __future__ import annotations

from collections.abc import Callable

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Variant, force_only, per_axis
from trihedron.diagnose.effects.hidden_drift import HiddenDrift
from trihedron.diagnose.session.twin import Distortion
from trihedron.diagnose.zeros.curve import DriftCurve
from trihedron.diagnose.zeros.of_session import SessionEvidence, accel_evidence, share_of_curve

FEWEST_OF_WAVES = ((25, 4), (18, 2))
"""Poses from which a curve of so many cosines an axis is tried: one length a pose, nine spent on S and b, three a
cosine, and some that are left to judge it by."""
BEYOND_NOISE = 3.0
"""Rms of the curve over the error of a pose's mean."""


class AccelHiddenDrift(HiddenDrift):
    """Of the accelerometer: what the length of gravity shows from pose to pose."""

    id = "accel-hidden-drift"
    leaves_open = ("accel-zero",)
    sensor = 0
    domain, unit = "static-accel", "m/s^2"
    fewest_poses = 18

    def on_axes(self, context: Context) -> Callable[[FloatArray], FloatArray]:
        return context.on_accelerometers

    def only(self, columns: FloatArray) -> Distortion:
        return force_only(columns)

    def evidence(self, context: Context) -> SessionEvidence | None:
        return accel_evidence(context)

    def is_beyond_noise(self, context: Context, found: SessionEvidence, curve: DriftCurve) -> bool:  # noqa: ARG002
        noise = float(np.sqrt(np.mean(found.zeros.readings.sigma**2) / 2.0))
        return not bool((curve.rms < BEYOND_NOISE * noise).all())

    def n_waves(self, n_poses: int) -> int:
        return next((waves for fewest, waves in FEWEST_OF_WAVES if n_poses >= fewest), 0)

    def share(self, found: SessionEvidence, curve: DriftCurve) -> float:
        return min(1.0, share_of_curve(found, curve.rms / np.sqrt(3.0)))

    def curve_variant(self, context: Context, curve: DriftCurve) -> Variant:
        values = np.stack([np.interp(context.time_s, curve.time_s, v) for v in curve.values], axis=1)
        columns = np.eye(3)[None] * values[:, None, :]
        return Variant(force_only(columns), per_axis("curve"), ("1",) * 3, label="smooth")
