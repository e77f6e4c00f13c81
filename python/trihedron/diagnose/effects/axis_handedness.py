"""Documented axes that form a left-handed triad."""

import numpy as np

from trihedron.arrays import AXES
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import DirectEffect, Evidence, per_axis_parameters
from trihedron.records.domains import Where

SIGN_SIGMA = 5.0
"""Standard errors between a scale and zero from which its sign counts: wrong by chance in one of 3.5 million axes."""
CERTAIN = 1e6
"""Gain that ranks it before every effect: with a mirrored axis nothing else can be judged."""


class AxisHandedness(DirectEffect):
    """The gyro's axes, as documented, have the other handedness than the accelerometer's as documented."""

    id = "axis-handedness"

    def find(self, context: Context) -> Evidence | None:
        S = context.fitted.state.gyro_S
        if context.obs.raw_rate is None or len(context.moves) < 3:
            return None
        main = np.argmax(np.abs(S), axis=0)
        if sorted(main.tolist()) != [0, 1, 2]:
            return None
        sigma = np.sqrt(np.maximum(np.diag(context.fitted.covariance())[9:18], 0.0)).reshape(3, 3)
        largest, signs = S[main, range(3)], np.sign(S[main, range(3)])
        # The sign of an axis is used only where its scale is determined.
        if (np.abs(largest) < SIGN_SIGMA * sigma[main, range(3)]).any():
            return None
        if (signs > 0).all() and (main == np.arange(3)).all():
            return None
        reversed_axes, kept = ([AXES[j] for j in np.flatnonzero(one)] for one in (signs < 0, signs > 0))
        n, moved = len(reversed_axes), [AXES[j] for j in range(3) if main[j] != j]
        if moved:
            statement = self.reported("exchanged", moved=moved, is_turned=n not in (0, 3))
        else:
            # Reflecting accelerometer axis k makes the rates about the other two axes appear reversed.
            statement = self.reported(
                "reversed", is_one=n == 1, is_two=n == 2, is_three=n == 3, reversed=reversed_axes, kept=kept,
            )  # fmt: skip
        parameters = per_axis_parameters("gyro_sign", signs, np.zeros(3), "1")
        return Evidence(
            0.0, CERTAIN, parameters, statement, "moves", Where(tuple(f"g{axis}" for axis in reversed_axes))
        )
