"""A diagnosis: where recording and twin differ, which physics explains it, and what remains."""

from __future__ import annotations

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, Literal, get_args

from trihedron.arrays import FloatArray
from trihedron.records.checked import WrongTypeError, all_of, kind_of, number_of, said
from trihedron.records.domains import Domain, DomainResiduals, DomainTest, HeldOut
from trihedron.records.frozen import Frozen, freeze, thawed

Verdict = Literal["consistent", "parameters-differ", "missing-physics", "unexplained", "not-testable"]
SCHEMA_VERSION = 2


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
class AcceptedEffect(Frozen):
    """An effect the recording demands, or, with ``side`` ``model``, one that only the given model has.

    ``share`` is the part of the misfit of the recording that it removes, 0 to 1; ``None`` where that was not computed.
    """

    id: str
    statement: str
    parameters: tuple[EffectParameter, ...]
    p_adjusted: float
    delta_bic: float
    held_out: tuple[HeldOut, ...]
    confounded_with: tuple[str, ...] = ()
    separating_experiment: str = ""
    model: MappingProxyType[str, Any] = field(default_factory=lambda: MappingProxyType({}))
    share: float | None = None
    side: Literal["recording", "model"] = "recording"

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types; ``heldout`` is the most improved domain, ``heldout_all`` every domain touched."""
        return {
            "id": self.id,
            "in": self.side,
            "share": self.share,
            "statement": self.statement,
            "parameters": [p.to_dict() for p in self.parameters],
            "p_adjusted": self.p_adjusted,
            "delta_bic": self.delta_bic,
            "heldout": self.held_out[0].to_dict() if self.held_out else None,
            "heldout_all": [h.to_dict() for h in self.held_out],
            "confounded_with": list(self.confounded_with),
            "separating_experiment": self.separating_experiment,
            "model": thawed(self.model),
        }


@dataclass(frozen=True)
class ParameterDifference:
    """One number of a given model against the value that the recording has.

    ``id`` is the group (``gyro-zero``, ``accel-scale``, ...), ``name`` the component. ``difference`` is recording minus
    model; ``p_value`` and ``significant`` are those of the group, the search over all groups paid for.
    """

    id: str
    sensor: Literal["accelerometer", "gyroscope", "both"]
    name: str
    model: float
    recording: float
    difference: float
    std: float
    unit: str
    p_value: float
    significant: bool

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types (the ``parameters`` entries of the schema)."""
        return {
            "id": self.id,
            "sensor": self.sensor,
            "name": self.name,
            "model": self.model,
            "recording": self.recording,
            "difference": self.difference,
            "std": self.std,
            "unit": self.unit,
            "p_value": self.p_value,
            "significant": self.significant,
        }


NoiseTerm = Literal[
    "N", "B", "K", "Q", "bandwidth", "line", "resolution", "range", "rate", "jitter", "octave", "distribution",
    "unit", "frame",
]  # fmt: skip


@dataclass(frozen=True)
class NoiseDifference:
    """One figure of noise or sampling of a given model against the recording's.

    ``ratio`` is model over recording with its 95 % ``interval``; ``axis`` is empty for what all axes share; ``remark``
    says in words what the number resembles (a density scaled by the rate twice). ``term`` ``unit`` is a reading written
    in another unit than it says, ``frame`` one along other axes (gravity's sign, rates of the world).
    """

    sensor: Literal["accelerometer", "gyroscope", "both"]
    axis: str
    term: NoiseTerm
    model: float | None
    recording: float | None
    ratio: float | None
    interval: tuple[float, float] | None
    unit: str
    p_value: float | None
    significant: bool
    remark: str = ""

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types (the ``noise`` entries of the schema)."""
        return {
            "sensor": self.sensor,
            "axis": self.axis,
            "term": self.term,
            "model": self.model,
            "recording": self.recording,
            "ratio": self.ratio,
            "interval": None if self.interval is None else list(self.interval),
            "unit": self.unit,
            "p_value": self.p_value,
            "significant": self.significant,
            "remark": self.remark,
        }


@dataclass(frozen=True)
class Law:
    """What a misfit without a known mechanism depends on, by which law, and how much of it that law predicts."""

    sensor: Literal["accelerometer", "gyroscope"]
    depends_on: tuple[str, ...]
    form: str
    coefficients: tuple[EffectParameter, ...]
    share: float
    held_out: HeldOut | None
    resembles: tuple[str, ...] = ()
    experiment: str = ""
    statement: str = ""

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types (the ``laws`` entries of the schema)."""
        return {
            "sensor": self.sensor,
            "depends_on": list(self.depends_on),
            "form": self.form,
            "coefficients": [c.to_dict() for c in self.coefficients],
            "share": self.share,
            "heldout": None if self.held_out is None else self.held_out.to_dict(),
            "resembles": list(self.resembles),
            "experiment": self.experiment,
            "statement": self.statement,
        }


@dataclass(frozen=True)
class StageDomain:
    """One domain at one stage, on poses and moves that the stage's fit did not see."""

    domain: Domain
    rms: float
    chi2_per_dof: float | None
    unit: str

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return {"domain": self.domain, "rms": self.rms, "chi2_per_dof": self.chi2_per_dof, "unit": self.unit}


@dataclass(frozen=True)
class Stage:
    """How well the recording is predicted: as given, with numbers, noise, effects re-estimated one after the other."""

    stage: Literal["as-given", "numbers", "noise", "effects"]
    domains: tuple[StageDomain, ...]

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types (the ``stages`` entries of the schema)."""
        return {"stage": self.stage, "domains": [d.to_dict() for d in self.domains]}


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
class LinearModel(Frozen):
    """S and b of both sensors with their standard errors (direct form, raw → SI), as plain nested tuples.

    ``covariance`` (24, 24), or (12, 12) without a gyro, in the order of a calibration file; ``None`` if not kept.
    """

    accelerometer: MappingProxyType[str, Any]
    gyroscope: MappingProxyType[str, Any] | None
    covariance: FloatArray | None = None

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types."""
        return {
            "accelerometer": thawed(self.accelerometer),
            "gyroscope": None if self.gyroscope is None else thawed(self.gyroscope),
            "covariance": None if self.covariance is None else self.covariance.tolist(),
        }


@dataclass(frozen=True)
class Diagnosis(Frozen):
    """What came out when the digital twin was held against the recording (schema version 2)."""

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
    parameters: tuple[ParameterDifference, ...] = ()
    noise_compared: tuple[NoiseDifference, ...] = ()
    laws: tuple[Law, ...] = ()
    stages: tuple[Stage, ...] = ()

    def __post_init__(self) -> None:
        if not isinstance(self.verdict, str) or self.verdict not in get_args(Verdict):
            raise WrongTypeError(f"verdict is one of {', '.join(get_args(Verdict))}, not {said(self.verdict)}.")
        for name in ("domains", "remaining"):
            all_of(name, getattr(self, name), DomainTest)
        all_of("effects", self.effects, AcceptedEffect)
        all_of("candidates", self.candidates, Candidate)
        for name in ("baseline", "extended"):
            kind_of(name, getattr(self, name), LinearModel)
        for name in ("noise", "references"):
            kind_of(name, getattr(self, name), dict, MappingProxyType)
        for name in ("gravity_m_s2", "alpha"):
            number_of(name, getattr(self, name))
        for name in ("recording_source", "recording_sha256"):
            kind_of(name, getattr(self, name), str)
        all_of("residuals", self.residuals, DomainResiduals)
        all_of("parameters", self.parameters, ParameterDifference)
        all_of("noise_compared", self.noise_compared, NoiseDifference)
        all_of("laws", self.laws, Law)
        all_of("stages", self.stages, Stage)
        freeze(self)

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
            "parameters": [p.to_dict() for p in self.parameters],
            "noise": [n.to_dict() for n in self.noise_compared],
            "noise_model": thawed(self.noise),
            "laws": [law.to_dict() for law in self.laws],
            "stages": [stage.to_dict() for stage in self.stages],
            "gravity_m_s2": self.gravity_m_s2,
            "alpha": self.alpha,
            "recording": {"source": self.recording_source, "sha256": self.recording_sha256},
            "references": dict(self.references),
            "residuals": [r.to_dict() for r in self.residuals],
        }
