"""A complete session on a simulated sensor, whose truth is known: log, calibration, verification, reports."""

from __future__ import annotations

import json
import os
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path

import numpy as np

from trihedron.api.calibrating import calibrate
from trihedron.api.reading import read
from trihedron.api.verifying import verify
from trihedron.arrays import rms_of, sigmas_of
from trihedron.errors import InputError
from trihedron.files.calibration import plain, write_calibration
from trihedron.files.log import write_recording
from trihedron.files.output import write_whole
from trihedron.records import PARAMETER_NAMES, Calibration, Comparison, Recording, Truth
from trihedron.records.results import CalibrationResult, DiagnosisResult, VerificationResult
from trihedron.report.calibration import calibration_report
from trihedron.report.demonstration import demonstration_report, with_files
from trihedron.report.document import Document
from trihedron.report.page import to_html
from trihedron.report.verification import verification_report
from trihedron.sensor_model import reframing
from trihedron.simulate import Environment, Scenario, hand_session, scenario_by_name, simulate
from trihedron.units import STANDARD_GRAVITY_M_S2

LATITUDE_DEG = 59.94
SEED = 2020
COUNTS_PER_G = 16384.0
"""Sensitivity that the data sheet of the simulated accelerometer states."""


def demo(
    folder: str | os.PathLike[str] = "trihedron-demo", *, seed: int = 0, overwrite: bool = False
) -> tuple[CalibrationResult, DiagnosisResult]:
    """Two acts, simulated: calibrate and compare with the truth; then a simulation that a log contradicts.

    Parameters
    ----------
    folder : path
        Where logs, calibrations and reports go.
    seed : int
        Draws the unit and the effect of the second act.
    overwrite : bool
        Whether files of a folder that exists are replaced.

    Returns
    -------
    (CalibrationResult, DiagnosisResult)
        Of the first act and of the second; ``print`` shows the report of each.

    Raises
    ------
    ValueError
        When the folder exists and may not be written into.

    Examples
    --------
    >>> calibrated, contradicted = trihedron.demo("demo")  # doctest: +SKIP
    """
    from trihedron.api.disagreeing import disagree

    target = Path(folder)
    return demonstrate(target, overwrite=overwrite)[0], disagree(target, seed, overwrite=overwrite)[0]


def demonstrate(
    folder: Path, *, overwrite: bool = False, say: Callable[[str], None] = lambda _: None
) -> tuple[CalibrationResult, VerificationResult, Document]:
    """Simulate two sessions of one sensor, calibrate by the first, verify on the second, write everything to
    ``folder``; the document compares with the truth.

    The logs are written as CSV and read back like any log: only the final comparison uses the truth.
    """
    if folder.exists() and not overwrite:
        raise InputError(f"{folder}: this exists and was left alone; choose another name or add --force.")
    folder.mkdir(parents=True, exist_ok=True)
    log, stored, other = (folder / name for name in ("session.csv", "calibration.json", "second-session.csv"))
    say("simulating two sessions of one sensor")
    first, second = _session(log, 0, overwrite), _session(other, 1, overwrite)
    truth = truth_of_the_day(_scenario(0), SEED)
    say("calibrating by the first")
    result = calibrate(first, latitude_deg=LATITUDE_DEG)
    say("verifying on the second")
    judged = verify(result, second, latitude_deg=LATITUDE_DEG)
    say("writing reports")
    write_calibration(result.calibration, stored, overwrite=overwrite)
    names = ("accelerometer_S", "accelerometer_b", "gyroscope_S", "gyroscope_b", "gravity_m_s2", "scenario", "seed")
    told = json.dumps({name: plain(getattr(truth, name)) for name in names}, indent=2) + "\n"
    write_whole(folder / "truth.json", told, overwrite=overwrite)
    pages = (
        ("report.html", calibration_report(result.calibration, result.segments, first)),
        ("verification.html", verification_report(judged.verification, judged.segments, second)),
    )
    for name, page in pages:
        page = with_files(page, LOG=log, FILE=stored, OTHER_LOG=other)
        write_whole(folder / name, to_html(page), overwrite=overwrite)
    comparison = compare_with_truth(result.calibration, truth)
    assert judged.segments.accelerometer_mean is not None
    # By the data sheet's sensitivity and without a bias.
    norm = np.linalg.norm(judged.segments.accelerometer_mean * (STANDARD_GRAVITY_M_S2 / COUNTS_PER_G), axis=1)
    before = rms_of(norm - judged.verification.gravity_m_s2)
    return result, judged, demonstration_report(comparison, before, judged.verification.norm_rms, folder)


def compare_with_truth(calibration: Calibration, truth: Truth) -> Comparison:
    """Estimate, truth and uncertainties of every free parameter of the frame.

    The truth is first rotated into the calibration's frame; that rotation depends on the truth alone.
    """
    change = reframing(truth.accelerometer_S, truth.accelerometer_b, calibration.frame)
    sensors = [("accelerometer", calibration.accelerometer, truth.accelerometer_S, truth.accelerometer_b)]
    if calibration.gyroscope is not None:
        sensors.append(("gyroscope", calibration.gyroscope, truth.gyroscope_S, truth.gyroscope_b))
    names = [f"{name}.{parameter}" for name, *_ in sensors for parameter in PARAMETER_NAMES]
    true = np.concatenate(
        [part for _, _, S, b in sensors for part in ((change.rotation @ S).ravel(), change.rotation @ b)]
    )
    estimate = np.concatenate([part for _, sensor, _, _ in sensors for part in (sensor.S.ravel(), sensor.b)])
    sigma = sigmas_of(calibration.covariance)
    free = np.flatnonzero(sigma > 0.0)
    return Comparison(
        tuple(names[k] for k in free),
        true[free],
        estimate[free],
        sigma[free],
        calibration.covariance[np.ix_(free, free)],
    )


def truth_of_the_day(scenario: Scenario, seed: int) -> Truth:
    """The truth with the mean biases of this session.

    A session determines the mean of a bias that drifts by flicker, random walk and ramp, not its nominal value. The
    drift is the difference to the same session simulated without these terms: all other random draws are equal.
    """
    recording, truth = simulate(scenario, seed)
    names = ("accelerometer", "gyroscope")
    slow = dict.fromkeys("BKR", (0.0, 0.0, 0.0))
    parts = {name: getattr(scenario, name) for name in names}
    steady = {name: replace(part, noise=replace(part.noise, **slow)) for name, part in parts.items()}
    without, _ = simulate(replace(scenario, **steady), seed)
    biases = {}
    for name in names:
        drift = np.mean(getattr(recording, name) - getattr(without, name), axis=0)
        biases[f"{name}_b"] = getattr(truth, f"{name}_b") - getattr(truth, f"{name}_S") @ drift
    return replace(truth, **biases)


def _scenario(layout: int) -> Scenario:
    place = Environment(gravity_m_s2=0.0, latitude_deg=LATITUDE_DEG, earth_rate=True)
    return replace(scenario_by_name("hand-session"), motion=hand_session(layout=layout), environment=place)


def _session(path: Path, layout: int, overwrite: bool) -> Recording:
    recording, _ = simulate(_scenario(layout), SEED + layout)
    write_recording(recording, path, overwrite=overwrite)
    return read(path)
