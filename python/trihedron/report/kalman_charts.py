"""Charts of a calibration by Kalman filter: convergence, innovations, slow noise."""

from collections.abc import Sequence

import numpy as np

from trihedron.arrays import AXES, XYZ, FloatArray
from trihedron.probability import chdtri
from trihedron.records import CONSTANT_NAMES, AxisKalmanResult, NormKalmanCalibration
from trihedron.report.chart import AXIS_COLOURS, Band, Chart, Colour, Level, Line, Panel, Points, Scale
from trihedron.report.drawn import said
from trihedron.report.numbers import one_of, unit_in_print

WINDOW = 15
"""Number of poses in a running mean of NIS, with a 99 % interval of 0.31 to 2.19 (χ² with 15 degrees of freedom)."""
METHODS: dict[str, tuple[str, Colour, bool]] = {
    "recursive least squares": ("recursive least squares", "accent", False),
    "recursive generalised least squares": ("recursive generalised least squares", "c3", True),
    "kalman": ("Kalman filter", "c1", False),
}


def convergence_chart(axis: AxisKalmanResult, raw_unit: str) -> Chart:
    """Every constant of one axis by every method, with the filter's 3σ band about its last value."""
    track = axis.track("kalman")
    pose = np.arange(1, len(track.constants) + 1, dtype=np.float64)
    unit = unit_in_print(raw_unit)
    panels = []
    for k, name in enumerate(CONSTANT_NAMES):
        last, sigma = float(track.constants[-1, k]), track.sigma[:, k]
        tracks = [found for found in axis.tracks if found.method in METHODS]
        lines = [Line(pose, found.constants[:, k], *METHODS[found.method]) for found in tracks]
        batch = [Level(y=float(c[k]), colour="ink", is_dashed=True, name="batch") for c, _ in axis.batch.values()]
        of = unit if name == "U0" else f"{unit}/(m/s²)"
        y = Scale(f"{name} [{of}]", of, limits=_frame([t.constants[:, k] for t in axis.tracks], sigma, last))
        band = Band(pose, last - 3 * sigma, last + 3 * sigma, "3 σ of the filter")
        x = Scale("poses", whole=True, limits=(1, max(2, len(pose))))
        panels.append(Panel(x, y, (band, *batch, *lines), height_px=150))
    return Chart(tuple(panels), columns=2, is_linked=False)


def norm_convergence_chart(outcome: NormKalmanCalibration) -> Chart:
    """S and b after every pose with their 3σ bands, without entries that the frame fixes at 0."""
    n = len(outcome.parameters)
    pose = np.arange(1, n + 1, dtype=np.float64)
    panels = []
    for k in range(12):
        name = f"S_{AXES[k // 3]}{AXES[k % 3]}" if k < 9 else f"b_{AXES[k - 9]}"
        value, sigma = outcome.parameters[:, k], outcome.sigma[:, k]
        if sigma[-1] == 0.0:
            continue
        last = float(value[-1])
        raw = outcome.accelerometer.raw_unit
        unit = "m/s²" if k >= 9 else "" if raw == "m/s^2" else f"m/s² per {one_of(raw)}"
        y = Scale(f"{name} [{unit}]" if unit else name, unit, limits=_frame([value], sigma, last))
        marks = (
            Band(pose, last - 3 * sigma, last + 3 * sigma, "3 σ about the last value"),
            Line(pose, value, "after so many poses", "c1"),
        )
        panels.append(Panel(Scale("poses", whole=True, limits=(1, max(2, n))), y, marks, height_px=110))
    return Chart(tuple(panels), columns=3)


def _frame(tracks: Sequence[FloatArray], sigma: FloatArray, last: float) -> tuple[float, float]:
    """Limits of the axis that show the convergence without the first estimates."""
    n = len(sigma)
    reach = [float(np.max(np.abs(track[n // 8 :] - last))) for track in tracks]
    # For a constant that is observed late, the 3σ band after a third of the session fits too.
    half = 1.1 * max(*reach, 3.0 * float(sigma[n // 3]), 6.0 * float(sigma[-1]))
    half = min(half, 60.0 * float(sigma[-1])) or abs(last) or 1.0
    return last - half, last + half


def innovations_chart(results: Sequence[AxisKalmanResult | NormKalmanCalibration]) -> Chart:
    """NIS of every judged pose, its running mean, and the 99 % interval of such means."""
    marks: list[Band | Line | Points | Level] = []
    window, n = WINDOW, 2
    for k, result in enumerate(results):
        pose = 1.0 + np.flatnonzero(result.is_settled).astype(np.float64)
        nis = result.nis[result.is_settled]
        window = max(1, min(WINDOW, len(pose) // 2))
        n = max(n, len(result.is_settled))
        mean = np.convolve(nis, np.ones(window) / window, mode="valid") if len(nis) else nis
        name = XYZ[result.axis] if isinstance(result, AxisKalmanResult) else "norm of gravity"
        tips = [
            said(f"pose {p:.0f}, {name}", float(v), "times its predicted variance")
            for p, v in zip(pose, nis, strict=True)
        ]
        marks.append(Points(pose, nis, tips, None, f"{name}: one pose", AXIS_COLOURS[k], True))
        marks.append(Line(pose[window - 1 :], mean, f"{name}: running mean", AXIS_COLOURS[k]))
    low, high = (np.full(2, chdtri(window, above) / window) for above in (0.995, 0.005))
    name = f"99 % of running means (of {window}) when the noise model is right"
    band = Band(np.array([0.3, n + 0.7]), low, high, name)
    # Below 0, so that no point is cut by the edge.
    below = -0.04 * max([float(np.max(m.y)) for m in marks if isinstance(m, Points)], default=0.0)
    y = Scale("innovation² / predicted variance", "", includes=(below,))
    return Chart((Panel(Scale("pose", limits=(0.3, n + 0.7), whole=True), y, (band, Level(y=1.0), *marks)),))


def drift_chart(results: Sequence[AxisKalmanResult], raw_unit: str) -> Chart:
    """Slow noise as filtered, and as smoothed with all readings."""
    panels = []
    for result in results:
        pose = np.arange(1, len(result.drift) + 1, dtype=np.float64)
        smooth, sigma = result.smoothed_drift, result.smoothed_drift_sigma
        marks = (
            Band(pose, smooth - sigma, smooth + sigma, "1 σ"),
            Line(pose, result.drift, "filtered", "accent", is_thin=True),
            Line(pose, smooth, "smoothed", "c1"),
        )
        unit = unit_in_print(raw_unit)
        y = Scale(f"{XYZ[result.axis]} [{unit}]", unit)
        panels.append(Panel(Scale("pose", whole=True, limits=(1, max(2, len(pose)))), y, marks, height_px=140))
    return Chart(tuple(panels), is_linked=True)
