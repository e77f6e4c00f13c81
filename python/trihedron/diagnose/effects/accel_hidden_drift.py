"""Accel bias that drifts smoothly in time; no logged channel explains it."""

from __future__ import annotations

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only
from trihedron.diagnose.effects.drift_shapes import drift_variants, warm_up_variant


class AccelHiddenDrift(Effect):
    """Warm-up exponential, straight line or slow curve per axis."""

    id = "accel-hidden-drift"
    leaves_open = ("accel-zero",)
    mechanism = "accelerometer bias drifts smoothly in time though no logged channel explains it"
    experiment = "log the temperature, or let the sensor warm up and repeat the first poses at the end"

    def unavailable(self, context: Context) -> str | None:
        return "fewer than six still poses" if context.obs.n_holds < 6 else None

    def variants(self, context: Context) -> list[Variant]:
        return drift_variants(context, context.on_accelerometers, force_only, "m/s^2")

    def reshaped(self, context: Context, variant: Variant, value: float) -> Variant | None:
        if variant.label != "warm-up":
            return None
        return warm_up_variant(context, context.on_accelerometers, force_only, "m/s^2", value)
