"""Domains of residuals, their tests against noise, and their cross-validated prediction."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

from trihedron.arrays import FloatArray
from trihedron.records.finding import Finding
from trihedron.records.frozen import Frozen
from trihedron.records.plain import Plain

Domain = Literal[
    "static-accel", "static-gyro", "moves", "dynamics", "rate", "within-static", "timing", "parameters", "noise"
]
DOMAINS: tuple[Domain, ...] = ("static-accel", "static-gyro", "moves", "dynamics", "within-static", "timing")


@dataclass(frozen=True)
class Where(Plain):
    """Where a disagreement is: channels, segments (``pose 3``, ``move 7``), intervals of time, frequencies."""

    channels: tuple[str, ...] = ()
    segments: tuple[str, ...] = ()
    times_s: tuple[tuple[float, float], ...] = ()
    frequencies_hz: tuple[float, ...] = ()


@dataclass(frozen=True)
class DomainTest(Plain):
    """Test of one domain's residuals, whitened by the predicted noise, against noise alone.

    ``limit`` is the χ² per degree of freedom up to which the domain agrees; ``None`` where another statistic decides:
    its noisiest pose, strongest line or worst time.
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

    @property
    def excess(self) -> float:
        """Chi-square beyond the degrees of freedom; 0 where it is less."""
        return max(self.chi2_per_dof - 1.0, 0.0) * self.dof


@dataclass(frozen=True, eq=False)
class DomainResiduals(Frozen, Plain):
    """Residuals of one domain before and after the accepted effects, pose by pose or move by move, SI or degrees.

    ``before`` (n, k) and ``after`` (m, k) at ``time_before_s`` (n,), ``time_after_s`` (m,) (middle of pose or move),
    with ``sigma_before`` (n,), ``sigma_after`` (m,) the standard deviation predicted for one number. n and m differ
    where an effect excludes moves or splits poses. ``channels`` (k,) names the columns, ``kind`` is ``pose`` or
    ``move``. ``names_before`` (n,) and ``names_after`` (m,) name the pose or move of each row: a disturbed pose has an
    interval on each side of the disturbance, both with its name.
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
    """Cross-validated prediction of one domain, without and with the effect."""

    domain: Domain
    chi2_per_dof_before: float
    chi2_per_dof_after: float
    rms_before: float
    rms_after: float
    unit: str


OF_THE_LINEAR_FIT: Mapping[Domain, frozenset[str]] = MappingProxyType(
    {
        "static-accel": frozenset({"residual-above-noise", "nonlinear-residual"}),
        "static-gyro": frozenset({"gyro-g-sensitivity", "gyro-bias-drift"}),
        "moves": frozenset({"residual-above-noise", "held-out-worse", "losses-possible"}),
        "dynamics": frozenset({"losses-possible"}),
    }
)
"""Findings about the residuals of the linear fit, by the domain in which they show."""


def not_explained(findings: Iterable[Finding], remaining: Iterable[DomainTest]) -> tuple[Finding, ...]:
    """Findings of a linear calibration without those about residuals in domains that agree with noise by the effects;
    ``remaining`` are the tests with the effects."""
    left = [OF_THE_LINEAR_FIT.get(d.domain, frozenset()) for d in remaining if d.disagrees]
    gone = frozenset().union(*OF_THE_LINEAR_FIT.values()).difference(*left)
    # Losses that a counter shows, without a share of the rotation, are facts of the log.
    by_motion = "losses-possible" in gone
    return tuple(
        f
        for f in findings
        if f.code not in gone and not (by_motion and f.code == "samples-lost" and "sigma_lost_share" in f.numbers)
    )
