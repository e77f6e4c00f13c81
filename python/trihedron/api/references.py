"""Several recordings of one unit, each with a reference: one calibration, and the fit to each reference."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from trihedron.api.choices import settle_gravity
from trihedron.api.reading import AnyRecording, recording_of, segment
from trihedron.api.referring import AnyReference, calibration_by, motion_of
from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.estimate.reference import fit_references
from trihedron.estimate.verification import reference_findings
from trihedron.records import Frame
from trihedron.records.reference import AgainstReference, FitToReference
from trihedron.records.results import ReferencesResult


def calibrate_references(
    recordings: Sequence[AnyRecording],
    references: Sequence[AnyReference],
    *,
    reference_columns: str | None = None,
    frame: Frame | None = None,
    gravity_m_s2: float | None = None,
    latitude_deg: float | None = None,
    height_m: float | None = None,
) -> ReferencesResult:
    """Calibrate one unit from recordings that each have a reference: S and effects are shared, biases are not.

    The calibration's bias is the mean over the recordings, and its uncertainty includes the repeatability.

    Parameters
    ----------
    recordings : sequence of Recording, or of what trihedron.read takes
        One unit, moved in any way.
    references : sequence of path, Recording or ReferenceMotion
        Known motion beside each (docs/reference.md).
    reference_columns : str
        Their columns where names do not state them.
    frame : "lower", "symmetric" or "case"
        Body frame; ``case`` is that of the reference.
    gravity_m_s2 or latitude_deg, height_m : float
        As for :func:`calibrate`.

    Returns
    -------
    ReferencesResult
        The shared calibration, and the fit of each recording to its reference.

    Raises
    ------
    ValueError
        When the numbers of logs and references differ, or as :func:`trihedron.diagnose` with a reference.

    Examples
    --------
    >>> trihedron.calibrate_references(["a.csv", "b.csv"], ["a-truth.csv", "b-truth.csv"])  # doctest: +SKIP
    """
    if len(recordings) != len(references) or not recordings:
        raise InputError(f"{len(recordings)} logs need as many references, not {len(references)}.")
    gravity, source, said = settle_gravity(gravity_m_s2, latitude_deg, height_m)
    logs = tuple(recording_of(one) for one in recordings)
    pairs = [(log, motion_of(one, reference_columns)) for log, one in zip(logs, references, strict=True)]
    found = fit_references(pairs, gravity)
    gyro = _with_repeatability([one.gyroscope for one in found])
    first = replace(found[0], gyroscope=gyro, accelerometer=_averaged(found))
    calibration = calibration_by(first, logs[0], gravity, source, frame)
    said = said if first.accelerometer is not None else ()
    findings = [*said, *(finding for one in found for finding in one.findings)]
    if first.accelerometer is not None:
        findings += [found for log in logs for found in reference_findings(calibration, log, segment(log))]
    return ReferencesResult(replace(calibration, findings=tuple(findings)), found)


def _with_repeatability(fits: Sequence[FitToReference]) -> FitToReference:
    """Shared S and the mean bias; the spread of the biases is added to the covariance of b."""
    b = np.array([fit.b for fit in fits])
    covariance = np.mean([fit.covariance for fit in fits], axis=0)
    if len(fits) > 1:
        covariance[9:, 9:] += np.diag(np.var(b, axis=0, ddof=1) * (1.0 + 1.0 / len(b)))
    return replace(fits[0], b=b.mean(axis=0), covariance=covariance)


def _averaged(found: Sequence[AgainstReference]) -> FitToReference | None:
    """Weighted mean of S and b, its covariance widened by their disagreement; errors of the shared gyro are common."""
    seen = [one for one in found if one.accelerometer is not None]
    if not seen:
        return None
    fits = [one.accelerometer for one in seen if one.accelerometer is not None]
    of_gyro = [
        X @ np.linalg.pinv(one.gyroscope.covariance, hermitian=True) @ X.T
        for one, X in ((one, one.cross_covariance) for one in seen)
    ]
    theta: list[FloatArray] = [np.concatenate([fit.S.ravel(), fit.b]) for fit in fits]
    weights = [
        np.linalg.pinv(fit.covariance - shared, hermitian=True) for fit, shared in zip(fits, of_gyro, strict=True)
    ]
    covariance = np.linalg.pinv(np.sum(weights, axis=0), hermitian=True)
    mean = covariance @ np.sum([w @ t for w, t in zip(weights, theta, strict=True)], axis=0)
    chi2 = sum(float((t - mean) @ w @ (t - mean)) for w, t in zip(weights, theta, strict=True))
    wide = max(1.0, chi2 / max(12 * (len(fits) - 1), 1))
    return replace(fits[0], S=mean[:9].reshape(3, 3), b=mean[9:], covariance=wide * covariance + of_gyro[0])
