"""Accelerometer zero that is another in every pose."""

from __future__ import annotations

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.laws.find import MOST_FOLLOWS, accel_zero_laws
from trihedron.diagnose.residuals.goodness_of_fit import asks_for_scatter
from trihedron.diagnose.residuals.jumps import JUMPS, jumps_in_poses
from trihedron.diagnose.zeros.of_session import (
    FEWEST_NORM_POSES,
    accel_evidence,
    exceeds_noise,
    scatter_parameters,
    share_of_zeros,
    with_accel_scatter,
)
from trihedron.records.words import why_not


class AccelZeroScatter(DirectEffect):
    """Zeros drawn anew in every pose, one size for three axes: the length of gravity does not tell axes apart."""

    is_spread = True
    id = "accel-zero-scatter"
    is_proof = True
    is_late = True

    def unavailable(self, context: Context) -> str | None:
        if context.obs.flickers(0):
            return why_not("flickers")
        few = context.obs.n_holds < FEWEST_NORM_POSES
        return why_not("few-poses", fewest=FEWEST_NORM_POSES) if few else None

    def find(self, context: Context) -> Evidence | None:
        found = accel_evidence(context)
        if (
            found is None
            or not (exceeds_noise(found) or asks_for_scatter(context.fitted, "static-accel"))
            or accel_zero_laws(context).share > MOST_FOLLOWS
        ):
            return None  # what follows something is a law, not scatter
        if jumps_in_poses(context.obs).p_value[0] < JUMPS:
            return None  # a zero that changes inside poses is not drawn anew in each
        sigma, si = float(found.evidence.scatter[0]), context.si_per_raw("accelerometer")
        return Evidence(
            found.evidence.p_scatter_spared,
            0.0,
            scatter_parameters(found, "m/s^2"),
            self.told("scatter", sigma=sigma),
            "static-accel",
            reweigh=lambda obs: with_accel_scatter(obs, sigma, si),
            share=share_of_zeros(found),
        )
