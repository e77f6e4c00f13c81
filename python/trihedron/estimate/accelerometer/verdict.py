"""Findings of a fitted triad: residual against noise, undetermined parameters, outliers, handedness, scale."""

from collections.abc import Iterator

import numpy as np

from trihedron import probability
from trihedron.arrays import TINY, FloatArray
from trihedron.estimate.accelerometer.poses import PoseDesign, parameter_names
from trihedron.records import Finding, FitQuality
from trihedron.units import AccelerationUnit, acceleration_to_si

SIGNIFICANCE = 0.01
"""False alarm rate of each statistical finding here."""

WEAK_PREDICTION = 3.0
"""Largest prediction error of a norm, in the noise of a pose, that is not reported. n well-spread poses predict any
other to √(9/n) of the noise of a pose; three times that noise means that some direction is hardly determined."""


def residual_findings(
    chi2: float,
    quality: FitQuality,
    bias_repeatability_m_s2: float | None = None,
    drift_m_s2: float = 0.0,
    *,
    has_temperature: bool = False,
) -> Iterator[Finding]:
    """Finding where the stated noise does not explain the residuals; a fit of the session has a bias repeatability, and
    perhaps a drift, its range over the session, which a temperature in the log may explain."""
    if quality.dof <= 0 or chi2 <= probability.chdtri(quality.dof, SIGNIFICANCE):
        return
    is_held = quality.held_out_rms is not None
    rms = quality.rms if quality.held_out_rms is None else quality.held_out_rms
    yield Finding.of(
        "residual-above-noise",
        "poses",
        rms_m_s2=rms,
        is_held_out=is_held,
        rms_in_sample_m_s2=quality.rms,
        floor_m_s2=quality.floor,
        times_noise=rms / max(quality.floor, TINY),
        chi2_per_dof=chi2 / quality.dof,
        dof=quality.dof,
        is_joint=bias_repeatability_m_s2 is not None,
        bias_repeatability_m_s2=bias_repeatability_m_s2 or 0.0,
        is_drift=drift_m_s2 > 0.0,
        drift_m_s2=drift_m_s2,
        has_temperature=has_temperature,
        is_lone=quality.lone_pose is not None,
        lone=0 if quality.lone_pose is None else quality.lone_pose + 1,
    )


def observability_findings(
    design: PoseDesign,
    relative_sigma: float,
    advice: tuple[str, ...],
    *,
    is_anchored: bool,
    anchor: float,
    are_faces: bool,
) -> Iterator[Finding]:
    """No finding, WEAKLY_OBSERVABLE or NOT_OBSERVABLE, with the poses to add; ``are_faces``: method 1 would apply."""
    if design.rank < 9:
        yield Finding.of(
            "not-observable",
            "poses-rank",
            rank=design.rank,
            n_parameters=9,
            missing=9 - design.rank,
            unseen=(unseen := _unseen(design)),
            is_combined=len(unseen) > 9 - design.rank,
            anchor=anchor,
            are_faces=are_faces,
            advice=advice,
        )
        return
    worst = design.worst_prediction()
    is_weak = worst > WEAK_PREDICTION * relative_sigma
    if is_anchored and not is_weak:
        # Other orientations would not help: each pose by itself is uncertain.
        yield Finding.of("not-observable", "poses-uncertain", measured_g=relative_sigma)
    elif is_anchored:
        yield Finding.of(
            "not-observable",
            "poses-weak",
            at_worst=min(worst, 1.0),
            weakest=design.weakest(),
            anchor=anchor,
            are_faces=are_faces,
            advice=advice,
            rank=design.rank,
            n_parameters=9,
            worst_prediction_g=worst,
        )
    elif is_weak:
        yield Finding.of(
            "weakly-observable",
            "poses",
            worst_prediction_g=worst,
            measured_g=relative_sigma,
            weakest=design.weakest(),
            advice=advice,
            rank=design.rank,
            n_parameters=9,
        )


def _unseen(design: PoseDesign) -> list[str]:
    null = design.directions[design.rank :] / design.scale
    share = np.sqrt((null**2).sum(axis=0))
    return [parameter_names()[k] for k in np.argsort(-share, kind="stable") if share[k] > 0.3 * share.max()]


def held_out_findings(held_out: FloatArray, sigma: FloatArray, chi2_per_dof: FloatArray, dof: int) -> list[Finding]:
    """Findings for outlier poses (externally studentised, Bonferroni)."""
    seen = np.isfinite(held_out)
    n = int(seen.sum())
    if n == 0 or dof < 2:
        return []
    spread = np.sqrt(np.maximum(np.where(np.isfinite(chi2_per_dof), chi2_per_dof, 1.0), 1.0))
    z = np.zeros(len(held_out))
    z[seen] = held_out[seen] / (sigma[seen] * spread[seen])
    limit = float(-probability.stdtrit(dof - 1, SIGNIFICANCE / (2 * n)))
    return [
        Finding.of("outlier-pose", pose=int(i) + 1, held_out_m_s2=held_out[i], z=z[i], limit=limit)
        for i in np.flatnonzero(np.abs(z) > limit)
    ]


OFF_NOMINAL = 0.15
"""Largest departure (logarithm) of a scale from that of the log's unit."""


def model_findings(S: FloatArray, raw_unit: AccelerationUnit) -> Iterator[Finding]:
    """Findings for a left-handed triad, and for scales that contradict the unit of the log."""
    if np.linalg.det(S) < 0:
        signs = "".join("+" if s > 0 else "-" for s in np.diag(S))
        yield Finding.of("left-handed", "accelerometer", signs=signs, det_S_sign=-1.0)
    nominal = acceleration_to_si(raw_unit)
    if nominal is not None:
        ratio = np.linalg.norm(S, axis=0) / nominal
        apart = np.log(ratio)
        worst = int(np.argmax(np.abs(apart)))
        # Uncalibrated consumer triads are within 10 % of their data sheet; a wrong unit or |g| is off by far more.
        if abs(apart[worst]) > OFF_NOMINAL:
            is_common = bool(np.ptp(apart) < OFF_NOMINAL)
            yield Finding.of(
                "scale-not-nominal",
                "accelerometer",
                axis=worst + 1,
                scale_ratio=np.exp(apart.mean() if is_common else apart[worst]),
                unit=raw_unit.value,
                is_common=is_common,
            )
