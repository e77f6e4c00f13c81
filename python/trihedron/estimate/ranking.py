"""Several calibrations compared on one recording: predictive density, intervals, and the mistake in a wrong one."""

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from trihedron.arrays import FloatArray, rms_of
from trihedron.estimate.gravity_error import norm_error
from trihedron.estimate.gyroscope.measurements import measure_moves
from trihedron.estimate.session.carried import carried_by, without_g_sensitivity
from trihedron.gravity import normal_gravity
from trihedron.records import Calibration, Recording, Segments, SensorCalibration, Verification
from trihedron.records.ranking import Interval, Suspicion
from trihedron.sensor_model import norms
from trihedron.units import STANDARD_GRAVITY_M_S2, degrees_from_radians

RESAMPLES = 2000
"""Bootstrap resamples: the ends of a 95 % interval are accurate to a tenth of its half width."""
STEPS = 20
"""Gauss-Newton steps for a bias (3,): it converges in four."""


def densities(verifications: list[Verification]) -> list[FloatArray]:
    """Log predictive density of every pose, move and static rate under each calibration, over what all of them predict.

    Each domain (norm of gravity, tilt error, static rate) is Gaussian about zero with the calibration's own rms: twice
    the rms lowers the log density by log 2 per point.
    """
    has_angle = all(len(v.angle_deg) for v in verifications)
    has_rest = all(len(v.static_rate) for v in verifications)
    out = []
    for v in verifications:
        parts = [v.norm_error, *([v.angle_deg] if has_angle else []), *([v.static_rate.ravel()] if has_rest else [])]
        points = []
        for part in parts:
            variance = max(float(np.mean(part**2)), np.finfo(float).tiny)
            points.append(-0.5 * np.log(2.0 * np.pi * variance) - 0.5 * part**2 / variance)
        out.append(np.concatenate(points))
    return out


def rms_interval(errors: FloatArray) -> Interval:
    """95 % bootstrap interval of the rms of errors (n,); NaN for fewer than two."""
    if len(errors) < 2:
        return float("nan"), float("nan")
    rng = np.random.default_rng(0)
    picked = rng.integers(0, len(errors), (RESAMPLES, len(errors)))
    rms = np.sqrt(np.mean(errors[picked] ** 2, axis=1))
    return float(np.quantile(rms, 0.025)), float(np.quantile(rms, 0.975))


def with_bias_of_log(calibration: Calibration, segments: Segments, gravity_m_s2: float) -> Calibration:
    """The calibration, with biases that its file does not state estimated from the poses of the log."""
    without = calibration.extensions.get("without_bias", ())
    accel, gyro = calibration.accelerometer, calibration.gyroscope
    if "accelerometer" in without and segments.accelerometer_mean is not None:  # type: ignore[operator]
        accel = replace(accel, b=_accelerometer_bias(accel, segments.accelerometer_mean, gravity_m_s2))
    if gyro is not None and "gyroscope" in without and segments.gyroscope_mean is not None:  # type: ignore[operator]
        gyro = replace(gyro, b=-gyro.S @ segments.gyroscope_mean.mean(axis=0))
    return replace(calibration, accelerometer=accel, gyroscope=gyro)


def _accelerometer_bias(sensor: SensorCalibration, means: FloatArray, gravity_m_s2: float) -> FloatArray:
    """b (3,) [m/s²] by least squares of ``|S a + b| - |g|`` over the poses' means (n, 3), with S fixed."""
    b = np.zeros(3)
    for _ in range(STEPS):
        norm, jacobian = norms(means, sensor.S, b)
        b = b + np.linalg.lstsq(jacobian[:, 9:], gravity_m_s2 - norm, rcond=None)[0]
    return b


def suspicions_of(
    calibration: Calibration, own: Calibration, recording: Recording, segments: Segments, gravity_m_s2: float
) -> tuple[Suspicion, ...]:
    """The single mistake of either sensor's parameters whose correction makes the calibration fit the recording."""
    assert segments.accelerometer_mean is not None
    means, zero = segments.accelerometer_mean, np.zeros((segments.n_poses, 3))

    def norm(S: FloatArray, b: FloatArray) -> float:
        sensor = replace(own.accelerometer, S=S, b=b)
        return rms_of(norm_error(sensor, means, zero, gravity_m_s2)[0])

    accel = calibration.accelerometer
    misses = Misses(norm, norm(own.accelerometer.S, own.accelerometer.b))
    found = accelerometer_suspicion(accel.S, accel.b, misses, gravity_m_s2)
    out = [found] if found is not None else []
    gyro, own_gyro = calibration.gyroscope, own.gyroscope
    if gyro is None or own_gyro is None or segments.gyroscope_mean is None or not segments.moves:
        return tuple(out)
    measured = without_g_sensitivity(measure_moves(recording, segments, own.accelerometer), own)
    # A wrong accelerometer causes tilt errors too: the log's own replaces it.
    base = calibration if found is None else own
    rates = segments.gyroscope_mean

    def tilt_deg(accel: Calibration, S: FloatArray) -> float:
        return rms_of(carried_by(accel, S, measured, segments).angle_deg[~measured.is_lost])

    of_gyro = gyroscope_suspicion(
        gyro.S,
        gyro.b,
        own_gyro.S,
        Misses(lambda S, _: tilt_deg(base, S), tilt_deg(own, own_gyro.S)),
        Misses(lambda S, b: rms_of(rates @ S.T + b), rms_of(rates @ own_gyro.S.T + own_gyro.b)),
    )
    return (*out, of_gyro) if of_gyro is not None else tuple(out)


# Single mistakes that are tried: sign of a bias, direction (correct or distort), unit, axes, gravity.

TEXTBOOK_M_S2 = 10.0
"""The largest gravity in use for calibration."""
NEAREST = 4
"""Number of mistakes whose correction is tested by tilt errors after rotations."""
HALF = 0.5
"""A mistake is reported only if its correction at least halves the rms error."""
NEAR = 4.0
"""... and only if the rms error left is at most this many times that of the log's own calibration (in sample)."""


@dataclass(frozen=True)
class Misses:
    """Rms error as a function of one sensor's (S, b), and the rms error ``own`` of the log's own calibration."""

    rms: Callable[[FloatArray, FloatArray], float]
    own: float


def accelerometer_suspicion(S: FloatArray, b: FloatArray, norm: Misses, gravity_m_s2: float) -> Suspicion | None:
    """The accelerometer's mistake by gravity errors in static poses, which do not depend on a rotation of the triad."""
    tried = [*_common(S, b), *_units(S, b, STANDARD_GRAVITY_M_S2), *_axes(S, b)]
    best = _best(tried, norm, norm.rms(S, b))
    # Gravity is a fitted factor between the smallest on Earth and the textbook's: it is preferred only if it fits best.
    factors = np.linspace(normal_gravity(0.0, 5000.0), TEXTBOOK_M_S2, 401) / gravity_m_s2
    scaled = min(factors, key=lambda k: norm.rms(S / k, b / k))
    wrong = _best([("gravity", S / scaled, b / scaled, float(scaled))], norm, norm.rms(S, b))
    if best is None or (wrong is not None and wrong.rms_undone < best.rms_undone):
        return wrong
    return best


def gyroscope_suspicion(
    S: FloatArray, b: FloatArray, own_S: FloatArray, tilt: Misses, rest: Misses
) -> Suspicion | None:
    """The gyro's mistake: of S by tilt errors after rotations; where these show none, of b by static rates.

    Rotations are integrated only for the ``NEAREST`` corrections of S closest to the log's own ``own_S`` (3, 3).
    """
    degree = degrees_from_radians(1.0)
    tried = [*_common(S, b), *_units(S, b, degree), *_axes(S, b)]
    of_S = [one for one in tried if "bias" not in one[0]]
    near = sorted(of_S, key=lambda one: float(np.linalg.norm(one[1] @ np.linalg.inv(own_S) - np.eye(3))))[:NEAREST]
    by_tilt = _best([one for one in of_S if any(one is kept for kept in near)], tilt, tilt.rms(S, b))
    if by_tilt is not None:
        return by_tilt
    of_bias = [one for one in tried if "bias" in one[0]]
    of_bias += [("bias-unit", S, b * degree, degree), ("bias-unit", S, b / degree, 1.0 / degree)]
    return _best(of_bias, rest, rest.rms(S, b))


def _common(S: FloatArray, b: FloatArray) -> Iterator[tuple[str, FloatArray, FloatArray, float]]:
    inverse: FloatArray = np.asarray(np.linalg.inv(S), dtype=np.float64)
    yield "bias-sign", S, -b, 1.0
    yield "bias-order", S, S @ b, 1.0
    yield "bias-order", S, inverse @ b, 1.0
    yield "direction", inverse, -inverse @ b, 1.0
    yield "transpose", S.T, b, 1.0


def _units(S: FloatArray, b: FloatArray, unit: float) -> Iterator[tuple[str, FloatArray, FloatArray, float]]:
    for factor in (unit, 1.0 / unit):
        yield "unit", factor * S, factor * b, factor


def _axes(S: FloatArray, b: FloatArray) -> Iterator[tuple[str, FloatArray, FloatArray, float]]:
    for order in permutations(range(3)):
        for signs in product((1.0, -1.0), repeat=3):
            P = np.zeros((3, 3))
            P[np.arange(3), order] = signs
            if np.array_equal(P, np.eye(3)):
                continue
            yield "axes", S @ P, b, 1.0
            yield "axes", P @ S, P @ b, 1.0


def _best(tried: list[tuple[str, FloatArray, FloatArray, float]], misses: Misses, base: float) -> Suspicion | None:
    """The mistake whose correction leaves the least rms error, if within ``HALF`` and ``NEAR``; else ``None``."""
    if base <= NEAR * misses.own:
        return None
    results = [(misses.rms(S, b), kind, factor) for kind, S, b, factor in tried]
    least = min((rms for rms, _, _ in results), default=np.inf)
    if not least < HALF * base or least > NEAR * misses.own:
        return None
    # Corrections within 1 % of the least are equivalent: the first of the list is the simplest.
    rms, kind, factor = next(one for one in results if one[0] <= 1.01 * least)
    return Suspicion(kind, base, rms, factor)
