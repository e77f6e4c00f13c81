"""Rotations on a table that differ from their intended multiple of 90°."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import Evidence
from trihedron.diagnose.effects.table_turns import NEAR_DEG, P_LIMIT, TableEffect, TableTurn, table_turns
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Where

OFF_SIGMA = 4.0
"""Deviation in sigma from which a rotation is named: by chance one of 16 000."""


class TurnAngleError(TableEffect):
    """Rotations on a table against a stop deviate from their multiple of 90° by more than the gyro's own error."""

    id = "turn-angle-error"

    def find(self, context: Context) -> Evidence | None:
        turns = table_turns(context)
        errors, sigmas = _without_common_scale(context, turns)
        z = errors / sigmas
        chi2 = float((z**2).sum())
        p = float(chdtrc(len(z), chi2))
        bad = np.flatnonzero(np.abs(z) > OFF_SIGMA)
        if p > P_LIMIT or len(bad) == 0:
            return None
        parameters = tuple(
            EffectParameter(
                f"error_move{turns[k].move}", float(np.degrees(errors[k])), float(np.degrees(sigmas[k])), "deg"
            )
            for k in bad
        )
        t = context.obs.time_s
        spans = tuple((float(t[a]), float(t[b - 1])) for a, b in (context.obs.move_ranges[turns[k].move] for k in bad))
        return Evidence(
            max(p, 1e-300), chi2, parameters,
            self.reported(
                "turns", wrong=len(bad), turns=len(turns), most_rad=max(abs(errors[k]) for k in bad), near_deg=NEAR_DEG
            ),
            "moves", Where(("gx", "gy", "gz"), context.obs.move_names([turns[k].move for k in bad]), spans),
        )  # fmt: skip


def _without_common_scale(context: Context, turns: list[TableTurn]) -> tuple[FloatArray, FloatArray]:
    """Errors of the rotations without the part that one scale error per body axis explains, and their noise [rad].

    A scale error grows with the angle and is the same for every rotation about an axis. The weighted median of error
    over angle is robust against single wrong rotations.
    """
    noise = context.noise_floor[1].mean() / np.sqrt(context.obs.recording.rate_hz)
    axes = np.array(
        [int(np.abs(context.fitted.state.up[context.obs.move_poses[turn.move][0]]).argmax()) for turn in turns]
    )
    errors, angles = np.array([turn.error_rad for turn in turns]), np.array([turn.angle_rad for turn in turns])
    sigmas = np.zeros(len(turns))
    for k, turn in enumerate(turns):
        where = context.moves[turn.move]
        duration = float(context.time_s[where.stop - 1] - context.time_s[where.start])
        sigmas[k] = np.hypot(noise * np.sqrt(duration), 1e-3)
    for axis in range(3):
        rows = axes == axis
        if rows.sum() < 2:
            continue
        ratio, weight = errors[rows] / angles[rows], np.abs(angles[rows])
        order = np.argsort(ratio)
        heavy = np.cumsum(weight[order])
        common = float(ratio[order][np.searchsorted(heavy, 0.5 * heavy[-1])])
        errors[rows] -= common * angles[rows]
    return errors, sigmas
