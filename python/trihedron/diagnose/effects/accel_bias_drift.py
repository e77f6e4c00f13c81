"""Accelerometer bias that drifts in time and that no logged channel explains."""

from trihedron.diagnose.effects.bias_drift import BiasDrift
from trihedron.diagnose.effects.contract import ACCELEROMETER

FEWEST_OF_WAVES = ((25, 4), (18, 2))
"""(poses, cosines per axis) from which a slow curve is tried. Each pose determines one number, the norm of gravity:
nine go to S and b, three to each cosine, and the others test the curve."""


class AccelBiasDrift(BiasDrift):
    """Accelerometer bias drift: seen in the norm of gravity from pose to pose."""

    id, sensor = "accel-bias-drift", ACCELEROMETER
    confounded_with = ("accel-bias",)
    typical = 0.05

    def n_waves(self, n_poses: int) -> int:
        return next((waves for fewest, waves in FEWEST_OF_WAVES if n_poses >= fewest), 0)
