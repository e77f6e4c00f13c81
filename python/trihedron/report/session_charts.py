"""Charts of a recording, and of a calibration tested on it."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import XYZ, BoolArray
from trihedron.records import Recording, Segments, Truth, Verification
from trihedron.report.calibration_charts import LIMIT_SIGMAS, mm_s2
from trihedron.report.channels import logged_sensors
from trihedron.report.chart import AXIS_COLOURS, Band, Bars, Chart, Colour, Level, Line, Panel, Points, Scale, Span
from trihedron.report.drawn import envelope, said
from trihedron.report.numbers import unit_in_print

ALLOWED = "3 σ of noise and calibration uncertainty"
LIMIT_RMS = float(np.sqrt(-np.log(0.0027)))
"""Limit of the length of a two-component Gaussian error, over its rms, with the probability of 3σ (0.27 %)."""


def signals_chart(recording: Recording, segments: Segments | None = None) -> Chart:
    """Both sensors over time; with segments, poses are shaded and disturbances marked."""
    poses = () if segments is None else segments.poses
    time_s = recording.time_s
    spans = [Span(float(time_s[h.start]), float(time_s[h.stop - 1]), "pose") for h in poses]
    last = recording.n_samples - 1
    bumps = [
        Span(float(time_s[a]), float(time_s[min(b, last)]), "disturbed, excluded", "warn")
        for pose in poses
        for a, b in pose.disturbed
    ]
    return _signals(recording, (*spans, *bumps))


def truth_chart(recording: Recording, truth: Truth) -> Chart:
    """Both sensors of a simulation over time, with the true static intervals shaded."""
    time_s, last = recording.time_s, recording.n_samples - 1
    spans = [Span(float(time_s[min(h.start, last)]), float(time_s[min(h.stop - 1, last)]), "pose") for h in truth.poses]
    return _signals(recording, tuple(spans))


def _signals(recording: Recording, spans: tuple[Span, ...]) -> Chart:
    panels = []
    limits = (float(recording.time_s[0]), float(recording.time_s[-1]) or 1.0)
    for name, readings, unit in logged_sensors(recording):
        lines = [
            Line(*envelope(recording.time_s, readings[:, k]), XYZ[k], AXIS_COLOURS[k], is_thin=True) for k in range(3)
        ]
        printed = unit_in_print(unit)
        y = Scale(f"{name}  [{printed}]", printed)
        panels.append(Panel(Scale("time [s]", "s", limits=limits), y, (*spans, *lines), height_px=190))
    return Chart(tuple(panels), is_linked=True)


def means_chart(segments: Segments) -> Chart:
    """Mean readings of every pose over time, in the unit of the log."""
    panels = []
    for name, means in (("accelerometer", segments.accelerometer_mean), ("gyroscope", segments.gyroscope_mean)):
        if means is None:
            continue
        marks = tuple(
            Points(
                segments.time_mid_s, means[:, k],
                [said(f"pose {n}, {axis}", v, "") for n, v in enumerate(means[:, k], 1)],
                None, axis, AXIS_COLOURS[k],
            )
            for k, axis in enumerate(XYZ)
        )  # fmt: skip
        panels.append(Panel(Scale("time [s]", "s"), Scale(name), marks, height_px=190))
    return Chart(tuple(panels), is_linked=True)


def verification_chart(verification: Verification) -> Chart:
    """Gravity error of every pose and tilt error after every move, with their expected size."""
    v = verification
    pose = np.arange(1, len(v.norm_error) + 1, dtype=np.float64)
    error, sigma = mm_s2(v.norm_error), mm_s2(v.norm_sigma)
    edge = np.column_stack([pose - 0.5, pose + 0.5]).ravel()
    limit = np.repeat(LIMIT_SIGMAS * sigma, 2)
    told = [
        said(f"pose {k}", e, f"mm/s² ({e / s:+.1f}σ)".replace("-", "−"))
        for k, (e, s) in enumerate(zip(error, sigma, strict=True), start=1)
    ]
    norm = Panel(
        Scale("pose", limits=(0.3, len(pose) + 0.7), whole=True),
        Scale("|f| − |g|  [mm/s²]", "mm/s²"),
        (
            Band(edge, -limit, limit, ALLOWED),
            Level(y=0.0),
            *(
                Points(pose[part], error[part], [told[i] for i in np.flatnonzero(part)], None, name, colour)
                for part, name, colour in _parted(np.abs(error) > LIMIT_SIGMAS * sigma)
            ),
        ),
    )
    if not len(v.angle_deg):
        return Chart((norm,))
    move = (v.moves + 1).astype(np.float64)
    told = [said(f"move {k + 1}", a, "°") for k, a in zip(v.moves, v.angle_deg, strict=True)]
    edge = np.column_stack([move - 0.5, move + 0.5]).ravel()
    limit = np.repeat(LIMIT_RMS * v.angle_sigma_deg, 2)
    moves = Panel(
        Scale("move", limits=(0.3, move[-1] + 0.7), whole=True),
        Scale("tilt error  [°]", "°", includes=(0.0,)),
        (
            Band(edge, 0.0 * limit, limit, ALLOWED),
            *(
                Bars(move[part], v.angle_deg[part], 0.7, [told[i] for i in np.flatnonzero(part)], name, colour)
                for part, name, colour in _parted(v.angle_deg > LIMIT_RMS * v.angle_sigma_deg)
            ),
        ),
        height_px=180,
    )
    return Chart((norm, moves))


def _parted(is_beyond: BoolArray) -> list[tuple[BoolArray, str, Colour]]:
    """Masks, names and colours of the points within and beyond the 3 σ band, without empty ones."""
    parts: list[tuple[BoolArray, str, Colour]] = [(~is_beyond, "within 3 σ", "c1"), (is_beyond, "beyond 3 σ", "accent")]
    return [part for part in parts if part[0].any()]
