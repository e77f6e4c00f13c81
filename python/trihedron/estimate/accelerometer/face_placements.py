"""Poses that follow each other on one face: one placement of the case, turned on its table in between."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron import probability
from trihedron.arrays import FloatArray, IntArray
from trihedron.estimate.accelerometer import face_poses, verdict
from trihedron.records.segments import Segments
from trihedron.session.rounding import undithered_axes


@dataclass(frozen=True, eq=False)
class Placements:
    """One mean (n, 3) of covariance ``noise`` (n, 3, 3) and face (n,) for each time that the case was set down.

    ``scatter`` is the variance [raw²] per level component by which headings on one face differ beyond noise, ``None``
    where they do not; it is not in ``noise`` and averages over ``n_headings`` (n,).
    """

    means: FloatArray
    noise: FloatArray
    faces: IntArray
    scatter: float | None
    n_headings: FloatArray


def shared_rounding(segments: Segments, step: FloatArray) -> FloatArray | None:
    """Variance (3,) [raw²] of pose means that readings at one place inside an LSB share.

    Where noise does not dither the ``step`` (3,), what the best of the means keeps is the rounding.
    """
    sigma, sigma_mean = segments.accelerometer_sigma, segments.accelerometer_sigma_mean
    if sigma is None or sigma_mean is None:
        return None
    white = np.sqrt(np.maximum(sigma**2 - step**2 / 12.0, 0.0))
    out: FloatArray = np.where(undithered_axes(step, white), np.min(sigma_mean, axis=0) ** 2, 0.0)
    return out


def placements(values: FloatArray, noise: FloatArray, faces: IntArray, shared: FloatArray | None = None) -> Placements:
    """Merge the poses of every placement.

    ``shared`` (3,) raw² is the part of the noise that equal readings share (rounding): an axis that is up reads alike
    at every heading, one that lies level at every return to a heading.

    Taken as independent they would seem to show, by agreeing with each other, that nothing is tilted. What they scatter
    beyond noise is a tilt that turns with the case, and goes into the error of their mean; a heading that the case came
    back to shows the same tilt once more and counts once.
    """
    start = np.flatnonzero(np.concatenate([[True], faces[1:] != faces[:-1]]))
    stop = np.concatenate([start[1:], [len(faces)]])
    level = np.abs(face_poses.direction_of(faces)) < 0.5
    within, n_within = 0.0, 0
    means, errors, n_headings, squares = [], [], [], 0.0
    for a, b in zip(start, stop, strict=True):
        across = level[a]
        centre = values[a:b].mean(axis=0)
        within += float(np.sum((values[a:b] - centre)[:, across] ** 2))
        n_within += int(b - a - 1)
        heading = _headings(values[a:b, across], noise[a:b][:, across][:, :, across])
        n = int(heading.max()) + 1
        of_heading = np.array([values[a:b][heading == k].mean(axis=0) for k in range(n)])
        count = np.bincount(heading, minlength=n)[heading]
        means.append(of_heading.mean(axis=0))
        share = count[:, None, None] * n
        error = np.sum(noise[a:b] / share**2, axis=0)
        if shared is not None:
            once = np.where(across, shared / n, shared)
            error += np.diag(once) - np.sum(np.diag(shared) / share**2, axis=0)
        errors.append(error)
        squares += float(np.sum((of_heading - means[-1])[:, across] ** 2))
        n_headings.append(n)
    merged, widened = np.array(means), np.array(errors)
    freedom = 2.0 * n_within
    expected = float(np.mean(np.einsum("nii->n", noise))) / 3.0
    limit = expected * float(probability.chdtri(freedom, verdict.SIGNIFICANCE)) if freedom else np.inf
    apart = 2.0 * float(np.sum(np.array(n_headings) - 1))
    if within <= limit or apart == 0.0:
        return Placements(merged, widened, faces[start], None, np.array(n_headings, dtype=np.float64))
    return Placements(merged, widened, faces[start], squares / apart, np.array(n_headings, dtype=np.float64))


def _headings(values: FloatArray, noise: FloatArray) -> npt.NDArray[np.intp]:
    """(n,) number of the heading of each pose (n, 2): that of the first one before it which it repeats within noise."""
    limit = float(probability.chdtri(2, verdict.SIGNIFICANCE))
    out = np.zeros(len(values), dtype=np.intp)
    first: list[int] = []
    for k in range(len(values)):
        for number, other in enumerate(first):
            apart = values[k] - values[other]
            if float(apart @ np.linalg.pinv(noise[k] + noise[other]) @ apart) < limit:
                out[k] = number
                break
        else:
            out[k] = len(first)
            first.append(k)
    return out
