"""A pose that was pushed or not still: the experiment, not the sensor."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only, per_axis
from trihedron.records.diagnosis import EffectParameter


class DisturbedPose(Effect):
    """One pose with an extra acceleration of its own."""

    id = "disturbed-pose"
    mechanism = "one pose was not still or was pushed"
    experiment = "repeat that pose"

    def variants(self, context: Context) -> list[Variant]:
        out = []
        for i in range(context.obs.n_holds):
            columns = np.zeros((context.n_points, 3, 3))
            columns[i] = np.eye(3)
            shape = {"pose": (float(i), "index")}
            out.append(Variant(force_only(columns), per_axis("push"), ("m/s^2",) * 3, shape, f"pose {i}"))
        return out

    def statement(self, parameters: tuple[EffectParameter, ...]) -> str:
        pose = next(p.value for p in parameters if p.name == "pose")
        size = float(np.sqrt(sum(p.value**2 for p in parameters if p.name.startswith("push"))))
        return f"Pose {pose:.0f} was not still or was pushed: its mean is off by {size:.2g} m/s²; repeat or leave it out."
