"""Gyro bias that depends on specific force."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import AXES, Effect, Variant, rate_only
from trihedron.diagnose.laws.find import ROOM_VECTOR, gyro_zero_laws
from trihedron.diagnose.zeros.of_session import STANDS_OUT, gyro_evidence
from trihedron.records.words import why_not


class GyroGSensitivity(Effect):
    """Rate bias linear in specific force: ω reads G f more."""

    id = "gyro-g-sensitivity"
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        return why_not("no-gyro") if context.obs.raw_rate is None else None

    def withstands(self, context: Context) -> bool:
        if any(ROOM_VECTOR in law.depends_on for law in gyro_zero_laws(context).laws):
            return False  # its vertical part alone would be taken for this
        p = self.own_p_value(context)
        return p is None or p < STANDS_OUT

    def own_p_value(self, context: Context) -> float | None:
        found = gyro_evidence(context)
        gravity = None if found is None else found.evidence.groups.get("gravity")
        return None if gravity is None else gravity.p_value

    def variants(self, context: Context) -> list[Variant]:
        eye = np.eye(9).reshape(9, 3, 3)
        columns = np.einsum("kij,nj->nik", eye, context.force)
        names = tuple(f"G_{i}{j}" for i in AXES for j in AXES)
        return [Variant(rate_only(columns), names, ("(rad/s)/(m/s^2)",) * 9)]
