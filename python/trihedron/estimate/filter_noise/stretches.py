"""Stretches of the gyro's attitude, and of the accelerometer's velocity, against the reference's."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

from trihedron._core import ReferenceBlocks
from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.filter_noise.stretch import Stretch, accumulated, parts_of_walk, walked
from trihedron.estimate.reference.beside import BLOCK_S, Beside, Point
from trihedron.estimate.reference.motion import MotionFit
from trihedron.ranges import edges_of

START_RAD = 0.3
"""Prior σ of the attitude error at the start of a stretch: the fit leaves some degrees."""
PARTS = (np.arange(8) + 0.5) / 8 - 0.5
"""Parts of a block at which a slow error is averaged."""
LONGEST, SHORTEST = 300, 12
"""Most and fewest blocks of a stretch: over five minutes parameters drift (temperature), and matrices stay small."""


def runs(is_good: BoolArray) -> list[tuple[int, int]]:
    """Stretches ``(first, last)`` of good blocks, from ``SHORTEST`` to ``LONGEST`` blocks long."""
    out = []
    for first, last in edges_of(is_good):
        parts = max(1, int(np.ceil((last - first) / LONGEST)))
        cuts = np.linspace(first, last, parts + 1).astype(int)
        out += [(int(a), int(b)) for a, b in pairwise(cuts) if b - a >= SHORTEST]
    return out


def band_power(signal: FloatArray, step_s: float, band_hz: float, n: int) -> FloatArray:
    """(m,) mean square [SI²] of a signal (k, 3) above ``band_hz``, over blocks of ``n`` samples and the three axes."""
    spectrum = np.fft.rfft(signal - signal.mean(axis=0), axis=0)
    spectrum[np.fft.rfftfreq(len(signal), step_s) < band_hz] = 0.0
    fast = np.fft.irfft(spectrum, len(signal), axis=0)
    m = len(fast) // n
    return np.asarray(np.mean(fast[: m * n].reshape(m, n, 3) ** 2, axis=(1, 2)))


def relative(power: FloatArray, density: float, width_hz: float) -> FloatArray:
    """Band power (m,) above the static noise, scaled to mean 1; zeros where it is within the noise.

    Static noise has the power 2 N² ``width_hz``, because N √rate is the σ of a sample; where N is not known
    (``density`` 0) it is the 10 % quantile of the power.
    """
    floor = 2.0 * density**2 * width_hz if density > 0.0 else float(np.quantile(power, 0.1))
    beyond = np.maximum(power - floor, 0.0)
    # Half of the noise power covers its scatter and an error of N.
    return np.asarray(beyond / beyond.mean()) if beyond.mean() > 0.5 * floor else np.zeros(len(power))


def quietest_density(power: FloatArray, width_hz: float) -> float:
    """Noise density [SI/√Hz] in the quietest block: an upper limit of static noise that is white up to the band."""
    return float(np.sqrt(np.min(power) / (2.0 * width_hz))) if len(power) else 0.0


def angle_stretches(found: MotionFit, band_hz: float, static_N: float) -> list[Stretch]:
    """Stretches of recording 0 between its gaps; ``static_N`` [rad/s/√Hz], 0 where it is not known."""
    side, problem, point = found.sides[0], found.problems[0], found.points[0]
    blocks = problem.blocks
    n = max(2, round(1.0 / side.grid.step_s))
    seen = np.asarray(np.all(side.seen[: len(side.seen) // n * n].reshape(-1, n), axis=1), dtype=bool)
    is_good = np.asarray(blocks.rows()[:, 0] > 0, dtype=bool)
    m = min(len(seen), len(is_good))
    power = band_power(side.corrected(point), side.grid.step_s, band_hz, n)
    width_hz = 0.5 / side.grid.step_s - band_hz
    vibration = relative(power[:m], static_N, width_hz)
    quietest = quietest_density(power[:m], width_hz)
    rows = blocks.rows()[:, 0]
    moments = blocks.moments().reshape(-1, 3, 3, blocks.moments().shape[-1])
    table = {
        "time": blocks.time_s(), "angle": problem.observed.reshape(-1, 3) + _within_blocks(blocks, point),
        "bias": moments[:, :, :, 3],
        "columns": problem.columns.reshape(len(rows), 3, -1), "attitude": blocks.attitude(),
        "white": rows.max() / np.maximum(rows, 1), "power": np.pad(vibration, (0, len(rows) - m)),
    }  # fmt: skip
    return [
        replace(_angle_stretch(table, slice(a, b), n * side.grid.step_s, problem.centre), quietest=quietest)
        for a, b in runs(is_good[:m] & seen[:m])
    ]


def _within_blocks(blocks: ReferenceBlocks, point: Point) -> FloatArray:
    """(m, 3) means of the estimated slow error over the blocks less its values at their middles, which `Beside.problem`
    adds to the observations: with them an observation contains the whole mean of the error."""
    time = blocks.time_s()
    if point.slow is None:
        return np.zeros((len(time), 3))
    parts = np.array([point.slow.at(time + part * BLOCK_S) for part in PARTS]).mean(axis=0)
    world, body = parts - point.slow.at(time)
    return np.asarray(world + np.einsum("mij,mj->mi", blocks.attitude(), body))


def _angle_stretch(table: dict[str, FloatArray], at: slice, h: float, centre: FloatArray) -> Stretch:
    time = table["time"][at]
    m = len(time)
    start = np.tile(START_RAD * np.eye(3), (m, 1))
    columns = np.hstack([table["columns"][at].reshape(3 * m, -1), start])
    steps = bias_steps(table["bias"][at])
    walk, power = parts_of_walk(m, is_triangle=False), table["power"][at]
    noise, vibration = (accumulated(walk, h * q) for q in (np.ones(m), power))
    return Stretch(
        time_s=time,
        observed=table["angle"][at].ravel(),
        columns=columns,
        centre=np.concatenate([centre, np.zeros(3)]),
        alike=(noise, vibration, np.diag(table["white"][at])),
        bias_walk=h * walked(steps),
        bias_steps=steps,
        tilts=None,
        attitude=table["attitude"][at],
        power=power,
        walk=walk,
    )


def bias_steps(upto: FloatArray) -> FloatArray:
    """(3 m, 3 m) derivative of the observations by the bias in each block, from that by a constant bias (m, 3, 3)."""
    m = len(upto)
    edge = np.concatenate([upto[:1], 0.5 * (upto[1:] + upto[:-1]), upto[-1:]])
    out = np.zeros((m, 3, m, 3))
    for k in range(m):
        out[k, :, :k] = (edge[1 : k + 1] - edge[:k]).transpose(1, 0, 2)
        out[k, :, k] = upto[k] - edge[k]
    return out.reshape(3 * m, 3 * m)


LEVI_CIVITA = np.cross(np.eye(3)[:, None], np.eye(3)[None])
"""Levi-Civita symbol: component k of e_i × e_j at [i, j, k]."""
SIZES = {"S": 0.05, "b": 0.5, "up": 0.5, "start": 5.0, "arm": 0.3}
"""Prior σ: 5 % of scale, 0.5 m/s² of bias and of gravity, 5 m/s of velocity at the start, 0.3 m of lever arm."""


def velocity_stretches(
    side: Beside, point: Point, band_hz: float, static_N: float, gravity_m_s2: float, white_rad: float
) -> list[Stretch]:
    """Stretches of differences of the position's block means, each a triangular mean of the velocity.

    ``white_rad`` is the white error of block means of the reference's attitude, added to the variance as known.
    """
    assert side.force is not None
    h_grid = side.grid.step_s
    n = max(2, round(1.0 / h_grid))
    m = len(side.grid.time_s) // n
    time = side.grid.time_s[: m * n]
    inside = time * (1.0 + point.rate) + point.offset_s
    seen = side.seen[: m * n] & side.reference.covers(inside)
    is_good = np.asarray(np.all(seen.reshape(m, n), axis=1), dtype=bool)
    power = band_power(side.force[: m * n], h_grid, band_hz, n)
    width_hz = 0.5 / h_grid - band_hz
    vibration = relative(power, static_N, width_hz)
    quietest = quietest_density(power[is_good], width_hz)
    C = side.reference.attitude(inside) @ point.mounting
    out = []
    for a, b in runs(is_good):
        at = slice(a * n, b * n)
        local = (C[at], side.force[at], side.reference.position(inside[at]))
        out.append(_velocity_stretch(local, time[at], n, vibration[a:b], gravity_m_s2))
    return [replace(one, given=_of_white_attitude(one, white_rad), quietest=quietest) for one in out]


def _velocity_stretch(
    local: tuple[FloatArray, FloatArray, FloatArray], time: FloatArray, n: int, vibration: FloatArray, gravity: float
) -> Stretch:
    """One stretch from ``local``: attitude (k, 3, 3), specific force (k, 3) and position (k, 3) at its samples."""
    C, force, position = local
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
    carried = between(world - gravity * up)
    observed = _differences(position, n) / h - carried
    m = len(observed)
    bias = between(C)
    scale = between(np.einsum("kij,kl->kijl", C, force).reshape(len(C), 3, 9)) * SIZES["S"]
    since = between(np.ones((len(C), 1)))[:, 0]
    arm = -_differences(C, n) / h * SIZES["arm"]
    start, upward = np.tile(np.eye(3) * SIZES["start"], (m, 1, 1)), since[:, None, None] * np.eye(3) * SIZES["up"]
    columns = np.concatenate([scale, bias * SIZES["b"], upward, start, arm], axis=2).reshape(3 * m, -1)
    steps = bias_steps(bias)
    walk = parts_of_walk(m + 1, is_triangle=True)
    noise, shakes = (accumulated(walk, h * q) for q in (np.ones(m + 1), vibration))
    # An attitude error e changes the specific force by e x f; its integral is a velocity error.
    across = between(np.einsum("ijk,nk->nij", LEVI_CIVITA, world))
    return Stretch(
        time_s=time[: m * n].reshape(m, n).mean(axis=1) + 0.5 * h,
        observed=observed.ravel(),
        columns=columns,
        centre=np.zeros(columns.shape[1]),
        alike=(noise, shakes, (2.0 * np.eye(m) - np.eye(m, k=1) - np.eye(m, k=-1)) / h**2),
        bias_walk=h * walked(steps),
        bias_steps=steps,
        tilts=np.diff(across, axis=0, prepend=0.0),
        # Attitude at the edge between two blocks.
        attitude=C[n - 1 : m * n : n],
        power=vibration,
        walk=walk,
    )


def _of_white_attitude(stretch: Stretch, white_rad: float) -> FloatArray:
    """Covariance (3 m, 3 m) of the velocity from a white attitude error per block: white acceleration |f| times it."""
    assert stretch.tilts is not None
    m = len(stretch.tilts)
    per_block = np.einsum("kij,klj->il", stretch.tilts, stretch.tilts) / m * white_rad**2
    return np.kron(accumulated(stretch.walk, np.ones(len(stretch.power))), per_block)


def _differences(samples: FloatArray, n: int) -> FloatArray:
    """Differences (m - 1, ...) of the means over blocks of ``n`` samples."""
    m = len(samples) // n
    return np.asarray(np.diff(samples[: m * n].reshape(m, n, *samples.shape[1:]).mean(axis=1), axis=0))
