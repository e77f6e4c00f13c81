"""Three accelerometers at different points of the package (size effect)."""

import numpy as np

from trihedron.arrays import AXES
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only


class AccelSizeEffect(Effect):
    """Accelerometers Y and Z displaced from accelerometer X: each reads its own α×r + ω×(ω×r)."""

    id = "accel-size-effect"
    needs_moves = True
    applies_elsewhere = True
    size = 5e-3
    """m: distance between dies in one package."""

    def variants(self, context: Context) -> list[Variant]:
        w, a = context.rate, context.angular_acceleration
        axes, to_axes = context.accel_axes, np.linalg.inv(context.accel_axes)
        square = np.sum(w**2, axis=1)[:, None]
        sides = []
        for j in (1, 2):
            n = to_axes[j]
            # n · (α × r + ω × (ω × r)) as a row vector that multiplies r.
            along = np.cross(n, a) + (w @ n)[:, None] * w - square * n
            sides.append(axes[:, j, None] * along[:, None, :])
        columns = np.concatenate(sides, axis=2)
        names = tuple(f"r{j + 1}{axis}-r1{axis}" for j in (1, 2) for axis in AXES)
        return [Variant(force_only(columns), names, ("m",) * 6)]
