"""Figures: the only place that draws. Every function returns a figure; :func:`png` makes a file of it."""

from __future__ import annotations

import io
from collections.abc import Sequence
from typing import Any

import numpy as np
from matplotlib.axes import Axes
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from matplotlib.ticker import MaxNLocator

from trihedron.arrays import XYZ, FloatArray
from trihedron.records import FitQuality, Recording, Segments, SensorCalibration, Verification
from trihedron.report.numbers import unit_in_print
from trihedron.units import mm_s2_from_m_s2

# Distinct for colour-blind readers and in grey (Okabe and Ito).
AXIS_COLOURS = ("#0072B2", "#E69F00", "#009E73")
ACCENT = "#D55E00"
INK = "#222222"
SHADE = "#DDE5EC"
DPI = 110
MOST_POINTS = 4000
MARK = 0.11
"""Diameter of a pose's mark, where the horizon has radius 1."""


def draw_signals(recording: Recording, segments: Segments | None = None) -> Figure:
    """Both sensors over time, holds shaded where segments are given."""
    sensors = [
        (recording.accelerometer, f"accelerometer\n[{unit_in_print(recording.accelerometer_unit.value)}]"),
        (recording.gyroscope, f"gyroscope\n[{unit_in_print(recording.gyroscope_unit.value)}]"),
    ]
    present = [(readings, label) for readings, label in sensors if readings is not None]
    figure, axes = panels(len(present), 1, (9.5, 1.0 + 1.9 * len(present)), share_x=True)
    for axis, (readings, label) in zip(axes, present, strict=True):
        if segments is not None:
            _shade_poses(axis, recording, segments)
        for k in range(3):
            time, values = _envelope(recording.time_s, readings[:, k])
            axis.plot(time, values, color=AXIS_COLOURS[k], linewidth=0.7, label=XYZ[k])
        axis.set_ylabel(label)
        axis.margins(x=0.0)
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False)
    if segments is not None:
        _mark_disturbances(axes, recording, segments)
    axes[-1].set_xlabel("time [s]")
    return figure


def draw_pose_means(segments: Segments) -> Figure:
    """Mean readings of every pose over time, in the unit of the log."""
    pairs = [("accelerometer", segments.accelerometer_mean), ("gyroscope", segments.gyroscope_mean)]
    present = [(name, means) for name, means in pairs if means is not None]
    figure, axes = panels(len(present), 1, (9.5, 1.0 + 1.9 * len(present)), share_x=True)
    for axis, (name, means) in zip(axes, present, strict=True):
        for k in range(3):
            axis.plot(segments.time_mid_s, means[:, k], "o", color=AXIS_COLOURS[k], markersize=4, label=XYZ[k])
        axis.set_ylabel(name)
    axes[0].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=3, frameon=False)
    axes[-1].set_xlabel("time [s]")
    return figure


def draw_residuals(quality: FitQuality) -> Figure:
    """Residual of every pose with its standard error, and the held-out prediction."""
    figure, (axis,) = panels(1, 1, (9.5, 3.2))
    pose = np.arange(1, len(quality.residual) + 1)
    axis.axhline(0.0, color=INK, linewidth=0.8)
    if quality.held_out is not None:
        axis.errorbar(
            pose + 0.18,
            mm_s2(quality.held_out),
            None if quality.held_out_sigma is None else mm_s2(quality.held_out_sigma),
            fmt="o",
            markersize=5,
            markerfacecolor="white",
            color=ACCENT,
            elinewidth=1.0,
            label="held out",
        )
    axis.errorbar(
        pose - 0.18,
        mm_s2(quality.residual),
        mm_s2(quality.sigma),
        fmt="o",
        markersize=4.5,
        color=AXIS_COLOURS[0],
        elinewidth=1.0,
        label="in sample",
    )
    axis.set_xlabel("pose")
    axis.set_ylabel("|f| − |g|  [mm/s²]")
    axis.set_xlim(0.2, len(pose) + 0.8)
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    return figure


def mm_s2(values: FloatArray) -> FloatArray:
    """Accelerations in mm/s²."""
    return values * mm_s2_from_m_s2(1.0)


def draw_poses(sensor: SensorCalibration, means: FloatArray) -> Figure:
    """Directions of "up" on two hemispheres, by Lambert's equal-area projection."""
    force = means @ sensor.S.T + sensor.b
    up = force / np.linalg.norm(force, axis=1)[:, None]
    figure, axes = panels(1, 2, (7.6, 4.1))
    for axis, sign, title in ((axes[0], 1.0, "+Z above the horizon"), (axes[1], -1.0, "+Z below the horizon")):
        _hemisphere(axis, title)
        # A pose with level Z lies on the rim of both.
        seen = [k for k in range(len(up)) if sign * up[k, 2] >= -1e-2]
        places = np.array([_equal_area(up[k] * np.array([1.0, 1.0, sign])) for k in seen]).reshape(-1, 2)
        axis.plot(*places.T, "o", markersize=8, color=AXIS_COLOURS[0], alpha=0.85)
        for group in alike(places):
            label = ", ".join(str(seen[k] + 1) for k in group)
            if len(group) == 1:
                axis.annotate(label, places[group[0]], ha="center", va="center", fontsize=5.5, color="white")
            else:
                # Poses alike share one label, beneath them.
                x, y = places[group].mean(axis=0)[0], places[group][:, 1].min()
                beneath: dict[str, Any] = {
                    "xytext": (0, -8),
                    "textcoords": "offset points",
                    "ha": "center",
                    "va": "center",
                }
                axis.annotate(label, (x, y), fontsize=6.5, color=INK, **beneath)
    return figure


def alike(places: FloatArray) -> list[list[int]]:
    """Indices of places (n, 2) whose marks would cover one another's labels, each group by its first."""
    groups: list[list[int]] = []
    for k, place in enumerate(places):
        near = (group for group in groups if np.linalg.norm(places[group[0]] - place) < MARK)
        group = next(near, None)
        if group is None:
            groups.append([k])
        else:
            group.append(k)
    return groups


def draw_moves(quality: FitQuality) -> Figure:
    """Angle between predicted and measured gravity after every move."""
    assert quality.angle_deg is not None
    figure, (axis,) = panels(1, 1, (9.5, 3.0))
    move = np.arange(1, len(quality.angle_deg) + 1)
    axis.bar(move - 0.2, quality.angle_deg, 0.38, color=AXIS_COLOURS[0], label="in sample")
    if quality.held_out_angle_deg is not None:
        axis.bar(move + 0.2, quality.held_out_angle_deg, 0.38, color=ACCENT, label="held out")
    axis.set_xlabel("move")
    axis.set_ylabel("tilt error [°]")
    axis.set_xlim(0.2, len(move) + 0.8)
    axis.xaxis.set_major_locator(MaxNLocator(integer=True))
    axis.legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    return figure


class ShownFigure(Figure):
    """A figure that a notebook shows by itself, whatever its back end."""

    def _repr_png_(self) -> bytes:
        return png(self)


def panels(rows: int, columns: int, size: tuple[float, float], *, share_x: bool = False) -> tuple[Figure, list[Axes]]:
    """A figure of the house and its panels, row by row."""
    figure = ShownFigure(figsize=size, dpi=DPI, layout="constrained")
    FigureCanvasAgg(figure)
    grid = figure.subplots(rows, columns, sharex=share_x, squeeze=False)
    axes: list[Axes] = list(grid.ravel())
    for axis in axes:
        axis.spines[["top", "right"]].set_visible(False)
        axis.tick_params(labelsize=8.5, color=INK)
    return figure, axes


def png(figure: Figure) -> bytes:
    """A drawn figure as a PNG file."""
    buffer = io.BytesIO()
    # Without a date or version the same data give the same bytes.
    figure.savefig(buffer, format="png", metadata={"Software": None})
    return buffer.getvalue()


def _shade_poses(axis: Axes, recording: Recording, segments: Segments) -> None:
    for pose in segments.poses:
        axis.axvspan(recording.time_s[pose.start], recording.time_s[pose.stop - 1], color=SHADE, linewidth=0, zorder=0)


def _mark_disturbances(axes: Sequence[Axes], recording: Recording, segments: Segments) -> None:
    for pose in segments.poses:
        for first, last in pose.disturbed:
            for axis in axes:
                start, stop = recording.time_s[first], recording.time_s[min(last, recording.n_samples) - 1]
                axis.axvspan(start, stop, color=ACCENT, alpha=0.35, linewidth=0, zorder=0)


def _envelope(time_s: FloatArray, values: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Smallest and largest value of each block: a long log drawn whole, with no peak lost."""
    n = len(values)
    if n <= MOST_POINTS:
        return time_s, values
    block = -(-n // (MOST_POINTS // 2))
    whole = n // block * block
    parts = values[:whole].reshape(-1, block)
    low_high = np.column_stack([np.nanmin(parts, axis=1), np.nanmax(parts, axis=1)]).ravel()
    return np.repeat(time_s[:whole:block], 2), low_high


def _equal_area(direction: FloatArray) -> tuple[float, float]:
    """Lambert's azimuthal projection of a unit vector about +Z, scaled so that the equator has radius one."""
    factor = 1.0 / np.sqrt(1.0 + max(float(direction[2]), 0.0))
    return float(direction[0] * factor), float(direction[1] * factor)


def _hemisphere(axis: Axes, title: str) -> None:
    angle = np.linspace(0.0, 2.0 * np.pi, 181)
    for elevation_deg in (0.0, 30.0, 60.0):
        z = np.sin(np.radians(elevation_deg))
        radius = np.sqrt(1.0 - z)
        axis.plot(radius * np.cos(angle), radius * np.sin(angle), color="#AAB4BD", linewidth=0.6, zorder=0)
    for label, x, y in (("+X", 1.15, 0.0), ("−X", -1.15, 0.0), ("+Y", 0.0, 1.15), ("−Y", 0.0, -1.15)):
        axis.annotate(label, (x, y), ha="center", va="center", fontsize=9, color=INK)
        axis.plot([0.0, np.clip(x, -1.0, 1.0)], [0.0, np.clip(y, -1.0, 1.0)], color="#D5DBE0", linewidth=0.6, zorder=0)
    axis.set_aspect("equal")
    axis.set_axis_off()
    axis.set_xlim(-1.22, 1.22)
    axis.set_ylim(-1.22, 1.22)
    axis.set_title(title, fontsize=10)


def draw_verification(verification: Verification) -> Figure:
    """Norm error per pose with its standard error, and angle per move with the expected one."""
    has_moves = len(verification.angle_deg) > 0
    figure, axes = panels(2 if has_moves else 1, 1, (9.5, 5.2 if has_moves else 3.0))
    pose = np.arange(1, len(verification.norm_error) + 1)
    axes[0].axhline(0.0, color=INK, linewidth=0.8)
    axes[0].errorbar(
        pose,
        mm_s2(verification.norm_error),
        mm_s2(verification.norm_sigma),
        fmt="o",
        markersize=4.5,
        color=AXIS_COLOURS[0],
        elinewidth=1.0,
    )
    axes[0].set_xlabel("pose")
    axes[0].set_ylabel("|f| − |g|  [mm/s²]")
    if has_moves:
        move = verification.moves + 1
        axes[1].bar(move, verification.angle_deg, 0.7, color=AXIS_COLOURS[0], label="tilt error")
        axes[1].plot(move, verification.angle_sigma_deg, "_", markersize=14, color=ACCENT, label="to be expected (rms)")
        axes[1].set_xlabel("move")
        axes[1].set_ylabel("tilt error [°]")
        axes[1].legend(loc="lower left", bbox_to_anchor=(0.0, 1.0), ncols=2, frameon=False)
    return figure
