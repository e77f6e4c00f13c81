"""Signals that effects are computed from: the motion of the fitted session along every sensor axis, and logged ones."""

from collections.abc import Mapping
from dataclasses import dataclass
from functools import cached_property

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, FloatArray, IntArray
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.solve import Fit
from trihedron.sensor_model import axis_scales

VIBRATION_WINDOW_S = 0.25
"""Window of the parabola that follows the motion while vibration is measured in a move."""


@dataclass(frozen=True, eq=False)
class Context:
    """Signals at the *points* of the session (one per pose, then every sample of every move), SI, body frame.

    Everything is computed from the fitted session, its motion corrected by S, b and the effects (eq. 11.3), when first
    used.
    """

    fitted: Fit

    @property
    def obs(self) -> Observations:
        return self.fitted.obs

    # -- time and layout ------------------------------------------------------------------------------------------
    @property
    def n_points(self) -> int:
        return len(self.force)

    @cached_property
    def move_edges(self) -> IntArray:
        """(moves, 2) first point of each move and one past its last."""
        ends = self.obs.n_poses + np.cumsum([0, *(stop - start for start, stop in self.obs.move_ranges)])
        return np.stack([ends[:-1], ends[1:]], axis=1)

    @cached_property
    def moves(self) -> tuple[slice, ...]:
        return tuple(slice(*ends) for ends in self.move_edges.tolist())

    @cached_property
    def point_samples(self) -> IntArray:
        """(points,) index of the sample."""
        mid = np.array([(pose.start + pose.stop) // 2 for pose in self.obs.segments.poses], dtype=np.int64)
        return np.concatenate([mid, *(np.arange(*ends) for ends in self.obs.move_ranges)])

    @cached_property
    def time_s(self) -> FloatArray:
        """(points,) middle of each pose, time of each sample."""
        times = self.obs.time_s[self.point_samples]
        times[: self.obs.n_poses] = self.obs.pose_time_s
        return times

    @cached_property
    def elapsed(self) -> FloatArray:
        """(points,) time from 0 at the first to 1 at the last sample of the recording."""
        return np.asarray((self.time_s - self.obs.time_s[0]) / max(self.obs.time_s[-1] - self.obs.time_s[0], TINY))

    # -- motion ---------------------------------------------------------------------------------------------------
    @cached_property
    def _motion(self) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        return self.fitted.core.path()

    @property
    def rate(self) -> FloatArray:
        """(points, 3) angular rate: zero in poses."""
        return self._motion[0]

    @property
    def force(self) -> FloatArray:
        """(points, 3) specific force: exactly g along the fitted vertical in poses."""
        return self._motion[1]

    @property
    def turned(self) -> FloatArray:
        """(points, 3, 3) rotation since the move began."""
        return self._motion[3]

    def derivative(self, values: FloatArray) -> FloatArray:
        """(points, 3) time derivative inside moves; zero in poses."""
        return _core.move_derivative(self.time_s, values, self.move_edges)

    def shifted(self, values: FloatArray, ahead_s: float) -> FloatArray:
        """(points, 3) values at a time ``ahead_s`` later inside moves, constant beyond their ends; unchanged in poses.

        By a cubic spline per move with zero slope at its ends: linear interpolation would be a low-pass of its own.
        """
        return _core.move_shifted(self.time_s, np.asarray_chkfinite(values), self.move_edges, ahead_s)

    @cached_property
    def angular_acceleration(self) -> FloatArray:
        """(points, 3) derivative of angular rate."""
        return self.derivative(self.rate)

    @property
    def gravity_in_moves(self) -> FloatArray:
        """(points, 3) minus gravity in the body, propagated by the gyro from each move's start; ``force`` in poses."""
        return self._motion[2]

    @cached_property
    def norm_columns(self) -> FloatArray:
        """(poses, 9) what the norm of gravity reads of S and b: the vertical and its products."""
        up = self.fitted.state.up
        return np.column_stack([up, *(up[:, j] * up[:, k] for j in range(3) for k in range(j, 3))])

    def static_errors(self, sensor: int) -> FloatArray:
        """(poses, 3) what the means over the poses read beyond gravity and the effects of the hypothesis, SI, body."""
        obs, state, distortion = self.obs, self.fitted.state, self.fitted.distortion
        if sensor:
            assert obs.pose_rate is not None
            error, effects = obs.pose_rate @ state.gyro_S.T, distortion.rate
        else:
            error, effects = (
                obs.pose_force @ state.accel_S.T + state.accel_b - state.gravity * state.up,
                distortion.force,
            )
        return np.asarray(error if effects is None else error - effects[: len(error)] @ state.effect)

    # -- sensor axes ----------------------------------------------------------------------------------------------
    @cached_property
    def accel_axes(self) -> FloatArray:
        """(3, 3) columns: change of corrected force when accelerometer j alone reads 1 m/s² more along its own axis."""
        return _sensor_axes(self.fitted.state.accel_S)

    @cached_property
    def gyro_axes(self) -> FloatArray:
        """(3, 3) columns: change of corrected rate when gyro j alone reads 1 rad/s more along its own axis."""
        return _sensor_axes(self.fitted.state.gyro_S)

    @cached_property
    def axis_force(self) -> FloatArray:
        """(points, 3) specific force along each accelerometer's own axis."""
        return self.force @ np.linalg.inv(self.accel_axes).T

    @cached_property
    def axis_rate(self) -> FloatArray:
        """(points, 3) angular rate along each gyro's own axis."""
        return self.rate @ np.linalg.inv(self.gyro_axes).T

    def axis_motion(self, sensor: int) -> FloatArray:
        """(points, 3) :attr:`axis_force` of sensor 0, :attr:`axis_rate` of sensor 1."""
        return self.axis_rate if sensor else self.axis_force

    def on_axes(self, sensor: int, values: FloatArray) -> FloatArray:
        """(points, 3, 3) columns: parameter j times ``values[:, j]`` added to the reading of axis j of a sensor."""
        # ``axes[i, j] · values[:, j]`` as one matrix product, which is faster than row by row.
        spread = np.zeros((3, 3, 3))
        spread[range(3), :, range(3)] = (self.gyro_axes if sensor else self.accel_axes).T
        return np.asarray((values @ spread.reshape(3, 9)).reshape(-1, 3, 3))

    # -- whole-recording signals ----------------------------------------------------------------------------------
    def at_points(self, samples: FloatArray) -> FloatArray:
        """Values of a whole-recording signal (n, ...) at the points: pose means, then move samples."""
        out = np.array(samples[self.point_samples], dtype=np.float64)
        out[: self.obs.n_poses] = self.obs.pose_means(samples)
        return out

    @cached_property
    def history(self) -> FloatArray:
        """(n, 3) specific force along the accelerometer axes at every sample; in poses that of the fitted vertical."""
        obs, state = self.obs, self.fitted.state
        force = obs.raw_force @ state.accel_S.T + state.accel_b
        for i, pose in enumerate(obs.segments.poses):
            force[pose.start : pose.stop] = state.gravity * state.up[i]
        return np.asarray(np.where(np.isfinite(force), force, 0.0) @ np.linalg.inv(self.accel_axes).T)

    def _logged(self, name: str) -> FloatArray | None:
        """A logged channel (n,) of the recording, if it has any value."""
        logged: FloatArray | None = getattr(self.obs.recording, name)
        return None if logged is None or not np.isfinite(logged).any() else logged

    @staticmethod
    def _filled(logged: FloatArray) -> FloatArray:
        """A logged channel with its mean in place of missing values."""
        return np.where(np.isfinite(logged), logged, np.nanmean(logged))

    @cached_property
    def temperature(self) -> FloatArray | None:
        """(points,) logged temperature minus its mean, °C."""
        logged = self._logged("temperature_degc")
        return None if logged is None else np.nan_to_num(self.at_points(logged) - self.references["temperature_degc"])

    def die_temperature(self, lag_s: float) -> FloatArray:
        """(points,) temperature of which the logged one is a low-pass with the time constant ``lag_s``, minus the mean
        of the logged one, °C; at a negative one the die's is such a low-pass of the logged one."""
        logged, now, rate = self._logged("temperature_degc"), self.temperature, self.temperature_rate
        assert logged is not None
        assert now is not None
        assert rate is not None
        if lag_s >= 0.0:
            return np.asarray(now + lag_s * rate)
        filled = np.tile(self._filled(logged)[:, None], 3)
        late = _core.simulate_first_order(filled, 1.0 / self.obs.recording.rate_hz, (-lag_s,) * 3)[:, 0]
        return self.at_points(late) - self.references["temperature_degc"]

    @cached_property
    def temperature_rate(self) -> FloatArray | None:
        """(points,) rate of change of the logged temperature, K/s, smoothed as little as its thermometer allows."""
        recording, logged = self.obs.recording, self._logged("temperature_degc")
        if logged is None:
            return None
        return self.at_points(_core.channel_slope(self._filled(logged), recording.time_s, recording.rate_hz))

    @cached_property
    def supply(self) -> FloatArray | None:
        """(points,) relative deviation of the logged supply voltage from its mean."""
        logged = self._logged("supply_v")
        return None if logged is None else np.nan_to_num(self.at_points(logged) / self.references["supply_v"] - 1.0)

    @property
    def references(self) -> Mapping[str, float]:
        """Means subtracted from (or dividing) the logged signals: needed to apply the model to another recording."""
        known = {name: self._logged(name) for name in ("temperature_degc", "supply_v")}
        n = self.obs.n_poses
        return {k: float(np.nanmean(self.at_points(v)[:n])) for k, v in known.items() if v is not None}

    @cached_property
    def pose_power(self) -> FloatArray:
        """(poses, 3) variance of the accelerometer inside each pose, SI², along the body axes."""
        force, poses = self.obs.raw_force @ self.fitted.state.accel_S.T, self.obs.segments.poses
        return np.array([np.nanvar(force[pose.samples()], axis=0) for pose in poses])

    def si_per_raw(self, sensor: int) -> FloatArray:
        """(3,) SI size of one raw unit along each axis of sensor 0 (accelerometer) or 1 (gyro)."""
        state = self.fitted.state
        return axis_scales(state.gyro_S if sensor else state.accel_S)

    @cached_property
    def vibration_power(self) -> FloatArray:
        """(points, 3) vibration power above that of the quietest pose, SI²: variance in a pose, running mean square in
        a move.

        In moves the slow motion is removed by a local parabola. The part of the vibration that the parabola removes
        too is restored by the ratio found in the vibrating poses.
        """
        obs, S, poses = self.obs, self.fitted.state.accel_S, self.pose_power
        width = max(round(VIBRATION_WINDOW_S * obs.recording.rate_hz), 7) | 1
        spans = obs.segments.spans.tolist()
        still = (_core.roughness(obs.raw_force[start:stop] @ S.T, width) for start, stop in spans)
        inside = np.array([power.mean(axis=0) for power in still])
        quiet, floor = (power.min(axis=0) for power in (inside, poses))
        passed = np.clip((inside - quiet).sum() / max(float((poses - floor).sum()), TINY), 0.1, 1.0)
        in_moves = [(_core.roughness(self.force[where], width) - quiet) / passed for where in self.moves]
        return np.asarray(np.maximum(np.concatenate([poses - floor, *in_moves]), 0.0))

    def between_poses(self, per_pose: FloatArray) -> FloatArray:
        """(points, ...) a quantity of the poses, interpolated in moves by the fraction of the angle turned so far."""
        out = np.zeros((self.n_points, *per_pose.shape[1:]))
        out[: self.obs.n_poses] = per_pose
        for where, (before, after) in zip(self.moves, self.obs.move_poses, strict=True):
            size = np.linalg.norm(self.rate[where], axis=1)
            turned = np.concatenate([[0.0], np.cumsum(0.5 * (size[1:] + size[:-1]) * np.diff(self.time_s[where]))])
            blend = (turned / max(turned[-1], TINY)).reshape(-1, *([1] * (per_pose.ndim - 1)))
            out[where] = per_pose[before] * (1 - blend) + per_pose[after] * blend
        return out

    @cached_property
    def attitude(self) -> FloatArray:
        """(points, 3, 3) local level (z up, arbitrary azimuth) → body, rotated by the gyro in moves, levelled in poses.

        Poses that no chain of moves reaches have NaN but for the vertical, which gravity shows.
        """
        return self.fitted.core.attitude()

    @cached_property
    def noise_density(self) -> FloatArray:
        """(2, 3) white noise, SI per √Hz: accelerometer, gyro."""
        obs, state = self.obs, self.fitted.state
        raw = obs.force_density, np.zeros(3) if obs.rate_density is None else obs.rate_density
        return np.array([np.sqrt(S**2 @ of**2) for S, of in zip((state.accel_S, state.gyro_S), raw, strict=True)])


def _sensor_axes(S: FloatArray) -> FloatArray:
    """(3, 3) columns: change of corrected readings when one sensor alone reads one unit more along its own axis."""
    return np.asarray(S / axis_scales(S))
