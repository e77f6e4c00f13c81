"""Three accelerometers that do not sit at one point."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import AXES, Effect, Variant, force_only


class AccelSizeEffect(Effect):
    """Accelerometers 2 and 3 displaced from accelerometer 1: each reads its own α×r + ω×(ω×r)."""

    id = "accel-size-effect"
    mechanism = "the three accelerometers do not sit at one point"
    experiment = "spin and shake the sensor about each axis in turn"

    def unavailable(self, context: Context) -> str | None:
        return "the log has no moves with a gyro" if not context.moves else None

    def variants(self, context: Context) -> list[Variant]:
        w, a = context.rate, context.angular_acceleration
        to_axes = np.linalg.inv(context.accel_axes)
        columns = np.zeros((context.n_points, 3, 6))
        for j in (1, 2):
            for c in range(3):
                r = np.eye(3)[c]
                local = np.cross(a, r) + np.cross(w, np.cross(w, r))
                along = local @ to_axes[j]
                columns[:, :, 3 * (j - 1) + c] = along[:, None] * context.accel_axes[:, j]
        names = tuple(f"r{j + 1}{axis}-r1{axis}" for j in (1, 2) for axis in AXES)
        return [Variant(force_only(columns), names, ("m",) * 6)]
