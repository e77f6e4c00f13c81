"""The diagnosis of recordings: locate the disagreement, search for missing effects, fit them, test the improvement."""

import math
from collections.abc import Iterable, Mapping, Sequence
from dataclasses import replace
from types import MappingProxyType

import numpy as np
from scipy.special import ndtr

from trihedron.arrays import rms_of
from trihedron.defaults import FALSE_ALARM, check_alpha
from trihedron.diagnose.accepted import Answer, accepted_effects, candidates, held_out_stages
from trihedron.diagnose.bias_strengths import bias_strengths, noise_bounds
from trihedron.diagnose.candidates import renewed, with_shapes
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.contract import GYRO, SENSORS, Evidence
from trihedron.diagnose.effects.timing_jitter import common_time_variance
from trihedron.diagnose.hypothesis import Hypothesis, again, hypothesis
from trihedron.diagnose.relations.records import noise_relations, records
from trihedron.diagnose.residuals.effect_curves import residuals_before_after
from trihedron.diagnose.residuals.goodness_of_fit import N_DOMAINS_TESTED, judge_rows
from trihedron.diagnose.residuals.within_poses import judge_within_poses, within_limit
from trihedron.diagnose.sample_evidence import look
from trihedron.diagnose.search import search, threshold
from trihedron.diagnose.session.observations import Observations, observe
from trihedron.diagnose.session.starting_point import linear_model, nominal, prior_of, start_state, starts_nominal
from trihedron.diagnose.shared import shared_effects
from trihedron.errors import InputError
from trihedron.records import Calibration, Progress, Recording, Segments
from trihedron.records.diagnosis import Diagnosis, SharedDiagnosis, Verdict
from trihedron.records.domains import Domain, DomainTest, Where
from trihedron.session.model import Prior, SessionState


def diagnose_recording(
    recording: Recording,
    segments: Segments,
    calibration: Calibration,
    *,
    calibration_is_given: bool = False,
    alpha: float = FALSE_ALARM,
    progress: Progress | None = None,
) -> Diagnosis:
    """Fit the sensor model to a recording and report the physical effects that it lacks (docs/diagnosis.md).

    ``calibration`` is the start of the fit; with ``calibration_is_given`` also its prior, so that the recording is
    compared with that calibration and not with one fitted to it. ``alpha`` is the chance that a healthy recording is
    called anything but consistent; ``progress`` is called with the fraction done and what is done.

    Refused when there is nothing to compare a model with: no accelerometer, fewer than two poses.
    """
    return _diagnosed(recording, segments, calibration, calibration_is_given, alpha, progress or _silently)[0]


def diagnose_recordings(
    given: Sequence[tuple[Recording, Segments, Calibration]], *, alpha: float, progress: Progress | None = None
) -> SharedDiagnosis:
    """Diagnose every recording of one unit as :func:`diagnose_recording`, and find the effects with one size common to
    all of them (eq. 11.21). Refused with fewer than two."""
    if len(given) < 2:
        raise InputError(f"what recordings share needs two or more, got {len(given)}.")
    notify = progress or _silently
    each = []
    for k, (recording, segments, calibration) in enumerate(given):
        notify(0.8 * k / len(given), f"diagnosing {recording.source}")
        each.append(_diagnosed(recording, segments, calibration, False, alpha, _silently))
    notify(0.8, "asking what all recordings share")
    effects, candidates_together = shared_effects([model for _, model in each], alpha)
    notify(1.0, "done")
    return SharedDiagnosis(tuple(one for one, _ in each), effects, candidates_together)


def _silently(_fraction: float, _text: str) -> None:
    pass


def _diagnosed(
    recording: Recording,
    segments: Segments,
    calibration: Calibration,
    calibration_is_given: bool,
    alpha: float,
    notify: Progress,
) -> tuple[Diagnosis, Hypothesis]:
    """As :func:`diagnose_recording`, and the final hypothesis of the search."""
    check_alpha(alpha)
    obs = observe(recording, segments, calibration.averaging)
    begin = calibration
    prior = prior_of(obs, calibration) if calibration_is_given else None
    if prior is None and starts_nominal(calibration):
        begin = nominal(recording, segments, (calibration.gravity_m_s2, calibration.gravity_source))
        prior = prior_of(obs, begin, is_weak=True)
    answer = _run(obs, start_state(obs, begin), prior, alpha, notify)
    model = answer.found.model
    relations = (*records(answer.found.related), *noise_relations(answer.predicted.obs, within_limit(alpha)))
    seen = calibration.accelerometer.observability
    is_determined = calibration_is_given or seen is None or seen.rank >= seen.n_parameters
    verdict = verdict_of(answer, has_relations=bool(relations), is_determined=is_determined)
    # Without missing effects S and b are those of a calibration of this recording.
    base = answer.bare.fitted
    final = base if verdict == "consistent" else answer.numbers.fitted
    residuals = residuals_before_after(answer.predicted, answer.judged, {one.effect.sensor for one in answer.biases})
    result = Diagnosis(
        verdict=verdict, domains=answer.domains, effects=accepted_effects(answer, residuals),
        remaining=answer.remaining, candidates=candidates(answer), baseline=linear_model(base),
        extended=linear_model(final), noise=_noise(model),
        gravity_m_s2=calibration.gravity_m_s2, alpha=alpha, recording_source=recording.source,
        recording_sha256=recording.sha256, references=MappingProxyType(model.context.references),
        residuals=residuals, relations=relations, stages=held_out_stages(answer),
    )  # fmt: skip
    notify(1.0, "done")
    return result, model


def _noise(model: Hypothesis) -> MappingProxyType[str, object]:
    """White noise density, noise corner time and bias changes of both sensors."""
    obs, state, out = model.obs, model.fitted.state, dict[str, object]()
    of_rate = None if obs.pose_rate_sigma is None else obs.pose_rate_sigma * model.context.si_per_raw(GYRO)
    errors = obs.norm_sigma(state.up @ state.accel_S), of_rate
    for sensor, (name, error) in enumerate(zip(("accelerometer", "gyroscope"), errors, strict=True)):
        bias = model.fitted.bias(sensor)
        changes = rms_of(bias - bias.mean(axis=0))
        out[f"{name}_density"] = None if error is None else model.context.noise_density[sensor].tolist()
        out[f"{name}_unit"] = f"{SENSORS[sensor].unit}/sqrt(Hz)"
        out[f"{name}_corner_s"] = model.strengths[0][sensor]
        out[f"{name}_bias"] = None if error is None else {"rms": changes, "noise": float(np.median(error))}
    return MappingProxyType(out)


def _run(obs: Observations, start: SessionState, prior: Prior | None, alpha: float, notify: Progress) -> Answer:
    notify(0.05, "fitting the session")
    # The same bounds of noise as beside the effects: what these do not explain is not cleared by them.
    plain, settles = _on_support(hypothesis(obs, start, prior, within=noise_bounds(obs)), alpha)
    context = plain.context
    notify(0.2, "looking at the samples")
    observed = look(plain, alpha)
    of_samples = judge_within_poses(context.obs, alpha), _judge_timing(context, alpha, observed.found.values())
    domains = _disagreeing((*judge_rows(plain.fitted, alpha), *of_samples), settles)
    notify(0.3, "letting effects compete")
    bare = hypothesis(observed.model.obs, observed.model.fitted.state, prior)
    found = search(bare, alpha)
    notify(0.8, "asking what biases do by themselves")
    # Bias processes are tested beside the relations: a bias that follows a variable does not drift at random.
    biases, asked = bias_strengths(found.related.model, alpha)
    notify(0.9, "checking the unexplained part")
    judged = again(found.model, found.model.terms, noise_bounds(found.model.obs, tuple(one.effect for one in biases)))
    numbers = with_shapes(renewed(found.model))
    answer = Answer(
        plain.fitted, bare, found, numbers, biases, observed.seen, judged.fitted, asked, observed.tested, domains
    )  # fmt: skip
    if "accel-hysteresis" in answer.ids:
        settles = {domain: p for domain, p in settles.items() if domain != "within-static"}
    rows, inside = (_disagreeing(some, settles) for some in (judge_rows(judged.fitted, alpha), of_samples))
    # Domains in which a relation shows disagree.
    follows = {one.effect.domain: math.exp(-0.5 * one.score) for one in found.related.relations}
    remaining = _disagreeing((*rows, *_explained(answer, inside)), follows)
    # Where nothing was added to the linear model there is one judgement of it.
    return replace(answer, domains=_disagreeing(domains, follows) if answer.ids else remaining, remaining=remaining)


def _on_support(plain: Hypothesis, alpha: float) -> tuple[Hypothesis, dict[Domain, float]]:
    """The session, with the motion of a support that yields (eq. 8.7f); and the domains in which a bias settles inside
    the poses, with p-values: the noise of their means had absorbed it."""
    obs, state = plain.obs, plain.fitted.state
    biases = [one for one in obs.segments.findings if one.code == "bias-settling"]
    shown: dict[Domain, float] = {"within-static": biases[0].numbers["p_value"]} if biases else {}
    support = obs.support_seen(state)
    if support is not None and support.of_bias >= threshold(alpha):
        shown["static-gyro"] = math.exp(-0.5 * support.of_bias)
    elif support is not None and support.yields:
        settled = obs.on(support, state.gyro_S)
        plain = hypothesis(settled, state, plain.fitted.prior, within=noise_bounds(settled))
    return plain, shown


def _disagreeing(domains: tuple[DomainTest, ...], p_values: Mapping[Domain, float]) -> tuple[DomainTest, ...]:
    """The domains, where those of another test's ``p_values`` disagree: noise of any strength had absorbed it."""
    return tuple(
        replace(d, disagrees=True, p_value=min(d.p_value, p_values[d.domain]), limit=None)
        if d.domain in p_values and not d.disagrees
        else d
        for d in domains
    )


def _judge_timing(context: Context, alpha: float, every: Iterable[Evidence]) -> DomainTest:
    """Chi-square: squared z of the common time error, plus the gain of lost samples; p-value of their own tests.

    ``every`` evidence in the samples counts.
    """
    value, spread, n = common_time_variance(context.obs)
    if not np.isfinite(spread):
        return DomainTest("timing", 1.0, float(n), 1.0, False, rms=0.0, unit="s")
    found, z = [one for one in every if one.domain == "timing"], value / spread
    p = min([min(1.0, 2.0 * e.p_value) for e in found], default=float(min(1.0, max(2.0 * ndtr(-z), 0.05))))
    where = Where(
        (), tuple(s for e in found for s in e.where.segments), tuple(t for e in found for t in e.where.times_s)
    )
    chi2_per_dof = 1.0 + max(z, 0.0) ** 2 / n + sum(e.strength for e in found if e.reweigh is not None) / n
    rms = float(np.sqrt(max(value, 0.0)))
    return DomainTest("timing", chi2_per_dof, float(n), p, p < alpha / N_DOMAINS_TESTED, where, rms, "s")


# The verdict: which domains could be tested, which disagree still, and one word.

POSE_DOMAINS = ("static-accel", "moves", "dynamics")
"""Domains that compare the model with gravity or zero velocity: without them nothing can contradict it."""


def _explained(answer: Answer, of_samples: Sequence[DomainTest]) -> list[DomainTest]:
    """The domains of the samples, which agree once an accepted effect explains their disagreement."""
    explained = {one.domain for one in answer.seen.values()}
    explained |= {domain for one in catalogue() if one.id in answer.ids for domain in one.accounts_for}
    return [replace(d, disagrees=False) if d.domain in explained else d for d in of_samples]


def verdict_of(answer: Answer, *, has_relations: bool, is_determined: bool) -> Verdict:
    """One word; ``not-testable`` where the poses do not determine the model, or no pose domain could be tested, and the
    samples show nothing either.

    Minor effects (a disturbed pose, a faint line) leave it at ``unexplained`` while something else disagrees.
    """
    if answer.ids:
        is_left = has_relations or any(d.disagrees for d in answer.remaining)
        return "missing-physics" if answer.says_why or not is_left else "unexplained"
    if has_relations or any(d.disagrees for d in answer.domains):
        return "unexplained"
    # A weak prior fills undetermined directions; rows that it alone determines test nothing.
    if not is_determined or not any(d.domain in POSE_DOMAINS for d in answer.domains):
        return "not-testable"
    return "consistent"
