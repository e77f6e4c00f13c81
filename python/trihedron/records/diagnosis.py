"""A diagnosis: where recording and twin differ, which physics explains it, and what remains."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal

import numpy as np
import numpy.typing as npt

FloatArray = npt.NDArray[np.float64]

Verdict = Literal["consistent", "missing-physics", "unexplained"]
Domain = Literal["static-accel", "static-gyro", "moves", "dynamics", "within-static", "timing"]
DOMAINS: tuple[Domain, ...] = ("static-accel", "static-gyro", "moves", "dynamics", "within-static", "timing")
SCHEMA_VERSION = 1


@dataclass(frozen=True)
class Where:
    """What carries a disagreement: channels, segments (``hold 3``, ``move 7``), stretches of time, frequencies."""

    channels: tuple[str, ...] = ()
    segments: tuple[str, ...] = ()
    times_s: tuple[tuple[float, float], ...] = ()
    frequencies_hz: tuple[float, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return {
            "channels": list(self.channels),
            "segments": list(self.segments),
            "times_s": [list(pair) for pair in self.times_s],
            "frequencies_hz": list(self.frequencies_hz),
        }


@dataclass(frozen=True)
class DomainTest:
    """Residuals of one domain, whitened by the predicted noise, against what a healthy recording gives."""

    domain: Domain
    chi2_per_dof: float
    dof: float
    p_value: float
    disagrees: bool
    where: Where = Where()
    rms: float = 0.0
    unit: str = ""

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types (the ``domains`` and ``remaining`` entries of the schema)."""
        return {
            "domain": self.domain,
            "chi2_per_dof": self.chi2_per_dof,
            "dof": self.dof,
            "p_value": self.p_value,
            "disagrees": self.disagrees,
            "where": self.where.to_dict(),
            "rms": self.rms,
            "unit": self.unit,
        }


@dataclass(frozen=True, eq=False)
class DomainResiduals:
    """What one domain looks like before and after the accepted effects, pose by pose or move by move, SI or degrees.

    ``before`` (n, k) and ``after`` (m, k) at ``time_before_s`` (n,), ``time_after_s`` (m,) (middle of pose or move),
    with ``sigma_before`` (n,), ``sigma_after`` (m,) the noise predicted for one number. An effect that leaves moves
    out or splits poses makes n and m differ. ``channels`` (k,) names the columns, ``kind`` is ``hold`` or ``move``.
    """

    domain: Domain
    quantity: str
    unit: str
    kind: Literal["hold", "move"]
    channels: tuple[str, ...]
    time_before_s: FloatArray
    before: FloatArray
    sigma_before: FloatArray
    time_after_s: FloatArray
    after: FloatArray
    sigma_after: FloatArray

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        arrays = ("time_before_s", "before", "sigma_before", "time_after_s", "after", "sigma_after")
        return {
            "domain": self.domain,
            "quantity": self.quantity,
            "unit": self.unit,
            "kind": self.kind,
            "channels": list(self.channels),
            **{name: getattr(self, name).tolist() for name in arrays},
        }


@dataclass(frozen=True)
class EffectParameter:
    """One physical parameter of an effect with its standard error."""

    name: str
    value: float
    std: float
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return {"name": self.name, "value": self.value, "std": self.std, "unit": self.unit}


@dataclass(frozen=True)
class HeldOut:
    """Prediction of poses and moves the fit did not see, without and with the effect, in the domain it helps most."""

    domain: Domain
    chi2_per_dof_before: float
    chi2_per_dof_after: float
    rms_before: float
    rms_after: float
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return {
            "domain": self.domain,
            "chi2_per_dof_before": self.chi2_per_dof_before,
            "chi2_per_dof_after": self.chi2_per_dof_after,
            "rms_before": self.rms_before,
            "rms_after": self.rms_after,
            "unit": self.unit,
        }


@dataclass(frozen=True)
class AcceptedEffect:
    """An effect the recording demands."""

    id: str
    statement: str
    parameters: tuple[EffectParameter, ...]
    p_adjusted: float
    delta_bic: float
    held_out: tuple[HeldOut, ...]
    confounded_with: tuple[str, ...] = ()
    separating_experiment: str = ""
    model: MappingProxyType[str, Any] = field(default_factory=lambda: MappingProxyType({}))

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types; ``heldout`` is the most improved domain, ``heldout_all`` every domain touched."""
        return {
            "id": self.id,
            "statement": self.statement,
            "parameters": [p.to_dict() for p in self.parameters],
            "p_adjusted": self.p_adjusted,
            "delta_bic": self.delta_bic,
            "heldout": self.held_out[0].to_dict() if self.held_out else None,
            "heldout_all": [h.to_dict() for h in self.held_out],
            "confounded_with": list(self.confounded_with),
            "separating_experiment": self.separating_experiment,
            "model": dict(self.model),
        }


@dataclass(frozen=True)
class Candidate:
    """One catalogue effect tried on the baseline: its score test, or why it does not apply."""

    id: str
    p_value: float | None
    applicable: bool
    reason: str = ""

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return {"id": self.id, "p_value": self.p_value, "applicable": self.applicable, "reason": self.reason}


@dataclass(frozen=True)
class LinearModel:
    """S and b of both sensors with their standard errors (direct form, raw → SI), as plain nested tuples.

    ``covariance`` (24, 24), or (12, 12) without a gyro, in the order of a calibration file; ``None`` if not kept.
    """

    accelerometer: MappingProxyType[str, Any]
    gyroscope: MappingProxyType[str, Any] | None
    covariance: FloatArray | None = None

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return {
            "accelerometer": dict(self.accelerometer),
            "gyroscope": None if self.gyroscope is None else dict(self.gyroscope),
            "covariance": None if self.covariance is None else self.covariance.tolist(),
        }


@dataclass(frozen=True)
class Diagnosis:
    """What came out when the digital twin was held against the recording (schema version 1)."""

    verdict: Verdict
    domains: tuple[DomainTest, ...]
    effects: tuple[AcceptedEffect, ...]
    remaining: tuple[DomainTest, ...]
    candidates: tuple[Candidate, ...]
    baseline: LinearModel
    extended: LinearModel
    noise: MappingProxyType[str, Any]
    gravity_m_s2: float
    alpha: float
    recording_source: str = ""
    recording_sha256: str = ""
    references: MappingProxyType[str, float] = field(default_factory=lambda: MappingProxyType({}))
    residuals: tuple[DomainResiduals, ...] = ()

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types, valid against the published schema."""
        return {
            "schema_version": SCHEMA_VERSION,
            "verdict": self.verdict,
            "domains": [d.to_dict() for d in self.domains],
            "effects": [e.to_dict() for e in self.effects],
            "remaining": [d.to_dict() for d in self.remaining],
            "candidates": [c.to_dict() for c in self.candidates],
            "calibration": {"baseline": self.baseline.to_dict(), "extended": self.extended.to_dict()},
            "noise": dict(self.noise),
            "gravity_m_s2": self.gravity_m_s2,
            "alpha": self.alpha,
            "recording": {"source": self.recording_source, "sha256": self.recording_sha256},
            "references": dict(self.references),
            "residuals": [r.to_dict() for r in self.residuals],
        }
