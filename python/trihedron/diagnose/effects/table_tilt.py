"""A table that is not level, detected by rotating the sensor on it."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc, ndtr, stdtrit

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import Evidence
from trihedron.diagnose.effects.table_turns import P_LIMIT, TableEffect, table_turns
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Where

FEWEST_TO_SCATTER = 3
"""Rotations from which their scatter is used."""
LEAST_SINE = 0.3
"""Least sine of half the rotation: below 35° the vertical moves by less than 0.6 of the tilt."""
ORDINARY_DEG = 0.05
"""Feet, dust and hands tilt a case by a few hundredths of a degree on any table."""


def _error_of_mean(values: FloatArray, weights: FloatArray, noise: FloatArray) -> float:
    """Standard error of a weighted mean of few values: the larger of that by their scatter and that by their noise.

    Neighbouring rotations share a pose, and a scatter of four values has an uncertainty of 40 %. It is widened so that
    two standard errors of a t distribution cover as much as those of a normal one.
    """
    share = weights / weights.sum()
    by_noise = float(np.sqrt((share**2 * noise**2).sum()))
    n = len(values)
    if n < FEWEST_TO_SCATTER:
        return by_noise
    variance = float((share * (values - (share * values).sum()) ** 2).sum()) * n / (n - 1)
    wider = float(stdtrit(n - 1, ndtr(2.0)) / 2.0)
    return max(by_noise, wider * float(np.sqrt(variance * (share**2).sum())))


class TableTilt(TableEffect):
    """Rotating on a tilted table turns the vertical about the table's normal; it returns only after a full turn."""

    id = "table-tilt"

    def find(self, context: Context) -> Evidence | None:
        state, obs = context.fitted.state, context.obs
        chi2, dof, tilts, weights, noises = 0.0, 0, [], [], []
        for turn in table_turns(context):
            before, after = obs.move_poses[turn.move]
            half = abs(np.sin(turn.angle_rad / 2.0))
            if half < LEAST_SINE:
                continue
            change = state.up[after] - state.up[before]
            variance = obs.pose_force_sigma[before] ** 2 + obs.pose_force_sigma[after] ** 2
            sigma = float(np.sqrt((state.accel_S**2 @ variance).mean())) / state.gravity
            chi2 += float(change @ change) / sigma**2
            dof += 2
            tilts.append(float(np.linalg.norm(change)) / (2.0 * half))
            weights.append(half**2)
            noises.append(sigma / (2.0 * half))
        if dof == 0:
            return None
        p = float(chdtrc(dof, chi2))
        tilt = float(np.degrees(np.average(tilts, weights=weights)))
        scatter = _error_of_mean(np.degrees(tilts), np.array(weights), np.degrees(noises))
        if p > P_LIMIT or tilt < ORDINARY_DEG or tilt < 3.0 * scatter:
            return None
        return Evidence(
            max(p, 1e-300), chi2, (EffectParameter("tilt", tilt, max(scatter, 1e-4), "deg"),),
            self.reported("tilt", tilt_deg=tilt), "static-accel", Where(("ax", "ay", "az")),
        )  # fmt: skip
