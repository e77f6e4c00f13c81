"""The diagnosis of a log with one or two orientations: biases over temperature and time, and spectral lines
(docs/static-logs.md).

The log is cut into pieces. They are the poses of a session without moves, in which either sensor reads a bias on three
axes, as a gyro does in static poses: effects, noise strengths and evidence are those of every session.
"""

from dataclasses import dataclass, replace
from itertools import zip_longest
from types import MappingProxyType
from typing import Any

import numpy as np

from trihedron.arrays import AXES, TINY, FloatArray, IntArray, rms_of
from trihedron.defaults import FALSE_ALARM
from trihedron.diagnose.accepted import effect_record, series_of, tried_candidate
from trihedron.diagnose.bias_strengths import BiasStrength, bias_strengths
from trihedron.diagnose.candidates import wald_p
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import by_id, catalogue
from trihedron.diagnose.effects.bias_process import BiasDrift
from trihedron.diagnose.effects.contract import ACCELEROMETER, GYRO, SENSORS, Effect, Variant
from trihedron.diagnose.effects.periodic_interference import PeriodicInterference
from trihedron.diagnose.hypothesis import Hypothesis, held_out_records, hypothesis
from trihedron.diagnose.residuals.effect_curves import bias_curves, effect_curves, residuals_before_after
from trihedron.diagnose.residuals.goodness_of_fit import N_DOMAINS_TESTED
from trihedron.diagnose.residuals.within_poses import judge_within_poses
from trihedron.diagnose.search import Found, search
from trihedron.diagnose.session.observations import Observations, observe
from trihedron.diagnose.session.solve import Distortion
from trihedron.diagnose.session.starting_point import PUBLISHED_DIGITS
from trihedron.records import Recording, Segments
from trihedron.records.diagnosis import AcceptedEffect, Candidate, Diagnosis, EffectParameter, LinearModel
from trihedron.records.domains import DomainResiduals, DomainTest, Where
from trihedron.records.words import why_not
from trihedron.sensor_model import axis_scales
from trihedron.session.model import LOWER, Prior
from trihedron.units import rate_to_si

Pieces = tuple[Segments, IntArray]
"""Static pieces as poses, and the orientation (n,) of each."""


def diagnose_static_log(
    recording: Recording, pieces: Pieces | None, model: LinearModel, gravity_m_s2: float, alpha: float
) -> Diagnosis:
    """Biases against temperature and time, and spectral lines, of a log with too few orientations for a calibration.

    ``pieces`` are none where too little of the log is static. ``model`` has nominal or given S, b of both sensors, used
    only for sizes in physical units.
    """
    sides: list[_Side] = []
    within, calm = list[DomainTest](), list[DomainTest]()
    effects = list[AcceptedEffect]()
    tried = {effect.id: Candidate(effect.id, None, False, why_not("few-orientations")) for effect in catalogue()}
    if pieces is not None:
        obs = observe(recording, pieces[0])
        n_sensors = 1 if obs.pose_rate is None else 2
        sides = [_judged(obs, pieces[1], model, gravity_m_s2, k, alpha) for k in range(n_sensors)]
        test, lines = _lines(sides[-1].plain, obs, alpha)
        effects = [*(effect for side in sides for effect in side.effects), *lines]
        within, calm = [test], [replace(test, disagrees=False, where=Where()) if lines else test]
        of_lines = Candidate("periodic-interference", test.p_value, True)
        tried |= {one.id: one for one in (*(c for side in sides for c in side.candidates), of_lines)}
    densities = [side.plain.context.noise_density[GYRO].tolist() for side in sides] or [[0.0] * 3]
    noise: dict[str, Any] = {}
    for (_, _, name, unit, _), density in zip_longest(SENSORS, densities):
        noise |= {f"{name}_density": density, f"{name}_unit": f"{unit}/sqrt(Hz)", f"{name}_corner_s": None}
    return Diagnosis(
        verdict="missing-physics" if effects else "not-testable",
        domains=(*(side.before for side in reversed(sides)), *within),
        effects=tuple(sorted(effects, key=lambda effect: -(effect.share or 0.0))),
        remaining=(*(side.after for side in reversed(sides)), *calm),
        candidates=tuple(tried[key] for key in sorted(tried)),
        baseline=model, extended=model, noise=MappingProxyType(noise), gravity_m_s2=gravity_m_s2, alpha=alpha,
        recording_source=recording.source, recording_sha256=recording.sha256,
        references=MappingProxyType(dict(sides[0].plain.context.references) if sides else {}),
    )  # fmt: skip


@dataclass(frozen=True, eq=False)
class _Side:
    """One sensor of a static log: the session in which it reads a bias, tests of it without and with the effects."""

    plain: Hypothesis
    effects: tuple[AcceptedEffect, ...]
    candidates: tuple[Candidate, ...]
    before: DomainTest
    after: DomainTest


def _judged(
    obs: Observations, orientation: IntArray, model: LinearModel, gravity_m_s2: float, sensor: int, alpha: float
) -> _Side:
    plain = _session(obs, orientation, model, gravity_m_s2, sensor)
    kinds = [by_id()[f"{SENSORS[sensor].prefix}-{name}"] for name in ("thermal-bias", "bias-drift")]
    unit, drift = _unit(obs.recording, model, sensor), kinds[1]
    assert isinstance(drift, BiasDrift)
    # The size of a count is unknown: that with which the biases change as those of a usual part do.
    changes = plain.fitted.obs.pose_rate
    count = drift.typical / max(rms_of(changes), TINY) if unit == "counts" and changes is not None else 1.0
    found = search(plain, alpha, [_aside(one, sensor, orientation, count) for one in kinds])
    known, terms = found.model, found.model.terms
    # What a curve of temperature or time leaves changes slowly too: no further cause is named for it.
    processes = [] if terms else bias_strengths(known, alpha)[0]
    walks = [one for one in processes if one.effect.sensor == GYRO and one.effect.walks]
    every = residuals_before_after(plain.fitted, known.fitted, {GYRO} if walks else ())
    shown = next(one for one in every if one.domain == SENSORS[GYRO].domain)
    explained = float(np.clip(1.0 - (shown.after**2).sum() / (shown.before**2).sum(), 0.0, 1.0))
    gains = [*found.gains, *(one.gain for one in walks)]
    candidates = [tried_candidate(one, found.against.get(key), "") for key, one in found.tried.items()]
    candidates += [Candidate(key, None, False, reason) for key, reason in found.missing.items()]
    made = [_of_term(found, k, obs, shown, unit) for k in range(len(terms))]
    candidates += [Candidate(one.id, p, True, "", one.delta_bic, size) for one, p, size in made]
    records = [*(one for one, *_ in made), *(_of_walk(known, one, drift, shown, unit) for one in walks)]
    named = [
        _of_sensor(one, sensor, unit, explained * gain / max(sum(gains), TINY))
        for one, gain in zip(records, gains, strict=True)
    ]
    tests = [_domain(sensor, x, shown, unit, is_named=bool(named)) for x in (shown.before, shown.after)]
    return _Side(plain, tuple(named), tuple(candidates), *tests)


def _of_term(
    found: Found, k: int, obs: Observations, shown: DomainResiduals, unit: str
) -> tuple[AcceptedEffect, float, tuple[EffectParameter, ...]]:
    """Effect ``k`` of the search as a record, its p-value and its parameters in the gyro's unit."""
    known, term = found.model, found.model.terms[k]
    value, covariance = known.value(k)
    parameters = term.effect.parameters(term.variant, value, covariance)
    curves = effect_curves(known.context, (None, term.distortion.rate), value, covariance, [shown])
    # One orientation does not separate bias, scale and a tilt of the fixture.
    rivals = ("accel-thermal-scale",) if term.effect.id == "accel-thermal-bias" else ()
    p_value, held = wald_p(value, covariance), held_out_records(found.without[k], known)
    effect, statement = by_id()[term.effect.id], term.effect.statement(parameters)
    series: dict[str, Any] = {}
    if isinstance(effect, BiasDrift):
        along = np.asarray(term.distortion.rate)[: obs.n_poses]
        sigma = np.sqrt(np.einsum("nik,kl,nil->ni", along, covariance, along)).max(axis=0)
        span = np.ptp(along @ value, axis=0)
        parameters, statement = effect.of_strength(
            span, np.sqrt(2.0) * sigma, is_counts=unit == "counts", variant=term.variant
        )
        series = series_of(obs, along @ value, sigma, unit)
    said = parameters, statement, p_value, found.scores[k]
    return effect_record(effect, *said, held, rivals, curves, **series), p_value, parameters


def _of_walk(
    known: Hypothesis, one: BiasStrength, drift: BiasDrift, shown: DomainResiduals, unit: str
) -> AcceptedEffect:
    path = known.fitted.bias(GYRO)
    parameters, statement = drift.of_strength(one.size, one.std, is_counts=unit == "counts")
    said, held = (parameters, statement, one.p_value, one.score), held_out_records(one.without, known)
    curves = bias_curves(known.context, GYRO, path, one.std, [shown])
    return effect_record(drift, *said, held, (), curves, **series_of(known.obs, path, one.std, unit))


def _centred(values: FloatArray, orientation: IntArray) -> FloatArray:
    """Values (n, ...) minus their mean in every orientation (n,)."""
    level = np.array([values[orientation == k].mean(axis=0) for k in range(orientation.max() + 1)])
    return np.asarray(values - level[orientation])


def _session(
    obs: Observations, orientation: IntArray, model: LinearModel, gravity_m_s2: float, sensor: int
) -> Hypothesis:
    """The session in whose place of the gyro a sensor reads its bias about the mean of every orientation; gravity is
    constant there, and S is known."""
    of_gravity, of_sensor = (np.diag(_sizes(model, k)) for k in (ACCELEROMETER, sensor))
    raw, means = ((obs.raw_force, obs.pose_force), (obs.raw_rate, obs.pose_rate))[sensor]
    density, sigma = ((obs.force_density, obs.pose_force_sigma), (obs.rate_density, obs.pose_rate_sigma))[sensor]
    assert means is not None
    aside = replace(
        obs, raw_rate=raw, pose_rate=_centred(means, orientation), pose_rate_sigma=sigma, rate_density=density,
        pose_force=np.tile([0.0, 0.0, gravity_m_s2 / of_gravity[2, 2]], (obs.n_poses, 1)), force_up=None,
    )  # fmt: skip
    mean = np.concatenate([of_gravity[LOWER], np.zeros(3), of_sensor.ravel()])
    prior = Prior(
        mean, np.diag((PUBLISHED_DIGITS * np.repeat([of_gravity[0, 0], gravity_m_s2, of_sensor[0, 0]], (6, 3, 9))) ** 2)
    )
    return hypothesis(aside, aside.at_means(gravity_m_s2, of_gravity, np.zeros(3), of_sensor), prior)


def _aside(effect: Effect, sensor: int, orientation: IntArray, count: float) -> Effect:
    """An effect whose columns, about their mean in every orientation, are those of the sensor in the gyro's place; a
    unit of its readings is ``count`` in SI."""
    kind: Any = type(effect)

    def turned(variant: Variant | None) -> Variant | None:
        if variant is None:
            return None
        columns = variant.distortion.rate if sensor == GYRO else variant.distortion.force
        assert columns is not None
        return replace(variant, distortion=Distortion(None, _centred(columns, orientation)))

    def is_plausible(self: Effect, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:
        own = variant.distortion if sensor == GYRO else Distortion(variant.distortion.rate, None)
        return bool(kind.is_plausible(self, replace(variant, distortion=own), count * value, count**2 * covariance))

    own = {
        "sizes": lambda self, context, variant: kind.sizes(self, context, variant) / count,
        "variants": lambda self, context: [turned(one) for one in kind.variants(self, context)],
        "reshaped": lambda self, context, variant, value: turned(kind.reshaped(self, context, variant, value)),
        "is_plausible": is_plausible,
        "shows_as": GYRO,
    }
    out: Effect = type(kind.__name__, (kind,), own)()
    return out


def _of_sensor(effect: AcceptedEffect, sensor: int, unit: str, share: float) -> AcceptedEffect:
    """The record with the sensor's own domain, channel and unit in place of the gyro's."""
    own, shown = SENSORS[sensor], SENSORS[GYRO].domain
    parameters = tuple(replace(one, unit=one.unit.replace(own.unit, unit)) for one in effect.parameters)
    held = tuple(replace(one, domain=own.domain, unit=unit) for one in effect.held_out if one.domain == shown)
    curves = tuple(replace(one, sensor=own.name) for one in effect.curves)
    return replace(effect, share=share, parameters=parameters, held_out=held, curves=curves)


def _sizes(model: LinearModel, sensor: int) -> FloatArray:
    """(3,) size of a raw unit along every axis, in the model's unit."""
    side = (model.accelerometer, model.gyroscope)[sensor]
    return np.ones(3) if side is None else axis_scales(np.array(side["S"]))


def _unit(recording: Recording, model: LinearModel, sensor: int) -> str:
    """SI, or ``counts`` where neither the log nor a given calibration states the unit of a gyro's count."""
    is_counts = sensor == GYRO and rate_to_si(recording.gyroscope_unit) is None
    return "counts" if is_counts and _sizes(model, GYRO)[0] == 1.0 else SENSORS[sensor].unit


def _domain(sensor: int, x: FloatArray, shown: DomainResiduals, unit: str, *, is_named: bool) -> DomainTest:
    """Biases about the mean of their orientation; the domain disagrees where an effect was named.

    A bias that walks is no disagreement by itself: without an effect nothing contradicts the model.
    """
    # Flicker and walk make neighbouring pieces differ by more than white noise: no missing effect.
    beside = np.sqrt(0.5 * np.mean(np.diff(shown.after, axis=0) ** 2, axis=0))
    z = x / np.maximum(shown.sigma_before[:, None], beside)
    chi2 = float(np.mean(z**2))
    p = float(np.exp(-1.5 * max(chi2 - 1.0, 0.0))) if is_named else 1.0
    where = Where(("ag"[sensor] + AXES[int(z.std(axis=0).argmax())],)) if is_named else Where()
    rms = rms_of(x)
    disagrees = p < FALSE_ALARM / N_DOMAINS_TESTED
    return DomainTest(SENSORS[sensor].domain, chi2, float(x.size), p, disagrees, where, rms, unit)


def _lines(plain: Hypothesis, obs: Observations, alpha: float) -> tuple[DomainTest, list[AcceptedEffect]]:
    """Spectral lines of the pieces, and the test of noise that differs between pieces."""
    test, effect = judge_within_poses(obs, alpha), PeriodicInterference()
    found = effect.find(plain.context if obs.raw_rate is None else Context(replace(plain.fitted, obs=obs)))
    if found is None or found.p_value * len(catalogue()) >= alpha / 2.0:
        return test, []
    record = effect_record(effect, found.parameters, found.statement, found.p_value, found.strength, found.held_out)
    return test, [replace(record, share=found.share)]
