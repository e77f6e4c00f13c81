"""Gyro zero that is another in every pose."""

from __future__ import annotations

import numpy as np

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.laws.find import MOST_FOLLOWS, gyro_zero_laws
from trihedron.diagnose.residuals.creep import settling
from trihedron.diagnose.residuals.goodness_of_fit import asks_for_scatter
from trihedron.diagnose.residuals.jumps import JUMPS, jumps_in_poses
from trihedron.diagnose.zeros.levels import two_levels
from trihedron.diagnose.zeros.of_session import (
    FEWEST_FOR_SIZE,
    exceeds_noise,
    gyro_evidence,
    scatter_parameters,
    share_of_zeros,
    with_gyro_scatter,
)
from trihedron.records.words import why_not


class GyroZeroScatter(DirectEffect):
    """The zero of every axis is drawn anew in every pose, beyond noise and drift."""

    is_spread = True
    id = "gyro-zero-scatter"
    is_proof = True
    is_late = True

    def unavailable(self, context: Context) -> str | None:
        if context.obs.raw_rate is None:
            return why_not("no-gyro")
        if context.obs.flickers(1):
            return why_not("flickers")
        return why_not("few-poses", fewest=FEWEST_FOR_SIZE) if context.obs.n_holds < FEWEST_FOR_SIZE else None

    def find(self, context: Context) -> Evidence | None:
        found = gyro_evidence(context)
        if (
            found is None
            or not (exceeds_noise(found) or asks_for_scatter(context.fitted, "static-gyro"))
            or gyro_zero_laws(context).share > MOST_FOLLOWS
        ):
            return None  # what follows something is a law, not scatter
        if jumps_in_poses(context.obs).p_value[1] < JUMPS:
            return None  # a zero that changes inside poses is not drawn anew in each
        if _takes_two_values(context):
            return None
        turning = settling(context)
        if turning.is_motion or (turning.creep > turning.scatter and not exceeds_noise(found)):
            return None  # the poses themselves turn
        sigma, si = found.evidence.scatter, context.si_per_raw("gyroscope")
        return Evidence(
            found.evidence.p_scatter_spared,
            0.0,
            scatter_parameters(found, "rad/s"),
            self.told("scatter", sigma=sigma),
            "static-gyro",
            reweigh=lambda obs: with_gyro_scatter(obs, sigma, si),
            share=share_of_zeros(found),
        )


def _takes_two_values(context: Context) -> bool:
    """A zero that some axis has one of two of (a trap, a play) is drawn from no law of scatter."""
    obs = context.obs
    if obs.hold_rate is None or obs.hold_rate_sigma is None:
        return False
    known = np.column_stack([obs.hold_force, obs.hold_time_s])
    return any(two_levels(obs.hold_rate[:, k], obs.hold_rate_sigma[:, k], known).is_clear for k in range(3))
