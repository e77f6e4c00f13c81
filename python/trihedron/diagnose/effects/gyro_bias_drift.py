"""Gyro bias that drifts in time and that no logged channel explains."""

from __future__ import annotations

from collections.abc import Callable

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.bias_drift import BiasDrift
from trihedron.diagnose.effects.contract import rate_only
from trihedron.diagnose.session.state import Distortion


class GyroBiasDrift(BiasDrift):
    """Gyro bias drift: seen in the static rates from pose to pose."""

    id = "gyro-bias-drift"
    confounded_with = ("gyro-bias",)
    sensor, unit, domain = 1, "rad/s", "static-gyro"
    typical = 4e-3

    def on_axes(self, context: Context) -> Callable[[FloatArray], FloatArray]:
        return context.on_gyros

    def only(self, columns: FloatArray) -> Distortion:
        return rate_only(columns)
