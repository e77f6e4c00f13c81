"""Ratiometric readout: the reading scales with the supply."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import LEAST_SWING_V, Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only, per_axis, rate_only
from trihedron.records.words import why_not


class SupplySensitivity(Effect):
    """Scale and offset proportional to the logged supply voltage."""

    id = "supply-sensitivity"
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        if context.supply is None:
            return why_not("no-supply")
        if np.ptp(context.supply) < LEAST_SWING_V:
            return why_not("steady-supply")
        return None

    def variants(self, context: Context) -> list[Variant]:
        assert context.supply is not None
        v = context.supply[:, None]
        offset = context.on_accelerometers(v * np.ones(3))
        scale = context.on_accelerometers(v * context.axis_force)
        accel = force_only(np.concatenate([scale, offset], axis=2))
        names = per_axis("accel_scale") + per_axis("accel_offset")
        out = [Variant(accel, names, ("1",) * 3 + ("m/s^2",) * 3, label="accelerometer")]
        if context.obs.raw_rate is not None:
            offset = context.on_gyros(v * np.ones(3))
            scale = context.on_gyros(v * context.axis_rate)
            gyro = rate_only(np.concatenate([scale, offset], axis=2))
            names = per_axis("gyro_scale") + per_axis("gyro_offset")
            out.append(Variant(gyro, names, ("1",) * 3 + ("rad/s",) * 3, label="gyro"))
        return out
