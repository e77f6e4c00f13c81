"""Documented axes that form a left-handed triad."""

import numpy as np

from trihedron.arrays import AXES, sigmas_of
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import DirectEffect, Evidence, per_axis_parameters
from trihedron.probability import SURE
from trihedron.records.domains import Where
from trihedron.sensor_model import order_and_reversed


class AxisHandedness(DirectEffect):
    """The gyro's axes, as documented, have the other handedness than the accelerometer's as documented."""

    id = "axis-handedness"

    def find(self, context: Context) -> Evidence | None:
        S = context.fitted.state.gyro_S
        if context.obs.raw_rate is None or len(context.moves) < 3:
            return None
        found = order_and_reversed(S)
        main, sigma = np.argmax(np.abs(S), axis=0), sigmas_of(context.fitted.covariance())[9:18].reshape(3, 3)
        largest = S[main, range(3)]
        # The sign of an axis is used only where its scale is determined.
        if (np.abs(largest) < SURE * sigma[main, range(3)]).any():
            return None
        if found is None:
            # A rotation by any angle is part of S; a reflection is not, whatever the angle.
            if np.linalg.det(S) > 0.0:
                return None
            reversed_axes, statement = list(AXES), self.reported("mirrored")
        else:
            order, against = found
            moved, reversed_axes = [AXES[j] for j in range(3) if order[j] != j], [AXES[j] for j in against]
            n = len(reversed_axes)
            if not (moved or n):
                return None
            # An exchange of accelerometer axes reflects its frame, in which all rates then appear reversed; reflecting
            # axis k alone makes the rates about the other two appear reversed.
            statement = (
                self.reported(
                    "exchanged", moved=moved, is_gyro=n == 0, is_pair=len(moved) == 2 and n in (0, 3),
                    directions=[(j in against, order[j] + 1) for j in range(3)],
                )
                if moved
                else self.reported(
                    "reversed", is_one=n == 1, is_two=n == 2, reversed=reversed_axes,
                    kept=[axis for axis in AXES if axis not in reversed_axes],
                )
            )  # fmt: skip
        parameters = per_axis_parameters("gyro_sign", np.sign(largest), np.zeros(3), "1")
        where = Where(tuple(f"g{axis}" for axis in reversed_axes))
        gain = float(((largest / sigma[main, range(3)]) ** 2).sum())
        return Evidence(0.0, gain, parameters, statement, "moves", where)
