"""What the alignment noticed, as findings."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
import numpy.typing as npt
from scipy.special import chdtrc

from trihedron.estimate.gyroscope.alignment import FALSE_ALARM, Aligned
from trihedron.estimate.gyroscope.measurements import MoveMeasurements, audit_moves
from trihedron.estimate.gyroscope.observability import describe, observability_findings
from trihedron.estimate.gyroscope.verification import Prediction
from trihedron.records.finding import Finding, FindingCode, Severity
from trihedron.units import STANDARD_GRAVITY_M_S2, RateUnit, degrees_from_radians, rate_to_si

FloatArray = npt.NDArray[np.float64]
MAX_SCALE_RATIO = 1.5
"""Untrimmed MEMS gyros are within 10 % of their data sheet; half as much again is a wrong unit or rate."""


def findings_of(aligned: Aligned, measured: MoveMeasurements, held: Prediction | None) -> tuple[Finding, ...]:
    """Everything the alignment noticed."""
    fit = aligned.fit
    S = np.asarray(fit.gyroscope_scale)
    covariance = aligned.covariance[12:21, 12:21]
    found = audit_moves(measured)
    found += handedness(S, np.asarray(fit.accelerometer_scale))
    found += observability_findings(describe(fit, covariance, S, aligned.n_gyroscope), covariance, S)
    if not fit.is_converged:
        found.append(
            Finding(
                FindingCode.NOT_CONVERGED,
                Severity.SERIOUS,
                f"the gyro fit did not settle ({fit.stopped_because}).",
                "moves that contradict each other, or a start far from the truth",
                "Look at the residual per move; give the nominal scale.",
            )
        )
    found += _outlier_findings(aligned, measured)
    if aligned.inflation > 1.0:
        found.append(
            Finding(
                FindingCode.RESIDUAL_ABOVE_NOISE,
                Severity.WARNING,
                f"gravity after the moves is missed by more than the noise explains: χ²/dof = {aligned.inflation:.1f} "
                f"with {fit.dof} degrees of freedom; the error bars are widened by its root.",
                "an effect outside the linear model: g-sensitivity, a time offset between the sensors, nonlinearity",
                "Run trihedron diagnose to see which.",
                MappingProxyType({"chi2_per_dof": aligned.inflation, "dof": float(fit.dof)}),
            )
        )
    found += _held_out_findings(held, aligned)
    found += _attitude_findings(measured, S)
    found += _drift_findings(measured, S)
    return tuple(found)


def scale_findings(S: FloatArray, raw_unit: RateUnit) -> list[Finding]:
    """A scale that contradicts the unit of the log: the rate of the log, or the unit, is wrong by that factor."""
    nominal = rate_to_si(raw_unit)
    if nominal is None:
        return []
    ratio = float(np.exp(np.mean(np.log(np.linalg.norm(S, axis=0) / nominal))))
    if not np.isfinite(ratio) or 1.0 / MAX_SCALE_RATIO <= ratio <= MAX_SCALE_RATIO:
        return []
    return [
        Finding(
            FindingCode.SCALE_NOT_NOMINAL,
            Severity.SERIOUS,
            f"The gyro needs a factor {ratio:.4g} although the log is in {raw_unit.value}.",
            "The log's time base or rate is wrong by that factor, or its unit is another one.",
            "Check --time-unit, --rate and --gyro-unit.",
            MappingProxyType({"scale_ratio": ratio}),
        )
    ]


def handedness(S: FloatArray, S_accelerometer: FloatArray) -> list[Finding]:
    """LEFT_HANDED when the logged axes of a sensor form a left-handed triad, or those of both sensors disagree.

    ``det S_ω < 0`` cannot come from the accelerometer's sign conventions: a reflection ``R`` of its frame makes
    ``S_ω → −R S_ω``, whose determinant keeps its sign. Two gyro axes that run against the accelerometer's show the
    accelerometer's reflection.
    """
    found = []
    if np.linalg.det(S) < 0.0:
        found.append(
            Finding(
                FindingCode.LEFT_HANDED,
                Severity.WARNING,
                "the gyro's axes as logged form a left-handed triad (det S < 0).",
                "one documented gyro axis is reversed, or two are exchanged",
                "Check the axis directions of the board; the calibration itself corrects them.",
                MappingProxyType({"determinant": float(np.linalg.det(S))}),
            )
        )
    if np.linalg.det(S_accelerometer) < 0.0:
        return found
    order = np.argmax(np.abs(S), axis=0)
    signs = np.sign(S[order, np.arange(3)])
    if (
        len(set(order.tolist())) == 3
        and np.linalg.det(S) > 0.0
        and not (np.array_equal(order, np.arange(3)) and np.all(signs > 0))
    ):
        reversed_axes = [f"{i + 1}" for i in range(3) if signs[i] < 0]
        seen = (
            f"gyro axes {' and '.join(reversed_axes)} run against the accelerometer's axes of the same name."
            if np.array_equal(order, np.arange(3))
            else "the gyro's axes as logged point along other axes of the accelerometer than their names say."
        )
        found.append(
            Finding(
                FindingCode.LEFT_HANDED,
                Severity.WARNING,
                seen,
                "the accelerometer's axes as logged are left-handed, or one sensor's signs or order were changed",
                "Check the axis directions of the board against both data sheets.",
            )
        )
    return found


def _outlier_findings(aligned: Aligned, measured: MoveMeasurements) -> list[Finding]:
    found = []
    for index in aligned.outliers:
        before, after = (int(k) for k in measured.links[index])
        sigma = float(np.sqrt(np.asarray(aligned.fit.cov_residuals)[index].trace() / 2.0))
        size = float(np.linalg.norm(np.asarray(aligned.fit.residuals)[index]))
        found.append(
            Finding(
                FindingCode.OUTLIER_MOVE,
                Severity.WARNING,
                f"move {index} (hold {before} to hold {after}) misses gravity by {size:.3g} m/s², "
                f"{size / sigma:.0f} times its noise, and is left out.",
                "one of its holds was not still, samples were lost, or the gyro was driven beyond its range",
                "Look at this move; repeat it.",
                MappingProxyType({"move": float(index), "residual_m_s2": size}),
            )
        )
    return found


def _held_out_findings(held: Prediction | None, aligned: Aligned) -> list[Finding]:
    if held is None:
        return []
    z2 = held.z2[aligned.used & np.isfinite(held.z2)]
    chi2, dof = float(z2.sum()), 2 * len(z2)
    # Residuals of neighbouring moves are correlated, which widens the scatter of their sum.
    if chdtrc(dof, chi2 / aligned.inflation / 1.5) > FALSE_ALARM:
        return []
    return [
        Finding(
            FindingCode.HELD_OUT_WORSE,
            Severity.WARNING,
            "moves that the fit did not see are predicted "
            f"{np.sqrt(chi2 / dof / aligned.inflation):.1f} times worse than the error bars say.",
            "too few moves for the number of parameters, or an effect that differs from move to move",
            "Record more moves, about all axes, both ways.",
            MappingProxyType({"chi2_per_dof": chi2 / dof}),
        )
    ]


def _attitude_findings(measured: MoveMeasurements, S: FloatArray) -> list[Finding]:
    attitude = measured.attitude
    if attitude is None:
        return []
    per_g = np.abs(S @ attitude.A) * STANDARD_GRAVITY_M_S2
    rate, force = (int(k) for k in np.unravel_index(int(np.argmax(per_g)), (3, 3)))
    per_move = np.median(measured.durations_s) * np.abs(attitude.A).max(axis=1) * STANDARD_GRAVITY_M_S2
    is_material = bool(np.any(per_move > measured.noise_density * np.sqrt(np.median(measured.durations_s))))
    return [
        Finding(
            FindingCode.GYRO_G_SENSITIVITY,
            Severity.WARNING if is_material else Severity.NOTE,
            "the gyro's zero reading follows gravity, by up to "
            f"{degrees_from_radians(float(per_g[rate, force])):.2g} deg/s per g (axis {rate + 1} for force along axis "
            f"{force + 1}), {100.0 * attitude.scatter_left:.0f} % of its scatter between holds is left without it. "
            "The moves were fitted without it, but S and b alone cannot correct it.",
            "g-sensitivity of the gyro",
            "Run trihedron diagnose for the extended model.",
            MappingProxyType({"largest_rad_s_per_m_s2": float(np.max(np.abs(S @ attitude.A)))}),
        )
    ]


def _drift_findings(measured: MoveMeasurements, S: FloatArray) -> list[Finding]:
    dof = len(measured.zero) - 1
    if dof < 1 or chdtrc(dof, float(measured.zero_excess.max())) > FALSE_ALARM / 3.0:
        return []
    rates = np.abs(np.diagonal(S)) if np.all(np.abs(np.diagonal(S)) > 0) else np.linalg.norm(S, axis=0)
    change = np.ptp(measured.zero, axis=0) * rates
    axis = int(np.argmax(measured.zero_excess))
    return [
        Finding(
            FindingCode.GYRO_BIAS_DRIFT,
            Severity.NOTE,
            "the gyro's zero reading differs between holds by up to "
            f"{degrees_from_radians(float(change[axis])):.2g} deg/s (axis {axis + 1}), "
            f"{np.sqrt(measured.zero_excess[axis] / dof):.1f} times its noise; each move uses the holds next to it.",
            "warm-up, slow noise, or a zero reading that depends on attitude (g-sensitivity)",
            "Let the sensor warm up; use the stated zero only near this temperature.",
            MappingProxyType({"change_rad_s": float(change[axis])}),
        )
    ]
