"""Stretches of the velocity from accelerometer and reference attitude, against the reference's position."""

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.filter_noise.angle import band_power, bias_steps, relative, runs
from trihedron.estimate.filter_noise.stretch import TRIANGLE_ENDS, Stretch, accumulated, neighbours, walked
from trihedron.estimate.reference.beside import Beside, Point

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
    vibration = relative(power, static_N, 0.5 / h_grid - band_hz)
    C = side.reference.attitude(inside) @ point.mounting
    out = []
    for a, b in runs(is_good):
        at = slice(a * n, b * n)
        local = (C[at], side.force[at], side.reference.position(inside[at]))
        out.append(_stretch(local, time[at], n, vibration[a:b], gravity_m_s2))
    return [replace(one, given=_of_white_attitude(one, white_rad)) for one in out]


def _stretch(
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
    quiet = np.full(m, h)
    shaken = 0.5 * h * (vibration[1:] + vibration[:-1])
    noise, shakes = (accumulated(q, TRIANGLE_ENDS) for q in (quiet, shaken))
    # An attitude error e changes the specific force by e x f; its integral is a velocity error.
    across = between(np.einsum("ijk,nk->nij", LEVI_CIVITA, world))
    return Stretch(
        time_s=time[: m * n].reshape(m, n).mean(axis=1) + 0.5 * h,
        observed=observed.ravel(),
        columns=columns,
        centre=np.zeros(columns.shape[1]),
        alike=(noise, shakes, (2.0 * np.eye(m) - neighbours(m)) / h**2),
        bias_walk=h * walked(steps),
        bias_steps=steps,
        tilts=np.diff(across, axis=0, prepend=0.0),
        # Attitude at the edge between two blocks.
        attitude=C[n - 1 : m * n : n],
        power=vibration[1:],
        ends=TRIANGLE_ENDS,
    )


def _of_white_attitude(stretch: Stretch, white_rad: float) -> FloatArray:
    """Covariance (3 m, 3 m) of the velocity from a white attitude error per block: white acceleration |f| times it."""
    assert stretch.tilts is not None
    m = len(stretch.tilts)
    per_block = np.einsum("kij,klj->il", stretch.tilts, stretch.tilts) / m * white_rad**2
    return np.kron(accumulated(np.ones(m), TRIANGLE_ENDS), per_block)


def _differences(samples: FloatArray, n: int) -> FloatArray:
    """Differences (m - 1, ...) of the means over blocks of ``n`` samples."""
    m = len(samples) // n
    return np.asarray(np.diff(samples[: m * n].reshape(m, n, *samples.shape[1:]).mean(axis=1), axis=0))
