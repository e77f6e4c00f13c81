"""Gyro bias that drifts in time and that no logged channel explains."""

from trihedron.diagnose.effects.bias_drift import BiasDrift
from trihedron.diagnose.effects.contract import GYRO


class GyroBiasDrift(BiasDrift):
    """Gyro bias drift: seen in the static rates from pose to pose."""

    id, sensor = "gyro-bias-drift", GYRO
    confounded_with = ("gyro-bias",)
    typical = 4e-3
