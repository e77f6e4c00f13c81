"""The gyro's bias over time: what a filter beside this recording would have had to find."""

from __future__ import annotations

import numpy as np

from trihedron.estimate.reference.likelihood import equations, together
from trihedron.estimate.reference.motion import MotionFit
from trihedron.records.reference import BiasOverTime


def bias_over_time(found: MotionFit, k: int) -> BiasOverTime:
    """Bias of recording k in every block, g-sensitivity at the recording's mean specific force included."""
    side, own, problem = found.sides[k], found.places[k], found.problems[k]
    strengths = found.fitted.strengths
    all_of = together(found.problems, [equations(p, s) for p, s in zip(found.problems, strengths, strict=True)])
    mean, cov = all_of.mean[problem.index], all_of.covariance[np.ix_(problem.index, problem.index)]
    columns, beside = problem.blocks.bias(problem.table(), np.exp(strengths[k]).tolist())
    m = len(beside)
    columns = columns.reshape(m, 3, -1)
    change = -columns[:, :, :-1]
    change[:, :, problem.bias] += np.diag(problem.sigma[problem.bias])
    value = found.points[k].b + columns[:, :, -1]
    if side.force is not None and "gyro-g-sensitivity" in own:
        # Bias and g-sensitivity hardly separate where the force keeps its direction; what both add up to is known.
        force = side.force[side.seen].mean(axis=0)
        at = np.flatnonzero(np.isin(problem.index, own["gyro-g-sensitivity"]))
        for i in range(3):
            change[:, i, at[3 * i : 3 * i + 3]] -= force * problem.sigma[at[3 * i : 3 * i + 3]]
        value = value - found.points[k].g @ force
    covariance = beside + change @ cov @ np.swapaxes(change, 1, 2)
    sigma = np.sqrt(np.maximum(np.diagonal(covariance, axis1=1, axis2=2), 0.0))
    return BiasOverTime(problem.blocks.time_s(), value + change @ mean, sigma)
