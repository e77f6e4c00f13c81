"""An accelerometer that settles after rotations: a part of every change of force comes late (docs/segmentation.md,
section 4)."""

from dataclasses import dataclass, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.probability import FALSE_ALARM, fdtrc
from trihedron.segment.channels import Channels
from trihedron.segment.means import PoseMeans, along_verticals, upright
from trihedron.segment.runs import Run, means_of

TIME_CONSTANTS_S = 0.7 * 2.0 ** np.arange(0.0, 4.1, 0.5)
"""Up to 11.2 s. Faster ones are over before a pose counts as static, slower ones are a drift."""
FINER = 2.0 ** np.array([-0.36, -0.25, -0.16, -0.09, -0.04, 0.04, 0.09, 0.16, 0.25, 0.36])
"""Factors on the likeliest: strong settling shows its time constant to a percent."""
FEWEST_POSES = 9
"""Three components, and twice as many poses that show how much the decay scatters from pose to pose."""
FEWEST_ON_QUADRIC = 18
"""Poses from which the means count beside the shapes: nine parameters and three, and six that show their scatter."""
FEWEST_BLOCKS = 4
"""Blocks of a pose: fewer have no shape."""


@dataclass(frozen=True, eq=False)
class Settling:
    """The ``share`` (3,) of a change of force that comes late, by axis, with ``sigma`` (3,), time constant ``tau_s``,
    and ``p_value`` that none does.

    It adds ``mean`` (h, 3) to the means of the poses, raw, with ``covariance`` (h, 3, 3); ``channels`` are the blocks
    without it.
    """

    share: FloatArray
    sigma: FloatArray
    tau_s: float
    p_value: float
    mean: FloatArray
    covariance: FloatArray
    channels: Channels

    def without(self, means: PoseMeans) -> PoseMeans:
        """The means of the poses as they would be long after every move."""
        mean, sigma, of_axes = means.mean.copy(), means.sigma.copy(), slice(0, 3)
        mean[:, of_axes] -= self.mean
        sigma[:, of_axes] = np.sqrt(sigma[:, of_axes] ** 2 + np.diagonal(self.covariance, axis1=1, axis2=2))
        along = means.sigma_up
        if means.up is not None and along is not None:
            along = np.sqrt(along**2 + np.einsum("hi,hij,hj->h", means.up, self.covariance, means.up))
        return replace(means, mean=mean, sigma=sigma, sigma_up=along)


def find_settling(channels: Channels, runs: list[Run], *, has_unit: bool) -> Settling | None:
    """The decay after rotations, averaged over time constants by their likelihood, if any is significant.

    Along the vertical the tilt of a yielding support does not show; noise of any colour, and a drift, have no relation
    to the rotation before: their decay is zero on average.
    """
    if channels.is_gyroscope.all() or len(runs) < FEWEST_POSES:
        return None
    force = channels.mean[:, ~channels.is_gyroscope]
    mean = means_of(force, [run.quiet_ranges() for run in runs])
    up = upright(mean, has_unit=has_unit)
    if up is None:
        return None
    present = np.isfinite(force).all(axis=1)
    path = force[np.maximum.accumulate(np.where(present, np.arange(len(force)), present.argmax()))]
    begins, upward = [run.outer_first for run in runs], along_verticals(channels, runs, up).mean[:, 0]

    def tried(tau: float) -> Tried | None:
        # How far the delayed force is behind at the end of a move.
        behind = _core.simulate_first_order(path, channels.step_s, (tau,) * 3)[begins] - mean
        return _with_time_constant(tau, _amplitudes(channels, runs, upward, tau), behind, mean, up)

    found = [one for tau in TIME_CONSTANTS_S if (one := tried(float(tau))) is not None]
    p_value = min((one.p_value for one in found), default=1.0)
    if p_value * len(TIME_CONSTANTS_S) >= FALSE_ALARM:
        return None
    best = max(found, key=lambda one: one.log_likelihood).tau_s
    found += [one for factor in FINER if (one := tried(float(best * factor))) is not None]
    return _averaged(channels, runs, sorted(found, key=lambda one: one.tau_s), p_value)


@dataclass(frozen=True, eq=False)
class Tried:
    """One time constant: share and its covariance, p of none by the shapes of the poses, log-likelihood; ``behind``
    (h, 3), raw, when a pose begins, ``late`` (h, 3) on average over it."""

    tau_s: float
    behind: FloatArray
    late: FloatArray
    share: FloatArray
    covariance: FloatArray
    p_value: float
    log_likelihood: float


def _decays(channels: Channels, run: Run, tau: float) -> tuple[IntArray, FloatArray]:
    """Valid blocks of a pose, and the decay there since the move before."""
    blocks = np.concatenate([np.arange(a, b) for a, b in run.quiet_ranges()])
    blocks = blocks[channels.is_valid[blocks]]
    return blocks, np.exp(-(blocks - run.outer_first) * channels.step_s / tau)


def _amplitudes(channels: Channels, runs: list[Run], upward: FloatArray, tau: float) -> FloatArray:
    """(3, h) of every pose: the amplitude of a decay of unit length in its blocks ``upward`` (m,), about the mean; that
    of a decay from 1, 0 where the pose shows no shape; the mean of a decay from 1."""
    reading, length, over_pose = out = np.zeros((3, len(runs)))
    for i, run in enumerate(runs):
        blocks, decay = _decays(channels, run, tau)
        if len(blocks) == 0:
            continue
        over_pose[i] = decay.mean()
        change = decay - over_pose[i]
        size = np.linalg.norm(change)
        if len(blocks) >= FEWEST_BLOCKS and not run.is_unsteady and size > 0.0:
            length[i], reading[i] = size, change @ upward[blocks] / size
    return out


def _with_time_constant(
    tau: float, shapes: FloatArray, behind: FloatArray, mean: FloatArray, up: FloatArray
) -> Tried | None:
    """Share by the ``shapes`` (3, h) of the poses, and by their means (h, 3) beside S and b; either group has the
    variance that it shows."""
    reading, length, over_pose = shapes
    used, late = length > 0.0, over_pose[:, None] * behind
    n = int(used.sum())
    if n < FEWEST_POSES:
        return None
    y, settles = reading[used], (up * behind * length[:, None])[used]
    left = _squares_beside(y, settles)
    if left <= 0.0 or np.linalg.matrix_rank(settles) < 3:
        return None
    groups = [(y, settles, left / (n - 3))]
    p_value = fdtrc(3, n - 3, (y @ y - left) / 3.0 / groups[0][2])
    if n >= FEWEST_ON_QUADRIC:
        norm, quadric, along = _on_quadric(mean[used])
        columns = np.hstack([-along * late[used], quadric])
        groups.append((norm, columns, _squares_beside(norm, columns) / (n - columns.shape[1])))
    # S and b, the unknowns of one group alone, are projected out.
    whitened = [
        _beside(np.column_stack([columns[:, :3], values]), columns[:, 3:]) / np.sqrt(variance)
        for values, columns, variance in groups
    ]
    together = np.vstack(whitened)
    inverse = np.linalg.pinv(together[:, :3])
    share = inverse @ together[:, 3]
    left_over = [
        variance * np.sum((one[:, 3] - one[:, :3] @ share) ** 2)
        for one, (_, _, variance) in zip(whitened, groups, strict=True)
    ]
    log_likelihood = -0.5 * n * float(np.sum(np.log(left_over)))
    return Tried(tau, behind, late, share, inverse @ inverse.T, p_value, log_likelihood)


def _on_quadric(mean: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Means (h, 3) as rows of the ellipsoid of gravity, 1 = q·(x², xy, x), scaled to errors along the vertical, raw:
    left side (h,), nine columns, and verticals (h, 3)."""
    centre, scale = 0.5 * (mean.max(axis=0) + mean.min(axis=0)), float(np.ptp(mean, axis=0).max())
    x = (mean - centre) / scale
    columns = np.hstack([x**2, x * np.roll(x, 1, axis=1), x])
    q = np.linalg.lstsq(columns, np.ones(len(x)), rcond=None)[0]
    gradient = 2.0 * q[:3] * x + q[3:6] * np.roll(x, 1, axis=1) + np.roll(q[3:6] * x, -1, axis=1) + q[6:]
    size = np.linalg.norm(gradient, axis=1, keepdims=True)
    return scale / size[:, 0], scale / size * columns, gradient / size


def _beside(values: FloatArray, columns: FloatArray) -> FloatArray:
    """What is left of ``values`` beside ``columns``."""
    return np.asarray(values - columns @ np.linalg.lstsq(columns, values, rcond=None)[0])


def _squares_beside(values: FloatArray, columns: FloatArray) -> float:
    return float((_beside(values, columns) ** 2).sum())


def _averaged(channels: Channels, runs: list[Run], tried: list[Tried], p_value: float) -> Settling:
    """The average over time constants, equally likely on a logarithmic scale.

    The share is common to all poses: as an error of each alone it would average out, so each has n/3 times its
    variance, n poses over three components.
    """
    likelihood = np.array([one.log_likelihood for one in tried])
    weight = np.exp(likelihood - likelihood.max()) * np.gradient(np.log([one.tau_s for one in tried]))
    weight /= weight.sum()
    added, blocks = np.array([one.late * one.share for one in tried]), channels.mean.copy()
    mean, axes = np.tensordot(weight, added, 1), np.flatnonzero(~channels.is_gyroscope)
    covariance = np.zeros((*mean.shape, 3))
    for one, own, away in zip(tried, weight, added - mean, strict=True):
        of_share = one.late[:, :, None] * one.covariance * one.late[:, None, :]
        covariance += own * len(runs) / 3.0 * (of_share + away[:, :, None] * away[:, None, :])
        for i, run in enumerate(runs):
            rows, decay = _decays(channels, run, one.tau_s)
            blocks[np.ix_(rows, axes)] -= own * np.outer(decay, one.share * one.behind[i])
    best = tried[int(np.argmax(weight))]
    sigma = np.sqrt(np.diagonal(best.covariance))
    return Settling(best.share, sigma, best.tau_s, p_value, mean, covariance, replace(channels, mean=blocks))
