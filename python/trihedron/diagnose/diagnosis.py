"""The four steps: locate, say what was left out, model it, show the fit improve."""

from __future__ import annotations

from collections.abc import Callable, Collection
from dataclasses import asdict, dataclass, replace
from types import MappingProxyType

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.effects.dropped_samples import DroppedSamples
from trihedron.diagnose.effects.sample_steps import step_errors
from trihedron.diagnose.effects.timing_jitter import TimingJitter, common_time_error
from trihedron.diagnose.laws.find import laws_of_rest
from trihedron.diagnose.residuals.before_after import residuals_before_after, with_covariance
from trihedron.diagnose.residuals.creep import settling, with_settling
from trihedron.diagnose.residuals.goodness_of_fit import hidden_zeros, judge_rows
from trihedron.diagnose.residuals.timing import judge_timing
from trihedron.diagnose.residuals.within_holds import judge_within_holds
from trihedron.diagnose.selection.accepted import accepted_effects
from trihedron.diagnose.selection.evidence import spread_anew, with_evidence
from trihedron.diagnose.selection.model import StepwiseModel, begin, with_only
from trihedron.diagnose.selection.numbers import final_numbers, linear_numbers
from trihedron.diagnose.selection.prune import judged_again
from trihedron.diagnose.selection.rivals import chosen_again
from trihedron.diagnose.selection.score import Scored
from trihedron.diagnose.selection.stages import held_out_stages
from trihedron.diagnose.selection.stepwise import MAX_EFFECTS, MAX_STEPS, candidates_of, scores, set_apart, with_next
from trihedron.diagnose.selection.verdict import accounted_for, verdict_of
from trihedron.diagnose.session.observations import Observations, observe, with_flicker
from trihedron.diagnose.session.solve import Fit
from trihedron.diagnose.session.starting_point import is_open, linear_model, nominal_start, prior_of, start_twin
from trihedron.diagnose.session.twin import Prior, Twin
from trihedron.diagnose.zeros.flicker import accel_flicker, gyro_flicker
from trihedron.records import Calibration, Recording, Segments
from trihedron.records.diagnosis import Candidate, Diagnosis
from trihedron.records.domains import DomainTest
from trihedron.records.progress import Progress
from trihedron.refused import RefusedError

LARGEST_ALPHA = 0.5
"""A false-alarm rate of a half or more is a coin, not a test."""


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
    if not 0.0 < alpha < LARGEST_ALPHA:
        raise RefusedError(f"alpha is a small probability such as 0.01, got {alpha}")
    obs = observe(recording, segments)
    start = start_twin(obs, calibration)
    prior = prior_of(obs, calibration) if calibration_is_given else None
    if prior is None and is_open(calibration):
        start, prior = nominal_start(obs, calibration)
    run = _run(obs, start, prior, alpha, lambda done, text: tell(0.6 * done, text))
    widened = _widened(obs, run.remaining)
    if widened is not obs:
        # Moves that nothing explains would bend everything beside them: once more, with their noise as it is.
        run = _run(widened, start, prior, alpha, lambda done, text: tell(0.6 + 0.4 * done, text))
    if not calibration_is_given:
        obs, run = _as_flicker(obs, start, prior, alpha, run)
    laws = laws_of_rest(run.model.context, run.remaining)
    model = run.model
    (numbered, final), base = final_numbers(model, run.remaining), linear_numbers(run.bare, run.domains)
    result = Diagnosis(
        verdict=verdict_of(model, run.domains, run.remaining, has_laws=bool(laws)),
        domains=run.domains,
        effects=accepted_effects(numbered, final),
        remaining=run.remaining,
        candidates=tuple(run.candidates[key] for key in sorted(run.candidates)),
        baseline=with_covariance(linear_model(base), base),
        extended=with_covariance(linear_model(final), final),
        noise=_noise(obs, model.fitted),
        gravity_m_s2=calibration.gravity_m_s2,
        alpha=alpha,
        recording_source=recording.source,
        recording_sha256=recording.sha256,
        references=MappingProxyType(model.context.references),
        residuals=residuals_before_after(run.bare.fitted, model.fitted),
        laws=laws,
        stages=held_out_stages(run.bare, model),
    )
    tell(1.0, "done")
    return result


def _noise(obs: Observations, fitted: Fit) -> MappingProxyType[str, object]:
    """White noise, and what zeros do, of both sensors."""
    twin = fitted.twin
    accel, gyro = hidden_zeros(fitted)
    return MappingProxyType(
        {
            "accelerometer_density": np.sqrt((twin.accel_S**2) @ obs.force_density**2).tolist(),
            "accelerometer_unit": "m/s^2/sqrt(Hz)",
            "accelerometer_corner_s": twin.accel_corner_s,
            "accelerometer_zero": asdict(accel) | _flicker(obs, twin.accel_S, 0),
            "gyroscope_density": None
            if obs.rate_density is None
            else np.sqrt((twin.gyro_S**2) @ obs.rate_density**2).tolist(),
            "gyroscope_unit": "rad/s/sqrt(Hz)",
            "gyroscope_corner_s": twin.gyro_corner_s,
            "gyroscope_zero": None if gyro is None else asdict(gyro) | _flicker(obs, twin.gyro_S, 1),
        }
    )


def _flicker(obs: Observations, S: FloatArray, k: int) -> dict[str, float]:
    """How far flicker carries zeros from pose to pose, SI, where the errors of their means hold it."""
    if obs.flicker is None or not obs.flickers(k):
        return {}
    return {"flicker": float(np.sqrt(np.mean(S**2 @ obs.flicker[k] ** 2)))}


@dataclass(frozen=True, eq=False)
class _Run:
    """One pass: the model before any effect and after all, the domains of both, every candidate's test."""

    bare: StepwiseModel
    model: StepwiseModel
    domains: tuple[DomainTest, ...]
    remaining: tuple[DomainTest, ...]
    candidates: dict[str, Candidate]


def _run(obs: Observations, start: Twin, prior: Prior | None, alpha: float, tell: Progress) -> _Run:
    tell(0.05, "fitting the session")
    bare = _with_creep(begin(obs, start, prior))
    tell(0.2, "looking at the samples")
    model, candidates = with_evidence(bare, alpha)
    domains = _all_domains(bare.context, alpha, model.refused)
    scored, missing = scores(model)
    candidates = candidates_of(scored, missing, candidates)
    tell(0.3, "letting effects compete")
    model = _grown(model, scored, alpha, lambda part: tell(0.3 + 0.4 * part, "letting effects compete"))
    tell(0.7, "judging every effect beside the others")
    judged = judged_again(model)
    if len(judged.accepted) < len(model.accepted):
        # What was needless stood where another may belong.
        scored, _ = scores(judged, exclude=judged.refused)
        grown = _grown(judged, scored, alpha, lambda _part: None)
        judged = judged if grown is judged else judged_again(grown)
    judged, candidates = _with_late(judged, candidates, alpha)
    chosen = chosen_again(judged)
    judged = judged if chosen is judged else judged_again(chosen)
    tell(0.9, "checking what remains")
    # Time errors were looked for twice: what was not accepted then mends nothing.
    named = {one.effect.id for one in judged.accepted}
    sought = {one.id for one in catalogue() if isinstance(one, DirectEffect) and one.is_sought_again}
    remaining = _all_domains(judged.context, alpha, judged.refused | (sought - named))
    return _Run(bare, judged, domains, accounted_for(judged, remaining), candidates)


def _as_flicker(
    obs: Observations, start: Twin, prior: Prior | None, alpha: float, run: _Run
) -> tuple[Observations, _Run]:
    """The session asked again where zeros wander, or disagree at rest, and do so as flicker does (Z.11).

    What flicker accounts for altogether is noise. Where anything else is left, or another effect would go, the first
    answer stands: it tells more.
    """
    others = tuple(one for one in run.model.accepted if one.effect.id not in WANDERS)
    wanders = len(others) < len(run.model.accepted)
    if not wanders and (others or not any(d.disagrees for d in run.domains)):
        return obs, run
    without = with_only(run.model, others) if others else run.bare
    flickering = _flickering(obs, without.context)
    if flickering is obs:
        return obs, run
    again = _run(flickering, start, prior, alpha, lambda _done, _text: None)
    if others:
        named = {one.effect.id for one in again.model.accepted} == {one.effect.id for one in others}
        is_noise = named and not any(d.disagrees for d in again.remaining)
    else:
        has_laws = bool(laws_of_rest(again.model.context, again.remaining))
        is_noise = verdict_of(again.model, again.domains, again.remaining, has_laws=has_laws) == "consistent"
    return (flickering, again) if is_noise else (obs, run)


def _flickering(obs: Observations, context: Context) -> Observations:
    """Observations whose poses' means are as uncertain as flicker makes them, in the sensors that have it."""
    raw = []
    for sensor, found in (("accelerometer", accel_flicker(context)), ("gyroscope", gyro_flicker(context))):
        raw.append(np.zeros(3) if found is None else found / context.si_per_raw(sensor))
    return with_flicker(obs, *raw)


WANDERS = frozenset({"accel-hidden-drift", "gyro-hidden-drift", "accel-zero-scatter", "gyro-zero-scatter"})
"""Effects of zeros that wander in no particular way, as flicker makes them."""


def _with_creep(bare: StepwiseModel) -> StepwiseModel:
    """The session with rates at rest and moves that allow for poses which turn while they settle, where they do."""
    rates = [one for one in judge_rows(bare.fitted, CREEP_ALPHA) if one.domain == "static-gyro"]
    if not any(one.disagrees for one in rates):
        return bare
    found = settling(bare.context)
    if not found.is_seen:
        return bare
    return begin(with_settling(bare.context, found), bare.start, bare.prior)


CREEP_ALPHA = 0.01
"""False alarms of the rates at rest above which creep is looked for at all."""


def _with_late(
    model: StepwiseModel, candidates: dict[str, Candidate], alpha: float
) -> tuple[StepwiseModel, dict[str, Candidate]]:
    """What shows only in the rest of everything else (zeros that scatter); then the competition once more beside it."""
    late, more = with_evidence(model, alpha, is_late=True)
    for key, one in more.items():
        known = candidates.get(key)
        if known is None or known.p_value is None or (one.p_value is not None and one.p_value < known.p_value):
            candidates = candidates | {key: one}
    if len(late.accepted) == len(model.accepted):
        return late, candidates  # the same model, which remembers what was looked for in vain
    # What was needless, or too little, in the noise of a model without them may stand beside them.
    late = replace(late, refused=frozenset(one for one in late.refused if not _competes(one)))
    scored, _ = scores(late, exclude=late.refused)
    grown = _grown(late, scored, alpha, lambda _part: None)
    return judged_again(grown if grown is late else spread_anew(grown, alpha)), candidates


def _competes(effect_id: str) -> bool:
    """Whether an effect has columns that compete; one with nothing but evidence of its own is not looked for again."""
    effect = next((one for one in catalogue() if one.id == effect_id), None)
    return not isinstance(effect, DirectEffect) or type(effect).variants is not DirectEffect.variants


def _grown(model: StepwiseModel, scored: list[Scored], alpha: float, tell: Callable[[float], None]) -> StepwiseModel:
    """Effects added one at a time until none is demanded."""
    before = len(model.accepted)
    for step in range(MAX_STEPS):
        tell(step / MAX_STEPS)
        if sum(not one.effect.is_local for one in model.accepted[before:]) >= MAX_EFFECTS:
            break
        larger = with_next(model, scored, alpha)
        if larger is None:
            break
        after, _ = scores(larger, exclude=larger.refused)
        model, scored = set_apart(larger, scored, after), after
    return model


UNEXPLAINED = 3.0
"""Chi-square per degree of freedom that remains in moves above which their noise is taken as it shows."""


def _widened(obs: Observations, remaining: tuple[DomainTest, ...]) -> Observations:
    left = {d.domain: d.chi2_per_dof for d in remaining if d.disagrees}
    moves, dynamics = left.get("moves", 1.0), left.get("dynamics", 1.0)
    if max(moves, dynamics) < UNEXPLAINED:
        return obs
    return replace(obs, moves_inflation=np.sqrt(max(moves, 1.0)), dynamics_inflation=np.sqrt(max(dynamics, 1.0)))


def _all_domains(context: Context, alpha: float, refused: Collection[str] = ()) -> tuple[DomainTest, ...]:
    common = common_time_error(step_errors(context), 1.0 / context.obs.recording.rate_hz)
    return (
        *judge_rows(context.fitted, alpha),
        judge_within_holds(context.obs, alpha),
        judge_timing(common, _found(context, refused) if np.isfinite(common[1]) else [], alpha),
    )


def _found(context: Context, refused: Collection[str]) -> list[Evidence]:
    """What the sharper looks at the sampling find; ``refused`` are ids of effects that did not predict held-out moves
    any better: jolts look like lost samples."""
    looks = [effect for effect in (DroppedSamples(), TimingJitter()) if effect.id not in refused]
    return [evidence for look in looks if (evidence := look.find(context)) is not None]
