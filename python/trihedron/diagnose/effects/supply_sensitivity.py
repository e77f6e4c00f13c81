"""Ratiometric readout: the reading scales with the supply."""

import numpy as np

from trihedron.diagnose.context import LEAST_SWING_V, Context
from trihedron.diagnose.effects.contract import SENSORS, Effect, Variant, joined, on_axes, per_axis
from trihedron.records.words import why_not


class SupplySensitivity(Effect):
    """Scale and offset proportional to the logged supply voltage."""

    id = "supply-sensitivity"
    applies_elsewhere = True

    def unavailable(self, context: Context) -> str | None:
        if context.supply is None:
            return why_not("no-supply")
        return why_not("steady-supply") if np.ptp(context.supply) < LEAST_SWING_V else None

    def variants(self, context: Context) -> list[Variant]:
        assert context.supply is not None
        v = context.supply[:, None]
        out = []
        for sensor, (label, prefix, unit) in enumerate(SENSORS):
            if sensor == 0 or context.obs.raw_rate is not None:
                names = per_axis(f"{prefix}_scale") + per_axis(f"{prefix}_offset")
                columns = on_axes(context, sensor, v * context.axis_motion(sensor), v)
                out.append(Variant(columns, names, ("1",) * 3 + (unit,) * 3, label=label))
        # Both sensors of a chip have one supply.
        return [*out, joined(out, label="both")] if len(out) > 1 else out
