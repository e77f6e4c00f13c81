"""Rotations on a table by multiples of 90°."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect
from trihedron.records.words import why_not

NEAR_DEG = 12.0
"""Distance from a multiple of 90° within which an intended one ends; moves by hand end anywhere."""
MOST_SWING_DEG = 8.0
"""On a table tilted by 4° half a turn moves the vertical in the body by twice that."""
MOST_ACROSS = 0.25
"""Rate across the vertical over that about it: on a table the axis stays within 14° of the vertical."""
FEWEST_TURNS, NEARLY_ALL = 4, 0.7
"""Hand moves end near a multiple by chance in 27 %: three of four do in 6 %, eight of ten in 1 of 1500 sessions."""
P_LIMIT = 1e-4
"""False-alarm rate of the χ² tests on a level table and on all angles together: none in 24 healthy sessions."""
HALF_RIGHT_RAD = np.pi / 4
"""45°: a smaller angle is nearer to 0° than to 90°."""


@dataclass(frozen=True, eq=False)
class TableTurn:
    """One move about the vertical between two poses of the same face: angle and its error to a multiple of 90°."""

    move: int
    angle_rad: float
    error_rad: float


def table_turns(context: Context) -> list[TableTurn]:
    """Moves about the vertical throughout: the vertical in the body is the same before and after."""
    state = context.fitted.state
    out = []
    for m, where in enumerate(context.moves):
        before, after = context.obs.move_poses[m]
        up = state.up[before]
        if up @ state.up[after] < np.cos(np.radians(MOST_SWING_DEG)):
            continue
        t = context.time_s[where]
        about_up = context.rate[where] @ up
        across = np.linalg.norm(context.rate[where] - np.outer(about_up, up), axis=1)
        angle = float(trapezoid(about_up, t))
        if abs(angle) < HALF_RIGHT_RAD or np.mean(across) > MOST_ACROSS * np.mean(np.abs(about_up)):
            continue
        error = (angle + HALF_RIGHT_RAD) % (2.0 * HALF_RIGHT_RAD) - HALF_RIGHT_RAD
        out.append(TableTurn(m, angle, float(error)))
    return out


class TableEffect(DirectEffect):
    """An effect of an experiment on a table."""

    is_of_session = True

    def unavailable(self, context: Context) -> str | None:
        """Unless at least four rotations, nearly all of them close to a multiple of 90°, are meant as such."""
        near = [abs(np.degrees(turn.error_rad)) < NEAR_DEG for turn in table_turns(context)]
        is_there = len(near) >= FEWEST_TURNS and float(np.mean(near)) > NEARLY_ALL
        return None if is_there else why_not("no-table-turns")
