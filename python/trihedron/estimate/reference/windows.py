"""Comparison without differentiation: both sides are weighted by the same smooth windows (modulating functions).

With a cubic B-spline h that begins and ends at zero, ``∫ h dx/dt = -∫ dh/dt x``: the reference is not differentiated.
Windows follow at the spacing of the knots, so that no frequency below 1/(2 spacing) is lost.
"""

from dataclasses import dataclass

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, IntArray


@dataclass(frozen=True, eq=False)
class Windows:
    """Windows of unit area on an even grid: weights (4m + 1,) of h, dh/dt, d²h/dt²; ``start`` (k,) first samples."""

    spacing: int
    step_s: float
    weight: FloatArray
    slope: FloatArray
    curvature: FloatArray
    start: IntArray

    @property
    def middle(self) -> IntArray:
        """(k,) grid index of the middle of each window."""
        return np.asarray(self.start + 2 * self.spacing, dtype=np.int64)

    def of(self, weights: FloatArray, signal: FloatArray) -> FloatArray:
        """Weighted sums (k, ...) of a signal (n, ...)."""
        flat = signal.reshape(len(signal), -1)
        out = np.zeros((len(self.start), flat.shape[1]))
        for k, weight in enumerate(weights):
            out += weight * flat[self.start + k]
        return out.reshape(len(self.start), *signal.shape[1:])


def windows_on(is_valid: BoolArray, step_s: float, spacing: int) -> Windows:
    """All windows with valid samples only; ``spacing`` samples between neighbours."""
    m = spacing
    x = np.arange(-2 * m, 2 * m + 1) / m
    a = np.abs(x)
    h = np.where(a <= 1.0, 2.0 / 3.0 - a**2 + a**3 / 2.0, np.where(a < 2.0, (2.0 - a) ** 3 / 6.0, 0.0))
    slope = np.sign(x) * np.where(a <= 1.0, -2.0 * a + 1.5 * a**2, np.where(a < 2.0, -((2.0 - a) ** 2) / 2.0, 0.0))
    curvature = np.where(a <= 1.0, -2.0 + 3.0 * a, np.where(a < 2.0, 2.0 - a, 0.0))
    # Aliasing of the sampled second derivative adds (ωT)²/12 of itself and would make a lever arm too short (0.05 % at
    # 1 Hz and 100 samples/s); its second difference corrects this.
    padded = np.pad(curvature, 1)
    curvature = curvature + (padded[2:] - 2.0 * curvature + padded[:-2]) / 12.0
    spacing_s = m * step_s
    n = len(is_valid)
    start = np.arange(0, max(n - 4 * m, 0), m)
    bad = np.concatenate([[0], np.cumsum(~is_valid)])
    start = start[bad[start + 4 * m + 1] == bad[start]]
    return Windows(
        m, step_s, h * step_s / spacing_s, slope * step_s / spacing_s**2, curvature * step_s / spacing_s**3, start
    )
