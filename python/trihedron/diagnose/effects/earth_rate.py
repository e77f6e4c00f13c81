"""The Earth's rotation, which turns with the attitude."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, rate_only
from trihedron.records.diagnosis import EffectParameter

EARTH_RATE_RAD_S = 7.292115e-5
"""WGS 84."""


class EarthRate(Effect):
    """Earth rate in the level frame of the first pose: two horizontal components and the vertical one."""

    id = "earth-rate"
    mechanism = "the gyros see the Earth turn"
    experiment = (
        "turn the level sensor by 180° on the table: Earth rate changes its horizontal part, g-sensitivity does not"
    )

    def unavailable(self, context: Context) -> str | None:
        if context.obs.raw_rate is None or not context.moves:
            return "the log has no moves with a gyro"
        return None

    def variants(self, context: Context) -> list[Variant]:
        attitude = context.hold_attitude
        attitude = np.where(np.isfinite(attitude), attitude, 0.0)
        return [
            Variant(
                rate_only(context.between_holds(attitude)), ("horizontal_x", "horizontal_y", "vertical"), ("rad/s",) * 3
            )
        ]

    def is_plausible(self, value: FloatArray, covariance: FloatArray) -> bool:
        # The Earth turns at one rate: a vector of another length is something else that turns with the attitude.
        size = float(np.linalg.norm(value))
        sigma = float(np.sqrt(value @ covariance @ value)) / max(size, 1e-30)
        return abs(size - EARTH_RATE_RAD_S) < 3.0 * sigma

    def parameters(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> tuple[EffectParameter, ...]:
        linear = super().parameters(variant, value, covariance)
        size = float(np.linalg.norm(value))
        if size == 0.0:
            return linear
        direction = value / size
        horizontal = max(float(np.hypot(value[0], value[1])), 1e-12)
        d_latitude = np.array([-value[0] * value[2], -value[1] * value[2], horizontal**2]) / (size**2 * horizontal)
        d_heading = np.array([-value[1], value[0], 0.0]) / horizontal**2
        return (
            EffectParameter("rate", size, float(np.sqrt(direction @ covariance @ direction)), "rad/s"),
            EffectParameter(
                "latitude",
                float(np.degrees(np.arctan2(value[2], horizontal))),
                float(np.degrees(np.sqrt(d_latitude @ covariance @ d_latitude))),
                "deg",
            ),
            EffectParameter(
                "north_azimuth",
                float(np.degrees(np.arctan2(value[1], value[0]))),
                float(np.degrees(np.sqrt(d_heading @ covariance @ d_heading))),
                "deg",
            ),
            *linear,
        )
