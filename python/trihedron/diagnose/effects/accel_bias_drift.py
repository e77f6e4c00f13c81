"""Accelerometer bias that drifts in time and that no logged channel explains."""

from __future__ import annotations

from collections.abc import Callable

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.bias_drift import BiasDrift
from trihedron.diagnose.effects.contract import force_only
from trihedron.diagnose.session.state import Distortion

FEWEST_OF_WAVES = ((25, 4), (18, 2))
"""(poses, cosines per axis) from which a slow curve is tried. Each pose determines one number, the norm of gravity:
nine go to S and b, three to each cosine, and the others test the curve."""


class AccelBiasDrift(BiasDrift):
    """Accelerometer bias drift: seen in the norm of gravity from pose to pose."""

    id = "accel-bias-drift"
    confounded_with = ("accel-bias",)
    sensor, unit, domain = 0, "m/s^2", "static-accel"
    typical = 0.05

    def on_axes(self, context: Context) -> Callable[[FloatArray], FloatArray]:
        return context.on_accelerometers

    def only(self, columns: FloatArray) -> Distortion:
        return force_only(columns)

    def n_waves(self, n_poses: int) -> int:
        return next((waves for fewest, waves in FEWEST_OF_WAVES if n_poses >= fewest), 0)
