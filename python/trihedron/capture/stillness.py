"""Still or moving, at once: the spread of a quarter of a second against the calmest so far.

The segmentation of the whole log decides later which poses count; this is for the eye and the ear while one waits.
"""

from __future__ import annotations

import numpy as np

from trihedron.arrays import FloatArray

WINDOW_S = 0.25
LOUDER = 3.0
"""Times the calmest spread: noise alone exceeds it in fewer than one window in 10⁶ (25 readings, six axes)."""

MEAN_SHIFT = 2.5
"""Times the calmest spread, from window to window: noise of means is a fifth of it, a slow turn is not."""

CALM_QUANTILE = 0.1
SHAKY = 1.8
"""Times the calmest spread, during a whole pose: a table that vibrates, or a hand."""


class Stillness:
    """Takes readings as they come; :attr:`still_for_s` says for how long the board has not moved."""

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
        """Readings (n, 3) or (n, 6) at ``time_s`` (n,)."""
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
        # A coarse ADC may show no spread at all where it stands still.
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


def _step(rows: FloatArray) -> FloatArray:
    """One LSB per axis, where readings are whole numbers."""
    whole = np.all(rows == np.round(rows), axis=0)
    return np.where(whole, 1.0, 0.0)
