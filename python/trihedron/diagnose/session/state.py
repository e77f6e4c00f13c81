"""The session model of the diagnosis: its state, what effects add, and the residual rows.

Unknowns: accelerometer S (lower) and b, gyro S, and for every pose the vertical in the body (2 angles), the gyro bias
and the slow part of the accelerometer bias. Both biases are random walks whose strength comes from the corner time of
the sensor's noise (docs/model-session.md). The arithmetic is :class:`trihedron._core.SessionModel`.
"""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
from scipy.ndimage import gaussian_filter1d

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.diagnose.session.observations import Observations
from trihedron.session.noise import START_STRENGTHS, Strengths, scatter_unit

BLOCKS_OF_WIDTH = 10
"""Blocks of samples per smoothing width: the blocks widen it by a part in 2400, and reduce windows of thousands of
samples to dozens of means."""


def smoothed_slope(values: FloatArray, time_s: FloatArray, width: float) -> FloatArray:
    """(n,) rate of change, per second, of ``values`` (n,) smoothed by a Gaussian of ``width`` samples.

    Timestamps are smoothed too: a straight line keeps its slope across pauses, and to the ends.
    """
    length = max(round(width / BLOCKS_OF_WIDTH), 1)
    starts = np.arange(0, len(values), length)
    if len(starts) < 2:
        return np.zeros(len(values))
    n = np.diff(starts, append=len(values))
    level, time = (np.add.reduceat(of, starts) / n for of in (values, time_s))
    smooth, at = (gaussian_filter1d(of, max(width / length, 1.0), mode="nearest") for of in (level, time))
    return np.interp(time_s, time, np.gradient(smooth, at))


STATIC_ACCEL, STATIC_GYRO, MOVES, DYNAMICS, PRIOR = range(5)
"""Labels of residual rows; ``PRIOR`` rows keep undetermined directions finite and belong to no domain."""


@dataclass(frozen=True, eq=False)
class Prior:
    """Prior mean and covariance of the 18 unknowns of the centred model.

    A given calibration, which the recording may contradict, or, if ``is_weak``, the range of any such instrument.
    """

    mean: FloatArray
    covariance: FloatArray
    is_weak: bool = False


@dataclass(frozen=True, eq=False)
class SessionState:
    """State of the session. ``accel_S``, ``accel_b``, ``gyro_S`` act on centred raw readings; the rest is per pose.

    Biases are in SI; ``strengths`` are the noise strengths of the session.
    """

    gravity: float
    accel_S: FloatArray
    accel_b: FloatArray
    gyro_S: FloatArray
    up: FloatArray
    gyro_bias: FloatArray
    accel_bias: FloatArray
    effect: FloatArray
    strengths: Strengths = START_STRENGTHS


@dataclass(frozen=True, eq=False)
class Distortion:
    """What effects add to the corrected readings, linear in their parameters: SI, body frame.

    ``force`` and ``rate`` (points, 3, K) or None, at the points of ``Trajectory`` (poses, then move samples).
    """

    force: FloatArray | None
    rate: FloatArray | None

    @property
    def n_parameters(self) -> int:
        """Number of effect parameters."""
        given = self.force if self.force is not None else self.rate
        return 0 if given is None else int(given.shape[2])


NO_DISTORTION = Distortion(None, None)


def stacked(parts: list[Distortion]) -> Distortion:
    """Several distortions side by side."""
    parts = [p for p in parts if p.n_parameters]
    if not parts:
        return NO_DISTORTION
    if len(parts) == 1:
        return parts[0]

    def side(name: str) -> FloatArray | None:
        given = [getattr(p, name) for p in parts]
        present = next((g for g in given if g is not None), None)
        if present is None:
            return None
        shape = present.shape[:2]
        blocks = [np.zeros((*shape, p.n_parameters)) if g is None else g for p, g in zip(parts, given, strict=True)]
        return np.concatenate(blocks, axis=2)

    return Distortion(side("force"), side("rate"))


def contiguous(values: FloatArray | None) -> FloatArray | None:
    """Values as a contiguous float64 array for the core."""
    return None if values is None else np.ascontiguousarray(values, dtype=np.float64)


def core_poses(obs: Observations) -> _core.SessionPoses:
    """The poses of some observations, as input of the core."""
    has_rate = obs.pose_rate is not None and obs.pose_rate_sigma is not None and obs.rate_density is not None
    return _core.SessionPoses(
        time_s=np.ascontiguousarray(obs.pose_time_s, dtype=np.float64), force=np.ascontiguousarray(obs.pose_force),
        force_sigma=np.ascontiguousarray(obs.pose_force_sigma),
        force_density=np.ascontiguousarray(obs.force_density), rate=contiguous(obs.pose_rate) if has_rate else None,
        rate_sigma=contiguous(obs.pose_rate_sigma) if has_rate else None,
        rate_density=contiguous(obs.rate_density) if has_rate else None, force_along=obs.force_up,
    )  # fmt: skip


def core_model(
    obs: Observations, gravity_m_s2: float, prior: Prior | None, *, is_scatter_free: bool = False
) -> _core.SessionModel:
    """The Rust model of some observations; with ``is_scatter_free`` biases may differ from pose to pose."""
    scatter = None
    if is_scatter_free:
        unit = scatter_unit(obs.pose_force_sigma, obs.pose_rate_sigma, obs.force_up)
        scatter = (unit, obs.force_scatter / float(unit[0, 0]))
    return _core.SessionModel(
        gravity_m_s2=gravity_m_s2,
        poses=core_poses(obs),
        moves=obs.core_moves,
        noise=(float(obs.jitter_s), 1.0 / obs.recording.rate_hz),
        prior=None
        if prior is None
        else (np.ascontiguousarray(prior.mean), np.ascontiguousarray(prior.covariance), prior.is_weak),
        scatter=scatter,
    )


def core_state(state: SessionState) -> _core.SessionState:
    """A state of the session as input of the Rust model: biases in raw units."""
    return _core.SessionState(
        force_scale=np.ascontiguousarray(state.accel_S),
        force_bias=np.ascontiguousarray(state.accel_b),
        rate_scale=np.ascontiguousarray(state.gyro_S),
        up=np.ascontiguousarray(state.up),
        pose_rate_bias=np.ascontiguousarray(np.linalg.solve(state.gyro_S, state.gyro_bias.T).T),
        pose_force_bias=np.ascontiguousarray(np.linalg.solve(state.accel_S, state.accel_bias.T).T),
        effect=np.ascontiguousarray(state.effect, dtype=np.float64),
    )


def state_of(core: _core.SessionFit, gravity_m_s2: float) -> SessionState:
    """The state where a fit ended, biases in SI."""
    accel_S, gyro_S = np.asarray(core.force_scale), np.asarray(core.rate_scale)
    return SessionState(
        gravity=gravity_m_s2, accel_S=accel_S, accel_b=np.asarray(core.force_bias), gyro_S=gyro_S,
        up=np.asarray(core.up), gyro_bias=core.pose_rate_bias @ gyro_S.T, accel_bias=core.pose_force_bias @ accel_S.T,
        effect=np.asarray(core.effect), strengths=core.strengths,
    )  # fmt: skip
