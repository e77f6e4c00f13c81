"""Bias that depends on the power of vibration."""

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import ACCELEROMETER, GYRO, Effect, Variant, on_axes
from trihedron.records.words import why_not
from trihedron.session.drift import TYPICAL

SHAKEN = 2.5
"""Vibration power, (m/s²)², by which the bias of consumer parts changes as while they warm up, one sigma: 200 mg/g²; a
tenth of it is tried too."""
STANDS_OUT = 1.5
"""Power of a pose over the median pose: the variance of 300 white readings has an uncertainty of 8 %; at most 1.13 in
48 healthy sessions."""


class VibrationRectification(Effect):
    """Bias proportional to vibration power above the quiet floor, per axis."""

    id = "vibration-rectification"
    accounts_for = ("within-static",)  # the vibration itself

    def sizes(self, context: Context, variant: Variant) -> FloatArray:  # noqa: ARG002
        return np.full(3, TYPICAL[GYRO if variant.distortion.force is None else ACCELEROMETER] / SHAKEN)

    def unavailable(self, context: Context) -> str | None:
        power = context.pose_power.sum(axis=1)
        return why_not("even-vibration") if power.max() < STANDS_OUT * np.median(power) else None

    def variants(self, context: Context) -> list[Variant]:
        excess = context.vibration_power
        # In moves vibration is hard to separate from quick motion: one variant with it, one without.
        still = np.where(np.arange(len(excess))[:, None] < context.obs.n_poses, excess, 0.0)
        out = [
            on_axes(context, ACCELEROMETER, ("accel_bias_per_power", power, "1/(m/s^2)"), label=label)
            for power, label in ((excess, "accelerometer"), (still, "accelerometer-in-poses"))
        ]
        if context.obs.raw_rate is not None:
            whole = excess.sum(axis=1, keepdims=True)
            out.append(on_axes(context, GYRO, ("gyro_bias_per_power", whole, "(rad/s)/(m/s^2)^2"), label="gyro"))
        return out
