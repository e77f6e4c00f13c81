"""Figures of a calibration by Kalman filter. Every function returns a figure."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np
from matplotlib.axes import Axes
from matplotlib.figure import Figure
from scipy import stats

from trihedron.arrays import AXES, XYZ, FloatArray
from trihedron.records import CONSTANT_NAMES, AxisKalmanResult, NormKalmanCalibration
from trihedron.report.figures import ACCENT, AXIS_COLOURS, INK, SHADE, mm_s2, panels

WINDOW = 15
STYLES = (
    ("recursive least squares", ACCENT, "-"),
    ("recursive generalised least squares", AXIS_COLOURS[2], "--"),
    ("kalman", AXIS_COLOURS[0], "-"),
)
NAMES = {"kalman": "Kalman filter"}


def draw_convergence(axis: AxisKalmanResult) -> Figure:
    """Every constant of one axis by every method."""
    figure, axes = panels(4, 1, (9.5, 9.0), share_x=True)
    for k, panel in enumerate(axes):
        for method, colour, line in STYLES:
            found = [track for track in axis.tracks if track.method == method]
            for track in found:
                pose = np.arange(1, len(track.constants) + 1)
                panel.plot(
                    pose, track.constants[:, k], line, color=colour, linewidth=1.1, label=NAMES.get(method, method)
                )
        track = axis.track("kalman")
        pose = np.arange(1, len(track.constants) + 1)
        last = track.constants[-1, k]
        panel.fill_between(pose, last - 3 * track.sigma[:, k], last + 3 * track.sigma[:, k], color=SHADE, zorder=0)
        for constants, _ in axis.batch.values():
            panel.axhline(constants[k], color=INK, linewidth=0.6, linestyle=":")
        panel.set_ylabel(CONSTANT_NAMES[k])
        _frame(panel, [t.constants[:, k] for t in axis.tracks], track.sigma[:, k], last)
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False)
    axes[-1].set_xlabel("poses")
    return figure


def _frame(panel: Axes, tracks: Sequence[FloatArray], sigma: FloatArray, last: float) -> None:
    """Limits that show the approach and not the first guesses."""
    n = len(sigma)
    later = slice(n // 8, None)
    reach = [float(np.max(np.abs(track[later] - last))) for track in tracks]
    # Where a constant is seen late, its band at mid-session still fits.
    half = 1.1 * max(*reach, 3.0 * float(sigma[n // 3]), 6.0 * float(sigma[-1]))
    half = min(half, 60.0 * float(sigma[-1]))
    panel.set_ylim(last - half, last + half)
    panel.set_xlim(1, n)


def draw_innovations(results: Sequence[AxisKalmanResult | NormKalmanCalibration]) -> Figure:
    """Running mean of the normalised innovation squared."""
    figure, (panel,) = panels(1, 1, (9.5, 3.2))
    window = WINDOW
    for k, result in enumerate(results):
        nis = np.where(result.is_settled, result.nis, np.nan)
        pose = np.flatnonzero(np.isfinite(nis))
        window = max(1, min(WINDOW, len(pose) // 2))
        mean = np.convolve(nis[pose], np.ones(window) / window, mode="valid")
        name = XYZ[result.axis] if isinstance(result, AxisKalmanResult) else "norm of gravity"
        panel.plot(pose[window - 1 :] + 1, mean, color=AXIS_COLOURS[k], linewidth=1.1, label=name)
    low, high = (float(stats.chi2.ppf(p, window)) / window for p in (0.005, 0.995))
    panel.axhspan(low, high, color=SHADE, zorder=0)
    panel.axhline(1.0, color=INK, linewidth=0.6)
    panel.set_ylim(bottom=0.0)
    panel.set_xlabel("poses")
    panel.set_ylabel(f"NIS, mean of {window}")
    panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False)
    return figure


def draw_drift(results: Sequence[AxisKalmanResult]) -> Figure:
    """Slow noise, filtered and smoothed."""
    figure, axes = panels(3, 1, (9.5, 6.0), share_x=True)
    for panel, result in zip(axes, results, strict=True):
        colour = AXIS_COLOURS[result.axis]
        pose = np.arange(1, len(result.drift) + 1)
        panel.plot(pose, result.drift, color=ACCENT, linewidth=0.7, alpha=0.7, label="filtered")
        panel.plot(pose, result.smoothed_drift, color=colour, linewidth=1.3, label="smoothed")
        low, high = (
            result.smoothed_drift - result.smoothed_drift_sigma,
            result.smoothed_drift + result.smoothed_drift_sigma,
        )
        panel.fill_between(pose, low, high, color=SHADE, zorder=0)
        panel.set_ylabel(f"{AXES[result.axis]} [raw]")
        panel.set_xlim(1, max(2, len(pose)))
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    axes[-1].set_xlabel("poses")
    return figure


def draw_residual(residual: FloatArray) -> Figure:
    """Residual (n, 3) of the components or (n, 1) of the length, m/s²."""
    figure, (panel,) = panels(1, 1, (9.5, 3.2))
    pose = np.arange(1, len(residual) + 1)
    for k in range(residual.shape[1]):
        name = AXES[k] if residual.shape[1] == 3 else "|f| − |g|"
        panel.plot(pose, mm_s2(residual[:, k]), ".", markersize=4, color=AXIS_COLOURS[k], label=name)
    panel.axhline(0.0, color=INK, linewidth=0.6)
    panel.set_xlabel("poses")
    panel.set_ylabel("residual [mm/s²]")
    panel.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False)
    return figure


def draw_norm_convergence(outcome: NormKalmanCalibration) -> Figure:
    """S and b after every pose, each against its last value in its last standard errors."""
    figure, axes = panels(3, 4, (11.0, 7.0), share_x=True)
    n = len(outcome.parameters)
    pose = np.arange(1, n + 1)
    for row in range(3):
        for column in range(4):
            panel = axes[4 * row + column]
            k = 3 * row + column if column < 3 else 9 + row
            name = f"S_{AXES[row]}{AXES[column]}" if column < 3 else f"b_{AXES[row]}"
            panel.set_title(name, fontsize=9)
            value, sigma = outcome.parameters[:, k], outcome.sigma[:, k]
            if sigma[-1] == 0.0:
                panel.annotate("0 by the frame", (0.5, 0.5), xycoords="axes fraction", ha="center", color=INK)
                panel.set_yticks([])
                continue
            panel.fill_between(pose, value[-1] - 3 * sigma, value[-1] + 3 * sigma, color=SHADE, zorder=0)
            panel.plot(pose, value, color=AXIS_COLOURS[0], linewidth=1.1)
            _frame(panel, [value], sigma, float(value[-1]))
    for panel in axes[8:]:
        panel.set_xlabel("poses")
    return figure
