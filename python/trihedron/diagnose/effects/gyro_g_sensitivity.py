"""Gyro bias that depends on specific force."""

import numpy as np

from trihedron.arrays import AXES
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, rate_only
from trihedron.records.words import why_not

UNIT = "(rad/s)/(m/s^2)"


class GyroGSensitivity(Effect):
    """Rate bias linear in specific force: the gyro reads ω + G f."""

    id = "gyro-g-sensitivity"
    size = 2e-4
    """(rad/s)/(m/s²): 0.1 °/s/g."""
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        return why_not("no-gyro") if context.obs.raw_rate is None else None

    def variants(self, context: Context) -> list[Variant]:
        eye = np.eye(9).reshape(9, 3, 3)
        columns = np.einsum("kij,nj->nik", eye, context.force)
        names = tuple(f"G_{i}{j}" for i in AXES for j in AXES)
        whole = Variant(rate_only(columns), names, (UNIT,) * 9)
        # One gyro axis of three may have it, or show it.
        rows = [
            Variant(rate_only(columns[:, :, 3 * k : 3 * k + 3]), names[3 * k : 3 * k + 3], (UNIT,) * 3, label=axis)
            for k, axis in enumerate(AXES)
        ]
        return [whole, *rows]
