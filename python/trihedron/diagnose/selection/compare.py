"""Two models of one session compared: information criterion, held-out prediction, and that in physical units."""

from __future__ import annotations

from dataclasses import dataclass
from functools import cached_property

import numpy as np
from scipy.special import chdtri, fdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.residuals.goodness_of_fit import ROW_DOMAINS, physical_rms, weighted_rms
from trihedron.diagnose.selection.excess import in_the_scatter_of
from trihedron.diagnose.selection.model import StepwiseModel, held_out
from trihedron.diagnose.selection.score import Scored, dispersion
from trihedron.diagnose.session.solve import (
    N_DOMAINS,
    Fit,
    Prediction,
    extend,
    held_out_gain,
    leverage,
)
from trihedron.diagnose.session.twin import (
    DYNAMICS,
    MOVES,
    PRIOR,
    STATIC_ACCEL,
    STATIC_GYRO,
    Distortion,
    stacked,
)
from trihedron.records.domains import HeldOut

LEAST_P = 1e-300
"""The rarest chance that a double holds with all its digits."""
VISIBLE = 0.98
"""An effect must lower the held-out misfit of some domain by at least this factor to be worth a name."""
OF_ACCELEROMETER = (STATIC_ACCEL, DYNAMICS)
OF_GYROSCOPE = (STATIC_GYRO, MOVES, DYNAMICS)
"""Domains in which a flaw of one sensor must show: velocity needs both, a tilted force being half of it."""


def own_domains(distortion: Distortion) -> tuple[int, ...]:
    """Row domains of the sensors that an effect adds to."""
    own: tuple[int, ...] = ()
    if distortion.force is not None:
        own += OF_ACCELEROMETER
    if distortion.rate is not None:
        own += OF_GYROSCOPE
    return tuple(dict.fromkeys(own))


def mends(
    before_fit: Fit, before: Prediction, after_fit: Fit, after: Prediction, touched: tuple[int, ...] | None = None
) -> bool:
    """Whether readings that were changed (samples put back, stamps made even) are predicted better when held out.

    Where only some moves were ``touched``, gravity and rest after those very moves must say so, in the dispersion that
    the others have: a jolt that looks like a loss leaves them as they were.
    """
    stays = np.maximum(after.per_row, 1.0)
    gain = float(((before.per_row - after.per_row) * after.n_rows / stays).sum())
    if gain <= 0.0 or not (after.per_row < VISIBLE * before.per_row).any():
        return False
    if touched is None:
        return True
    (there, others), (there_after, _) = (
        _of_moves(fitted, prediction, touched) for fitted, prediction in ((before_fit, before), (after_fit, after))
    )
    usual = max(float(np.mean(others)) if len(others) else 1.0, 1.0)
    fall = float(there.sum() - there_after.sum())
    return fall > MIN_FALL * usual and float(there_after.mean()) < MUST_HALVE * float(there.mean())


MIN_FALL = 15.0
"""Chi-square that moves must gain by samples put back: as one of two numbers (place and count) paid for by a search."""
MUST_HALVE = 0.5
"""Share of the misfit of such moves that may stay: a loss explains its move, a jolt does not."""


def _of_moves(fitted: Fit, prediction: Prediction, moves: tuple[int, ...]) -> tuple[FloatArray, FloatArray]:
    """Squared held-out residuals of the rows of some moves, and those of all other moves."""
    system = fitted.system
    rows = np.isin(system.domain, (MOVES, DYNAMICS)) & (system.walk == 0)
    named = np.isin(system.segment, moves)
    squared = prediction.residual**2
    return squared[rows & named], squared[rows & ~named]


@dataclass(frozen=True, eq=False)
class Comparison:
    """A model with one effect (``fitted``) against the model without it (``base``), on the same observations.

    ``cost`` is what the effect's parameters pay, ``n_new`` how many linear ones it has at ``first`` among the fit's.
    """

    variant: Variant
    is_local: bool
    base: Fit
    base_prediction: Prediction
    fitted: Fit
    cost: float
    first: int
    known_prediction: Prediction | None = None

    @cached_property
    def prediction(self) -> Prediction:
        """Held-out prediction of the model with the effect, made when first asked for."""
        return held_out(self.fitted) if self.known_prediction is None else self.known_prediction

    @property
    def n_new(self) -> int:
        """Number of linear parameters of the effect."""
        return self.variant.distortion.n_parameters

    @cached_property
    def likelihood_gain(self) -> float:
        """Twice the gain in log-likelihood, the states between holds integrated out and noise tuned on either side."""
        return 2.0 * (profile(self.fitted) - profile(self.base))

    @cached_property
    def drop(self) -> FloatArray:
        """(domains,) how far chi-square falls."""
        return _domain_chi2(self.base) - _domain_chi2(self.fitted)

    @cached_property
    def stays(self) -> FloatArray:
        """(domains,) dispersion that is left: noise to the effect, which must beat that and not the sensor's alone."""
        return dispersion(self.fitted.system.residual, self.fitted, leverage(self.fitted))

    @property
    def bic_gain(self) -> float:
        """ΔBIC against what stays unexplained with the effect."""
        return self.bic_gain_at(self.stays)

    def bic_gain_at(self, stays: FloatArray) -> float:
        """ΔBIC with each domain's drop of chi-square over the dispersion ``stays`` (at least 1)."""
        return self.gain_at(stays) - self.cost

    def gain_at(self, stays: FloatArray) -> float:
        """Likelihood gain with each domain's drop of chi-square over the dispersion ``stays``, poses' lengths by F."""
        of_lengths = max(float((self.drop / stays)[STATIC_ACCEL]), 0.0)
        return self._over(stays) - self._of_few(of_lengths)

    def equals(self, other: Comparison, stays: FloatArray, margin: float) -> bool:
        """Whether this explains as much as another within a margin, whatever the zeros would explain by themselves.

        That poses' lengths are few is said of either sensor's effects alike here: a clock that is late and a filter of
        the other sensor make one and the same misfit.
        """
        return self.worth(stays) > other.worth(stays) - margin

    def worth(self, stays: FloatArray) -> float:
        """ΔBIC by likelihood alone: which of several, not whether any (eq. 8.11e)."""
        return min(self.likelihood_gain, self._likely(stays)) - self.cost

    def ahead_of(self, other: Comparison, stays: FloatArray) -> float:
        """ΔBIC between two that are both demanded, by likelihood where poses' lengths concern but one of them."""
        if (self.variant.distortion.force is None) == (other.variant.distortion.force is None):
            return self.bic_gain_at(stays) - other.bic_gain_at(stays)
        return self.worth(stays) - other.worth(stays)

    def _over(self, stays: FloatArray) -> float:
        gain = self._likely(stays)
        if self.variant.distortion.rate is None:
            # What the accelerometer's walk gains, tuned anew, is of the poses' lengths and counts by their dispersion.
            gain -= max(self.likelihood_gain - float(self.drop.sum()), 0.0) * (1.0 - 1.0 / float(stays[STATIC_ACCEL]))
        return min(self.likelihood_gain, gain)

    def _likely(self, stays: FloatArray) -> float:
        return self.likelihood_gain - float((self.drop * (1.0 - 1.0 / stays)).sum())

    def _of_few(self, drop: float) -> float:
        """What a fall of chi-square of the poses' lengths is not worth, their scatter being known from few.

        A zero that is another in every pose explains any lengths with one number, its size. Against that rival a fall
        is a ratio of variances: F with the degrees of freedom that stay, and counts as the chi-square that is as rare.
        """
        if self.variant.distortion.force is None or drop <= 0.0:
            return 0.0
        k, dof = float(self.n_new), float(self.dof[STATIC_ACCEL])
        if dof <= 0.0:
            return drop
        rare = float(fdtrc(k, dof, drop / k))
        return max(drop - float(chdtri(k, max(rare, LEAST_P))), 0.0)

    @cached_property
    def dof(self) -> FloatArray:
        """(domains,) degrees of freedom that stay with the effect."""
        free = 1.0 - leverage(self.fitted)
        return np.array([float(free[self.fitted.system.domain == d].sum()) for d in range(N_DOMAINS)])

    @property
    def predicts(self) -> bool:
        """Whether poses and moves that were held out are predicted better: on the whole and not by one block alone."""
        gain = held_out_gain(self.base_prediction, self.prediction)
        return bool(gain.sum() > 0.0 and (gain.sum() - gain.max() > 0.0 or self.is_local))

    @property
    def falls(self) -> bool:
        """Whether held-out rms in physical units falls visibly in a domain of the effect's own sensor.

        At rest plain, or with every reading weighted by what the base knows of its noise and scatter.
        """
        before, _ = physical_rms(self.base, self.base_prediction.innovation)
        after, _ = physical_rms(self.fitted, self.prediction.innovation)
        own = own_domains(self.variant.distortion)
        if any(after[d] < VISIBLE * before[d] for d in own if d in after and d in before):
            return True
        before = weighted_rms(self.base, self.base_prediction.innovation, self.base)
        after = weighted_rms(self.fitted, self.prediction.innovation, self.base)
        return any(after[d] < VISIBLE * before[d] for d in own if d in after and d in before)

    @property
    def has_size(self) -> bool:
        """Whether some parameter of the effect exceeds its own standard error: else nothing is known of its size."""
        value = self.fitted.twin.effect[self.first : self.first + self.n_new]
        return bool((np.abs(value) > np.sqrt(np.maximum(np.diag(self.covariance), 0.0))).any())

    @cached_property
    def covariance(self) -> FloatArray:
        """(n_new, n_new) covariance of the effect's linear parameters."""
        n_effects = self.fitted.n_effect
        whole = self.fitted.covariance()
        first = len(whole) - n_effects + self.first
        return whole[first : first + self.n_new, first : first + self.n_new]

    @property
    def value(self) -> FloatArray:
        """(n_new,) the effect's linear parameters."""
        return self.fitted.twin.effect[self.first : self.first + self.n_new]

    def held_out(self) -> tuple[HeldOut, ...]:
        """Held-out prediction per domain, that of its largest gain first."""
        return held_out_records(self.base, self.base_prediction, self.fitted, self.prediction)


@dataclass(frozen=True, eq=False)
class Refit:
    """A candidate fitted jointly with everything accepted before, and what came of it."""

    scored: Scored
    against: Comparison


def cost_of(fitted: Fit, rank: int, n_shape: int) -> float:
    """What parameters pay in 2 log-likelihood: Schwarz's log n each."""
    return float(np.log(max(int((fitted.system.domain != PRIOR).sum()), 2)) * (rank + n_shape))


def refit(model: StepwiseModel, scored: Scored) -> Refit:
    """Joint fit of a candidate beside the accepted effects."""
    base = model.fitted
    # The base is at its optimum and effects are small: two steps settle the sum.
    fitted = extend(base, stacked(model.distortions), scored.variant.distortion)
    cost = cost_of(base, scored.rank, len(scored.variant.shape))
    return Refit(
        scored,
        Comparison(
            scored.variant, scored.effect.is_local, base, model.prediction, fitted, cost, base.n_effect
        ),
    )  # fmt: skip


def _domain_chi2(fitted: Fit) -> FloatArray:
    squared = fitted.system.residual**2
    return np.array([squared[fitted.system.domain == d].sum() for d in range(N_DOMAINS)])


def profile(fitted: Fit) -> float:
    """Log-likelihood with the hidden states integrated out and the model's parameters at their optimum.

    Marginal likelihoods over everything differ by the flat prior of the new parameters; theirs is left out.
    """
    return fitted.log_profile


def held_out_records(before_fit: Fit, before: Prediction, after_fit: Fit, after: Prediction) -> tuple[HeldOut, ...]:
    """Held-out chi-square and physical rms per domain of two models, the largest gain first.

    Over one noise: that of a scatter which an effect's lack made larger would hide the fall.
    """
    same = in_the_scatter_of(before_fit, after_fit)
    if same is not before_fit:
        before_fit, before = same, held_out(same)
    rms_before, unit = physical_rms(before_fit, before.innovation)
    rms_after, _ = physical_rms(after_fit, after.innovation)
    out = []
    for d, name in ROW_DOMAINS.items():
        if before.n_rows[d] < 1.0 or d not in rms_before or d not in rms_after:
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
