"""Several calibrations judged on one recording: predictive density, intervals, and the mistake in a wrong one."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.gyroscope.measurements import MoveMeasurements, measure_moves
from trihedron.estimate.session.carried import carried
from trihedron.estimate.suspicions import Misses, accelerometer_suspicion, gyroscope_suspicion
from trihedron.estimate.verification import norm_error
from trihedron.records import Calibration, Recording, Segments, SensorCalibration, Verification
from trihedron.records.ranking import Interval, Suspicion

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
    has_rest = all(len(v.rest_rate) for v in verifications)
    out = []
    for v in verifications:
        parts = [v.norm_error, *([v.angle_deg] if has_angle else []), *([v.rest_rate.ravel()] if has_rest else [])]
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
    measured = measure_moves(recording, segments, own.accelerometer, 3)
    # A wrong accelerometer would be seen in the tilt as well.
    base = calibration if found is None else own
    tilt = _Tilt(recording, segments, measured)
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

    def __init__(self, recording: Recording, segments: Segments, measured: MoveMeasurements) -> None:
        self._time_s = recording.time_s
        self._anchors_s = segments.time_mid_s[measured.links]
        self._measured = measured

    def rms_deg(self, calibration: Calibration, S: FloatArray) -> float:
        """Root mean square of the tilt errors [deg]."""
        accel = calibration.accelerometer
        return _rms(
            carried(self._time_s, self._measured, self._anchors_s, accel.S, accel.b, S).angle_deg[
                ~self._measured.is_lost
            ]
        )


def _rms(values: FloatArray) -> float:
    return float(np.sqrt(np.mean(values**2)))
