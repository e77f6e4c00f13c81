"""Rates of known size in a session: ``|S w̄ + b| = W``, w̄ the mean reading of a rotation about any axis.

It is the norm fit of an accelerometer's poses with another constant (docs/model-gyroscope.md). The rows update the
posterior of poses and moves of the same log, so that the frame stays that of the accelerometer. Here W is the speed of
a rate table; `stated_turns.py` has turns by known angles.
"""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import BoolArray, FloatArray, rms_of
from trihedron.errors import InputError
from trihedron.estimate.accelerometer.norm import gravity_quality
from trihedron.estimate.case_frame import CaseFit, CaseRows, solved
from trihedron.estimate.gyroscope.measurements import measure_moves
from trihedron.estimate.session.carried import carried_by, move_quality, without_g_sensitivity
from trihedron.probability import FALSE_ALARM, fdtrc
from trihedron.ranges import ranges_of
from trihedron.records import Calibration, Finding, FitQuality, Recording, Segments, SensorCalibration
from trihedron.records.checked import number_of
from trihedron.sensor_model import norms
from trihedron.session.noise import NOISE_DOF
from trihedron.session.rounding import undithered_axes

ITERATIONS = 20
SCATTER = "scatter"


@dataclass(frozen=True, eq=False)
class StatedRates:
    """Mean readings (k, 3) with their covariances (k, 3, 3) at ``speeds`` (k,) [rad/s] with a common relative error.

    ``shared`` (k, 3, m) are m further errors of the mean readings, one standard deviation each; ``unit`` (k,) is the
    change of each speed [rad/s] by a scatter of one.
    """

    mean: FloatArray
    covariance: FloatArray
    shared: FloatArray
    speeds: FloatArray
    unit: FloatArray
    relative_sigma: float = 0.0

    def of(self, used: BoolArray) -> StatedRates:
        """The rates ``used`` (k,)."""
        rows = (self.mean[used], self.covariance[used], self.shared[used], self.speeds[used], self.unit[used])
        return StatedRates(*rows, self.relative_sigma)

    def predicted(self, values: FloatArray) -> tuple[FloatArray, FloatArray]:
        """Speeds (k,) [rad/s], and their derivatives (k, 24) by the parameters of both sensors."""
        speed, slope = norms(self.mean, values[12:21].reshape(3, 3), values[21:])
        return speed, np.pad(slope, ((0, 0), (12, 0)))

    def on(self, calibration: Calibration, scatter: float = 0.0) -> Updated:
        """The calibration updated with these rates of so much ``scatter``, relinearised until it converges."""
        start, none = parameters_of(calibration), np.zeros((24, 0))
        by_reading = self.predicted(start)[1][:, 21:] @ start[12:21].reshape(3, 3)
        own = np.einsum("ki,kij,kj->k", by_reading, self.covariance, by_reading)
        together = np.einsum("ki,kim->km", by_reading, self.shared)
        noise = np.diag(own) + together @ together.T + np.outer(self.speeds, self.speeds) * self.relative_sigma**2
        values = start
        for _ in range(ITERATIONS):
            speed, slope = self.predicted(values)
            rows = CaseRows(slope, self.speeds - speed + slope @ values, noise, {SCATTER: np.diag(self.unit)})
            fit = solved(start, calibration.covariance, none, rows, {SCATTER: scatter})
            last, values = values, fit.values
            if np.max(np.abs(values - last)[12:]) <= 1e-12 * np.max(np.abs(start[12:])):
                break
        left = self.speeds - self.predicted(values)[0]
        chi2 = float(left @ np.linalg.solve(noise + np.diag((scatter * self.unit) ** 2), left))
        is_fitted = fdtrc(float(len(left)), NOISE_DOF, chi2 / len(left)) >= FALSE_ALARM
        return Updated(**vars(fit), left=left, is_fitted=is_fitted)

    def scattered_on(self, calibration: Calibration) -> Updated:
        """The calibration updated with these rates, and with the scatter that they show: that with which χ² is its
        degrees of freedom, where they deviate by more than all known errors."""
        found, dof = self.on(calibration), len(self.speeds)
        if dof < 1 or fdtrc(float(dof), NOISE_DOF, found.chi2 / dof) >= FALSE_ALARM:
            return found
        from scipy.optimize import brentq

        most = 2.0 * float(np.sqrt(np.sum((found.misfit / self.unit) ** 2) / dof))
        return self.on(calibration, float(brentq(lambda one: self.on(calibration, one).chi2 - dof, 0.0, most)))


@dataclass(frozen=True, eq=False)
class Updated(CaseFit):
    """Parameters of both sensors (24,), updated with rates; ``left`` (k,) [rad/s] of these differs from them, by no
    more than their noise and scatter where the update ``is_fitted``."""

    left: FloatArray
    is_fitted: bool

    @property
    def scatter(self) -> float:
        """Scatter of the rates, which the session predicts, in changes of one."""
        return self.sizes[SCATTER]


def moved_to(
    calibration: Calibration, values: FloatArray, covariance: FloatArray, recording: Recording, segments: Segments
) -> Calibration:
    """The calibration with parameters ``values`` (24,), and with residuals of poses and moves at them."""
    assert calibration.gyroscope is not None
    shift = values - parameters_of(calibration)
    # The shift from the optimum of poses and moves increases their χ² by this, to first order.
    cost = float(shift @ np.linalg.pinv(calibration.covariance, hermitian=True) @ shift)
    after = replace(
        calibration,
        accelerometer=with_parameters(calibration.accelerometer, values[:12], covariance[:12, :12]),
        gyroscope=with_parameters(calibration.gyroscope, values[12:], covariance[12:, 12:]),
        covariance=covariance,
    )
    return with_own_residuals(after, recording, segments, cost)


def parameters_of(calibration: Calibration) -> FloatArray:
    """Parameters (24,) of both sensors, in the order of the covariance."""
    gyro = calibration.gyroscope
    assert gyro is not None
    accelerometer = calibration.accelerometer
    return np.concatenate([accelerometer.S.ravel(), accelerometer.b, gyro.S.ravel(), gyro.b])


def with_parameters(sensor: SensorCalibration, values: FloatArray, covariance: FloatArray) -> SensorCalibration:
    """The sensor with parameters ``values`` (12,) and their ``covariance``."""
    return replace(sensor, S=values[:9].reshape(3, 3), b=values[9:], covariance=covariance)


def with_own_residuals(calibration: Calibration, recording: Recording, segments: Segments, cost: float) -> Calibration:
    """The calibration with residuals of poses and moves at its S and b; ``cost`` is the increase of the moves' χ².

    Held-out gravity errors stay those of the fit without these rows, which only narrow it; those of moves are removed.
    """
    accelerometer, gyroscope = calibration.accelerometer, calibration.gyroscope
    if accelerometer.quality is not None and segments.accelerometer_mean is not None:
        found = _of_poses(accelerometer, accelerometer.quality, segments, calibration.gravity_m_s2)
        accelerometer = replace(accelerometer, quality=found)
    if gyroscope is not None and gyroscope.quality is not None and gyroscope.quality.angle_deg is not None:
        before = gyroscope.quality
        measured = without_g_sensitivity(measure_moves(recording, segments, calibration.accelerometer), calibration)
        seen = carried_by(calibration, gyroscope.S, measured, segments)
        used = np.ones(len(seen.angle_deg)) if before.weights is None else before.weights
        after = move_quality(calibration.gravity_m_s2, seen, None, used, (before.chi2 + cost, before.dof))
        after = replace(after, n_iterations=before.n_iterations, stopped_because=before.stopped_because)
        gyroscope = replace(gyroscope, quality=after)
    return replace(calibration, accelerometer=accelerometer, gyroscope=gyroscope)


def _of_poses(sensor: SensorCalibration, quality: FitQuality, segments: Segments, gravity_m_s2: float) -> FitQuality:
    assert segments.accelerometer_mean is not None
    if len(quality.residual) != segments.n_poses:
        return quality
    residual = norms(segments.accelerometer_mean, sensor.S, sensor.b)[0] - gravity_m_s2
    seen = gravity_quality(residual, quality.sigma, quality.dof, None)
    return replace(quality, residual=residual, chi2=seen.chi2, rms=seen.rms, rms_dof=seen.rms_dof)


# A rate table at known speeds, the unit on it in any orientation.


BLOCK_S = 0.2
"""Length of a block of readings: its noise is small against the speed, which is constant over a block."""
STEADY = 0.01
"""Relative change of speed within a steady turn: the table's control. A hand is not as steady for a second."""
SHORTEST_S = 1.0
NOISE = 6.0
"""Standard errors of a block's mean by which a steady rate may deviate."""
SLOWEST = 20.0
"""Smallest rate of a turn, in standard errors of a block's mean."""


def plateaus(recording: Recording, segments: Segments) -> tuple[list[tuple[int, int]], FloatArray, FloatArray]:
    """Stretches of steady rotation of ``SHORTEST_S`` or longer, in the moves between poses: half-open ranges (k), mean
    reading (k, 3) raw and its covariance (k, 3, 3)."""
    assert recording.gyroscope is not None
    assert segments.gyroscope_mean is not None
    assert segments.gyroscope_sigma is not None
    rate, quantum = recording.gyroscope, recording.facts.of("gyroscope").step
    size = max(round(BLOCK_S * recording.rate_hz), 4)
    noise = np.hypot(segments.gyroscope_sigma, quantum / np.sqrt(12.0))
    rest = segments.gyroscope_mean.mean(axis=0)
    spans, means, covariances = [], [], []
    for move in segments.moves:
        n = (move.stop - move.start) // size
        blocks = rate[move.start : move.start + n * size].reshape(n, size, 3).mean(axis=1)
        for first, last in _steady(blocks, rest, noise / np.sqrt(size)):
            if (last - first) * size < SHORTEST_S * recording.rate_hz:
                continue
            mine = blocks[first:last]
            spans.append((move.start + first * size, move.start + last * size))
            means.append(mine.mean(axis=0))
            white = np.diag(noise**2) / ((last - first) * size)
            hidden = np.diag(np.where(undithered_axes(quantum, segments.gyroscope_sigma), quantum**2 / 12.0, 0.0))
            covariances.append(np.maximum(white, np.diag(mine.var(axis=0, ddof=1) / (last - first))) + hidden)
    return spans, np.array(means).reshape(-1, 3), np.array(covariances).reshape(-1, 3, 3)


def _steady(blocks: FloatArray, rest: FloatArray, sigma: FloatArray) -> list[tuple[int, int]]:
    """Runs of block means (n, 3) within noise and ``STEADY`` of the run's second one, without the first and last."""
    away = np.linalg.norm(blocks - rest, axis=1)
    is_turning = np.all(np.isfinite(blocks), axis=1) & (away > SLOWEST * np.linalg.norm(sigma))
    out = []
    for begin, end in ranges_of(is_turning):
        first = begin
        while first < end:
            level = min(first + 1, end - 1)
            allowed = STEADY * away[level] + NOISE * np.sqrt(2.0) * float(np.linalg.norm(sigma))
            apart = np.linalg.norm(blocks[first:end] - blocks[level], axis=1) > allowed
            last = first + max(int(np.argmax(apart)), 1) if np.any(apart) else end
            # The first and the last block may contain part of a ramp.
            if last - first > 3:
                out.append((first + 1, last - 1))
            first = last
    return out


def on_turntable(
    calibration: Calibration,
    recording: Recording,
    segments: Segments,
    speeds_deg_s: Sequence[float] | None,
    relative_sigma: float = 0.0,
) -> Calibration:
    """The calibration updated with the speeds of a turntable in the same log, for any orientation of the unit on it.

    ``speeds_deg_s`` is one for all steady turns, or one a turn in the order of the log; 0 excludes a turn, signs do not
    matter. ``relative_sigma`` is the standard error of the table's speed, common to all turns (0.001: one part in a
    thousand). Raises ``InputError`` when there is no gyro, no steady turn, or another number of them than of speeds.
    """
    if not 0.0 <= number_of("turntable_sigma", relative_sigma) < 0.5:
        raise InputError(f"turntable_sigma is a relative error such as 0.001, not {relative_sigma}.")
    if speeds_deg_s is None:
        raise InputError("turntable_sigma is the error of turntable_deg_s: give the speeds, too.")
    if recording.gyroscope is None:
        raise InputError("a turntable calibrates the gyro, and this log has none.")
    if calibration.gyroscope is None:
        return calibration  # a finding says why the poses leave the gyro out
    spans, mean, covariance = plateaus(recording, segments)
    speeds = _speeds(spans, speeds_deg_s, recording.rate_hz)
    used = speeds > 0.0
    unshared = np.zeros((len(speeds), 3, 0))
    rates = StatedRates(mean, covariance, unshared, speeds, speeds, relative_sigma).of(used)
    updated = rates.scattered_on(calibration)
    if not updated.is_fitted:
        return replace(calibration, findings=(*calibration.findings, not_fitted(rates, updated, is_turned=False)))
    said = _said(rates, updated, rates.predicted(parameters_of(calibration))[0])
    after = moved_to(calibration, updated.values, updated.covariance, recording, segments)
    return replace(after, findings=(*calibration.findings, said))


def _speeds(spans: list[tuple[int, int]], speeds_deg_s: Sequence[float], rate_hz: float) -> FloatArray:
    n, given = len(spans), np.abs(np.radians(np.asarray(speeds_deg_s, dtype=np.float64)))
    if not np.isfinite(given).all() or not np.any(given > 0.0):
        raise InputError("speeds of a turntable are numbers in °/s: one for all turns, or one each; 0 leaves one out.")
    if n == 0:
        raise InputError("no steady turn of a second or longer was found: let the table run at its speed for 5 s.")
    if len(given) not in (1, n):
        at = ", ".join(f"{begin / rate_hz:.1f}-{end / rate_hz:.1f}" for begin, end in spans[:40])
        raise InputError(
            f"{len(given)} speeds were given and {n} steady turns were found (seconds {at}): "
            "give one for all, or one a turn; 0 leaves a turn out."
        )
    return np.broadcast_to(given, (n,)).copy()


def not_fitted(rates: StatedRates, updated: Updated, *, is_turned: bool) -> Finding:
    """Finding on rates that the update leaves off by more than noise: it did not converge."""
    rms = rms_of(updated.left / rates.speeds)
    return Finding.of("turntable", "not-fitted", turns=len(rates.speeds), is_turned=is_turned, rms=rms)


def _said(rates: StatedRates, updated: Updated, seen: FloatArray) -> Finding:
    """Finding on the speeds, of which moves and poses give ``seen`` (k,) [rad/s]."""
    turns, rms = len(seen), rms_of(updated.left / rates.speeds)
    if updated.scatter == 0.0:
        return Finding.of("turntable", turns=turns, rms_percent=100.0 * rms)
    off = seen / rates.speeds - 1.0
    worst = int(np.argmax(np.abs(off)))
    return Finding.of(
        "turntable",
        "contradicting",
        turns=turns,
        seen_rad_s=seen[worst],
        stated_rad_s=rates.speeds[worst],
        rms=rms_of(off),
        common_percent=100.0 * float(np.mean(off)),
        numbers={"scatter": updated.scatter, "sigma": rates.relative_sigma},
    )
