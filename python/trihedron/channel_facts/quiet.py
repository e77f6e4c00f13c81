"""Short windows of a log and which of them are quiet: the basis for recognising units and column order.

This is not the segmentation: no pose is accepted or excluded here.
"""

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, BoolArray, FloatArray, IntArray
from trihedron.quantiles import median, medians, quantile

WINDOW_S = 0.5
MAX_WINDOWS = 2000
_ROWS_AT_ONCE = 2048


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of about half a second, evenly spread over the log where there are too many.

    ``mean`` and ``noise`` map a sensor's name to (m, 3): mean reading and white noise of one sample (standard deviation
    of the first difference over √2) of each window; ``start`` (m,) is its first sample, ``length`` its samples;
    ``quiet`` (m,) marks those near the log's own noise floor in every sensor.
    """

    start: IntArray
    length: int
    mean: dict[str, FloatArray]
    noise: dict[str, FloatArray]
    quiet: BoolArray

    @property
    def edges(self) -> tuple[IntArray, IntArray]:
        """(m,) first sample of each window, and one past its last."""
        return self.start, self.start + self.length

    def quiet_mean(self, sensor: str) -> FloatArray:
        """(k, 3) mean readings of the quiet windows."""
        return self.mean[sensor][self.quiet]

    def quiet_noise(self, sensor: str) -> FloatArray:
        """(3,) median noise of one sample over the quiet windows."""
        return medians(self.noise[sensor][self.quiet])


def look(sensors: dict[str, FloatArray], rate_hz: float, *, in_a_row: int = 1) -> Windows | None:
    """Windows of a log, ``in_a_row`` consecutive ones where they are spread; ``None`` if all lack values."""
    n = min(len(a) for a in sensors.values())
    length = int(min(max(round(WINDOW_S * rate_hz), 8), max(n, 1)))
    n_windows = n // length
    if n_windows == 0 or n < 2:
        return None
    first = np.linspace(0, max(n_windows - in_a_row, 0), -(-min(n_windows, MAX_WINDOWS) // in_a_row)).astype(np.int64)
    picked = np.unique(first[:, None] + np.arange(in_a_row)) if n_windows > MAX_WINDOWS else np.arange(n_windows)
    start = picked * length
    found = {name: _core.window_statistics(array, start, length) for name, array in sensors.items()}
    whole = {name: one for name, one in found.items() if one is not None}
    if len(whole) < len(sensors):
        # Half of a window may be missing; fewer readings do not determine its noise.
        least = max(1, length // 2 if length > 2 else 1)
        blocks = {name: array[start[:, None] + np.arange(length)] for name, array in sensors.items()}
        pairs = [np.isfinite(np.diff(block, axis=1)).all(axis=2).sum(axis=1) for block in blocks.values()]
        enough = np.min(pairs, axis=0) >= least
        if not enough.any():
            return None
        start = start[enough]
        whole = {name: _beside_gaps(block[enough]) for name, block in blocks.items()}
    mean, noise, spread = ({name: one[k] for name, one in whole.items()} for k in range(3))
    quiet = np.ones(len(start), dtype=bool)
    for value in spread.values():
        # The quietest tenth has the sensor's own noise; up to three times that is no hand motion.
        quiet &= value <= 3.0 * quantile(value, 0.1)
    if not quiet.any():
        total = np.sum([v / max(median(v), TINY) for v in spread.values()], axis=0)
        quiet = np.asarray(total <= quantile(total, 0.1))
    if not quiet.any():
        quiet[:] = True
    return Windows(start, length, mean, noise, quiet)


def _beside_gaps(block: FloatArray) -> tuple[FloatArray, FloatArray, FloatArray]:
    """Mean and noise (m, 3) and spread (m,) of windows (m, n, 3) without their missing readings."""
    noise = np.nanstd(np.diff(block, axis=1), axis=1) / np.sqrt(2.0)
    return np.nanmean(block, axis=1), noise, np.linalg.norm(np.nanstd(block, axis=1), axis=1)


def is_integer(array: FloatArray) -> bool:
    """Whether all readings (of a sample of up to about 20000 rows) are whole numbers."""
    probe = array[:: max(1, len(array) // 20000)]
    # In pieces: most logs show in their first rows that they are not, and all at once needs time and memory.
    pieces = (probe[k : k + _ROWS_AT_ONCE] for k in range(0, len(probe), _ROWS_AT_ONCE))
    return all(_is_whole(piece) for piece in pieces) and bool(np.isfinite(probe).any())


def _is_whole(piece: FloatArray) -> bool:
    whole = piece == np.rint(piece)
    return bool(whole.all() or (whole | ~np.isfinite(piece)).all())
