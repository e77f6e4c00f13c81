"""The session model as the diagnosis and the calibration build it: readings of its poses, its state, its prior.

Unknowns: accelerometer S (lower) and b, gyro S, and for every pose the vertical in the body (2 angles), the gyro bias
and the slow part of the accelerometer bias. Both biases are random walks whose strength comes from the corner time of
the sensor's noise (docs/model-session.md). The arithmetic is :class:`trihedron._core.SessionModel`.
"""

from dataclasses import dataclass
from enum import IntEnum
from typing import NamedTuple

import numpy as np

from trihedron import _core
from trihedron.arrays import AXES, FloatArray
from trihedron.session.noise import SessionNoise
from trihedron.transforms import directions_of

LOWER = np.tril_indices(len(AXES))
"""Indices of a lower-triangular scale, row by row."""
RowDomain = IntEnum("RowDomain", "STATIC_ACCEL STATIC_GYRO MOVES DYNAMICS PRIOR", start=0)
STATIC_ACCEL, STATIC_GYRO, MOVES, DYNAMICS, PRIOR = RowDomain
"""Labels of residual rows; ``PRIOR`` rows keep undetermined directions finite and belong to no domain."""

NOTHING: tuple[None, None, list[float]] = (None, None, [])
"""No further columns, as a hypothesis of the core."""


class Prior(NamedTuple):
    """Prior mean and covariance of the 18 unknowns of the centred model.

    A given calibration, which the recording may contradict, or, if ``is_weak``, the range of any such instrument.
    """

    mean: FloatArray
    covariance: FloatArray
    is_weak: bool = False


@dataclass(frozen=True, eq=False)
class SessionState:
    """State of the session. ``accel_S``, ``accel_b``, ``gyro_S`` act on centred raw readings; the rest is per pose,
    biases in SI."""

    gravity: float
    accel_S: FloatArray
    accel_b: FloatArray
    gyro_S: FloatArray
    up: FloatArray
    gyro_bias: FloatArray
    accel_bias: FloatArray
    effect: FloatArray


@dataclass(frozen=True, eq=False, kw_only=True)
class SessionReadings(SessionNoise):
    """Pose means ``pose_force``, ``pose_rate`` (h, 3) of a session with their noise, relative to ``force_origin``,
    ``rate_origin`` (3,): counts around 32768 would cost the normal equations ten digits.

    ``earth_up_rad_s`` is the Earth's rotation about the vertical, which the gyro reads in every pose; 0 where unknown.
    """

    force_origin: FloatArray
    rate_origin: FloatArray
    pose_time_s: FloatArray
    pose_force: FloatArray
    pose_rate: FloatArray | None
    earth_up_rad_s: float = 0.0

    @property
    def n_poses(self) -> int:
        return len(self.pose_force)

    def core_poses(self) -> _core.SessionPoses:
        """The poses as input of the core."""
        return _core.SessionPoses(
            time_s=self.pose_time_s, force=self.pose_force, force_sigma=self.pose_force_sigma,
            force_density=self.force_density, rate=self.pose_rate, rate_sigma=self.pose_rate_sigma,
            rate_density=self.rate_density, force_along=self.force_up,
        )  # fmt: skip

    def core_model(
        self, gravity_m_s2: float, moves: _core.SessionMoves, timing_s: tuple[float, float], prior: Prior | None
    ) -> _core.SessionModel:
        """The Rust model; ``timing_s``: scatter of the sampling instants, and the sample interval."""
        unit = self.scatter_unit()
        return _core.SessionModel(
            gravity=(gravity_m_s2, self.earth_up_rad_s), poses=self.core_poses(), moves=moves, noise=timing_s,
            prior=prior, scatter=(unit, self.force_scatter / float(unit[0, 0])),
        )  # fmt: skip

    def at_means(
        self, gravity_m_s2: float, accel_S: FloatArray, accel_b: FloatArray, gyro_S: FloatArray, n_effects: int = 0
    ) -> SessionState:
        """The state with S and b on centred readings, every pose at its measured vertical and gyro bias."""
        up, none = directions_of(self.pose_force @ accel_S.T + accel_b), np.zeros((self.n_poses, 3))
        bias = none if self.pose_rate is None else self.pose_rate @ gyro_S.T
        return SessionState(gravity_m_s2, accel_S, accel_b, gyro_S, up, bias, none, np.zeros(n_effects))


def misfits(core: _core.SessionFit) -> tuple[FloatArray, FloatArray]:
    """χ² (4,) and degrees of freedom (4,) of a fit by domain, the label of the rows."""
    domain, n = core.labels[:, 0], PRIOR + 1
    chi2, dof = (np.bincount(domain, of_rows, n)[:PRIOR] for of_rows in (core.residual**2, 1.0 - core.leverage()))
    return np.asarray(chi2, dtype=np.float64), np.asarray(dof, dtype=np.float64)


def core_state(state: SessionState) -> _core.SessionState:
    """A state of the session as input of the Rust model: biases in raw units."""
    return _core.SessionState(
        force_scale=state.accel_S, force_bias=state.accel_b, rate_scale=state.gyro_S, up=state.up, effect=state.effect,
        pose_rate_bias=np.asarray(np.linalg.solve(state.gyro_S, state.gyro_bias.T).T, dtype=np.float64),
        pose_force_bias=np.asarray(np.linalg.solve(state.accel_S, state.accel_bias.T).T, dtype=np.float64),
    )  # fmt: skip


def state_of(core: _core.SessionFit, gravity_m_s2: float) -> SessionState:
    """The state where a fit ended, biases in SI."""
    accel_S, gyro_S = np.asarray(core.force_scale), np.asarray(core.rate_scale)
    return SessionState(
        gravity=gravity_m_s2, accel_S=accel_S, accel_b=np.asarray(core.force_bias), gyro_S=gyro_S,
        up=np.asarray(core.up), gyro_bias=core.pose_rate_bias @ gyro_S.T, accel_bias=core.pose_force_bias @ accel_S.T,
        effect=np.asarray(core.effect),
    )  # fmt: skip
