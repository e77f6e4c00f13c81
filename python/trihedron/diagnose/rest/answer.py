"""The diagnosis of a log with one or two orientations (docs/static-logs.md)."""

from __future__ import annotations

from collections.abc import Iterable, Mapping
from dataclasses import dataclass
from types import MappingProxyType, SimpleNamespace
from typing import Any, Literal, cast

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.periodic_interference import PeriodicInterference
from trihedron.diagnose.residuals.goodness_of_fit import N_DOMAINS_TESTED
from trihedron.diagnose.residuals.within_poses import judge_within_poses
from trihedron.diagnose.rest.heat import Curve, DriftCurve, branch_gap, slow_change, smooth_curve, thermal_curve
from trihedron.diagnose.rest.pieces import RestPieces, rest_pieces
from trihedron.diagnose.rest.process import BiasReadings
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Fit
from trihedron.records import Pose, Recording
from trihedron.records.diagnosis import AcceptedEffect, Candidate, Diagnosis, EffectParameter, LinearModel
from trihedron.records.domains import Domain, DomainTest, HeldOut, Where
from trihedron.records.words import effect_words, experiment_for, why_not
from trihedron.session.noise import NOISE_CORNER_S
from trihedron.units import rate_to_si

Sensor = Literal["accelerometer", "gyroscope"]
PREFIX: dict[Sensor, str] = {"accelerometer": "accel", "gyroscope": "gyro"}
DOMAIN: dict[Sensor, Domain] = {"accelerometer": "static-accel", "gyroscope": "static-gyro"}
BEYOND_NOISE = 3.0
"""Least rms of a drift, in errors of one mean; of a walk, in the walk that white noise equals after 20 s (K = √3 N/τ),
as among poses."""


@dataclass(frozen=True, eq=False)
class _Samples:
    """The part of observations that the spectrum of a static log needs: readings with their slow part subtracted."""

    recording: Recording
    time_s: FloatArray
    raw_force: FloatArray
    raw_rate: FloatArray | None
    segments: Any

    def pose_names(self, which: Iterable[int]) -> tuple[str, ...]:
        """Names of the static pieces, numbered from 1."""
        return tuple(f"pose {i + 1}" for i in which)


def diagnose_rest(recording: Recording, model: LinearModel, gravity_m_s2: float, alpha: float) -> Diagnosis:
    """Biases against temperature and time, and spectral lines, of a log with too few orientations for a calibration.

    Parameters
    ----------
    recording : Recording
        A static log, a chamber log, two orientations: with an accelerometer.
    model : LinearModel
            Nominal or given S, b of both sensors, used only for sizes in physical units.
    """
    pieces = rest_pieces(recording)
    domains: list[DomainTest] = []
    remaining: list[DomainTest] = []
    effects: list[AcceptedEffect] = []
    not_here = why_not("few-orientations")
    tried = {effect.id: Candidate(effect.id, None, False, not_here) for effect in catalogue()}
    if pieces is not None:
        sensors: list[Sensor] = ["gyroscope", "accelerometer"] if pieces.rate is not None else ["accelerometer"]
        for sensor in sensors:
            unit = _unit(recording, model, sensor)
            before, after, found, candidates = _biases(pieces, sensor, _sizes(model, sensor), unit, alpha)
            domains.append(before)
            remaining.append(after)
            effects += found
            tried |= {c.id: c for c in candidates}
        within, line = _lines(recording, pieces, model, alpha)
        domains.append(within)
        remaining.append(within if line is None else _agreeing(within))
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


def _sizes(model: LinearModel, sensor: Sensor) -> FloatArray:
    """(3,) size of a raw unit along every axis, in the model's unit."""
    side = model.accelerometer if sensor == "accelerometer" else model.gyroscope
    return np.ones(3) if side is None else 1.0 / np.linalg.norm(np.linalg.inv(np.array(side["S"])), axis=1)


def _unit(recording: Recording, model: LinearModel, sensor: Sensor) -> str:
    """SI, or ``raw`` where neither the log nor a given calibration states the unit of a gyro's count."""
    if sensor == "accelerometer":
        return "m/s^2"
    side = model.gyroscope
    is_unknown = rate_to_si(recording.gyroscope_unit) is None and side is not None and side["S"][0][0] == 1.0
    return "raw" if is_unknown else "rad/s"


def _noise(recording: Recording, pieces: RestPieces | None, model: LinearModel) -> dict[str, Any]:
    step = np.sqrt(1.0 / recording.rate_hz)
    out: dict[str, Any] = {"accelerometer_density": [0.0] * 3, "accelerometer_unit": "m/s^2/sqrt(Hz)",
                           "accelerometer_corner_s": None, "gyroscope_density": None,
                           "gyroscope_unit": "rad/s/sqrt(Hz)", "gyroscope_corner_s": None}  # fmt: skip
    if pieces is not None:
        out["accelerometer_density"] = (pieces.force_sigma * _sizes(model, "accelerometer") * step).tolist()
        if pieces.rate_sigma is not None:
            out["gyroscope_density"] = (pieces.rate_sigma * _sizes(model, "gyroscope") * step).tolist()
    return out


def _biases(
    pieces: RestPieces, sensor: Sensor, size: FloatArray, unit: str, alpha: float
) -> tuple[DomainTest, DomainTest, list[AcceptedEffect], list[Candidate]]:
    """One sensor's biases: tests before and after removing the thermal curve or smooth drift found, and the effects."""
    prefix = PREFIX[sensor]
    sigma = pieces.force_sigma if sensor == "accelerometer" else pieces.rate_sigma
    assert sigma is not None
    n_effects = len(catalogue())
    own = size * sigma / np.sqrt(float(np.median(pieces.count)))
    candidates = []
    curve = thermal_curve(pieces, sensor)
    effect: AcceptedEffect | None = None
    if pieces.temperature is None:
        candidates.append(Candidate(f"{prefix}-thermal-bias", None, False, why_not("no-temperature")))
    else:
        candidates.append(Candidate(f"{prefix}-thermal-bias", 1.0 if curve is None else curve.p_value, True))
    raw = _about_poses(pieces, sensor) * size
    left = raw
    if curve is not None and curve.p_value * n_effects < alpha:
        effect = _thermal(pieces, sensor, curve, size, unit, n_effects)
        left = curve.rest * size
    else:
        drift, p, is_smooth = _drift(pieces, sensor)
        candidates.append(Candidate(f"{prefix}-bias-drift", p, True))
        span = float(pieces.time_s[-1] - pieces.time_s[0])
        walk = np.sqrt(3.0) * size * sigma * np.sqrt(float(np.median(pieces.length_s / pieces.count)))
        walk = walk / NOISE_CORNER_S * np.sqrt(span / 6.0)
        least = BEYOND_NOISE * (own if is_smooth else np.hypot(walk, own))
        if drift is not None and p * n_effects < alpha and (drift.rms * size > least).any():
            effect = _drifting(sensor, drift, raw, size, unit, p, n_effects)
            at = np.stack([np.interp(pieces.time_s, drift.time_s, v) for v in drift.values], axis=1) * size
            left = raw - (
                at - np.array([at[pieces.pose == k].mean(axis=0) for k in range(pieces.n_poses)])[pieces.pose]
            )
    tests = [_domain(DOMAIN[sensor], x, own, unit, is_named=effect is not None, alpha=alpha) for x in (raw, left)]
    return tests[0], tests[1], [] if effect is None else [effect], candidates


def _about_poses(pieces: RestPieces, sensor: Sensor) -> FloatArray:
    values = pieces.force if sensor == "accelerometer" else pieces.rate
    assert values is not None
    level = np.array([values[pieces.pose == p].mean(axis=0) for p in range(pieces.n_poses)])
    return np.asarray(values - level[pieces.pose])


def _domain(domain: Domain, x: FloatArray, own: FloatArray, unit: str, *, is_named: bool, alpha: float) -> DomainTest:
    """Biases about the mean of their orientation, in ``unit``; the domain disagrees where an effect was named.

    A bias that walks is no disagreement by itself: without an effect nothing contradicts the model.
    """
    chi2 = float(np.mean((x / own) ** 2))
    dof = float(x.size)
    p = 1.0 if not is_named else float(min(1.0, np.exp(-0.5 * max(chi2 - 1.0, 0.0) * 3.0)))
    worst = AXES[int(np.argmax((x / own).std(axis=0)))]
    where = Where((("a" if domain == "static-accel" else "g") + worst,)) if is_named else Where()
    return DomainTest(domain, chi2, dof, p, p < alpha / N_DOMAINS_TESTED, where, float(np.sqrt(np.mean(x**2))), unit)


def _case(unit: str) -> str:
    """Case of the sentence: sizes in customary units, or in counts where the scale is unknown."""
    return "at-rest" if unit in ("rad/s", "m/s^2") else "at-rest-counts"


def _thermal(
    pieces: RestPieces, sensor: Sensor, curve: Curve, size: FloatArray, unit: str, n_effects: int
) -> AcceptedEffect:
    units = {"bias_per_kelvin": f"{unit}/K", "bias_per_kelvin2": f"{unit}/K^2", "bias_per_kelvin3": f"{unit}/K^3",
             "bias_per_kelvin_per_s": f"{unit}/(K/s)", "half_gap": unit}  # fmt: skip
    parameters = [
        EffectParameter(
            f"{name}_{axis}", float(curve.value[k, j] * size[k]), float(curve.std[k, j] * size[k]), units[name]
        )
        for j, name in enumerate(curve.names)
        for k, axis in enumerate(AXES)
    ]  # fmt: skip
    raw, rest = curve.raw * size, curve.rest * size
    low, high = curve.range_degc
    effect_id = f"{PREFIX[sensor]}-thermal-bias"
    order = sum("kelvin_per_s" not in n and n != "half_gap" for n in curve.names)
    gap = branch_gap(pieces, rest)
    if gap is not None:
        parameters += [
            EffectParameter(f"branch_difference_{axis}", float(g), float(s), unit)
            for axis, g, s in zip(AXES, *gap, strict=True)
        ]
    confounded = ("accel-thermal-scale",) if sensor == "accelerometer" else ()
    statement = effect_words(
        effect_id, _case(unit), low_degc=low, high_degc=high, is_straight=order == 1, is_parabola=order == 2,
        has_rate="bias_per_kelvin_per_s" in curve.names, has_branches="half_gap" in curve.names,
        swing=curve.swing * size, left=rest.std(axis=0), raw=raw.std(axis=0), has_gap=gap is not None,
        gap=() if gap is None else gap[0], is_one_pose=bool(confounded) and pieces.n_poses == 1,
    )  # fmt: skip
    share = float(np.clip(1.0 - (rest**2).sum() / (raw**2).sum(), 0.0, 1.0))
    mean_size = float(np.sqrt(np.mean(size**2)))
    held = HeldOut(DOMAIN[sensor], 1.0, (curve.held_after / curve.held_before) ** 2, curve.held_before * mean_size,
                   curve.held_after * mean_size, unit)  # fmt: skip
    return AcceptedEffect(
        id=effect_id,
        statement=statement,
        parameters=tuple(parameters),
        p_adjusted=float(min(1.0, max(curve.p_value, 1e-300) * n_effects)),
        delta_bic=curve.gain - curve.cost,
        held_out=(held,),
        confounded_with=confounded,
        separating_experiment=experiment_for(effect_id, at_rest=True) if confounded else "",
        model=_model("rest-curve", _series(pieces, sensor, size, unit)),
        share=share,
    )


def _series(pieces: RestPieces, sensor: Sensor, size: FloatArray, unit: str) -> Mapping[str, Any]:
    out: dict[str, Any] = {"time_s": pieces.time_s.tolist(), "value": (_about_poses(pieces, sensor) * size).T.tolist(),
                           "pose": pieces.pose.tolist(), "unit": unit}  # fmt: skip
    if pieces.temperature is not None:
        out["temperature_degc"] = pieces.temperature.tolist()
    return out


def _model(variant: str, series: Mapping[str, Any]) -> MappingProxyType[str, Any]:
    return MappingProxyType(
        {"variant": variant, "shape": {}, "values": [], "applies_to_other_recordings": False, "curve": dict(series)}
    )


def _drift(pieces: RestPieces, sensor: Sensor) -> tuple[DriftCurve | None, float, bool]:
    """The curve of slowly changing biases, p of any slow change, and whether a walk alone does not explain it.

    ``None`` where they do not change slowly. The noise of every sensor becomes a walk; a smooth drift is an effect.
    """
    parts = [pieces.readings(sensor, axis, []) for axis in range(3)]
    together = BiasReadings(
        np.vstack([r.values for r in parts]), np.vstack([r.sigma for r in parts]), parts[0].time_s,
        parts[0].length_s, parts[0].pose, parts[0].design, parts[0].direction,
    )  # fmt: skip
    found = slow_change(together)
    if not found.is_slow:
        return None, found.p_value, False
    columns = list(range(together.design.shape[1]))
    curve = smooth_curve(found.process, columns, found.sigma, together.time_s[::2])
    return curve, max(found.p_value, 1e-300), found.is_smooth


def _drifting(
    sensor: Sensor, curve: DriftCurve, raw: FloatArray, size: FloatArray, unit: str, p: float, n_effects: int
) -> AcceptedEffect:
    spans = curve.range * size
    errors = [float(np.hypot(s[v.argmax()], s[v.argmin()])) for v, s in zip(curve.values, curve.sigma, strict=True)]
    effect_id = f"{PREFIX[sensor]}-bias-drift"
    share = float(np.clip(((curve.rms * size) ** 2).sum() / max(float(raw.var(axis=0).sum()), 1e-300), 0.0, 1.0))
    series = {"time_s": curve.time_s.tolist(), "value": (curve.values * size[:, None]).tolist(),
              "sigma": (curve.sigma * size[:, None]).tolist(), "unit": unit}  # fmt: skip
    return AcceptedEffect(
        id=effect_id,
        statement=effect_words(effect_id, _case(unit), range=spans),
        parameters=tuple(
            EffectParameter(f"range_{axis}", float(r), e * float(s), unit)
            for axis, r, e, s in zip(AXES, spans, errors, size, strict=True)
        ),
        p_adjusted=float(min(1.0, p * n_effects)),
        delta_bic=float(max(-2.0 * np.log(p), 0.0)),
        held_out=(),
        separating_experiment="",
        model=_model("rest-drift", series),
        share=share,
    )


def _lines(
    recording: Recording, pieces: RestPieces, model: LinearModel, alpha: float
) -> tuple[DomainTest, AcceptedEffect | None]:
    """Spectral lines of the pieces, their slow part subtracted, and the test of noise that differs between pieces."""
    assert recording.accelerometer is not None
    t = recording.time_s

    def quick(values: FloatArray, means: FloatArray) -> FloatArray:
        slow = np.stack([np.interp(t, pieces.time_s, m) for m in means.T], axis=1)
        return np.asarray(values - slow)

    poses = tuple(Pose(k, a, b, a, b) for k, (a, b) in enumerate(pieces.spans))
    force = quick(recording.accelerometer, pieces.force)
    rate = None if recording.gyroscope is None or pieces.rate is None else quick(recording.gyroscope, pieces.rate)
    samples = cast(Observations, _Samples(recording, t, force, rate, SimpleNamespace(poses=poses)))
    test = judge_within_poses(samples, alpha)
    S = [np.eye(3) if side is None else np.array(side["S"]) for side in (model.accelerometer, model.gyroscope)]
    fitted = cast(Fit, SimpleNamespace(state=SimpleNamespace(accel_S=S[0], gyro_S=S[1])))
    effect = PeriodicInterference()
    found = effect.find(Context(samples, fitted))
    if found is None or found.p_value * len(catalogue()) >= alpha / 2.0:
        return test, None
    return test, AcceptedEffect(
        id=effect.id, statement=found.statement, parameters=found.parameters,
        p_adjusted=float(min(1.0, max(found.p_value, 1e-300) * len(catalogue()))), delta_bic=found.strength,
        held_out=found.held_out, model=_model("", {}), share=found.share,
    )  # fmt: skip


def _agreeing(test: DomainTest) -> DomainTest:
    return DomainTest(test.domain, test.chi2_per_dof, test.dof, test.p_value, False, Where(), test.rms, test.unit)
