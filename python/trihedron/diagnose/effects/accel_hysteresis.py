"""Accelerometer offset that depends on the previous orientation."""

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import ACCELEROMETER, Effect, Variant, on_axes
from trihedron.session.drift import SLOW_S

PLAY_WIDTHS_M_S2 = (0.5, 2.0, 5.0)
"""Half-widths tried, a twentieth to half of g, then refined; above g the play never reverses in poses."""


class AccelHysteresis(Effect):
    """Offset per axis that depends on the direction of arrival (play operator) or settles after a rotation."""

    id = "accel-hysteresis"

    def variants(self, context: Context) -> list[Variant]:
        seen = [one.numbers["tau_s"] for one in context.obs.segments.findings if one.code == "bias-settling"]
        creeps = [_creep(context, tau) for tau in (*SLOW_S, *seen)]
        return [_play(context, width) for width in PLAY_WIDTHS_M_S2] + creeps

    def reshaped(self, context: Context, variant: Variant, value: float) -> Variant | None:
        return _play(context, value) if variant.label == "play" else _creep(context, value)


def _coarse(context: Context) -> tuple[FloatArray, npt.NDArray[np.intp], int]:
    """History of the force every 0.1 s, the index of the interval of each sample, and samples per interval."""
    step = max(1, round(0.1 * context.obs.recording.rate_hz))
    coarse = context.history[::step]
    return coarse, np.minimum(np.arange(len(context.history)) // step, len(coarse) - 1), step


def _play(context: Context, width: float) -> Variant:
    coarse, index, _ = _coarse(context)
    # Hysteresis adds minus the lead of the force over its follower.
    lead = context.at_points(-_core.play(coarse, width)[index])
    shape = {"half_width": (width, "m/s^2")}
    return on_axes(context, ACCELEROMETER, ("offset", lead, "m/s^2"), label="play", shape=shape)


def _creep(context: Context, tau: float) -> Variant:
    coarse, index, step = _coarse(context)
    slow = _core.simulate_first_order(coarse, step / context.obs.recording.rate_hz, (tau,) * 3)
    late = context.at_points((slow - coarse)[index])
    return on_axes(context, ACCELEROMETER, ("creep", late, "1"), label="creep", shape={"time_constant": (tau, "s")})
