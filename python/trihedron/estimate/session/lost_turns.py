"""Samples that a log lost unseen: what they take from every turn, as far as the moves' scatter leaves room for it."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import BoolArray
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.estimate.session.carried import Carried
from trihedron.estimate.session.fit import SessionSolution

ACROSS_VERTICAL = 2.0 / 3.0
"""Part of a turn's squared error that gravity shows, turns being about any axis."""
MOST_STEPS = 3.0
"""What a move misses beyond so many of its usual steps is no sample or two that were lost."""
MANY = 0.3
"""Losses a move from which on the moves without any no longer decide the fit: a move left out is then not the odd
one. Below, what was left out was left out rightly."""


EVEN = 1e-4
"""Scatter of the stamps, in steps, from which on they are a clock's: a loss would show in them."""


def lost_share(
    measured: MoveMeasurements, solution: SessionSolution, seen: Carried, used: BoolArray
) -> tuple[float, float]:
    """Part of the samples that could be missing though the stamps are even; 0 where the moves miss by their noise.

    A lost sample takes ``ω h`` from its turn. Samples lost at random with share ``p`` take ``p ∫ω dt`` in the mean,
    which nothing tells from a scale, and scatter by the variance ``p h ∫ω² dt``, which the moves show: ``p`` follows
    from how far gravity after the moves misses beyond its noise (docs/model-session.md, 11.17). That the excess has
    another cause is the commoner case; the error bars must carry that it has this one.

    Returns
    -------
    float, float
        The share that the error bars carry, and the one with every move that was left out.
    """
    if solution.inflation[0] <= 1.0 or measured.sigma_time_s > EVEN * measured.nominal_step_s:
        return 0.0, 0.0
    speed2 = np.sum(((measured.rate - measured.zero_mean) @ solution.S_w.T) ** 2, axis=1)
    step_s = measured.nominal_step_s
    # ∫ω² dt times the step: the variance of a move's angle if one sample was lost in all, times the samples.
    room = ACROSS_VERTICAL * step_s**2 * np.array([float(np.nansum(speed2[a:b])) for a, b in measured.edges])
    length = np.maximum(measured.edges[:, 1] - measured.edges[:, 0], 1)
    g2 = float(np.mean(np.sum((measured.reading @ solution.S_a.T + solution.b_a) ** 2, axis=1)))
    missed2 = np.minimum(np.radians(seen.angle_deg) ** 2, MOST_STEPS**2 * room / length)

    def share(which: BoolArray, dof: float) -> float:
        n = 2.0 * float(np.count_nonzero(which))
        excess = float(np.sum(missed2[which]) * n / max(dof, 1.0) - np.sum(seen.floor2[which]) / g2)
        total = float(np.sum(room[which]))
        # The scatter of few losses is known to about a part in the root of half the moves.
        return max(excess, 0.0) / total * (1.0 + np.sqrt(4.0 / max(n, 4.0))) if total > 0.0 else 0.0

    is_used, is_known = np.asarray(used, dtype=bool), ~measured.is_lost
    among_used = share(is_used, solution.moves_dof)
    n_out = int(np.count_nonzero(is_known & ~is_used))
    each = among_used * float(np.mean(length)) + float(np.log(measured.n_moves / max(measured.n_moves - n_out, 1)))
    among_all = max(share(is_known, solution.moves_dof + 2.0 * n_out), among_used)
    return (among_all if each > MANY else among_used), among_all
