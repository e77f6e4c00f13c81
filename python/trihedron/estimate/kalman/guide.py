"""How far the goal is, and which pose brings it nearer: the covariance runs ahead of the data."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass
from typing import Generic, TypeVar

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError

State = TypeVar("State")


@dataclass(frozen=True)
class Goal:
    """Good enough: standard error of sensitivities relative to the axis' own, and of the bias in m/s²."""

    sensitivity: float = 1e-3
    bias_m_s2: float = 0.02

    def __post_init__(self) -> None:
        if not (self.sensitivity > 0 and self.bias_m_s2 > 0):
            raise RefusedError(f"a goal must be positive, got {self.sensitivity} and {self.bias_m_s2} m/s²")

    def shortfall(self, relative_sigma: FloatArray) -> float:
        """Largest standard error (3, 4) over its limit: 1 or less is good enough."""
        return float(np.max(relative_sigma / np.array([self.sensitivity] * 3 + [self.bias_m_s2])))


def _directions() -> FloatArray:
    grid = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1) if (x, y, z) != (0, 0, 0)])
    unit: FloatArray = grid / np.linalg.norm(grid, axis=1)[:, None]
    return unit


DIRECTIONS: FloatArray = _directions()
"""(26, 3) poses offered when no plan is given: faces, edges and corners of a cube."""


@dataclass(frozen=True)
class Guide(Generic[State]):
    """Looks ahead from a filter's state.

    ``after(state, direction)`` is the state after one more pose with specific force ``direction`` (3,), m/s²;
    ``relative_sigma(state)`` (3, 4) are the standard errors that the goal is about.
    """

    goal: Goal
    gravity_m_s2: float
    after: Callable[[State, FloatArray], State]
    relative_sigma: Callable[[State], FloatArray]

    def most_useful(self, state: State) -> tuple[FloatArray, State]:
        """The direction, of 26, whose pose leaves the smallest shortfall, and the state after it."""
        futures = [(self.gravity_m_s2 * d, self.after(state, self.gravity_m_s2 * d)) for d in DIRECTIONS]

        def cost(future: tuple[FloatArray, State]) -> float:
            relative = self.relative_sigma(future[1])
            # The worst constant decides; among equals the sum of all does, so that no pose is chosen for nothing.
            return self.goal.shortfall(relative) + 1e-3 * self.goal.shortfall(np.mean(relative, axis=0, keepdims=True))

        return min(futures, key=cost)

    def look_ahead(self, state: State, plan: FloatArray | None, most: int) -> tuple[int | None, FloatArray | None]:
        """Further poses until the goal is reached (None when ``most`` or the plan do not), and the next direction."""
        first: FloatArray | None = None
        for count in range(1, (most if plan is None else min(most, len(plan))) + 1):
            if plan is None:
                direction, state = self.most_useful(state)
            else:
                direction = plan[count - 1]
                state = self.after(state, direction)
            first = direction if first is None else first
            if self.goal.shortfall(self.relative_sigma(state)) <= 1.0:
                return count, first
        return None, first
