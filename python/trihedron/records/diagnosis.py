"""A diagnosis: where recording and model differ, which effects explain it, and which residuals stay unexplained."""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, Literal

from trihedron.arrays import FloatArray
from trihedron.records.calibration import Calibration, SensorCalibration
from trihedron.records.checked import Checked
from trihedron.records.domains import Domain, DomainResiduals, DomainTest, HeldOut
from trihedron.records.finding import Finding
from trihedron.records.frozen import Frozen
from trihedron.records.plain import Layout, Plain, as_plain
from trihedron.records.presented import Printed

Verdict = Literal["consistent", "parameters-differ", "missing-physics", "unexplained", "not-testable"]
SCHEMA_VERSION = 3


RELATIVE = ("accel-scale", "gyro-scale", "gravity")
"""Groups of parameters whose differences and uncertainties are relative; they are compared by their logarithms."""


@dataclass(frozen=True)
class EffectParameter(Plain):
    """One physical parameter of an effect with its standard error."""

    name: str
    value: float
    std: float
    unit: str


@dataclass(frozen=True, eq=False)
class EffectCurve(Frozen):
    """Error that an effect adds to one axis of a sensor, as a function of one variable, with the data of single poses.

    ``driver`` is ``force``, ``rate`` (of ``driver_axis``), ``temperature``, ``supply``, ``vibration`` or ``time``, SI.
    ``value`` (m,) at ``x`` (m,) with ``sigma`` (m,): m/s² or rad/s, or, with ``is_relative``, part of the reading.
    ``data`` (n,) at ``data_x`` (n,) of ``poses`` (n,), counted from 0: the curve plus the residual of each pose; empty
    where poses do not show the effect.
    """

    sensor: Literal["accelerometer", "gyroscope"]
    axis: int
    driver: str
    driver_axis: int
    is_relative: bool
    x: FloatArray
    value: FloatArray
    sigma: FloatArray
    poses: tuple[int, ...]
    data_x: FloatArray
    data: FloatArray


@dataclass(frozen=True)
class AcceptedEffect(Frozen, Plain):
    """An effect accepted for the recording, or, with ``side`` ``model``, one that only the given model has.

    ``share`` is the fraction of the recording's misfit that it removes, 0 to 1; ``None`` where that was not computed.
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
    curves: tuple[EffectCurve, ...] = ()
    LAYOUT: ClassVar[Layout] = Layout(
        {"side": "in", "held_out": "heldout_all"},
        # The most improved domain, beside every domain touched.
        lambda effect, made: {"heldout": made["heldout_all"][0] if effect.held_out else None},
        ("curves",),
    )


@dataclass(frozen=True)
class ParameterDifference(Plain):
    """One parameter of a given model compared with its value in the recording.

    ``id`` is the group (``gyro-bias``, ``accel-scale``, ...), ``name`` the component. ``difference`` is recording minus
    model; ``p_value`` and ``significant`` are those of the group, corrected for multiple testing over all groups.
    ``remark`` names a likely mistake in words (biases that were drawn and never applied).
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
    remark: str = ""


NoiseTerm = Literal[
    "N", "B", "K", "Q", "bandwidth", "resolution", "range", "rate", "jitter", "octave", "distribution",
    "unit", "frame", "correlation-time", "poses", "moves",
]  # fmt: skip


@dataclass(frozen=True)
class NoiseDifference(Plain):
    """One figure of noise or sampling of a given model compared with the recording's.

    ``ratio`` is model over recording with its 95 % ``interval``; ``axis`` is empty for a figure common to all axes;
    ``remark`` names a likely mistake in words (a density scaled by the rate twice). ``term`` ``unit``: readings are in
    another unit than stated; ``frame``: along other axes (sign of gravity, rates in the world frame).
    ``band_hz`` are the limits of an octave. ``poses`` and ``moves``: rms gravity error and tilt error of simulations
    with the recording's motion; their interval is of 1 − 2 alpha.
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
    band_hz: tuple[float, float] | None = None


@dataclass(frozen=True)
class Relation(Plain):
    """An empirical relation: variables on which an unexplained misfit depends, and the fraction that they predict."""

    sensor: Literal["accelerometer", "gyroscope"]
    depends_on: tuple[str, ...]
    form: str
    coefficients: tuple[EffectParameter, ...]
    share: float
    held_out: HeldOut | None
    resembles: tuple[str, ...] = ()
    experiment: str = ""
    statement: str = ""
    LAYOUT: ClassVar[Layout] = Layout({"held_out": "heldout"})


@dataclass(frozen=True)
class StageDomain(Plain):
    """Residuals of one domain at one stage, on poses and moves held out of the stage's fit."""

    domain: Domain
    rms: float
    chi2_per_dof: float | None
    unit: str


@dataclass(frozen=True)
class Stage(Plain):
    """Prediction errors of the model as given, then with parameters, noise and effects re-estimated in turn."""

    stage: Literal["as-given", "parameters", "noise", "effects"]
    domains: tuple[StageDomain, ...]


@dataclass(frozen=True)
class Candidate(Plain):
    """One effect of the catalogue that was tried, accepted or not, or the reason why it does not apply.

    ``score`` is twice its gain in log-evidence beside the accepted effects, corrected for multiple testing; ``size``
    its parameters there, ``limit95`` the 95 % upper limit on the largest of them, in its unit; ``superseded_by`` the
    accepted effect that makes it redundant, where it would be accepted without that one.
    """

    id: str
    p_value: float | None
    applicable: bool
    reason: str = ""
    score: float | None = None
    size: tuple[EffectParameter, ...] = ()
    limit95: float | None = None
    superseded_by: str | None = None


@dataclass(frozen=True)
class LinearModel(Frozen, Plain):
    """S and b of both sensors with their standard errors (direct form, raw → SI), as plain nested tuples.

    ``covariance`` (24, 24), or (12, 12) without a gyro, in the order of a calibration file; ``None`` if not kept.
    """

    accelerometer: MappingProxyType[str, Any]
    gyroscope: MappingProxyType[str, Any] | None
    covariance: FloatArray | None = None

    @classmethod
    def of_sensors(
        cls, accelerometer: SensorCalibration, gyroscope: SensorCalibration | None, covariance: FloatArray | None = None
    ) -> LinearModel:
        """The model of calibrated sensors."""
        accel, gyro = (
            None if s is None else {"S": s.S.tolist(), "b": s.b.tolist(), "sigma_S": s.sigma_S.tolist(),
                                    "sigma_b": s.sigma_b.tolist(), "raw_unit": s.raw_unit}
            for s in (accelerometer, gyroscope)
        )  # fmt: skip
        assert accel is not None
        return cls(MappingProxyType(accel), None if gyro is None else MappingProxyType(gyro), covariance)


@dataclass(frozen=True)
class Diagnosis(Checked, Plain):
    """Where a recording and its model differ, which effects are missing, and what is unexplained (schema version 3).

    Attributes
    ----------
    verdict : str
        ``consistent``, ``parameters-differ``, ``missing-physics``, ``unexplained`` or ``not-testable``.
    domains, remaining : tuple of DomainTest
        χ² of every kind of residual with the linear model, and with the effects.
    effects, candidates : tuple of AcceptedEffect, tuple of Candidate
        Accepted effects, largest share of the misfit first; every effect tried, with the reason where not accepted.
    baseline, extended : LinearModel
        S and b with uncertainties, without and with the effects.
    noise : mapping
        Noise densities and bias changes that the model uses, by sensor.
    gravity_m_s2, alpha : float
        |g|, and the probability that a healthy log is called anything but consistent.
    recording_source, recording_sha256 : str
        The log.
    references : mapping of name to float
        Figures from the reference motion recorded beside the log.
    residuals : tuple of DomainResiduals
        Pose by pose and move by move, without and with the effects.
    parameters, noise_compared : tuple of ParameterDifference, tuple of NoiseDifference
        A given model's parameters and noise beside the recording's; empty without one.
    relations, stages : tuple of Relation, tuple of Stage
        Empirical relations in residuals that no effect explains; prediction errors stage by stage.

    Examples
    --------
    >>> trihedron.diagnose(recording, latitude_deg=60.0).alpha
    0.01
    """

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
    relations: tuple[Relation, ...] = ()
    stages: tuple[Stage, ...] = ()
    LAYOUT: ClassVar[Layout] = Layout(
        {"noise": "noise_model", "noise_compared": "noise"},
        lambda _, made: {
            "schema_version": SCHEMA_VERSION,
            "calibration": {name: made[name] for name in ("baseline", "extended")},
            "recording": {name: made[f"recording_{name}"] for name in ("source", "sha256")},
        },
        ("baseline", "extended", "recording_source", "recording_sha256"),
    )

    @property
    def predicted(self) -> tuple[tuple[StageDomain, StageDomain], ...]:
        """Cross-validated gravity error in poses and tilt error after rotations, without and with the effects."""
        stages = {stage.stage: {one.domain: one for one in stage.domains} for stage in self.stages}
        before, after = stages.get("parameters", {}), stages.get("effects", {})
        of_both = (domain for domain in ("static-accel", "moves") if domain in before and domain in after)
        return tuple((before[domain], after[domain]) for domain in of_both)

    def to_dict(self) -> dict[str, Any]:
        """As plain JSON types, valid against the published schema."""
        return as_plain(self, Diagnosis)


# Effects that several recordings of one unit share.


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
