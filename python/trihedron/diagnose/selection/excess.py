"""How much misfit a fit holds beyond its noise, and how much of that another has no more."""

from __future__ import annotations

from dataclasses import replace

from trihedron.diagnose.residuals.goodness_of_fit import LEAST_DOF, ROW_DOMAINS
from trihedron.diagnose.session.solve import Fit, fit, leverage
from trihedron.diagnose.session.twin import DYNAMICS, MOVES


def domain_chi2(fitted: Fit) -> dict[int, tuple[float, float]]:
    """Chi-square and degrees of freedom of every row domain, in the noise that was predicted.

    Where noise was widened for what nothing explained, the widening is taken out.
    """
    used = leverage(fitted)
    obs = fitted.line.obs
    out = {}
    for d in ROW_DOMAINS:
        rows = fitted.system.domain == d
        widened = {MOVES: obs.moves_inflation, DYNAMICS: obs.dynamics_inflation}.get(d, 1.0)
        out[d] = (
            float((fitted.system.residual[rows] ** 2).sum()) * float(widened) ** 2,
            float((1.0 - used[rows]).sum()),
        )
    return out


def in_the_scatter_of(before: Fit, after: Fit) -> Fit:
    """A model fitted with zeros that scatter as they do in another of the same observations.

    Either model chose the size of a named scatter for itself, and what one lacks it called scatter: how much it does
    not explain shows in the scatter of the one that explains it.
    """
    line, scatter = before.line, after.twin.scatter
    if line.obs is not after.line.obs or line.obs.zero_scatter is None or before.twin.scatter == scatter:
        return before
    return fit(line.obs, replace(before.twin, scatter=scatter), line.distortion, line.prior)


def excess(fitted: Fit) -> float:
    """Chi-square beyond its degrees of freedom, over the domains that have more than they should."""
    return sum(max(chi2 - dof, 0.0) for chi2, dof in domain_chi2(fitted).values())


def explained(before: Fit, after: Fit) -> float:
    """How much excess is gone, over as many rows as there were before.

    Moves that an effect leaves out take their excess with them: that explains something only so far as they disagreed
    more than those that stay.
    """
    left = domain_chi2(after)
    gone = 0.0
    for domain, (chi2, dof) in domain_chi2(in_the_scatter_of(before, after)).items():
        still, rows = left.get(domain, (0.0, 0.0))
        rest = max(still - rows, 0.0) * (dof / rows if rows >= LEAST_DOF else 0.0)
        gone += max(chi2 - dof, 0.0) - rest
    return max(gone, 0.0)
