"""The four steps: locate, say what was left out, model it, show the fit improve."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
from scipy.special import chdtrc
from threadpoolctl import threadpool_limits

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.residuals.before_after import residuals_before_after, with_covariance
from trihedron.diagnose.residuals.goodness_of_fit import ROW_DOMAINS, physical_rms, test_rows
from trihedron.diagnose.residuals.timing import test_timing
from trihedron.diagnose.residuals.within_holds import test_within_static
from trihedron.diagnose.selection.accepted import worded
from trihedron.diagnose.selection.compare import (
    CONFOUNDED_DELTA_BIC,
    MAX_EFFECTS,
    MIN_DELTA_BIC,
    Refit,
    mends,
    profile,
    refined,
    refit,
    score_all,
)
from trihedron.diagnose.selection.model import Found, GrowingModel
from trihedron.diagnose.selection.prune import drop_hollow, settle_direct
from trihedron.diagnose.session.observations import Observations, observe
from trihedron.diagnose.session.solve import N_DOMAINS, Fit, Prediction, folds_of, predict_held_out, tune_noise
from trihedron.diagnose.session.starting_point import is_open, linear_model, nominal_start, prior_of, start_twin
from trihedron.diagnose.session.twin import NO_DISTORTION, PRIOR, Prior, Twin, stacked
from trihedron.records import Calibration, Recording, Segments
from trihedron.records.diagnosis import (
    Candidate,
    Diagnosis,
    DomainTest,
    HeldOut,
    Verdict,
)

Progress = Callable[[float, str], None]
N_REFITS = 4
"""Candidates fitted jointly at each step: the leaders of the score test."""
FAR_AHEAD = 4.0
"""A sound candidate whose score is this many times another's is not caught up by a joint fit."""


def diagnose_recording(
    recording: Recording,
    segments: Segments,
    calibration: Calibration,
    *,
    calibration_is_given: bool = False,
    alpha: float = 0.01,
    progress: Progress | None = None,
) -> Diagnosis:
    """Hold a digital twin against a recording and say which physics it lacks (docs/diagnosis.md).

    Parameters
    ----------
    recording, segments : Recording, Segments
        Raw readings with their still poses and moves.
    calibration : Calibration
        Linear model of both sensors: the start of the fit; with ``calibration_is_given`` also its prior, so that the
        recording is held against that calibration and not against one fitted to it.
    alpha : float
        Chance that a healthy recording is called anything but consistent.
    progress : callable (fraction, text), optional
        Called as the work goes on.

    Raises
    ------
    ValueError
        When there is nothing to hold a model against: no accelerometer, fewer than two poses.
    """
    tell = progress or (lambda _fraction, _text: None)
    if not 0.0 < alpha < 0.5:
        raise ValueError(f"alpha is a small probability such as 0.01, got {alpha}")
    obs = observe(recording, segments)
    start = start_twin(obs, calibration)
    prior = prior_of(obs, calibration) if calibration_is_given else None
    if prior is None and is_open(calibration):
        start, prior = nominal_start(obs, calibration)
    # Matrices of a few hundred columns: threads of the linear algebra would wait for each other longer than they work.
    with threadpool_limits(limits=1, user_api="blas"):
        run = _run(obs, start, prior, alpha, lambda done, text: tell(0.6 * done, text))
        widened = _widened(obs, run.remaining)
        if widened is not obs:
            # Moves that nothing explains would bend everything beside them: once more, with their noise as it is.
            run = _run(widened, start, prior, alpha, lambda done, text: tell(0.6 + 0.4 * done, text))
    model, base, domains, remaining, candidates = run.model, run.base, run.domains, run.remaining, run.candidates
    verdict: Verdict = "consistent"
    if model.found:
        verdict = "missing-physics"
    elif any(d.disagrees for d in domains):
        verdict = "unexplained"
    twin = model.fitted.twin
    result = Diagnosis(
        verdict=verdict,
        domains=domains,
        effects=worded(model),
        remaining=remaining,
        candidates=tuple(candidates[key] for key in sorted(candidates)),
        baseline=with_covariance(linear_model(base), base),
        extended=with_covariance(linear_model(model.fitted), model.fitted),
        noise=MappingProxyType(
            {
                "accelerometer_density": (np.sqrt((twin.accel_S**2) @ obs.force_density**2)).tolist(),
                "accelerometer_unit": "m/s^2/sqrt(Hz)",
                "accelerometer_corner_s": twin.accel_corner_s,
                "gyroscope_density": None
                if obs.rate_density is None
                else (np.sqrt((twin.gyro_S**2) @ obs.rate_density**2)).tolist(),
                "gyroscope_unit": "rad/s/sqrt(Hz)",
                "gyroscope_corner_s": twin.gyro_corner_s,
            }
        ),
        gravity_m_s2=calibration.gravity_m_s2,
        alpha=alpha,
        recording_source=recording.source,
        recording_sha256=recording.sha256,
        references=MappingProxyType(Context(model.obs, model.fitted).references),
        residuals=residuals_before_after(base, model.fitted),
    )
    tell(1.0, "done")
    return result


@dataclass
class _Run:
    """One pass: the twin before any effect, the model after all, and the domains of both."""

    base: Fit
    model: GrowingModel
    domains: tuple[DomainTest, ...]
    remaining: tuple[DomainTest, ...]
    candidates: dict[str, Candidate]


def _run(obs: Observations, start: Twin, prior: Prior | None, alpha: float, tell: Progress) -> _Run:
    tell(0.05, "fitting the twin")
    base = tune_noise(obs, start, NO_DISTORTION, prior)
    model = GrowingModel(obs, base, predict_held_out(base, folds_of(base), N_DOMAINS))
    tell(0.2, "looking at the samples")
    candidates: dict[str, Candidate] = {}
    _accept_direct(model, Context(obs, base), candidates, alpha, prior)
    domains = _all_domains(obs, base, alpha, model.refused)
    for step in range(MAX_EFFECTS):
        tell(0.3 + 0.15 * step, "letting effects compete")
        if not _accept_next(model, candidates, alpha, first=step == 0):
            break
    tell(0.9, "checking what remains")
    remaining = _all_domains(model.obs, model.fitted, alpha, model.refused)
    if drop_hollow(model, domains, remaining, prior):
        remaining = _all_domains(model.obs, model.fitted, alpha, model.refused)
    return _Run(base, model, domains, settle_direct(model, remaining), candidates)


UNEXPLAINED = 3.0
"""Chi-square per degree of freedom that remains in moves above which their noise is taken as it shows."""


def _widened(obs: Observations, remaining: tuple[DomainTest, ...]) -> Observations:
    left = {d.domain: d.chi2_per_dof for d in remaining if d.disagrees}
    moves, dynamics = left.get("moves", 1.0), left.get("dynamics", 1.0)
    if max(moves, dynamics) < UNEXPLAINED:
        return obs
    return replace(obs, moves_inflation=np.sqrt(max(moves, 1.0)), dynamics_inflation=np.sqrt(max(dynamics, 1.0)))


def _all_domains(obs: Observations, fitted: Fit, alpha: float, refused: Collection[str] = ()) -> tuple[DomainTest, ...]:
    return (
        *test_rows(fitted, alpha),
        test_within_static(obs, alpha),
        test_timing(Context(obs, fitted), alpha, refused),
    )


# -- direct evidence ------------------------------------------------------------
def _accept_direct(
    model: GrowingModel, context: Context, candidates: dict[str, Candidate], alpha: float, prior: Prior | None
) -> None:
    n_effects = len(catalogue())
    found: list[tuple[DirectEffect, Evidence]] = []
    for effect in catalogue():
        if not isinstance(effect, DirectEffect):
            continue
        reason = effect.unavailable(context)
        if reason is not None:
            candidates[effect.id] = Candidate(effect.id, None, False, reason)
            continue
        evidence = effect.find(context)
        if not effect.repeatable or evidence is not None:
            candidates[effect.id] = Candidate(effect.id, 1.0 if evidence is None else evidence.p_value, True)
        if evidence is not None and evidence.p_value * n_effects < alpha / 2.0:
            found.append((effect, evidence))
    # A clipped reading spoils every other look at the samples: it is settled first.
    for effect, evidence in sorted(found, key=lambda pair: ("saturation" not in pair[0].id, -pair[1].strength)):
        before = model.prediction
        base_fit = model.fitted
        gain = evidence.strength
        if evidence.reweigh is not None or evidence.variant is not None:
            obs = model.obs if evidence.reweigh is None else evidence.reweigh(model.obs)
            added = [] if evidence.variant is None else [evidence.variant.distortion]
            distortion = stacked([*model.distortions, *added])
            n_new = sum(d.n_parameters for d in added)
            start = replace(base_fit.twin, effect=np.concatenate([base_fit.twin.effect, np.zeros(n_new)]))
            fitted = tune_noise(obs, start, distortion, prior)
            prediction = predict_held_out(fitted, folds_of(fitted), N_DOMAINS)
            if not effect.is_proof and not mends(before, prediction):
                model.refused.add(effect.id)
                continue
            model.obs, model.fitted, model.prediction = obs, fitted, prediction
            model.distortions += added
            gain = max(gain, 2.0 * (profile(model.fitted) - profile(base_fit)))
            if evidence.restate is not None:
                evidence = replace(evidence, parameters=evidence.restate(Context(model.obs, model.fitted)))
        held = evidence.held_out or _held_out(base_fit, before, model.fitted, model.prediction)
        model.found.append(
            Found(
                effect, evidence.variant, evidence, min(1.0, evidence.p_value * n_effects), float(gain), held, -1,
                evidence.confounded_with, len(model.found),
            )
        )  # fmt: skip


# -- the competition ------------------------------------------------------------
def _accept_next(model: GrowingModel, candidates: dict[str, Candidate], alpha: float, *, first: bool) -> bool:
    context = Context(model.obs, model.fitted)
    taken = {f.effect.id for f in model.found if not f.effect.repeatable}
    scored, missing = score_all(context, taken)
    n_effects = len(catalogue())
    if first:
        for effect_id, reason in missing:
            candidates[effect_id] = Candidate(effect_id, None, False, reason)
        for s in scored:
            known = candidates.get(s.effect.id)
            p = s.p_value if known is None or known.p_value is None else min(s.p_value, known.p_value)
            candidates[s.effect.id] = Candidate(s.effect.id, p, True)
    leaders = [s for s in scored[:N_REFITS] if s.p_value * n_effects < alpha / 2.0]
    if not leaders:
        return False
    refits: list[Refit] = []
    sound: list[Refit] = []
    for s in leaders:
        if any(r.scored.merit > FAR_AHEAD * s.merit for r in sound):
            break
        refits.append(refit(context, model.distortions, s, model.prediction))
        if refits[-1].bic_gain > MIN_DELTA_BIC and refits[-1].predicts and _is_plausible(refits[-1]):
            sound.append(refits[-1])
    if not sound:
        return False
    # Rivals are compared against one rest, that of the best explained: else its small differences weigh large gains.
    rest = np.min([r.stays for r in sound], axis=0)
    best = max(sound, key=lambda r: r.bic_gain_at(rest))
    # What another mechanism explains as well: by its joint fit, or, for all of its shapes, by the score test.
    enough = best.bic_gain_at(rest) - CONFOUNDED_DELTA_BIC
    close = [r.scored.effect.id for r in refits if r is not best and r.bic_gain_at(rest) > enough]
    close += [
        s.effect.id
        for s in scored
        if s.effect is not best.scored.effect and max(s.merits) > best.scored.merit - CONFOUNDED_DELTA_BIC
    ]
    rivals = tuple(dict.fromkeys(close))
    best = refined(context, model.distortions, best)
    before_fit, before = model.fitted, model.prediction
    model.fitted = best.fitted
    model.prediction = best.prediction
    model.distortions.append(best.scored.variant.distortion)
    model.found.append(
        Found(
            best.scored.effect, best.scored.variant, None, _p_adjusted(best, n_effects), best.bic_gain,
            _held_out(before_fit, before, model.fitted, model.prediction), _primary(before_fit, model.fitted), rivals,
            len(model.found),
        )
    )  # fmt: skip
    return True


def _is_plausible(one: Refit) -> bool:
    k = one.scored.variant.distortion.n_parameters
    covariance = one.fitted.covariance()[-k:, -k:]
    return one.scored.effect.is_plausible(one.fitted.twin.effect[-k:], covariance)


def _p_adjusted(best: Refit, n_effects: int) -> float:
    gain = best.bic_gain + np.log(max(int((best.fitted.system.domain != PRIOR).sum()), 2)) * best.scored.rank
    p = min(best.scored.p_value, float(chdtrc(best.scored.rank, max(gain, 0.0)))) if gain > 0 else best.scored.p_value
    return float(min(1.0, max(p, 1e-300) * n_effects))


def _primary(before: Fit, after: Fit) -> int:
    drops = [
        float((before.system.residual[before.system.domain == d] ** 2).sum())
        - float((after.system.residual[after.system.domain == d] ** 2).sum())
        for d in range(N_DOMAINS)
    ]
    return int(np.argmax(drops))


def _held_out(before_fit: Fit, before: Prediction, after_fit: Fit, after: Prediction) -> tuple[HeldOut, ...]:
    rms_before, unit = physical_rms(before_fit, before.residual)
    rms_after, _ = physical_rms(after_fit, after.residual)
    out = []
    for d, name in ROW_DOMAINS.items():
        if before.n_rows[d] < 1.0 or d not in rms_before:
            continue
        out.append(
            (
                before.chi2[d] - after.chi2[d],
                HeldOut(
                    name, float(before.chi2[d] / before.n_rows[d]), float(after.chi2[d] / max(after.n_rows[d], 1e-9)),
                    rms_before[d], rms_after[d], unit[d],
                ),
            )
        )  # fmt: skip
    return tuple(h for _, h in sorted(out, key=lambda pair: -pair[0]))
