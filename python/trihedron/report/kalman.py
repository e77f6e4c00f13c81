"""Report of a calibration by Kalman filter: constants by every method, convergence, innovations."""

from collections.abc import Sequence
from functools import partial
from typing import Any

import numpy as np

from trihedron.arrays import AXES, XYZ, FloatArray, rms_of
from trihedron.files.calibration import calibration_document
from trihedron.probability import chdtri
from trihedron.records import (
    CONSTANT_NAMES,
    AxisKalmanResult,
    Calibration,
    Consistency,
    KalmanCalibration,
    NormKalmanCalibration,
)
from trihedron.records.plain import as_plain
from trihedron.records.published import BY_FILTER
from trihedron.report.calibration import FRAMES, parameter_table
from trihedron.report.chart import AXIS_COLOURS, Band, Chart, Colour, Level, Line, Panel, Points, Scale
from trihedron.report.document import WITHIN, Block, Document, Facts, Picture, Section, Table
from trihedron.report.drawn import said
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.numbers import each_with_sigma, in_mm_s2, plain_number, unit_in_print
from trihedron.units import mm_s2_from_m_s2

TEST = "Test the calibration on another recording: `trihedron verify FILE OTHER_LOG`."
_INNOVATIONS = """Normalised innovations squared (NIS), innovation² / predicted variance: every pose that is judged, \
their running mean, and where 99 % of such means lie when the noise model is right."""
_AS_PREDICTED = "the innovations are as large and as white as the noise model predicts"
_SMALLER = "the innovations are smaller than the noise model predicts, the uncertainties too wide"
_IN_SAMPLE = ", in sample without redundancy: no test of the fit"


def kalman_report(outcome: KalmanCalibration | NormKalmanCalibration, calibration: Calibration) -> Document:
    # The chart of innovations, which shows whether the uncertainties are valid, is next to the verdict.
    results: tuple[AxisKalmanResult | NormKalmanCalibration, ...]
    if isinstance(outcome, KalmanCalibration):
        results, sections = outcome.axes, _with_references(outcome, calibration)
    else:
        results, sections = (outcome,), _without_references(outcome, calibration)
    sections[1:1] = [
        Section("Findings", (findings_block(calibration.findings),)),
        Section("Innovations", (_consistency_table(_consistencies(outcome)),)),
    ]
    residual = "residual" if isinstance(outcome, KalmanCalibration) else "gravity error in static poses"
    is_small = any(one.code == "innovations-too-small" for one in calibration.findings)
    is_tested = all(one.n for _, one, _ in _consistencies(outcome))
    return Document(
        title="Calibration by Kalman filter",
        subtitle=calibration.recording_source or "no recording named",
        verdict=verdict_of(
            calibration.findings,
            f"OK: {_SMALLER if is_small else _AS_PREDICTED}.",
            f"{WITHIN}{residual} {in_mm_s2(rms_of(outcome.residual_m_s2))} rms" if is_tested else "Usable",
            "NOT TO BE TRUSTED",
        ),
        sections=tuple(sections),
        lead=Picture("innovations", _INNOVATIONS, partial(innovations_chart, results)) if is_tested else None,
        next_step=TEST if calibration.is_trustworthy else "",
    )


def _consistencies(outcome: KalmanCalibration | NormKalmanCalibration) -> list[tuple[str, Consistency, int]]:
    """Name, consistency and number of poses, of which only those after the diffuse start are judged."""
    if isinstance(outcome, KalmanCalibration):
        return [(AXES[axis.axis], axis.consistency, outcome.n_poses) for axis in outcome.axes]
    return [("norm", outcome.consistency, len(outcome.residual_m_s2))]


def _meaning(seen: Consistency) -> str:
    """The mean NIS in words: whether the filter's noise is too large or too small."""
    if seen.nis_mean < seen.nis_low:
        return "the noise given is too large, the uncertainties too wide"
    if seen.nis_mean > seen.nis_high:
        return "the noise given is too small; the uncertainties are multiplied by the root of it"
    return "as predicted"


def _with_references(outcome: KalmanCalibration, calibration: Calibration) -> list[Section]:
    facts = (
        ("poses", f"{outcome.n_poses} in known attitudes"),
        ("gravity", f"{calibration.gravity_m_s2:.5f} m/s², {calibration.gravity_source}"),
        ("residual", _residual_words(outcome.residual_m_s2)),
        ("without drift", _residual_words(outcome.residual_without_drift_m_s2)),
    )
    raw_unit, pictures = outcome.accelerometer.raw_unit, list[Block]()
    for axis in outcome.axes:
        name = AXES[axis.axis]
        caption = f"Constants of {name.upper()} after every pose by every method, with the filter's 3 σ band around "
        caption += "its last value."
        pictures.append(Picture(f"convergence-{name}", caption, partial(convergence_chart, axis, raw_unit)))
    return [
        Section("Result", (Facts(facts), *(_constants_table(axis, raw_unit) for axis in outcome.axes))),
        Section("Calibration", (parameter_table("accelerometer", outcome.accelerometer),)),
        Section("Poses", (_pose_table(outcome),)),
        Section("Figures", tuple(pictures)),
    ]


def _without_references(outcome: NormKalmanCalibration, calibration: Calibration) -> list[Section]:
    facts = (
        ("poses", f"{len(outcome.residual_m_s2)} in unknown attitudes"),
        ("gravity", f"{calibration.gravity_m_s2:.5f} m/s², {calibration.gravity_source}"),
        ("frame", FRAMES[calibration.frame]),
        (
            "gravity error in static poses",
            _residual_words(outcome.residual_m_s2) + ("" if outcome.consistency.n else _IN_SAMPLE),
        ),
    )
    return [Section("Result", (Facts(facts), parameter_table("accelerometer", outcome.accelerometer)))]


def _residual_words(residual: FloatArray) -> str:
    rms, worst = rms_of(residual), float(np.max(np.abs(residual)))
    return f"{in_mm_s2(rms)} rms, {in_mm_s2(worst)} at worst, {BY_FILTER}"


def _constants_table(axis: AxisKalmanResult, raw_unit: str) -> Table:
    unit = unit_in_print(raw_unit)
    per = "" if raw_unit == "m/s^2" else f" [{unit}/(m/s²)]"
    rows = [("Kalman filter", *each_with_sigma(axis.constants, axis.sigma))]
    rows += [(method.capitalize(), *each_with_sigma(*solution)) for method, solution in axis.batch.items()]
    last = [track for track in axis.tracks if track.method == "recursive least squares"]
    rows += [("Recursive least squares, as it says", *each_with_sigma(t.constants[-1], t.sigma[-1])) for t in last]
    name = AXES[axis.axis]
    head = ("", *(f"k{name}{other}{per}" for other in AXES), f"bias [{unit}]")
    return Table(head, tuple(rows), f"{name.upper()}: reading = k · f + bias + noise")


def _consistency_table(seen: list[tuple[str, Consistency, int]]) -> Table:
    rows = []
    for name, c, n in seen:
        limits = f"{plain_number(c.nis_low)} to {plain_number(c.nis_high)}"
        rows.append((name, f"{c.n} of {n}", plain_number(c.nis_mean), limits, plain_number(c.whiteness_p, 2)))
    head = ("axis", "poses judged", "mean NIS", "99 % when right", "whiteness, p")
    caption = "NIS: innovations squared over their predicted variance; Ljung-Box test of whiteness. The first poses "
    caption += "only start the filter, which predicts nothing yet"
    return Table(head, tuple(rows), caption)


def _pose_table(outcome: KalmanCalibration) -> Table:
    rows = tuple(
        (
            str(k + 1),
            plain_number(float(outcome.start_s[k]), 4),
            *(plain_number(float(v), 3) for v in outcome.references[k]),
            *(plain_number(mm_s2_from_m_s2(float(v)), 3) for v in outcome.residual_m_s2[k]),
            *(plain_number(float(np.sqrt(axis.nis[k])), 2) if axis.is_settled[k] else "–" for axis in outcome.axes),
        )
        for k in range(outcome.n_poses)
    )
    head = ("pose", "start [s]", "fx", "fy", "fz [m/s²]", "rx", "ry", "rz [mm/s²]", "ix", "iy", "iz [σ]")
    return Table(head, rows, "Reference, residual r, innovation i in its predicted standard deviations")


def kalman_record(outcome: KalmanCalibration | NormKalmanCalibration, calibration: Calibration) -> dict[str, Any]:
    """The calibration file's content, and the filter's: tracks, innovations, bias drift, residuals."""
    names = {"constants": list(CONSTANT_NAMES)} if isinstance(outcome, KalmanCalibration) else {}
    return {**as_plain(outcome), **names, **calibration_document(calibration)}


# Charts of a calibration by Kalman filter: convergence, innovations.

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
    return Chart(tuple(panels), columns=2)


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
