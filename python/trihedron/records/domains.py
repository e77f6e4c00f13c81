"""Domains in which residuals are looked at, their tests, and how well each is predicted where no fit looked."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Literal

from trihedron.arrays import FloatArray
from trihedron.records.frozen import Frozen
from trihedron.records.plain import Plain

Domain = Literal[
    "static-accel", "static-gyro", "moves", "dynamics", "rate", "within-static", "timing", "parameters", "noise"
]
DOMAINS: tuple[Domain, ...] = ("static-accel", "static-gyro", "moves", "dynamics", "within-static", "timing")


@dataclass(frozen=True)
class Where(Plain):
    """What carries a disagreement: channels, segments (``hold 3``, ``move 7``), stretches of time, frequencies."""

    channels: tuple[str, ...] = ()
    segments: tuple[str, ...] = ()
    times_s: tuple[tuple[float, float], ...] = ()
    frequencies_hz: tuple[float, ...] = ()


@dataclass(frozen=True)
class DomainTest(Plain):
    """Residuals of one domain, whitened by the predicted noise, against what a healthy recording gives.

    ``limit`` is the χ² per degree of freedom up to which the domain agrees; ``None`` where something else decides: its
    loudest pose, line or time.
    """

    domain: Domain
    chi2_per_dof: float
    dof: float
    p_value: float
    disagrees: bool
    where: Where = Where()
    rms: float = 0.0
    unit: str = ""
    limit: float | None = None


@dataclass(frozen=True, eq=False)
class DomainResiduals(Frozen, Plain):
    """What one domain looks like before and after the accepted effects, pose by pose or move by move, SI or degrees.

    ``before`` (n, k) and ``after`` (m, k) at ``time_before_s`` (n,), ``time_after_s`` (m,) (middle of pose or move),
    with ``sigma_before`` (n,), ``sigma_after`` (m,) the noise predicted for one number. An effect that leaves moves
    out or splits poses makes n and m differ. ``channels`` (k,) names the columns, ``kind`` is ``pose`` or ``move``.
    ``names_before`` (n,) and ``names_after`` (m,) say which pose or move of the recording a row is: a pose that was
    disturbed has an interval on each side, both with its name.
    """

    domain: Domain
    quantity: str
    unit: str
    kind: Literal["pose", "move"]
    channels: tuple[str, ...]
    time_before_s: FloatArray
    before: FloatArray
    sigma_before: FloatArray
    time_after_s: FloatArray
    after: FloatArray
    sigma_after: FloatArray
    names_before: tuple[str, ...]
    names_after: tuple[str, ...]

    @property
    def n_whole(self) -> int:
        """Poses or moves of the recording among the rows, each counted once."""
        return len({name for name in self.names_before if name.startswith(self.kind)})


@dataclass(frozen=True)
class HeldOut(Plain):
    """Prediction of poses and moves the fit did not see, without and with the effect, in the domain it helps most."""

    domain: Domain
    chi2_per_dof_before: float
    chi2_per_dof_after: float
    rms_before: float
    rms_after: float
    unit: str
