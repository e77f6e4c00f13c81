"""Effects that several recordings of one unit share."""

import math
from dataclasses import dataclass

from trihedron.records.calibration import Calibration
from trihedron.records.diagnosis import Diagnosis, EffectParameter
from trihedron.records.finding import Finding
from trihedron.records.frozen import Frozen
from trihedron.records.plain import Plain
from trihedron.records.presented import Printed


@dataclass(frozen=True)
class SharedEffect(Frozen, Plain):
    """An effect accepted with common parameters for all recordings together.

    ``score`` is twice its gain in log-evidence, corrected for multiple testing, ``scores`` the same for every recording
    alone; ``each`` are its parameters there, ``p_agree`` the p-value of the hypothesis that they are equal.
    """

    id: str
    score: float
    parameters: tuple[EffectParameter, ...]
    scores: tuple[float, ...]
    each: tuple[tuple[EffectParameter, ...], ...]
    p_agree: float
    is_of_instrument: bool
    """Whether the recordings' values agree; otherwise the effect differs from recording to recording."""

    @property
    def surest(self) -> int:
        """Index of the recording that alone determines the parameters best, by the product of their uncertainties."""
        return min(range(len(self.each)), key=lambda k: math.prod(one.std for one in self.each[k]))


@dataclass(frozen=True)
class SharedCandidate(Frozen, Plain):
    """An effect that was tried in all recordings together and not accepted, with its score."""

    id: str
    score: float


@dataclass(frozen=True, eq=False, repr=False)
class SharedDiagnosis(Printed):
    """Several recordings of one unit: a diagnosis of each, and shared effects. ``print`` gives the report."""

    diagnoses: tuple[Diagnosis, ...]
    effects: tuple[SharedEffect, ...]
    candidates: tuple[SharedCandidate, ...]
    calibrations: tuple[Calibration, ...] = ()
    """The calibration of each recording by itself, with which its diagnosis began."""
    findings: tuple[Finding, ...] = ()
    """Parameters in which the recordings differ as those of different units do."""

    @property
    def of_single_recordings(self) -> tuple[tuple[str, ...], ...]:
        """For every recording the effects (ids) of its own diagnosis that are not shared."""
        shared = {one.id for one in self.effects if one.is_of_instrument}
        return tuple(tuple(one.id for one in d.effects if one.id not in shared) for d in self.diagnoses)

    def __repr__(self) -> str:
        return f"<SharedDiagnosis of {len(self.diagnoses)} recordings, {len(self.effects)} shared effects>"
