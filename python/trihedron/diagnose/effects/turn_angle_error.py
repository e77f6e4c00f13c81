"""Turns that are not the multiple of a right angle they were meant to be."""

from __future__ import annotations

import numpy as np
from scipy.special import chdtrc

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.table_turns import NEAR_DEG, meant_as_multiples, table_turns
from trihedron.records.diagnosis import EffectParameter, Where


class TurnAngleError(DirectEffect):
    """Table turns against a wall miss their multiple of 90° by more than the gyro's own error."""

    id = "turn-angle-error"
    mechanism = "a turn meant to be a multiple of 90° was not"
    experiment = "repeat the turns against a stop; turn back by the same angle"

    def unavailable(self, context: Context) -> str | None:
        if not context.moves or not meant_as_multiples(table_turns(context)):
            return "the session has no turns on a table against a wall"
        return None

    def find(self, context: Context) -> Evidence | None:
        turns = table_turns(context)
        cov = context.fitted.covariance()[9:18, 9:18]
        raw_scale = np.linalg.norm(np.linalg.inv(context.fitted.twin.gyro_S), axis=1).mean()
        scale_sigma = float(np.sqrt(np.mean(np.diag(cov)[[0, 4, 8]])) * raw_scale)
        noise = context.noise_floor[1].mean() / np.sqrt(context.obs.recording.rate_hz)
        errors, sigmas = [], []
        for turn in turns:
            where = context.moves[turn.move]
            duration = float(context.time_s[where.stop - 1] - context.time_s[where.start])
            errors.append(turn.error_rad)
            # A common scale error of up to a few sigma cannot pass for wrong turns: it grows with the angle.
            sigmas.append(float(np.hypot(3.0 * scale_sigma * abs(turn.angle_rad), noise * np.sqrt(duration))) + 1e-3)
        z = np.array(errors) / np.array(sigmas)
        chi2 = float((z**2).sum())
        p = float(chdtrc(len(z), chi2))
        bad = np.flatnonzero(np.abs(z) > 4.0)
        if p > 1e-4 or len(bad) == 0:
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
            f"{len(bad)} of {len(turns)} table turns miss their multiple of 90° (up to "
            f"{max(abs(np.degrees(errors[k])) for k in bad):.1f}°, others within {NEAR_DEG:.0f}°).",
            "moves", Where(("gx", "gy", "gz"), tuple(f"move {turns[k].move}" for k in bad), spans),
        )  # fmt: skip
