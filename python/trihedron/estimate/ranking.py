"""Several calibrations judged on one recording: predictive density, intervals, and the mistake in a wrong one."""

from __future__ import annotations

from collections.abc import Callable, Iterator
from dataclasses import dataclass, replace
from itertools import permutations, product

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.gyroscope.measurements import MoveMeasurements, measure_moves
from trihedron.estimate.session.carried import carried_by
from trihedron.estimate.verification import norm_error
from trihedron.gravity import normal_gravity
from trihedron.records import Calibration, Recording, Segments, SensorCalibration, Verification
from trihedron.records.ranking import Interval, Suspicion
from trihedron.units import STANDARD_GRAVITY_M_S2, degrees_from_radians

RESAMPLES = 2000
"""Of the bootstrap: the ends of a 95 % interval are then known to a tenth of its half width."""
STEPS = 20
"""Of Gauss and Newton for a bias of three numbers: it converges in four."""


def densities(verifications: list[Verification]) -> list[FloatArray]:
    """Log predictive density of every pose, move and rest rate by each calibration, over what all of them predict.

    Each domain (length of gravity, tilt, rate at rest) is Gaussian about zero with the calibration's own rms: a
    calibration that misses twice as far is log 2 behind in every point.
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
    """95 % interval of the rms of errors (n,) by resampling them; NaN of fewer than two."""
    if len(errors) < 2:
        return float("nan"), float("nan")
    rng = np.random.default_rng(0)
    picked = rng.integers(0, len(errors), (RESAMPLES, len(errors)))
    rms = np.sqrt(np.mean(errors[picked] ** 2, axis=1))
    return float(np.quantile(rms, 0.025)), float(np.quantile(rms, 0.975))


def with_bias_of_log(calibration: Calibration, segments: Segments, gravity_m_s2: float) -> Calibration:
    """The calibration with the biases that its file does not hold taken from the poses of the log."""
    without = calibration.extensions.get("without_bias", ())
    accel, gyro = calibration.accelerometer, calibration.gyroscope
    if "accelerometer" in without and segments.accelerometer_mean is not None:  # type: ignore[operator]
        accel = replace(accel, b=_accelerometer_bias(accel, segments.accelerometer_mean, gravity_m_s2))
    if gyro is not None and "gyroscope" in without and segments.gyroscope_mean is not None:  # type: ignore[operator]
        gyro = replace(gyro, b=-gyro.S @ segments.gyroscope_mean.mean(axis=0))
    return replace(calibration, accelerometer=accel, gyroscope=gyro)


def _accelerometer_bias(sensor: SensorCalibration, means: FloatArray, gravity_m_s2: float) -> FloatArray:
    """b with which ``|S a + b|`` of the poses is nearest to gravity."""
    force, b = means @ sensor.S.T, np.zeros(3)
    for _ in range(STEPS):
        total = force + b
        norm = np.linalg.norm(total, axis=1)
        step = np.linalg.lstsq(total / norm[:, None], gravity_m_s2 - norm, rcond=None)[0]
        b = b + step
    return b


def suspicions_of(
    calibration: Calibration, own: Calibration, recording: Recording, segments: Segments, gravity_m_s2: float
) -> tuple[Suspicion, ...]:
    """The mistake in the accelerometer's and in the gyro's part, where undoing one makes it fit."""
    assert segments.accelerometer_mean is not None
    means, zero = segments.accelerometer_mean, np.zeros((segments.n_poses, 3))

    def norm(S: FloatArray, b: FloatArray) -> float:
        sensor = replace(own.accelerometer, S=S, b=b)
        return _rms(norm_error(sensor, means, zero, gravity_m_s2)[0])

    accel = calibration.accelerometer
    misses = Misses(norm, norm(own.accelerometer.S, own.accelerometer.b))
    found = accelerometer_suspicion(accel.S, accel.b, misses, gravity_m_s2)
    out = [found] if found is not None else []
    gyro, own_gyro = calibration.gyroscope, own.gyroscope
    if gyro is None or own_gyro is None or segments.gyroscope_mean is None or not segments.moves:
        return tuple(out)
    measured = measure_moves(recording, segments, own.accelerometer)
    # A wrong accelerometer would be seen in the tilt as well.
    base = calibration if found is None else own
    tilt = _Tilt(segments, measured)
    rates = segments.gyroscope_mean
    of_gyro = gyroscope_suspicion(
        gyro.S,
        gyro.b,
        own_gyro.S,
        Misses(lambda S, _: tilt.rms_deg(base, S), tilt.rms_deg(own, own_gyro.S)),
        Misses(lambda S, b: _rms(rates @ S.T + b), _rms(rates @ own_gyro.S.T + own_gyro.b)),
    )
    return (*out, of_gyro) if of_gyro is not None else tuple(out)


class _Tilt:
    """Gravity carried through the moves of one log, by any S of the gyro."""

    def __init__(self, segments: Segments, measured: MoveMeasurements) -> None:
        self._segments, self._measured = segments, measured

    def rms_deg(self, calibration: Calibration, S: FloatArray) -> float:
        """Root mean square of the tilt errors [deg]."""
        seen = carried_by(calibration, S, self._measured, self._segments)
        return _rms(seen.angle_deg[~self._measured.is_lost])


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))


# Which single mistake, undone, makes a calibration fit a recording: sign of a bias, direction, unit, axes, gravity.

Pair = tuple[FloatArray, FloatArray]

TEXTBOOK_M_S2 = 10.0
"""The largest gravity that anybody calibrates with."""
NEAREST = 4
"""Mistakes whose undoing is tried on the rotations."""
HALF = 0.5
"""A mistake is named where undoing it at least halves the miss."""
NEAR = 4.0
"""... and leaves no more than this many times what the log's own calibration leaves, which knows the log."""


@dataclass(frozen=True)
class Misses:
    """How far a pair (S, b) of one sensor misses, and how far the log's own does."""

    rms: Callable[[FloatArray, FloatArray], float]
    own: float


def accelerometer_suspicion(S: FloatArray, b: FloatArray, norm: Misses, gravity_m_s2: float) -> Suspicion | None:
    """Of the accelerometer by the length of gravity at rest; no pose knows how the triad as a whole is turned."""
    tried = [*_common(S, b), *_units(S, b, STANDARD_GRAVITY_M_S2), *_axes(S, b)]
    best = _best(tried, norm, norm.rms(S, b))
    # A gravity is a factor that may be anything the Earth has; it is fitted, so it comes last.
    factors = np.linspace(normal_gravity(0.0, 5000.0), TEXTBOOK_M_S2, 401) / gravity_m_s2
    scaled = min(factors, key=lambda k: norm.rms(S / k, b / k))
    wrong = _best([("gravity", S / scaled, b / scaled, float(scaled))], norm, norm.rms(S, b))
    if best is None or (wrong is not None and wrong.rms_undone < best.rms_undone):
        return wrong
    return best


def gyroscope_suspicion(
    S: FloatArray, b: FloatArray, own_S: FloatArray, tilt: Misses, rest: Misses
) -> Suspicion | None:
    """Of the gyro by tilt after rotations (S), where that is sound by the rate at rest (b).

    Rotations are integrated for the mistakes alone whose undoing comes nearest to the log's own ``own_S`` (3, 3).
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
    """The mistake whose undoing leaves least, where it at least halves the miss and comes near the log's own."""
    if base <= NEAR * misses.own:
        return None
    results = [(misses.rms(S, b), kind, factor) for kind, S, b, factor in tried]
    least = min((rms for rms, _, _ in results), default=np.inf)
    if not least < HALF * base or least > NEAR * misses.own:
        return None
    # Of mistakes that are undone as well as one another, the first of the list is the simplest.
    rms, kind, factor = next(one for one in results if one[0] <= 1.01 * least)
    return Suspicion(kind, base, rms, factor)
