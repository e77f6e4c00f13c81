"""Extend a calibration by the effects found in its recording, where they improve cross-validated predictions."""

from __future__ import annotations

from collections.abc import Iterator, Mapping
from dataclasses import replace
from types import MappingProxyType
from typing import Any

import numpy as np

from trihedron.api.diagnosing import diagnose
from trihedron.arrays import FloatArray
from trihedron.defaults import FALSE_ALARM
from trihedron.errors import InputError
from trihedron.records import Calibration, Finding, Progress, SensorCalibration, Severity
from trihedron.records.checked import WrongTypeError
from trihedron.records.diagnosis import Diagnosis
from trihedron.records.domains import not_explained
from trihedron.records.results import CalibrationResult
from trihedron.records.words import words


def extend(
    result: CalibrationResult, *, alpha: float = FALSE_ALARM, progress: Progress | None = None
) -> CalibrationResult:
    """A calibration with the physical effects found in its recording: S, b fitted with them, effects in ``extensions``.

    Parameters
    ----------
    result : CalibrationResult
        Of :func:`trihedron.calibrate`, in the lower-triangular frame.
    alpha : float
        False-alarm probability of the diagnosis.
    progress : callable(share done from 0 to 1, what is being done)

    Returns
    -------
    CalibrationResult
        The extended calibration; unchanged where no effect is found or none improves the prediction.

    Raises
    ------
    ValueError
        When the calibration is in another frame than ``lower``.

    Examples
    --------
    >>> effects = trihedron.extend(result).calibration.extensions.get("effects")
    """
    if not isinstance(result, CalibrationResult):
        raise WrongTypeError(f"trihedron.extend takes what trihedron.calibrate gave, not {type(result).__name__}.")
    base = result.calibration
    if base.frame != "lower":
        raise InputError(
            f"an extended calibration is made in frame lower, not {base.frame}: "
            "use method joint or separate and leave the frame out."
        )
    diagnosis = diagnose(
        result.recording, gravity_m_s2=base.gravity_m_s2, segments=result.segments, alpha=alpha, progress=progress
    )
    spoilt = _spoilt(diagnosis) if diagnosis.effects else None
    if diagnosis.effects and spoilt is None:
        extended = _extended(result, diagnosis)
        return replace(result, calibration=extended, diagnosis=diagnosis)
    finding = _modelled(diagnosis) if spoilt is None else spoilt
    return replace(result, calibration=replace(base, findings=(*base.findings, finding)))


MAY_RISE = 1.25
"""Largest allowed rise of a cross-validated rms: twice the relative uncertainty (13 %) of an rms over 30 poses."""
DRIFTS = "accel-bias-drift", "gyro-bias-drift"
"""Effects by which a bias changes within the recording."""


def _spoilt(diagnosis: Diagnosis) -> Finding | None:
    """A finding where nothing determines the gyro beside the effects, or they raise the cross-validated rms of a domain
    by more than chance; else None."""
    effects = [effect.id for effect in diagnosis.effects]
    gyro, covariance = diagnosis.extended.gyroscope, diagnosis.extended.covariance
    if gyro is not None and covariance is not None and np.diag(covariance)[12:21].max() > np.square(gyro["S"]).max():
        return Finding.of("effects-modelled", "undetermined", effects=effects, n_effects=len(effects))
    for before, after in diagnosis.predicted:
        if after.rms > MAY_RISE * before.rms:
            return Finding.of(
                "effects-modelled",
                "stays-linear",
                effects=effects,
                n_effects=len(effects),
                domain=before.domain,
                rms_before=before.rms,
                rms_after=after.rms,
                unit=before.unit,
            )
    return None


def _extended(result: CalibrationResult, diagnosis: Diagnosis) -> Calibration:
    base, model, finding = result.calibration, diagnosis.extended, _modelled(diagnosis)
    assert model.covariance is not None
    covariance = model.covariance
    # What the effects do not answer; the diagnosis has judged g-sensitivity.
    left = (one for one in not_explained(base.findings, diagnosis.remaining) if one.code != "gyro-g-sensitivity")
    return replace(
        base,
        accelerometer=_sensor(base.accelerometer, model.accelerometer, covariance[:12, :12]),
        gyroscope=None
        if base.gyroscope is None or model.gyroscope is None
        else _sensor(base.gyroscope, model.gyroscope, covariance[12:, 12:]),
        covariance=covariance,
        findings=(*left, finding, *_drifts(diagnosis)),
        extensions=MappingProxyType(
            {
                **base.extensions,
                "effects": [effect.to_dict() for effect in diagnosis.effects],
                "references": dict(diagnosis.references),
                "verdict": diagnosis.verdict,
                "remaining": [d.domain for d in diagnosis.remaining if d.disagrees],
            }
        ),
    )


def _drifts(diagnosis: Diagnosis) -> Iterator[Finding]:
    """A finding for each bias that changes in the recording, with how far it does per axis."""
    for effect in diagnosis.effects:
        if effect.id not in DRIFTS:
            continue
        variant, unit = effect.model.get("variant"), effect.parameters[0].unit
        each = np.array([abs(one.value) for one in effect.parameters if one.unit == unit]).reshape(-1, 3)
        # A cosine goes from 1 to -1.
        change = (each.sum(axis=0) * (2.0 if variant == "curve" else 1.0)).tolist()
        yield Finding.of(
            "bias-drift",
            is_gyro=float(effect.id == DRIFTS[1]),
            change=(max(change), unit),
            is_warm=variant == "warm-up",
            change_x=change[0],
            change_y=change[1],
            change_z=change[2],
        )


def _sensor(base: SensorCalibration, model: Mapping[str, Any], covariance: FloatArray) -> SensorCalibration:
    # Residuals and observability are dropped: they are those of the fit without the effects.
    return replace(
        base,
        S=np.array(model["S"]),
        b=np.array(model["b"]),
        covariance=covariance,
        method=f"{base.method}, extended by diagnosis",
        quality=None,
        observability=None,
    )


def _modelled(diagnosis: Diagnosis) -> Finding:
    left = [d.domain for d in diagnosis.remaining if d.disagrees]
    return Finding.of(
        "effects-modelled",
        severity=Severity.WARNING if left else Severity.NOTE,
        effects=[effect.id for effect in diagnosis.effects],
        statements=[words("because", sentence=effect.statement) for effect in diagnosis.effects],
        is_fitted=bool(diagnosis.effects),
        left=left,
        is_left=bool(left),
        n_effects=len(diagnosis.effects),
        n_domains_left=len(left),
    )
