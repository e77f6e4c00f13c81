"""Report of a calibration by Kalman filter: constants by every method, convergence, innovations."""

from functools import partial
from typing import Any

import numpy as np

from trihedron.arrays import AXES, FloatArray, rms_of
from trihedron.files.calibration import calibration_document
from trihedron.records import (
    CONSTANT_NAMES,
    AxisKalmanResult,
    Calibration,
    Consistency,
    KalmanCalibration,
    NormKalmanCalibration,
)
from trihedron.records.published import BY_FILTER
from trihedron.report.calibration import FRAMES, parameter_table
from trihedron.report.document import WITHIN, Block, Document, Facts, Picture, Section, Table
from trihedron.report.findings import findings_block, verdict_of
from trihedron.report.kalman_charts import convergence_chart, drift_chart, innovations_chart, norm_convergence_chart
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
        is_trustworthy=calibration.is_trustworthy,
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


def _limits(seen: Consistency) -> str:
    return f"{plain_number(seen.nis_low)} to {plain_number(seen.nis_high)}"


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
    drift = "Bias drift that the filter saw: while it ran, and smoothed with all readings, with 1 σ bands."
    pictures.append(Picture("drift", drift, partial(drift_chart, outcome.axes, raw_unit)))
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
    convergence = "S and b after every pose, with the 3 σ band around their last values."
    picture = Picture("convergence", convergence, partial(norm_convergence_chart, outcome))
    return [
        Section("Result", (Facts(facts), parameter_table("accelerometer", outcome.accelerometer))),
        Section("Figures", (picture,)),
    ]


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
    rows = tuple(
        (name, f"{c.n} of {n}", plain_number(c.nis_mean), _limits(c), plain_number(c.whiteness_p, 2))
        for name, c, n in seen
    )
    head = ("axis", "poses judged", "mean NIS", "99 % when right", "whiteness, p")
    caption = "NIS: innovations squared over their predicted variance; Ljung-Box test of whiteness. The first poses "
    caption += "only start the filter, which predicts nothing yet"
    return Table(head, rows, caption)


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
    """The result for JSON: the calibration file's content, the tracks and the innovations."""
    out: dict[str, Any] = dict(calibration_document(calibration))
    if isinstance(outcome, KalmanCalibration):
        out["constants"] = list(CONSTANT_NAMES)
        out["axes"] = [_axis_record(axis) for axis in outcome.axes]
        out["residual_m_s2"] = outcome.residual_m_s2.tolist()
        return out
    return out | {
        "parameters": outcome.parameters.tolist(),
        "parameters_sigma": outcome.sigma.tolist(),
        "innovation_m_s2": outcome.innovation.tolist(),
        "innovation_sigma_m_s2": outcome.innovation_sigma.tolist(),
        "consistency": _consistency_record(outcome.consistency),
        "residual_m_s2": outcome.residual_m_s2.tolist(),
    }


def _consistency_record(seen: Consistency) -> dict[str, Any]:
    return dict(vars(seen)) | {"autocorrelation": list(seen.autocorrelation)}


def _axis_record(axis: AxisKalmanResult) -> dict[str, Any]:
    return {
        "axis": AXES[axis.axis],
        "noise": dict(vars(axis.noise)),
        "constants": axis.constants.tolist(),
        "covariance": axis.covariance.tolist(),
        "batch": {m: {"constants": c.tolist(), "sigma": s.tolist()} for m, (c, s) in axis.batch.items()},
        "tracks": [
            {"method": t.method, "constants": t.constants.tolist(), "sigma": t.sigma.tolist()} for t in axis.tracks
        ],
        "innovation": axis.innovation.tolist(),
        "innovation_sigma": axis.innovation_sigma.tolist(),
        "drift": axis.smoothed_drift.tolist(),
        "drift_sigma": axis.smoothed_drift_sigma.tolist(),
        "consistency": _consistency_record(axis.consistency),
    }
