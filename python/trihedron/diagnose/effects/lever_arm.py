"""Places of the accelerometers: the triad away from the centre of rotation, or its axes apart (size effect)."""

import math

import numpy as np

from trihedron import _core
from trihedron.arrays import AXES
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import DirectEffect, Effect, Evidence, Variant, acting_on, per_axis_parameters
from trihedron.diagnose.effects.saturation import clipped_samples
from trihedron.records.domains import HeldOut, Where
from trihedron.records.words import why_not
from trihedron.session.noise import FEWEST_POSES

P_LIMIT = 1e-5
"""False-alarm rate of Hotelling's test: the travel of a hand follows the rotation by chance (rust/lever_arm.rs)."""


class LeverArm(DirectEffect):
    """In moves f - (−g) follows α×r + ω×(ω×r) with one r for all of them.

    The travel of the hand is an unknown, mostly slow acceleration. Significance therefore comes from the scatter of the
    arm between moves (jackknife), not from sample noise.
    """

    id = "lever-arm"
    is_of_motion = True

    def unavailable(self, context: Context) -> str | None:
        return why_not("six-moves") if len(_true_moves(context)) < FEWEST_POSES else None

    def find(self, context: Context) -> Evidence | None:
        moves = [(where.start, where.stop) for where in _true_moves(context)]
        found = _core.lever_arm_of_moves(
            (context.time_s, context.rate, context.force, context.gravity_in_moves), context.turned,
            np.array(moves), rate_hz=context.obs.recording.rate_hz, fewest=FEWEST_POSES,
        )  # fmt: skip
        if found is None:
            return None
        arm, covariance, p_value, (before, after), n_moves = found
        if p_value > P_LIMIT:
            return None
        noise = context.obs.recording.rate_hz * float((context.noise_density[0] ** 2).mean())
        held = HeldOut("dynamics", before / noise, after / noise, math.sqrt(before), math.sqrt(after), "m/s^2")
        parameters = per_axis_parameters("r", arm, np.sqrt(np.diag(covariance)), "m")
        statement = self.reported("arm", arm_m=float(np.linalg.norm(arm)), share=1.0 - after / before)
        strength = n_moves * math.log(before / after)
        return Evidence(p_value, strength, parameters, statement, "dynamics", Where(("ax", "ay", "az")), (held,))


def _true_moves(context: Context) -> list[slice]:
    """Moves without readings at a range limit, which are false."""
    if not context.moves:
        return []
    clipped = clipped_samples(context.obs)
    pairs = zip(context.moves, context.obs.move_ranges, strict=True)
    return [where for where, (a, b) in pairs if not clipped[a:b].any()]


class AccelSizeEffect(Effect):
    """Accelerometers Y and Z displaced from accelerometer X: each reads its own α×r + ω×(ω×r)."""

    id = "accel-size-effect"
    needs_moves = True
    applies_elsewhere = True
    size = 5e-3
    """m: distance between dies in one package."""

    def variants(self, context: Context) -> list[Variant]:
        w, a = context.rate, context.angular_acceleration
        axes, to_axes = context.accel_axes, np.linalg.inv(context.accel_axes)
        square = np.sum(w**2, axis=1)[:, None]
        sides = []
        for j in (1, 2):
            n = to_axes[j]
            # n · (α × r + ω × (ω × r)) as a row vector that multiplies r.
            along = np.cross(n, a) + (w @ n)[:, None] * w - square * n
            sides.append(axes[:, j, None] * along[:, None, :])
        columns = np.concatenate(sides, axis=2)
        names = tuple(f"r{j + 1}{axis}-r1{axis}" for j in (1, 2) for axis in AXES)
        return [Variant(acting_on(0, columns), names, ("m",) * 6)]
