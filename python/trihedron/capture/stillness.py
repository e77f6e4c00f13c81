"""Immediate detection of stillness: the standard deviation over ``WINDOW_S`` against the lowest so far.

The segmentation of the whole log decides later which poses count; this one only drives the display.
"""

import math

import numpy as np

from trihedron.arrays import FloatArray

MOVED_DEG = 8.0
"""Smallest change of direction that is another orientation."""

LEAST_POSE_S = 1.0
"""Static time after which a pose that was left early is examined: the segmentation decides whether it counts."""

WINDOW_S = 0.25
LOUDER = 3.0
"""Limit of a window's standard deviation over the calm one: noise exceeds it in < 10⁻⁶ of windows (25 rows, 6 axes)."""

MEAN_SHIFT = 2.5
"""Limit of the change of mean between windows over the calm standard deviation; noise of a mean is a fifth of it."""

CALM_QUANTILE = 0.1
SHAKY = 1.8
"""A window's standard deviation over the calm one above which a static board is on a vibrating table, or held."""


class Stillness:
    """Detects stillness from readings as they arrive; :attr:`still_for_s` is how long the board has been static."""

    def __init__(self) -> None:
        self.still_for_s = 0.0
        self.mean: FloatArray | None = None
        self.is_shaky = False
        self._rows: list[FloatArray] = []
        self._since_s: float | None = None
        self._spreads: list[FloatArray] = []
        self._before: FloatArray | None = None
        self._still_from_s: float | None = None

    def add(self, time_s: FloatArray, readings: FloatArray) -> None:
        """Add readings (n, 3) or (n, 6) at ``time_s`` (n,) [s]."""
        start = 0
        for i, t in enumerate(time_s):
            if self._since_s is None:
                self._since_s = float(t)
            if t - self._since_s >= WINDOW_S:
                self._rows.append(readings[start:i])
                self._window(float(t))
                start, self._since_s = i, float(t)
        self._rows.append(readings[start:])

    def _window(self, end_s: float) -> None:
        rows = np.concatenate(self._rows)
        self._rows = []
        if len(rows) < 3 or not np.all(np.isfinite(rows)):
            return
        mean, spread = rows.mean(axis=0), rows.std(axis=0)
        self._spreads.append(spread)
        if len(self._spreads) > 4000:
            del self._spreads[::2]
        calm = np.quantile(np.array(self._spreads), CALM_QUANTILE, axis=0)
        # With a coarse ADC the standard deviation in a pose may be 0.
        calm = np.maximum(calm, 0.05 * np.median(np.array(self._spreads), axis=0) + 1e-12)
        is_still = bool(np.all(spread <= LOUDER * calm + _step(rows)))
        if self._before is not None:
            is_still &= bool(np.all(np.abs(mean - self._before) <= MEAN_SHIFT * calm + _step(rows)))
        self.is_shaky = is_still and bool(np.any(spread > SHAKY * calm + _step(rows)))
        self._before, self.mean = mean, mean
        if not is_still:
            self._still_from_s = None
            self.still_for_s = 0.0
            return
        if self._still_from_s is None:
            self._still_from_s = end_s - WINDOW_S
        self.still_for_s = end_s - self._still_from_s


class Orientation:
    """Static time in the present orientation: a tremble does not end it, a turn does."""

    def __init__(self) -> None:
        self.is_counted = False
        self._static_s = self._before_s = 0.0
        self._mean: FloatArray | None = None

    @property
    def is_uncounted(self) -> bool:
        """Whether it lasted long enough for a pose and was not counted."""
        return self._static_s >= LEAST_POSE_S and not self.is_counted

    def is_over(self, stillness: Stillness) -> bool:
        """Whether the board is static in another orientation."""
        if stillness.still_for_s <= 0.0 or stillness.mean is None or self._mean is None:
            return False
        a, b = self._mean[:3], stillness.mean[:3]
        cosine = float(a @ b) / max(float(np.linalg.norm(a) * np.linalg.norm(b)), 1e-300)
        return cosine < math.cos(math.radians(MOVED_DEG))

    def add(self, stillness: Stillness) -> None:
        """Add the time that has passed since the last call."""
        if self._mean is None or self.is_over(stillness):
            self.is_counted, self._static_s, self._before_s = False, 0.0, 0.0
            self._mean = stillness.mean if stillness.still_for_s > 0.0 else None
        more = stillness.still_for_s - self._before_s
        self._static_s += more if more >= 0.0 else stillness.still_for_s
        self._before_s = stillness.still_for_s


def _step(rows: FloatArray) -> FloatArray:
    """(k,) allowance per axis: 1 LSB where readings are whole numbers, else 0."""
    whole = np.all(rows == np.round(rows), axis=0)
    return np.where(whole, 1.0, 0.0)
