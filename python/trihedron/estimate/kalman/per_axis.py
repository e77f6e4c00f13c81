"""Calibration in known attitudes, axis by axis: noise model, Kalman filter with its tests, and least squares."""

from collections.abc import Iterator, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import AXES, BoolArray, FloatArray
from trihedron.errors import InputError
from trihedron.probability import FALSE_ALARM, chdtrc, chdtri, ndtri
from trihedron.records import AxisKalmanResult, AxisNoise, Consistency, ConstantsTrack, KalmanCalibration, PoseTable
from trihedron.records.calibration import Observability, SensorCalibration
from trihedron.records.finding import Finding
from trihedron.records.words import words
from trihedron.sensor_model import other_form, other_form_jacobian

SLOWEST_PER_SESSION, FASTEST_PER_POSE = 0.3, 6.0
"""Extreme inverse correlation times of flicker, times the length of session and of pose. With one Gauss-Markov process
per decade between them the Allan deviation follows flicker within 2 %."""


RAMP_PER_SESSION, RAMP_DAMPING = 0.1, 1.0 / np.sqrt(2.0)
"""ω₀ of the second-order ramp, times the length of the session, for a slope that lasts for all of it; ζ."""


def shaping_model(noise: AxisNoise, *, session_s: float, pose_s: float) -> _core.AxisKalmanModel:
    """Compiled shaping filter of one axis for a session of ``session_s`` with poses of about ``pose_s``; a reading is
    the exact mean over its pose (docs/kalman.md, eq. 4-8)."""
    slow, fast = SLOWEST_PER_SESSION / session_s, FASTEST_PER_POSE / pose_s
    n = max(2, int(np.ceil(np.log10(fast / slow))) + 1)
    return _core.AxisKalmanModel(
        quantisation=noise.quantisation,
        white=noise.white,
        flicker=noise.flicker,
        walk=noise.walk,
        ramp=noise.ramp,
        gauss_markov=noise.gauss_markov,
        gauss_markov_rate=1.0 / noise.gauss_markov_time_s if noise.gauss_markov_time_s > 0 else 0.0,
        resolution=noise.resolution,
        dither=noise.sample_sigma,
        flicker_rates=np.geomspace(slow, fast, n).tolist(),
        ramp_frequency=RAMP_PER_SESSION / session_s,
        ramp_damping=RAMP_DAMPING,
        averages=True,
    )


CONFIDENCE = 0.99
DIFFUSE_RATIO = 30.0
"""Ratio of an innovation's σ to the later ones' above which the diffuse start dominates it, and not the noise."""


def is_settled(innovation_sigma: FloatArray, n_unknowns: int) -> BoolArray:
    """Innovations (n,) that the data predict; the σ of the others, one for each unknown or more, is dominated by the
    diffuse start."""
    rest = np.delete(innovation_sigma, np.argsort(-innovation_sigma, kind="stable")[:n_unknowns])
    typical = float(np.median(rest)) if len(rest) else 0.0
    return innovation_sigma <= DIFFUSE_RATIO * typical


def check_innovations(innovation: FloatArray, innovation_sigma: FloatArray, n_unknowns: int) -> Consistency:
    """Mean of the normalised innovation squared, and Ljung-Box test of whiteness (docs/kalman.md, eq. 11-12), from
    one-step prediction errors (n,) and their predicted standard deviations (n,) in any unit."""
    judged = np.flatnonzero(is_settled(innovation_sigma, n_unknowns))
    z = (innovation / innovation_sigma)[judged]
    n = len(z)
    if n == 0:
        return Consistency(np.nan, np.nan, np.nan, 0, np.nan, 0, ())
    tail = (1.0 - CONFIDENCE) / 2.0
    low, high = chdtri(n, 1.0 - tail) / n, chdtri(n, tail) / n
    n_lags = min(20, n // 5)
    power = float(z @ z)
    r = np.array([float(z[lag:] @ z[: n - lag]) / power for lag in range(1, n_lags + 1)]) if power > 0 else np.zeros(0)
    p = 1.0
    if len(r):
        q = n * (n + 2) * float(np.sum(r**2 / (n - np.arange(1, n_lags + 1))))
        p = chdtrc(n_lags, q)
    beyond = judged[np.abs(z) > -ndtri(0.5 * FALSE_ALARM / n)]
    first = int(beyond[0]) + 1 if len(beyond) else 0
    return Consistency(power / n, low, high, n, p, n_lags, tuple(float(v) for v in r), first)


def covariance_scale(seen: Consistency) -> float:
    """Factor of a covariance whose innovations are larger than predicted: their mean square; else 1."""
    return seen.nis_mean if seen.n and seen.nis_mean > seen.nis_high else 1.0


def consistency_findings(axis: int | None, seen: Consistency) -> Iterator[Finding]:
    """Findings where innovations contradict the noise model; ``axis`` None for the norm of all three.

    Where they are too large the covariance has the factor ``covariance_scale``.
    """
    case, name = ("norm", "") if axis is None else ("axis", AXES[axis])
    mean, low, high = seen.nis_mean, seen.nis_low, seen.nis_high
    if seen.n == 0:
        yield Finding.of("few-poses", "untested", poses=9 if axis is None else 4)
    if seen.n and mean > high:
        yield Finding.of(
            "innovations-too-large",
            case,
            axis=name,
            nis_mean=mean,
            nis_low=low,
            nis_high=high,
            widening=np.sqrt(covariance_scale(seen)),
            has_first=seen.first_beyond > 0,
            first_pose=seen.first_beyond,
        )
    elif seen.n and mean < low:
        yield Finding.of("innovations-too-small", case, axis=name, nis_mean=mean, nis_low=low, nis_high=high)
    if seen.n_lags and seen.whiteness_p < 1.0 - CONFIDENCE:
        yield Finding.of(
            "innovations-correlated",
            case,
            axis=name,
            whiteness_p=seen.whiteness_p,
            n_lags=seen.n_lags,
            autocorrelation_1=seen.autocorrelation[0],
        )


DIFFUSE = 1e8
"""σ of a diffuse start in standard deviations of one reading: its information is 1e-16 of one pose's."""


def noise_per_axis(noise: AxisNoise | Sequence[AxisNoise]) -> tuple[AxisNoise, AxisNoise, AxisNoise]:
    """Noise of each of the three axes, from one for all or one per axis."""
    if isinstance(noise, AxisNoise):
        return noise, noise, noise
    if len(noise) != 3:
        raise InputError(f"noise must describe one axis or three, got {len(noise)}")
    return noise[0], noise[1], noise[2]


def calibrate_with_references(
    readings: npt.ArrayLike,
    table: PoseTable,
    noise: AxisNoise | Sequence[AxisNoise],
    *,
    start_s: FloatArray,
    pose_s: FloatArray,
    extra_variance: FloatArray | float = 0.0,
    raw_unit: str = "counts",
) -> KalmanCalibration:
    """Calibrate a triad from mean readings in known attitudes, by all methods after every pose (docs/kalman.md, eq. 2).

    ``readings`` (n, 3) are the mean raw readings of the poses in the attitudes of the ``table``, ``noise`` that of one
    axis or of three, ``start_s`` (n,) and ``pose_s`` (n,) the start and length of the poses [s], ``extra_variance``
    (n, 3) [raw²] in addition to the noise model.

    Raises ``InputError`` when shapes disagree, values are not finite, poses are out of order or do not determine the
    constants.
    """
    f = table.specific_force
    z = np.array(readings, dtype=np.float64)
    if z.shape != f.shape:
        raise InputError(f"there are {len(f)} reference poses, but the readings have shape {z.shape}: one row per pose")
    extra = np.broadcast_to(extra_variance, z.shape)
    noises = noise_per_axis(noise)
    session = float(start_s[-1] + pose_s[-1] - start_s[0])
    models = [shaping_model(n, session_s=session, pose_s=float(np.median(pose_s))) for n in noises]
    if table.sigma_m_s2 > 0:
        # An angle error changes the reference by σ across it; the axis' sensitivity converts it to raw units.
        extra = extra + (table.sigma_m_s2 * _sensitivity(z, f)) ** 2
    axes: list[AxisKalmanResult] = []
    findings: list[Finding] = []
    for axis in range(3):
        result = _one_axis(
            axis, noises[axis], models[axis], z[:, axis].copy(), f, start_s, pose_s, extra[:, axis].copy()
        )
        axes.append(replace(result, covariance=covariance_scale(result.consistency) * result.covariance))
        findings += consistency_findings(axis, result.consistency)
    observability, seen = _observability(f)
    findings += seen
    accelerometer = direct_form(axes, raw_unit, observability)
    residual = (z @ accelerometer.S.T + accelerometer.b) - f
    return KalmanCalibration(tuple(axes), accelerometer, f, start_s, residual, tuple(findings))


def _sensitivity(z: FloatArray, f: FloatArray) -> FloatArray:
    """(3,) approximate norm of each axis' sensitivity row [raw/(m/s²)], to scale an angle error."""
    rows = np.linalg.lstsq(np.column_stack([f, np.ones(len(f))]), z, rcond=None)[0][:3]
    return np.asarray(np.linalg.norm(rows, axis=0))


def _one_axis(
    axis: int,
    noise: AxisNoise,
    model: _core.AxisKalmanModel,
    z: FloatArray,
    f: FloatArray,
    start: FloatArray,
    pose: FloatArray,
    extra: FloatArray,
) -> AxisKalmanResult:
    mean, sigma = np.zeros(4), np.full(4, DIFFUSE * model.fast_variance(float(np.min(pose))) ** 0.5)
    begin = _core.KalmanStart(mean, sigma, np.zeros(4))
    poses = _core.KalmanPoses(z, f, start, pose, extra)
    constants, stated, covariance, innovation, variance, _, _ = _core.kalman_track(model, begin, poses)
    _, _, smoothed, smoothed_sigma = _core.kalman_smooth(model, begin, poses)
    # Ordinary least squares uses only the variance of one reading.
    white = model.fast_variance(float(np.median(pose))) + float(np.median(extra))
    recursive = _core.kalman_least_squares(z, f, white, mean, sigma)
    ols, ols_cov, gls, gls_cov, *track = _core.kalman_generalised_least_squares(model, begin, poses)
    innovation_sigma = np.sqrt(variance)
    return AxisKalmanResult(
        axis=axis,
        noise=noise,
        constants=constants[-1].copy(),
        covariance=covariance,
        tracks=(
            ConstantsTrack("kalman", constants, stated),
            ConstantsTrack("recursive least squares", *recursive),
            ConstantsTrack("recursive generalised least squares", track[0], track[1]),
        ),
        batch={
            "least squares": (ols, np.sqrt(np.diag(ols_cov))),
            "generalised least squares": (gls, np.sqrt(np.diag(gls_cov))),
        },
        innovation=innovation,
        innovation_sigma=innovation_sigma,
        is_settled=is_settled(innovation_sigma, len(mean)),
        smoothed_drift=smoothed,
        smoothed_drift_sigma=smoothed_sigma,
        consistency=check_innovations(innovation, innovation_sigma, len(mean)),
    )


def direct_form(
    axes: Sequence[AxisKalmanResult], raw_unit: str, observability: Observability | None = None
) -> SensorCalibration:
    """``raw = S_a f + b_a`` per axis → ``f = S raw + b`` with its covariance, to first order (docs/kalman.md, eq. 9).

    Raises ``InputError`` when the three axes are not independent: no direct form exists.
    """
    inverse_S = np.array([a.constants[:3] for a in axes])
    inverse_b = np.array([a.constants[3] for a in axes])
    scale = np.linalg.norm(inverse_S, axis=1)
    if np.any(scale == 0) or np.linalg.cond(inverse_S / scale[:, None]) > 1e6:
        raise InputError("the three axes read the same component of gravity: the triad cannot be inverted")
    S, b = other_form(inverse_S, inverse_b)
    covariance = np.zeros((12, 12))
    for i, axis in enumerate(axes):
        # Row i of S_a and b_a[i] are correlated; axes are independent.
        of_axis = [3 * i, 3 * i + 1, 3 * i + 2, 9 + i]
        covariance[np.ix_(of_axis, of_axis)] = axis.covariance
    jacobian = other_form_jacobian(inverse_S, inverse_b)
    return SensorCalibration(
        S=S,
        b=b,
        covariance=jacobian @ covariance @ jacobian.T,
        raw_unit=raw_unit,
        si_unit="m/s^2",
        method="kalman, known attitudes",
        observability=observability,
    )


def _observability(f: FloatArray) -> tuple[Observability, list[Finding]]:
    """Observability of the four constants of any axis by the reference forces (n, 3)."""
    design = np.column_stack([f, np.full(len(f), np.sqrt(np.mean(f**2) * 3.0))])
    design = design / np.sqrt(np.mean(np.sum(f**2, axis=1)))
    singular = np.linalg.svd(design / np.sqrt(len(f)), compute_uv=True)
    values, directions = singular[1], singular[2]
    condition = float(values[0] / values[-1]) if values[-1] > 0 else float("inf")
    weakest = int(np.argmax(np.abs(directions[-1])))
    axis = "" if weakest == 3 else AXES[weakest]
    name = words("sensitivity-to", axis=axis) if axis else words("bias")
    advice = words("tilt-towards-vertical", axis=axis) if axis else words("bias-both-ways")
    rank = int(np.sum(values > 1e-9 * values[0]))
    observability = Observability(rank, 4, condition, values, weakest=name, advice=(advice,))
    if condition <= 30.0:
        return observability, []
    return observability, [
        Finding.of("weakly-observable", "attitudes", weakest=name, advice=advice, condition=condition)
    ]
