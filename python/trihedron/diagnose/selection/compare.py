"""Effects compete: score test, joint refit, blocked cross-validation; one is added at a time (eq. 8.7-8.10)."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import chdtrc

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import Effect, catalogue
from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.residuals.goodness_of_fit import physical_rms
from trihedron.diagnose.session.observations import FloatArray
from trihedron.diagnose.session.solve import (
    N_DOMAINS,
    Fit,
    Prediction,
    extend,
    folds_of,
    held_out_gain,
    leverage,
    predict_held_out,
    reduce,
    score,
)
from trihedron.diagnose.session.twin import PRIOR, Distortion, stacked

MAX_EFFECTS = 4
"""Effects accepted at most: a recording of one session does not carry evidence for more."""
VISIBLE = 0.98
"""An effect must lower the held-out misfit of some domain by at least this factor to be worth a name."""
MIN_DELTA_BIC = 10.0
"""Kass and Raftery's bound for very strong evidence."""
CONFOUNDED_DELTA_BIC = 6.0
"""Below a difference of 6 (strong evidence) two explanations are named together."""


@dataclass(frozen=True, eq=False)
class Scored:
    """One candidate's best variant under the score test."""

    effect: Effect
    variant: Variant
    gain: float
    rank: int
    p_value: float
    merit: float
    merits: tuple[float, ...] = ()


def mends(before: Prediction, after: Prediction) -> bool:
    """Whether readings that were changed (samples put back, stamps made even) are predicted better when held out."""
    stays = np.maximum(after.per_row, 1.0)
    gain = float(((before.per_row - after.per_row) * after.n_rows / stays).sum())
    return gain > 0.0 and bool((after.per_row < VISIBLE * before.per_row).any())


def dispersion(residual: FloatArray, fitted: Fit, used: FloatArray) -> FloatArray:
    """(domains,) how far each domain's misfit exceeds its noise, at least 1."""
    out = np.ones(N_DOMAINS)
    for d in range(N_DOMAINS):
        rows = fitted.system.domain == d
        dof = float((1.0 - used[rows]).sum())
        if dof >= 1.0:
            out[d] = max(1.0, float((residual[rows] ** 2).sum()) / dof)
    return out


def score_all(context: Context, exclude: set[str]) -> tuple[list[Scored], list[tuple[str, str]]]:
    """Score test of every applicable effect; the gain is judged against what remains after it.

    Returns the scored candidates, best first, and ``(id, reason)`` of those that do not apply.
    """
    fitted = context.fitted
    reduced = reduce(fitted)
    used = leverage(fitted)
    residual = fitted.system.residual
    n_rows = int((fitted.system.domain != PRIOR).sum())
    out, missing = [], []
    for effect in catalogue():
        if effect.id in exclude:
            continue
        reason = effect.unavailable(context)
        if reason is not None:
            missing.append((effect.id, reason))
            continue
        best: Scored | None = None
        merits: list[float] = []
        variants = effect.variants(context)
        if not variants:
            continue  # judged by its own evidence
        for variant in variants:
            columns = fitted.line.columns(variant.distortion)
            result = score(reduced, columns)
            if result.rank == 0:
                continue
            after = residual + reduced.project(columns) @ result.estimate
            scale = dispersion(after, fitted, used)
            gain = 0.0
            for d in range(N_DOMAINS):
                rows = fitted.system.domain == d
                gain += float((residual[rows] ** 2).sum() - (after[rows] ** 2).sum()) / scale[d]
            prior_rows = fitted.system.domain == PRIOR
            gain += float((residual[prior_rows] ** 2).sum() - (after[prior_rows] ** 2).sum())
            gain = max(gain, 0.0)
            n_shape = len(variant.shape)
            merit = gain - np.log(n_rows) * (result.rank + n_shape) - 2.0 * np.log(len(variants))
            merits.append(float(merit))
            p = min(1.0, float(chdtrc(result.rank, gain)) * len(variants))
            scored = Scored(effect, variant, gain, result.rank, p, merit)
            if best is None or merit > best.merit:
                best = scored
        if best is None:
            missing.append((effect.id, "the calibration itself imitates it in this recording"))
        else:
            out.append(replace(best, merits=tuple(merits)))
    out.sort(key=lambda s: -s.merit)
    return out, missing


@dataclass(frozen=True, eq=False)
class Refit:
    """A candidate fitted jointly with everything accepted before."""

    scored: Scored
    base_fit: Fit
    fitted: Fit
    likelihood_gain: float
    drop: FloatArray
    stays: FloatArray
    prediction: Prediction
    base: Prediction

    @property
    def bic_gain(self) -> float:
        """ΔBIC against what stays unexplained after this candidate."""
        return self.bic_gain_at(self.stays)

    def bic_gain_at(self, stays: FloatArray) -> float:
        """ΔBIC with each domain's drop of chi-square over the dispersion ``stays`` (at least 1)."""
        return min(self.likelihood_gain, self.likelihood_gain - float((self.drop * (1.0 - 1.0 / stays)).sum()))

    @property
    def predicts(self) -> bool:
        """Whether poses and moves that were held out are predicted better: on the whole, not by one block alone, and
        visibly in some domain.
        """
        gain = held_out_gain(self.base, self.prediction)
        if gain.sum() <= 0.0 or (gain.sum() - gain.max() <= 0.0 and not self.scored.effect.is_local):
            return False
        before, after = self.base.per_row, self.prediction.per_row
        if (after < VISIBLE * before).any():
            return True
        rms_before, _ = physical_rms(self.base_fit, self.base.residual)
        rms_after, _ = physical_rms(self.fitted, self.prediction.residual)
        return any(rms_after[d] < VISIBLE * rms_before[d] for d in rms_after if d in rms_before)


def refit(context: Context, accepted: list[Distortion], scored: Scored, base_prediction: Prediction) -> Refit:
    """Joint fit of a candidate: BIC and held-out prediction against the model without it."""
    base = context.fitted
    # The base is at its optimum and effects are small: two steps settle the sum.
    fitted = extend(base, stacked(accepted), scored.variant.distortion)
    n_rows = int((base.system.domain != PRIOR).sum())
    cost = np.log(n_rows) * (scored.rank + len(scored.variant.shape))
    # Marginal likelihoods differ by the flat prior of the new parameters; their own log-determinant is taken out so
    # that the difference is that of the profile likelihoods with noise tuned on either side.
    gain = 2.0 * (profile(fitted) - profile(base))
    # What stays unexplained is noise to the candidate: it must beat that, not the sensor's noise alone.
    stays = dispersion(fitted.system.residual, fitted, leverage(fitted))
    drop = _domain_chi2(base) - _domain_chi2(fitted)
    prediction = predict_held_out(fitted, folds_of(fitted), N_DOMAINS)
    return Refit(scored, base, fitted, gain - cost, drop, stays, prediction, base_prediction)


def _domain_chi2(fitted: Fit) -> FloatArray:
    squared = fitted.system.residual**2
    return np.array([squared[fitted.system.domain == d].sum() for d in range(N_DOMAINS)])


def profile(fitted: Fit) -> float:
    """Marginal log-likelihood over the hidden states with the model's parameters at their optimum."""
    from trihedron.diagnose.session.twin import N_ACCEL, N_GYRO, N_HOLD

    first, last = N_ACCEL + N_GYRO, N_ACCEL + N_GYRO + N_HOLD * fitted.line.obs.n_holds
    hidden = fitted.jacobian[:, first:last] / fitted.scale[first:last]
    normal = hidden.T @ hidden
    normal[np.diag_indices_from(normal)] += 1e-12
    log_det = 2.0 * float(np.log(np.diag(np.linalg.cholesky(normal))).sum())
    log_det += 2.0 * float(np.log(fitted.scale[first:last]).sum())
    return -0.5 * fitted.chi2 - 0.5 * log_det + fitted.system.log_weight


def refined(context: Context, accepted: list[Distortion], best: Refit) -> Refit:
    """The shape number at the top of the profile likelihood, with the standard error its curvature gives.

    A parabola through log-spaced values around the grid's best; done twice so that a far optimum is reached.
    """
    variant = best.scored.variant
    if len(variant.shape) != 1:
        return best
    name, (value, unit) = next(iter(variant.shape.items()))
    effect = best.scored.effect
    spread = 0.5
    reduced = reduce(context.fitted)

    def gain(v: float) -> float:
        made = effect.reshaped(context, variant, v)
        assert made is not None
        return score(reduced, context.fitted.line.columns(made.distortion)).chi2

    if effect.reshaped(context, variant, value) is None:
        return best
    sigma_log = float("inf")
    for _ in range(3):
        x = np.linspace(-spread, spread, 5)
        g = np.array([gain(value * float(np.exp(step))) for step in x])
        a, b, _c = np.polyfit(x, g, 2)
        if a < 0.0:
            move = float(np.clip(-b / (2 * a), -spread, spread))
            sigma_log = float(np.sqrt(-1.0 / a))
        else:
            move = float(x[g.argmax()])
        value *= float(np.exp(move))
        spread = float(np.clip(2.0 * sigma_log, 0.05, 0.5))
    made = effect.reshaped(context, variant, value)
    assert made is not None
    final = replace(made, shape={name: (value, unit)}, shape_sigma=float(value * min(sigma_log, 10.0)))
    again = refit(context, accepted, replace(best.scored, variant=final), best.base)
    return again if again.bic_gain >= best.bic_gain else best
