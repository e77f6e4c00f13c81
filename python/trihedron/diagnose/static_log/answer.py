"""The diagnosis of a log with one or two orientations (docs/static-logs.md)."""

from collections.abc import Iterable, Mapping
from dataclasses import dataclass, replace
from types import MappingProxyType, SimpleNamespace
from typing import Any, cast

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.contract import ACCELEROMETER, GYRO, SENSORS, per_axis_parameters
from trihedron.diagnose.effects.periodic_interference import PeriodicInterference
from trihedron.diagnose.residuals.goodness_of_fit import N_DOMAINS_TESTED
from trihedron.diagnose.residuals.within_poses import judge_within_poses
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Fit
from trihedron.diagnose.static_log.heat import POWERS, Curve, DriftCurve, branch_gap, slow_change, thermal_curve
from trihedron.diagnose.static_log.pieces import StaticPieces, static_pieces
from trihedron.probability import LEAST_P
from trihedron.records import Pose, Recording
from trihedron.records.diagnosis import AcceptedEffect, Candidate, Diagnosis, EffectParameter, LinearModel
from trihedron.records.domains import Domain, DomainTest, HeldOut, Where
from trihedron.records.words import effect_words, experiment_for, why_not
from trihedron.session.noise import NOISE_CORNER_S
from trihedron.units import rate_to_si

DOMAINS: tuple[Domain, Domain] = ("static-accel", "static-gyro")
BEYOND_NOISE = 3.0
"""Least rms of a drift, in errors of one mean; of a walk, in the walk that white noise equals after 20 s (K = √3 N/τ),
as among poses."""


@dataclass(frozen=True, eq=False)
class _Samples:
    """The part of observations that the spectrum of a static log needs: readings with their slow part subtracted."""

    recording: Recording
    time_s: FloatArray
    readings: FloatArray
    segments: Any

    def pose_names(self, which: Iterable[int]) -> tuple[str, ...]:
        """Names of the static pieces, numbered from 1."""
        return tuple(f"pose {i + 1}" for i in which)


def diagnose_static_log(recording: Recording, model: LinearModel, gravity_m_s2: float, alpha: float) -> Diagnosis:
    """Biases against temperature and time, and spectral lines, of a log with too few orientations for a calibration.

    Parameters
    ----------
    recording : Recording
        A static log, a chamber log, two orientations: with an accelerometer.
    model : LinearModel
            Nominal or given S, b of both sensors, used only for sizes in physical units.
    """
    pieces = static_pieces(recording)
    domains: list[DomainTest] = []
    remaining: list[DomainTest] = []
    effects: list[AcceptedEffect] = []
    tried = {effect.id: Candidate(effect.id, None, False, why_not("few-orientations")) for effect in catalogue()}
    if pieces is not None:
        for sensor in reversed(range(len(pieces.means))):
            side = _Side(pieces, sensor, _sizes(model, sensor), _unit(recording, model, sensor))
            before, after, effect, candidates = _biases(side, alpha)
            domains.append(before)
            remaining.append(after)
            effects += [] if effect is None else [effect]
            tried |= {c.id: c for c in candidates}
        within, line = _lines(recording, pieces, model, alpha)
        domains.append(within)
        remaining.append(within if line is None else replace(within, disagrees=False, where=Where()))
        effects += [] if line is None else [line]
        tried["periodic-interference"] = Candidate("periodic-interference", within.p_value, True)
    effects.sort(key=lambda e: -(e.share or 0.0))
    return Diagnosis(
        verdict="missing-physics" if effects else "not-testable",
        domains=tuple(domains),
        effects=tuple(effects),
        remaining=tuple(remaining),
        candidates=tuple(tried[key] for key in sorted(tried)),
        baseline=model,
        extended=model,
        noise=MappingProxyType(_noise(recording, pieces, model)),
        gravity_m_s2=gravity_m_s2,
        alpha=alpha,
        recording_source=recording.source,
        recording_sha256=recording.sha256,
        references=MappingProxyType(
            {} if pieces is None or pieces.temperature is None
            else {"temperature_degc": float(pieces.temperature.mean())}
        ),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Side:
    """One sensor of a static log: its number, and the ``size`` (3,) of a raw unit along every axis in ``unit``."""

    pieces: StaticPieces
    sensor: int
    size: FloatArray
    unit: str

    @property
    def own(self) -> FloatArray:
        """(3,) standard error of a mean."""
        count = float(np.median(self.pieces.count))
        return np.asarray(self.size * self.pieces.sigma[self.sensor] / np.sqrt(count))

    def chi2(self, x: FloatArray) -> float:
        """χ² per degree of freedom of biases (n, 3) by noise alone."""
        return float(np.mean((x / self.own) ** 2))

    def id(self, effect: str) -> str:
        """The sensor's effect of this kind."""
        return f"{SENSORS[self.sensor].prefix}-{effect}"

    @property
    def biases(self) -> FloatArray:
        """(n, 3) readings about the mean of their orientation."""
        return self.pieces.about_poses(self.pieces.means[self.sensor]) * self.size

    @property
    def case(self) -> str:
        """Case of the sentence: sizes in customary units, or in counts where the scale is unknown."""
        return "static-counts" if self.unit == "counts" else "static"


def _matrix(model: LinearModel, sensor: int) -> FloatArray:
    side = (model.accelerometer, model.gyroscope)[sensor]
    return np.eye(3) if side is None else np.array(side["S"])


def _sizes(model: LinearModel, sensor: int) -> FloatArray:
    """(3,) size of a raw unit along every axis, in the model's unit."""
    return np.asarray(1.0 / np.linalg.norm(np.linalg.inv(_matrix(model, sensor)), axis=1))


def _unit(recording: Recording, model: LinearModel, sensor: int) -> str:
    """SI, or ``counts`` where neither the log nor a given calibration states the unit of a gyro's count."""
    is_counts = sensor == GYRO and rate_to_si(recording.gyroscope_unit) is None
    return "counts" if is_counts and _matrix(model, GYRO)[0, 0] == 1.0 else SENSORS[sensor].unit


def _noise(recording: Recording, pieces: StaticPieces | None, model: LinearModel) -> dict[str, Any]:
    step = np.sqrt(1.0 / recording.rate_hz)
    out: dict[str, Any] = {"accelerometer_density": [0.0] * 3, "accelerometer_unit": "m/s^2/sqrt(Hz)",
                           "accelerometer_corner_s": None, "gyroscope_density": None,
                           "gyroscope_unit": "rad/s/sqrt(Hz)", "gyroscope_corner_s": None}  # fmt: skip
    for sensor, sigma in enumerate(() if pieces is None else pieces.sigma):
        name = ("accelerometer", "gyroscope")[sensor]
        out[f"{name}_density"] = (sigma * _sizes(model, sensor) * step).tolist()
    return out


def _biases(side: _Side, alpha: float) -> tuple[DomainTest, DomainTest, AcceptedEffect | None, list[Candidate]]:
    """One sensor's biases: tests before and after removing the thermal curve or smooth drift found, and that effect."""
    pieces, sigma = side.pieces, side.pieces.sigma[side.sensor]
    n_effects = len(catalogue())
    curve = thermal_curve(pieces, side.sensor)
    effect: AcceptedEffect | None = None
    candidates = [Candidate(side.id("thermal-bias"), 1.0 if curve is None else curve.p_value, True)]
    if pieces.temperature is None:
        candidates = [Candidate(side.id("thermal-bias"), None, False, why_not("no-temperature"))]
    raw = left = side.biases
    if curve is not None and curve.p_value * n_effects < alpha:
        effect = _thermal(side, curve, n_effects)
        left = curve.rest * side.size
    else:
        drift, p, is_smooth = _drift(side)
        candidates.append(Candidate(side.id("bias-drift"), p, True))
        span = float(pieces.time_s[-1] - pieces.time_s[0])
        walk = np.sqrt(3.0) * side.size * sigma * np.sqrt(float(np.median(pieces.length_s / pieces.count)))
        walk = walk / NOISE_CORNER_S * np.sqrt(span / 6.0)
        least = BEYOND_NOISE * (side.own if is_smooth else np.hypot(walk, side.own))
        if drift is not None and p * n_effects < alpha and (drift.rms * side.size > least).any():
            effect = _drifting(side, drift, p, n_effects)
            at = np.stack([np.interp(pieces.time_s, drift.time_s, v) for v in drift.values], axis=1) * side.size
            left = raw - pieces.about_poses(at)
    before, after = (_domain(side, x, is_named=effect is not None, alpha=alpha) for x in (raw, left))
    return before, after, effect, candidates


def _domain(side: _Side, x: FloatArray, *, is_named: bool, alpha: float) -> DomainTest:
    """Biases about the mean of their orientation; the domain disagrees where an effect was named.

    A bias that walks is no disagreement by itself: without an effect nothing contradicts the model.
    """
    chi2 = side.chi2(x)
    p = 1.0 if not is_named else float(min(1.0, np.exp(-0.5 * max(chi2 - 1.0, 0.0) * 3.0)))
    worst = AXES[int(np.argmax((x / side.own).std(axis=0)))]
    where = Where(("ag"[side.sensor] + worst,)) if is_named else Where()
    return DomainTest(
        DOMAINS[side.sensor], chi2, float(x.size), p, p < alpha / N_DOMAINS_TESTED, where,
        float(np.sqrt(np.mean(x**2))), side.unit,
    )  # fmt: skip


def _thermal(side: _Side, curve: Curve, n_effects: int) -> AcceptedEffect:
    size, unit = side.size, side.unit
    units = {"bias_per_kelvin": f"{unit}/K", "bias_per_kelvin2": f"{unit}/K^2", "bias_per_kelvin3": f"{unit}/K^3",
             "bias_per_kelvin_per_s": f"{unit}/(K/s)", "half_gap": unit}  # fmt: skip
    parameters: list[EffectParameter] = []
    for name, value, std in zip(curve.names, curve.value.T, curve.std.T, strict=True):
        parameters += per_axis_parameters(name, value * size, std * size, units[name])
    raw, rest = side.biases, curve.rest * size
    gap = branch_gap(side.pieces, rest)
    if gap is not None:
        parameters += per_axis_parameters("branch_difference", *gap, unit)
    effect_id, is_accelerometer = side.id("thermal-bias"), side.sensor == ACCELEROMETER
    order, heat = sum(name in POWERS for name in curve.names), side.pieces.temperature
    assert heat is not None
    statement = effect_words(
        effect_id, side.case, low_degc=float(heat.min()), high_degc=float(heat.max()), is_straight=order == 1,
        is_parabola=order == 2, has_rate="bias_per_kelvin_per_s" in curve.names, has_branches="half_gap" in curve.names,
        swing=curve.swing * size, left=rest.std(axis=0), raw=raw.std(axis=0), has_gap=gap is not None,
        gap=() if gap is None else gap[0], is_one_pose=is_accelerometer and side.pieces.n_poses == 1,
    )  # fmt: skip
    missed = curve.held_out * size
    before, after = (float(np.sqrt(np.mean(x**2))) for x in (raw, missed))
    held = HeldOut(DOMAINS[side.sensor], side.chi2(raw), side.chi2(missed), before, after, unit)
    series = {"time_s": side.pieces.time_s.tolist(), "value": side.biases.T.tolist(),
              "pose": side.pieces.pose.tolist(), "unit": unit, "temperature_degc": heat.tolist()}  # fmt: skip
    return AcceptedEffect(
        id=effect_id, statement=statement, parameters=tuple(parameters),
        p_adjusted=float(min(1.0, max(curve.p_value, LEAST_P) * n_effects)), delta_bic=curve.score,
        held_out=(held,), confounded_with=("accel-thermal-scale",) if is_accelerometer else (),
        separating_experiment=experiment_for(effect_id, is_static=True) if is_accelerometer else "",
        model=_model("static-curve", series),
        share=float(np.clip(1.0 - (rest**2).sum() / (raw**2).sum(), 0.0, 1.0)),
    )  # fmt: skip


def _model(variant: str, series: Mapping[str, Any]) -> MappingProxyType[str, Any]:
    return MappingProxyType(
        {"variant": variant, "shape": {}, "values": [], "applies_to_other_recordings": False, "curve": dict(series)}
    )


def _drift(side: _Side) -> tuple[DriftCurve | None, float, bool]:
    """The curve of slowly changing biases, p of any slow change, and whether a walk alone does not explain it.

    ``None`` where they do not change slowly. The noise of every sensor becomes a walk; a smooth drift is an effect.
    """
    found = slow_change(side.pieces.readings(side.sensor))
    if not found.is_slow:
        return None, found.p_value, False
    curve = found.curve(range(side.pieces.n_poses), side.pieces.time_s[::2])
    return curve, max(found.p_value, LEAST_P), found.is_smooth


def _drifting(side: _Side, curve: DriftCurve, p: float, n_effects: int) -> AcceptedEffect:
    size, spans = side.size, curve.range * side.size
    errors = [float(np.hypot(s[v.argmax()], s[v.argmin()])) for v, s in zip(curve.values, curve.sigma, strict=True)]
    whole = float(side.biases.var(axis=0).sum())
    series = {"time_s": curve.time_s.tolist(), "value": (curve.values * size[:, None]).tolist(),
              "sigma": (curve.sigma * size[:, None]).tolist(), "unit": side.unit}  # fmt: skip
    return AcceptedEffect(
        id=side.id("bias-drift"), statement=effect_words(side.id("bias-drift"), side.case, range=spans),
        parameters=per_axis_parameters("range", spans, np.array(errors) * size, side.unit),
        p_adjusted=float(min(1.0, p * n_effects)),
        delta_bic=float(max(-2.0 * np.log(p), 0.0)), held_out=(), separating_experiment="",
        model=_model("static-drift", series),
        share=float(np.clip(((curve.rms * size) ** 2).sum() / whole, 0.0, 1.0)),
    )  # fmt: skip


def _lines(
    recording: Recording, pieces: StaticPieces, model: LinearModel, alpha: float
) -> tuple[DomainTest, AcceptedEffect | None]:
    """Spectral lines of the pieces, their slow part subtracted, and the test of noise that differs between pieces."""
    assert recording.accelerometer is not None
    t = recording.time_s

    sides = [one for one in (recording.accelerometer, recording.gyroscope) if one is not None]
    quick = [
        values - np.stack([np.interp(t, pieces.time_s, m) for m in means.T], axis=1)
        for values, means in zip(sides, pieces.means, strict=True)
    ]
    poses = tuple(Pose(k, a, b, a, b) for k, (a, b) in enumerate(pieces.spans))
    samples = cast(Observations, _Samples(recording, t, np.hstack(quick), SimpleNamespace(poses=poses)))
    test = judge_within_poses(samples, alpha)
    state = SimpleNamespace(accel_S=_matrix(model, ACCELEROMETER), gyro_S=_matrix(model, GYRO))
    effect = PeriodicInterference()
    found = effect.find(Context(cast(Fit, SimpleNamespace(obs=samples, state=state))))
    if found is None or found.p_value * len(catalogue()) >= alpha / 2.0:
        return test, None
    return test, AcceptedEffect(
        id=effect.id, statement=found.statement, parameters=found.parameters,
        p_adjusted=float(min(1.0, found.p_value * len(catalogue()))), delta_bic=found.strength,
        held_out=found.held_out, model=_model("", {}), share=found.share,
    )  # fmt: skip
