"""What a fitted triad must say about itself: residual against noise, unseen poses, outliers, handedness, scale."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
from scipy import special

from trihedron.estimate.accelerometer.poses import NAMES, PoseDesign
from trihedron.records.calibration import FloatArray
from trihedron.records.finding import Finding, FindingCode, Severity
from trihedron.units import AccelerationUnit, acceleration_to_si

SIGNIFICANCE = 0.01
"""Rate at which a healthy recording raises one of the statistical findings here."""

WEAK_PREDICTION = 3.0
"""A set of n well spread poses predicts any new one to √(9/n) of a pose's noise; at three times the noise of a pose the
set hardly constrains some direction."""


def covariance_scale(chi2: float, dof: int) -> float:
    """χ²/dof where it exceeds the 99 % quantile of noise alone, else 1: errors never shrink below the noise."""
    if dof <= 0 or chi2 <= special.chdtri(dof, SIGNIFICANCE):
        return 1.0
    return chi2 / dof


def residual_findings(chi2: float, dof: int, rms: float, floor: float) -> list[Finding]:
    """Residuals that the stated noise does not explain."""
    scale = covariance_scale(chi2, dof)
    if scale == 1.0:
        return []
    return [
        Finding(
            FindingCode.RESIDUAL_ABOVE_NOISE,
            Severity.WARNING,
            f"The residual of the still poses is {1e3 * rms:.3g} mm/s² rms, the noise of their means explains only "
            f"{1e3 * floor:.3g} mm/s² (χ² per degree of freedom {scale:.3g}, {dof} degrees); all standard errors of "
            f"the accelerometer are multiplied by {np.sqrt(scale):.3g}.",
            "Poses not quite still, a zero that drifts between poses, nonlinearity, or noise of the means underrated.",
            "Look at the residual per pose; `trihedron diagnose` names the effect.",
            MappingProxyType({"chi2_per_dof": scale, "dof": float(dof), "rms_m_s2": rms, "floor_m_s2": floor}),
        )
    ]


def observability_findings(
    design: PoseDesign, relative_sigma: float, advice: tuple[str, ...], *, is_anchored: bool, anchor: float
) -> list[Finding]:
    """Nothing, a warning, or a refusal, with the poses to add."""
    add = "Add still poses with " + "; ".join(f"({i + 1}) {words}" for i, words in enumerate(advice)) + "."
    numbers = {"rank": float(design.rank), "n_parameters": 9.0}
    if design.rank < 9:
        return [
            Finding(
                FindingCode.NOT_OBSERVABLE,
                Severity.SERIOUS,
                f"The still poses determine {design.rank} of the 9 parameters of the accelerometer; unseen is the "
                f"{_unseen(design)}, held within {100 * anchor:.0f} % of a perfect triad.",
                "Too few different orientations: six faces alone are six equations for nine parameters.",
                add,
                MappingProxyType(numbers),
            )
        ]
    worst = design.worst_prediction()
    numbers["worst_prediction_g"] = worst
    if is_anchored:
        return [
            Finding(
                FindingCode.NOT_OBSERVABLE,
                Severity.SERIOUS,
                f"The still poses determine the accelerometer so weakly that some pose could be wrong by "
                f"{100 * min(worst, 1.0):.2g} % of gravity; worst is {design.weakest()}. All parameters were held "
                f"within {100 * anchor:.0f} % of a perfect triad.",
                "The orientations are too much alike.",
                add,
                MappingProxyType(numbers),
            )
        ]
    if worst > WEAK_PREDICTION * relative_sigma:
        return [
            Finding(
                FindingCode.WEAKLY_OBSERVABLE,
                Severity.WARNING,
                f"Some orientations are predicted {worst / relative_sigma:.2g} times worse than one pose is measured; "
                f"worst is {design.weakest()}.",
                "No pose lies near those orientations.",
                add,
                MappingProxyType(numbers),
            )
        ]
    return []


def _unseen(design: PoseDesign) -> str:
    null = design.directions[design.rank :] / design.scale
    share = np.sqrt((null**2).sum(axis=0))
    names = [NAMES[k] for k in np.argsort(-share, kind="stable") if share[k] > 0.3 * share.max()]
    return ", the ".join(names)


def held_out_findings(held_out: FloatArray, sigma: FloatArray, chi2_per_dof: FloatArray, dof: int) -> list[Finding]:
    """Poses that the others do not predict (externally studentised, Bonferroni), and a fit that does not generalise."""
    seen = np.isfinite(held_out)
    n = int(seen.sum())
    if n == 0 or dof < 2:
        return []
    spread = np.sqrt(np.maximum(np.where(np.isfinite(chi2_per_dof), chi2_per_dof, 1.0), 1.0))
    z = np.zeros(len(held_out))
    z[seen] = held_out[seen] / (sigma[seen] * spread[seen])
    limit = float(-special.stdtrit(dof - 1, SIGNIFICANCE / (2 * n)))
    found = [
        Finding(
            FindingCode.OUTLIER_POSE,
            Severity.WARNING,
            f"Still pose {i} differs from what all other poses predict by {1e3 * held_out[i]:.3g} mm/s² "
            f"({abs(z[i]):.1f} standard errors, limit {limit:.1f}).",
            "The sensor was touched or not still in this pose, or a reading clipped.",
            "Leave the pose out, or use a robust loss.",
            MappingProxyType({"pose": float(i), "held_out_m_s2": float(held_out[i]), "z": float(z[i])}),
        )
        for i in np.flatnonzero(np.abs(z) > limit)
    ]
    mean_square = float(np.mean(z[seen] ** 2))
    # Held-out z share one training set and heavy tails of t: twice the variance of noise alone is beyond both.
    if not found and n >= 12 and mean_square > 2.0 * special.chdtri(n, SIGNIFICANCE) / n:
        found.append(
            Finding(
                FindingCode.HELD_OUT_WORSE,
                Severity.WARNING,
                f"Poses that the fit did not see are missed by {np.sqrt(mean_square):.2g} times their predicted error.",
                "The fit bends to its own poses: too few of them, or an effect that a linear model does not have.",
                "Record more poses; see `trihedron diagnose`.",
                MappingProxyType({"held_out_z_rms": float(np.sqrt(mean_square))}),
            )
        )
    return found


def model_findings(S: FloatArray, raw_unit: AccelerationUnit, *, signs_are_known: bool) -> list[Finding]:
    """A left-handed triad, and scales that contradict the unit of the log."""
    found = []
    if np.linalg.det(S) < 0:
        signs = "".join("+" if s > 0 else "-" for s in np.diag(S))
        found.append(
            Finding(
                FindingCode.LEFT_HANDED,
                Severity.WARNING,
                f"The accelerometer's axes form a left-handed triad: det S < 0 (signs of the diagonal {signs}).",
                "The documented direction of one axis (or of all three) is wrong, or two axes are swapped."
                + ("" if signs_are_known else " Still poses alone cannot tell signs; these are the ones asked for."),
                "Check the axis directions printed on the board against a pose with one axis up.",
                MappingProxyType({"det_S_sign": -1.0}),
            )
        )
    nominal = acceleration_to_si(raw_unit)
    if nominal is not None:
        ratio = np.linalg.norm(S, axis=0) / nominal
        worst = int(np.argmax(np.abs(np.log(ratio))))
        # Uncalibrated consumer triads are within 10 % of their data sheet; a wrong unit or |g| is off by far more.
        if abs(np.log(ratio[worst])) > 0.15:
            found.append(
                Finding(
                    FindingCode.SCALE_NOT_NOMINAL,
                    Severity.WARNING,
                    f"Axis {worst + 1} needs a factor {ratio[worst]:.4g} although the log is in {raw_unit.value}.",
                    "The log is in another unit than stated, or |g| is wrong.",
                    "State the unit of the log and |g|.",
                    MappingProxyType({"scale_ratio": float(ratio[worst])}),
                )
            )
    return found


def convergence_findings(is_converged: bool, stopped_because: str) -> list[Finding]:
    """The solver did not reach its convergence inequality."""
    if is_converged:
        return []
    return [
        Finding(
            FindingCode.NOT_CONVERGED,
            Severity.SERIOUS,
            f"The accelerometer fit did not converge ({stopped_because}).",
            "Poses contradict each other, or hardly differ.",
            "Check that every pose was still; add poses.",
        )
    ]
