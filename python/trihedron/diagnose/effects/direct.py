"""Effects detected by a test on the samples, with evidence of their own, not by columns over poses."""

from abc import abstractmethod
from collections.abc import Callable
from dataclasses import dataclass
from typing import ClassVar

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect
from trihedron.diagnose.session.observations import Observations
from trihedron.probability import LEAST_P
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Domain, HeldOut, Where

NOWHERE = Where()
MIN_FALL = 15.0
"""Chi-square that inserted samples must gain in their moves: it allows for the search over place and count."""
MUST_HALVE = 0.5
"""Largest share of the misfit of such moves that may remain: a loss explains its move, a jolt does not."""


@dataclass(frozen=True, eq=False)
class Evidence:
    """Result of a direct test.

    ``p_value`` is not corrected for the number of effects tested; ``held_out`` compares before and after on data that
    the parameters were not fitted to; ``reweigh`` changes the observations (noise, excluded moves), or is None;
    ``strength`` is the gain in twice a log-likelihood, for ranking.
    ``touched`` are the moves whose readings ``reweigh`` changes, ``None`` for all: these moves must improve.
    ``share`` is the share of its domain's misfit that it explains, for effects that do not show in poses and moves.
    ``statement`` is the catalogue's (:meth:`Effect.reported`), or that of a user's own effect.
    ``restate`` gives the parameters again from the session fitted with ``reweigh`` applied.
    """

    p_value: float
    strength: float
    parameters: tuple[EffectParameter, ...]
    statement: str
    domain: Domain
    where: Where = NOWHERE
    held_out: tuple[HeldOut, ...] = ()
    reweigh: Callable[[Observations], Observations] | None = None
    restate: Callable[[Context], tuple[EffectParameter, ...]] | None = None
    share: float | None = None
    touched: tuple[int, ...] | None = None

    def __post_init__(self) -> None:
        """Keep the p-value where its logarithm exists."""
        object.__setattr__(self, "p_value", min(max(float(self.p_value), LEAST_P), 1.0))


class DirectEffect(Effect):
    """An effect with its own test on the samples."""

    is_sought_again: ClassVar[bool] = False
    """Whether the test is repeated after the search: another effect may have hidden it or been mistaken for it."""
    is_proof: ClassVar[bool] = False
    """Whether the samples alone prove it (a range limit); otherwise its correction must improve held-out moves."""

    @abstractmethod
    def find(self, context: Context) -> Evidence | None:
        """The evidence for the effect in this recording, or ``None``."""
