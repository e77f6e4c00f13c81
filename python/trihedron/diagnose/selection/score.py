"""Rao's score test of every candidate against the model as it stands (eq. 8.8)."""

from __future__ import annotations

from collections.abc import Collection
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt
from scipy.special import chdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects import Effect, catalogue
from trihedron.diagnose.effects.contract import Variant
from trihedron.diagnose.session.solve import N_DOMAINS, Fit, leverage, reduce, score
from trihedron.diagnose.session.twin import PRIOR
from trihedron.records.words import why_not


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


def dispersion(residual: FloatArray, fitted: Fit, used: FloatArray) -> FloatArray:
    """(domains,) how far each domain's misfit exceeds its noise, at least 1."""
    out = np.ones(N_DOMAINS)
    for d in range(N_DOMAINS):
        rows = fitted.system.domain == d
        dof = float((1.0 - used[rows]).sum())
        if dof >= 1.0:
            out[d] = max(1.0, float((residual[rows] ** 2).sum()) / dof)
    return out


@dataclass(frozen=True, eq=False)
class _Rest:
    """What the fit leaves by domain: squares of the residuals, degrees of freedom, prior rows last."""

    residual: FloatArray
    domain: npt.NDArray[np.int8]
    squares: FloatArray
    dof: FloatArray

    @staticmethod
    def of(fitted: Fit) -> _Rest:
        residual, domain = fitted.system.residual, fitted.system.domain
        used = leverage(fitted)
        return _Rest(residual, domain, _by_domain(domain, residual**2), _by_domain(domain, 1.0 - used)[:N_DOMAINS])

    def gain_and_dispersion(self, after: FloatArray) -> tuple[float, FloatArray]:
        """Fall of chi-square over the dispersion that is left, and that dispersion (domains,)."""
        left = _by_domain(self.domain, after**2)
        fewest = np.where(self.dof >= 1.0, self.dof, np.inf)
        scale = np.maximum(1.0, left[:N_DOMAINS] / fewest)
        fall = self.squares - left
        return float((fall[:N_DOMAINS] / scale).sum() + fall[N_DOMAINS:].sum()), scale


def _by_domain(domain: npt.NDArray[np.int8], values: FloatArray) -> FloatArray:
    return np.asarray(np.bincount(domain, values, minlength=PRIOR + 1), dtype=np.float64)


def score_all(context: Context, exclude: Collection[str]) -> tuple[list[Scored], list[tuple[str, str]]]:
    """Score test of every applicable effect; the gain is judged against what remains after it.

    Returns the scored candidates, best first, and ``(id, reason)`` of those that do not apply.
    """
    fitted = context.fitted
    reduced = reduce(fitted)
    rest = _Rest.of(fitted)
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
            gain, scale = rest.gain_and_dispersion(rest.residual + result.projected @ result.estimate)
            gain = max(gain, 0.0)
            n_shape = len(variant.shape)
            merit = gain - np.log(n_rows) * (result.rank + n_shape) - 2.0 * np.log(len(variants))
            # A shape whose own estimate is impossible (a lag that answers before it is asked) is nobody's rival.
            spread = result.covariance * float(scale.max())
            if not effect.is_plausible_variant(variant, result.estimate, spread):
                merit = -np.inf
            merits.append(float(merit))
            p = min(1.0, float(chdtrc(result.rank, gain)) * len(variants))
            scored = Scored(effect, variant, gain, result.rank, p, merit)
            if best is None or merit > best.merit:
                best = scored
        if best is None:
            missing.append((effect.id, why_not("imitated")))
        else:
            out.append(replace(best, merits=tuple(merits)))
    out.sort(key=lambda s: -s.merit)
    return out, missing
