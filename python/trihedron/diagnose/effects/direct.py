"""Effects that show themselves in the samples, not as a curve over poses: they bring their own evidence."""

from __future__ import annotations

from abc import abstractmethod
from collections.abc import Callable, Mapping
from dataclasses import dataclass, field
from typing import Any, ClassVar

import numpy as np
import numpy.typing as npt

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant
from trihedron.diagnose.session.observations import Observations
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Domain, HeldOut, Where

NOWHERE = Where()
MIN_FALL = 15.0
"""Chi-square that moves must gain by samples put back: as one of two numbers (place and count) paid for by a search."""
MUST_HALVE = 0.5
"""Share of the misfit of such moves that may stay: a loss explains its move, a jolt does not."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """What a direct test found.

    ``p_value`` before payment for the search over effects; ``held_out`` the effect's own before/after on data its
    parameters were not fitted to; ``reweigh`` changes what the observations claim (noise, excluded moves),
    or None; ``strength`` is the gain in 2 log-likelihood, for ranking.
    ``touched`` are the moves whose readings ``reweigh`` changes, ``None`` for all: there the change must help.
    ``share`` is the part of its domain's misfit that it explains, where that is not a matter of poses and moves.
    ``statement`` is the catalogue's (:meth:`Effect.told`), or what a user's own effect says.
    ``series`` is a curve that belongs to the answer, as plain JSON types.
    ``restate`` gives the parameters once more from the twin that was fitted with the evidence taken into account.
    """

    p_value: float
    strength: float
    parameters: tuple[EffectParameter, ...]
    statement: str
    domain: Domain
    where: Where = NOWHERE
    held_out: tuple[HeldOut, ...] = ()
    reweigh: Callable[[Observations], Observations] | None = None
    confounded_with: tuple[str, ...] = ()
    restate: Callable[[Context], tuple[EffectParameter, ...]] | None = None
    share: float | None = None
    touched: tuple[int, ...] | None = None
    series: Mapping[str, Any] = field(default_factory=dict)


class DirectEffect(Effect):
    """An effect with a test of its own."""

    is_sought_again: ClassVar[bool] = False
    """Whether it is looked for once more then: what another effect had hidden, or what was mistaken for it."""
    is_proof: ClassVar[bool] = False
    """Whether the samples alone prove it (a range that ends): else mending it must predict held-out moves better."""

    @abstractmethod
    def find(self, context: Context) -> Evidence | None:
        """The evidence for the effect in this recording, or ``None`` when there is none."""

    def variants(self, context: Context) -> list[Variant]:  # noqa: ARG002
        """Direct effects do not compete in the score test."""
        return []


def without_moves(
    ranges: tuple[tuple[int, int], ...], poses: npt.NDArray[np.intp], bad: set[int]
) -> tuple[tuple[tuple[int, int], ...], npt.NDArray[np.intp]]:
    """Move ranges and their poses without some of them."""
    keep = [m for m in range(len(ranges)) if m not in bad]
    return tuple(ranges[m] for m in keep), poses[keep]
