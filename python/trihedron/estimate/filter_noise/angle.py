"""Stretches of the gyro's attitude against the reference's."""

from itertools import pairwise

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.estimate.filter_noise.stretch import BLOCK_ENDS, Stretch, accumulated, walked
from trihedron.estimate.reference.motion import MotionFit
from trihedron.ranges import edges_of

START_RAD = 0.3
"""Prior σ of the attitude error at the start of a stretch: the fit leaves some degrees."""
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


def angle_stretches(found: MotionFit, band_hz: float, static_N: float) -> list[Stretch]:
    """Stretches of recording 0 between its gaps; ``static_N`` [rad/s/√Hz], 0 where it is not known."""
    side, problem, point = found.sides[0], found.problems[0], found.points[0]
    blocks = problem.blocks
    n = max(2, round(1.0 / side.grid.step_s))
    seen = np.asarray(np.all(side.seen[: len(side.seen) // n * n].reshape(-1, n), axis=1), dtype=bool)
    is_good = np.asarray(blocks.rows()[:, 0] > 0, dtype=bool)
    m = min(len(seen), len(is_good))
    power = band_power(side.corrected(point), side.grid.step_s, band_hz, n)
    vibration = relative(power[:m], static_N, 0.5 / side.grid.step_s - band_hz)
    rows = blocks.rows()[:, 0]
    moments = blocks.moments().reshape(-1, 3, 3, blocks.moments().shape[-1])
    table = {
        "time": blocks.time_s(), "angle": problem.observed.reshape(-1, 3), "bias": moments[:, :, :, 3],
        "columns": problem.columns.reshape(len(rows), 3, -1), "attitude": blocks.attitude(),
        "white": rows.max() / np.maximum(rows, 1), "power": np.pad(vibration, (0, len(rows) - m)),
    }  # fmt: skip
    return [_stretch(table, slice(a, b), n * side.grid.step_s, problem.centre) for a, b in runs(is_good[:m] & seen[:m])]


def _stretch(table: dict[str, FloatArray], at: slice, h: float, centre: FloatArray) -> Stretch:
    time = table["time"][at]
    m = len(time)
    start = np.tile(START_RAD * np.eye(3), (m, 1))
    columns = np.hstack([table["columns"][at].reshape(3 * m, -1), start])
    steps = bias_steps(table["bias"][at])
    quiet, shaken = np.full(m, h), h * table["power"][at]
    noise, vibration = (accumulated(q, BLOCK_ENDS) for q in (quiet, shaken))
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
        power=table["power"][at],
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
