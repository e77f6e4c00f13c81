"""What several recordings of one unit demand together."""

from __future__ import annotations

from dataclasses import dataclass

from trihedron.records.diagnosis import Diagnosis, EffectParameter
from trihedron.records.frozen import Frozen
from trihedron.records.plain import Plain
from trihedron.records.presented import Printed


@dataclass(frozen=True)
class SharedEffect(Frozen, Plain):
    """An effect whose one size all recordings demand together.

    ``score`` is twice the log-evidence gained less what the search paid, ``scores`` the same of every recording by
    itself; ``each`` are its parameters there, ``p_agree`` the chance that equal ones differ as much.
    """

    id: str
    score: float
    parameters: tuple[EffectParameter, ...]
    scores: tuple[float, ...]
    each: tuple[tuple[EffectParameter, ...], ...]
    p_agree: float
    is_of_instrument: bool
    """Whether the recordings' values agree: else something like it differs from recording to recording."""


@dataclass(frozen=True)
class SharedCandidate(Frozen, Plain):
    """An effect that was tried in all recordings together and is not demanded, with its score."""

    id: str
    score: float


@dataclass(frozen=True, eq=False, repr=False)
class SharedDiagnosis(Printed):
    """Several recordings of one unit: each diagnosed by itself, and what they share. ``print`` gives the report."""

    diagnoses: tuple[Diagnosis, ...]
    effects: tuple[SharedEffect, ...]
    candidates: tuple[SharedCandidate, ...]

    @property
    def of_single_recordings(self) -> tuple[tuple[str, ...], ...]:
        """Of every recording the effects (ids) that it names by itself and not all share."""
        shared = {one.id for one in self.effects if one.is_of_instrument}
        return tuple(tuple(one.id for one in d.effects if one.id not in shared) for d in self.diagnoses)

    def __repr__(self) -> str:
        return f"<SharedDiagnosis of {len(self.diagnoses)} recordings, {len(self.effects)} shared effects>"
