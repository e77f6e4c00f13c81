"""Stretches of the gyro's attitude, and of the accelerometer's velocity, against the reference's."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from trihedron._core import ReferenceBlocks
from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.filter_noise.stretch import Stretch, parts_of_walk
from trihedron.estimate.reference.beside import BLOCK_S, Beside, Point
from trihedron.estimate.reference.motion import MotionFit
from trihedron.ranges import edges_of
from trihedron.transforms import cross_matrix

START_RAD = 0.3
"""Prior σ of the attitude error at the start of a stretch: the fit leaves some degrees."""
PARTS = (np.arange(8) + 0.5) / 8 - 0.5
"""Parts of a block at which a slow error is averaged."""
LONGEST, SHORTEST = 300, 12
"""Most and fewest blocks of a stretch: over five minutes parameters drift (temperature), and matrices stay small."""


def runs(is_good: BoolArray) -> list[slice]:
    """Stretches of good blocks, from ``SHORTEST`` to ``LONGEST`` blocks long."""
    out = []
    for first, last in edges_of(is_good):
        parts = max(1, int(np.ceil((last - first) / LONGEST)))
        cuts = np.linspace(first, last, parts + 1).astype(int)
        out += [slice(int(a), int(b)) for a, b in pairwise(cuts) if b - a >= SHORTEST]
    return out


def per_block(side: Beside) -> int:
    """Samples in a block."""
    return max(2, round(BLOCK_S / side.grid.step_s))


def shaken(
    signal: FloatArray, side: Beside, is_good: BoolArray, band_hz: float, static_N: float
) -> tuple[FloatArray, float]:
    """Vibration (m,) of a signal (k, 3) in each block, and the noise density [SI/√Hz] of the quietest good block.

    Vibration is the mean square above ``band_hz`` less that of static noise, scaled to mean 1; zeros where it is within
    the noise. Static noise has the power 2 N² width, because N √rate is the σ of a sample; where N is not known
    (``static_N`` 0) it is the 10 % quantile of the power. The quietest block limits a noise that is white up to the
    band.
    """
    n, m, step_s = per_block(side), len(is_good), side.grid.step_s
    spectrum = np.fft.rfft(signal - signal.mean(axis=0), axis=0)
    spectrum[np.fft.rfftfreq(len(signal), step_s) < band_hz] = 0.0
    fast = np.fft.irfft(spectrum, len(signal), axis=0)
    power = np.mean(fast[: m * n].reshape(m, n, 3) ** 2, axis=(1, 2))
    width_hz = 0.5 / step_s - band_hz
    floor = 2.0 * static_N**2 * width_hz if static_N > 0.0 else float(np.quantile(power, 0.1))
    beyond = np.maximum(power - floor, 0.0)
    quietest = float(np.sqrt(np.min(power[is_good], initial=np.inf) / (2.0 * width_hz)))
    # Half of the noise power covers its scatter and an error of N.
    return beyond / beyond.mean() if beyond.mean() > 0.5 * floor else np.zeros(m), quietest


def angle_stretches(found: MotionFit, band_hz: float, static_N: float) -> list[Stretch]:
    """Stretches of recording 0 between its gaps; ``static_N`` [rad/s/√Hz], 0 where it is not known."""
    side, problem, point = found.sides[0], found.problems[0], found.points[0]
    blocks, n = problem.blocks, per_block(side)
    rows = blocks.rows()[:, 0]
    m = min(len(side.seen) // n, len(rows))
    is_good = np.asarray(np.all(side.seen[: m * n].reshape(m, n), axis=1) & (rows[:m] > 0), dtype=bool)
    power, quietest = shaken(side.corrected(point), side, is_good, band_hz, static_N)
    time, attitude = blocks.time_s(), blocks.attitude()
    expected = problem.columns @ problem.centre
    angle = (problem.observed - expected).reshape(-1, 3) + _within_blocks(blocks, point)
    columns = problem.columns.reshape(len(rows), 3, -1)
    by_bias = blocks.moments().reshape(len(rows), 3, 3, -1)[..., 3]
    out = []
    for at in runs(is_good):
        start = np.tile(START_RAD * np.eye(3), (at.stop - at.start, 1))
        stretch = Stretch(
            time_s=time[at],
            observed=angle[at].ravel(),
            columns=np.hstack([columns[at].reshape(len(start), -1), start]),
            white=np.diag(rows.max() / rows[at]),
            bias_steps=bias_steps(by_bias[at]),
            tilts=None,
            attitude=attitude[at],
            power=power[at],
            walk=parts_of_walk(len(power[at]), is_triangle=False),
            quietest=quietest,
        )
        out.append(stretch)
    return out


def _within_blocks(blocks: ReferenceBlocks, point: Point) -> FloatArray:
    """(m, 3) means of the estimated slow error over the blocks less its values at their middles, which `Beside.problem`
    adds to the observations: with them an observation contains the whole mean of the error."""
    time = blocks.time_s()
    if point.slow is None:
        return np.zeros((len(time), 3))
    parts = np.array([point.slow.at(time + part * BLOCK_S) for part in PARTS]).mean(axis=0)
    world, body = parts - point.slow.at(time)
    return np.asarray(world + np.einsum("mij,mj->mi", blocks.attitude(), body))


def bias_steps(upto: FloatArray) -> FloatArray:
    """(3 m, 3 m) derivative of the observations by the bias in each block, from that by a constant bias (m, 3, 3)."""
    m = len(upto)
    edge = np.concatenate([upto[:1], 0.5 * (upto[1:] + upto[:-1]), upto[-1:]])
    out = np.zeros((m, 3, m, 3))
    for k in range(m):
        out[k, :, :k] = (edge[1 : k + 1] - edge[:k]).transpose(1, 0, 2)
        out[k, :, k] = upto[k] - edge[k]
    return out.reshape(3 * m, 3 * m)


SIZES = {"S": 0.05, "b": 0.5, "up": 0.5, "start": 5.0, "arm": 0.3}
"""Prior σ: 5 % of scale, 0.5 m/s² of bias and of gravity, 5 m/s of velocity at the start, 0.3 m of lever arm."""


def velocity_stretches(
    side: Beside, point: Point, band_hz: float, static_N: float, gravity_m_s2: float, white_rad: float
) -> list[Stretch]:
    """Stretches of differences of the position's block means, each a triangular mean of the velocity.

    ``white_rad`` is the white error of block means of the reference's attitude, added to the variance as known.
    """
    assert side.force is not None
    n = per_block(side)
    m = len(side.grid.time_s) // n
    inside = side.grid.time_s[: m * n] * (1.0 + point.rate) + point.offset_s
    seen = side.seen[: m * n] & side.reference.covers(inside)
    is_good = np.asarray(np.all(seen.reshape(m, n), axis=1), dtype=bool)
    power, quietest = shaken(side.force, side, is_good, band_hz, static_N)
    C = side.reference.attitude(inside) @ point.mounting
    out = []
    for run in runs(is_good):
        at = slice(run.start * n, run.stop * n)
        local = (C[at], side.force[at], side.reference.position(inside[at]))
        one = _velocity_stretch(local, side.grid.time_s[at], power[run], gravity_m_s2)
        out.append(replace(one, white_rad=white_rad, quietest=quietest))
    return out


def _velocity_stretch(
    local: tuple[FloatArray, FloatArray, FloatArray], time: FloatArray, vibration: FloatArray, gravity: float
) -> Stretch:
    """One stretch from ``local``: attitude (k, 3, 3), specific force (k, 3) and position (k, 3) at its samples."""
    C, force, position = local
    n = len(time) // len(vibration)
    step = float(np.median(np.diff(time)))
    h = n * step

    def between(samples: FloatArray) -> FloatArray:
        """Triangular means of velocity between neighbouring blocks, from an acceleration (k, ...)."""
        # Both integrals by trapezoids: a plain cumulative sum is half a sample ahead.
        once = np.cumsum(samples, axis=0) - 0.5 * samples
        return _differences(np.cumsum(once, axis=0) - 0.5 * once, n) * step**2 / h

    world = np.einsum("kij,kj->ki", C, force)
    up = world.mean(axis=0) / np.linalg.norm(world.mean(axis=0))
    # The gravity vector is free about |g| along the mean specific force.
    observed = _differences(position, n) / h - between(world - gravity * up)
    m = len(observed)
    bias = between(C)
    scale = between(np.einsum("kij,kl->kijl", C, force).reshape(len(C), 3, 9)) * SIZES["S"]
    since = between(np.ones((len(C), 1)))[:, :, None]
    arm = -_differences(C, n) / h * SIZES["arm"]
    start, upward = np.tile(np.eye(3) * SIZES["start"], (m, 1, 1)), since * np.eye(3) * SIZES["up"]
    columns = np.concatenate([scale, bias * SIZES["b"], upward, start, arm], axis=2).reshape(3 * m, -1)
    return Stretch(
        time_s=time.reshape(-1, n).mean(axis=1)[:-1] + 0.5 * h,
        observed=observed.ravel(),
        columns=columns,
        white=(2.0 * np.eye(m) - np.eye(m, k=1) - np.eye(m, k=-1)) / h**2,
        bias_steps=bias_steps(bias),
        # An attitude error e changes the specific force f by e x f; its integral is a velocity error.
        tilts=np.diff(between(-cross_matrix(world)), axis=0, prepend=0.0),
        # Attitude at the edge between two blocks.
        attitude=C[n - 1 : m * n : n],
        power=vibration,
        walk=parts_of_walk(m + 1, is_triangle=True),
    )


def _differences(samples: FloatArray, n: int) -> FloatArray:
    """Differences (m - 1, ...) of the means over blocks of ``n`` samples."""
    return np.asarray(np.diff(samples.reshape(-1, n, *samples.shape[1:]).mean(axis=1), axis=0))
