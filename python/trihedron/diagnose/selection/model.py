"""The model as it grows, effect by effect, and what is kept of each."""

from __future__ import annotations

from dataclasses import dataclass, field

from trihedron.diagnose.effects.contract import Effect, Variant
from trihedron.diagnose.effects.direct import Evidence
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Fit, Prediction
from trihedron.diagnose.session.twin import Distortion
from trihedron.records.diagnosis import HeldOut


@dataclass
class GrowingModel:
    """The model as it grows."""

    obs: Observations
    fitted: Fit
    prediction: Prediction
    distortions: list[Distortion] = field(default_factory=list)
    found: list[Found] = field(default_factory=list)
    refused: set[str] = field(default_factory=set)


@dataclass
class Found:
    """One accepted effect, before it is put into words."""

    effect: Effect
    variant: Variant | None
    evidence: Evidence | None
    p_adjusted: float
    delta_bic: float
    held_out: tuple[HeldOut, ...]
    primary: int
    rivals: tuple[str, ...]
    order: int
