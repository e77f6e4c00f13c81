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
from trihedron.diagnose.session.solve import N_DOMAINS, Fit, Reduced, leverage, reduce, score
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

    def fall_and_dispersion(self, after: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Fall of chi-square (domains, then the prior), and the dispersion that is left (domains,)."""
        left = _by_domain(self.domain, after**2)
        fewest = np.where(self.dof >= 1.0, self.dof, np.inf)
        scale = np.maximum(1.0, left[:N_DOMAINS] / fewest)
        return self.squares - left, scale


def _by_domain(domain: npt.NDArray[np.int8], values: FloatArray) -> FloatArray:
    return np.asarray(np.bincount(domain, values, minlength=PRIOR + 1), dtype=np.float64)


@dataclass(frozen=True, eq=False)
class _Tried:
    """One shape of an effect under the score test: over the dispersion ``scale`` that it leaves itself, and ``fall``
    of chi-square (domains,) with what it takes off the prior last, to be held over another."""

    scored: Scored
    fall: FloatArray
    scale: FloatArray
    cost: float

    def merit_at(self, scale: FloatArray) -> float:
        """Merit with the fall of chi-square over another dispersion; an impossible shape stays one."""
        if not np.isfinite(self.scored.merit):
            return self.scored.merit
        return max(float((self.fall[:N_DOMAINS] / scale).sum() + self.fall[N_DOMAINS:].sum()), 0.0) - self.cost


def _tried(effect: Effect, variant: Variant, reduced: Reduced, rest: _Rest, n_variants: int) -> _Tried | None:
    """``None`` where the calibration imitates every direction of the shape."""
    fitted = reduced.fitted
    result = score(reduced, fitted.line.columns(variant.distortion))
    if result.rank == 0:
        return None
    fall, scale = rest.fall_and_dispersion(rest.residual + result.projected @ result.estimate)
    gain = max(float((fall[:N_DOMAINS] / scale).sum() + fall[N_DOMAINS:].sum()), 0.0)
    n_rows = int((fitted.system.domain != PRIOR).sum())
    cost = float(np.log(n_rows) * (result.rank + len(variant.shape)) + 2.0 * np.log(n_variants))
    merit = gain - cost
    # A shape whose own estimate is impossible (a lag that answers before it is asked) is nobody's rival.
    spread = result.covariance * float(scale.max())
    if not effect.is_plausible_variant(variant, result.estimate, spread):
        merit = -np.inf
    p = min(1.0, float(chdtrc(result.rank, gain)) * n_variants)
    return _Tried(Scored(effect, variant, gain, result.rank, p, float(merit)), fall, scale, cost)


def score_all(context: Context, exclude: Collection[str]) -> tuple[list[Scored], list[tuple[str, str]]]:
    """Score test of every applicable effect; the gain is judged against what remains after it.

    Returns the scored candidates, best first, and ``(id, reason)`` of those that do not apply.
    """
    fitted = context.fitted
    reduced = reduce(fitted)
    rest = _Rest.of(fitted)
    out, missing = [], []
    for effect in catalogue():
        if effect.id in exclude:
            continue
        reason = effect.unavailable(context)
        if reason is not None:
            missing.append((effect.id, reason))
            continue
        variants = effect.variants(context)
        if not variants:
            continue  # judged by its own evidence
        seen = [one for variant in variants if (one := _tried(effect, variant, reduced, rest, len(variants)))]
        if not seen:
            missing.append((effect.id, why_not("imitated")))
            continue
        # Shapes of one effect over one rest, the smallest: over its own, a shape with numbers to spare would be paid
        # for a rest that is hardly smaller with all that the effect explains.
        least = np.min([one.scale for one in seen], axis=0)
        best = max(seen, key=lambda one: one.merit_at(least))
        out.append(replace(best.scored, merits=tuple(one.scored.merit for one in seen)))
    out.sort(key=lambda s: -s.merit)
    return out, missing
