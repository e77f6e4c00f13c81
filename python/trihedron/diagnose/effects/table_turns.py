"""Turns on a table by multiples of a right angle: what they say about the turns and the table."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.integrate import trapezoid

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect
from trihedron.records.words import why_not

NEAR_DEG = 12.0
"""A turn meant to be a multiple of 90° lands within this; hand moves land anywhere."""
MOST_SWING_DEG = 8.0
"""On a table tilted by 4° a half turn swings the vertical in the body by twice that."""
MOST_ACROSS = 0.25
"""Rate across the vertical over that about it: on a table the axis stays within 14° of the vertical."""
FEWEST_TURNS, NEARLY_ALL = 4, 0.7
"""Hand moves land near a multiple by chance in 27 %: three of four do in 6 %, eight of ten in 1 of 1500 sessions."""
HALF_RIGHT_RAD = np.pi / 4
"""A turn by less is nearer to none than to a right angle."""


@dataclass(frozen=True, eq=False)
class TableTurn:
    """One move about the vertical between two poses of the same face: angle and its distance from the multiple."""

    move: int
    angle_rad: float
    error_rad: float


def table_turns(context: Context) -> list[TableTurn]:
    """Moves whose axis is the vertical throughout: the vertical ends where it began in the body."""
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


def meant_as_multiples(turns: list[TableTurn]) -> bool:
    """Whether these are turns against a wall: at least four, nearly all close to a multiple of 90°."""
    near = [abs(np.degrees(turn.error_rad)) < NEAR_DEG for turn in turns]
    return len(turns) >= FEWEST_TURNS and float(np.mean(near)) > NEARLY_ALL


class TableEffect(DirectEffect):
    """An effect of an experiment on a table."""

    is_of_session = True

    def unavailable(self, context: Context) -> str | None:
        is_there = context.moves and meant_as_multiples(table_turns(context))
        return None if is_there else why_not("no-table-turns")
