"""Input of the session model: pose means, moves and their noise, centred, in raw units."""

from __future__ import annotations

from dataclasses import dataclass, field, replace

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.errors import InputError
from trihedron.estimate.gyroscope.measurements import MoveMeasurements
from trihedron.gravity import earth_rate_up, turned_with_earth
from trihedron.records import Recording, Segments
from trihedron.session.model import LOWER, Prior, SessionReadings
from trihedron.session.noise import measure_noise
from trihedron.session.rounding import UNIFORM
from trihedron.session.support import support_of
from trihedron.transforms import directions_of

EITHER = 0.5
"""Prior mean and standard deviation of ``a``: a sensor of either kind is one standard deviation off."""
OF_FILTERS = 4.0
"""The standard deviation where the noise shows a low-pass: corners at 0.2 of the rate or above are within two."""
DELAY_S = 0.005
"""Prior σ of the delay between the sensors, by filters or readout: data sheets differ by up to some ms."""
Near = tuple[FloatArray, FloatArray, FloatArray]
"""Initial ``S_a`` (3, 3) lower-triangular, ``b_a`` (3,) and ``S_w`` (3, 3)."""
HELD = 1e-7
"""Relative prior σ of a given accelerometer: far below any noise, and above rounding errors in the rows."""
SHOWN = 0.1
"""That of a gyro's scale which turns show: far above their errors, far below those of moves that do not show it."""


@dataclass(frozen=True, eq=False, kw_only=True)
class Observed(SessionReadings):
    """One session for the core: the samples of the ``moves`` with the poses ``before`` (m,) in which they begin.

    ``force_effect``, ``rate_effect`` (poses, then samples of moves, 3, k), raw, are the derivatives of the readings by
    k unknowns with prior σ ``effect_sigma`` (k,): position of the bias inside its LSB, for the ``n_hidden`` axes whose
    noise does not dither it; averaging of readings over their interval, relative to ``EITHER``; errors that all moves
    share; delay of the accelerometer; those of ``causes``, by name. ``effect_time_s`` are the times of their rows,
    ``effect_force`` (rows, 3) the readings of force there, ``pose_lasts_s`` (n,) the lengths of the poses. ``prior`` is
    that of both linear models on centred readings.
    """

    gravity_m_s2: float
    pose_rate: FloatArray
    moves: _core.SessionMoves
    before: IntArray
    timing_s: tuple[float, float]
    force_effect: FloatArray
    rate_effect: FloatArray
    effect_sigma: FloatArray
    effect_time_s: FloatArray
    effect_force: FloatArray
    pose_lasts_s: FloatArray
    n_hidden: int
    causes: dict[str, slice] = field(default_factory=dict)
    prior: Prior | None = None

    def behind_filters(self) -> Observed:
        """The session of sensors with low-pass filters, which smooth more than a mean over the interval does."""
        sigma = self.effect_sigma.copy()
        sigma[self.n_hidden] = OF_FILTERS
        return replace(self, effect_sigma=sigma)

    def model(self) -> _core.SessionModel:
        """The Rust model; bias repeatability from pose to pose is not bounded, but determined by the evidence."""
        return self.core_model(self.gravity_m_s2, self.moves, self.timing_s, self.prior)


def arranged(
    recording: Recording, segments: Segments, measured: MoveMeasurements, gravity_m_s2: float, used: BoolArray,
    near: Near,
) -> Observed:  # fmt: skip
    """Arrange the poses and the moves ``used`` (m,) for the core; one static sample on either side brackets a move."""
    assert recording.accelerometer is not None
    assert recording.gyroscope is not None
    n, rows, readings = recording.n_samples, measured.rows, measured.force
    force_origin, rate_origin = measured.reading.mean(axis=0), measured.bias_read.mean(axis=0)
    ranges: list[tuple[int, int]] = []
    before = []
    for (start, stop), (pose, after), is_used in zip(measured.edges, measured.links, used, strict=True):
        a, b = int(start) - int(rows[start] > 0), int(stop) + int(rows[stop - 1] < n - 1)
        is_whole = np.isfinite(readings[a:b]).all() and np.isfinite(measured.rate[a:b]).all()
        if not is_used or after != pose + 1 or b - a < 3 or not is_whole:
            continue
        ranges.append((a, b))
        before.append(pose)
    if not ranges:
        raise InputError("readings are missing in every move: each row needs both sensors")
    noise, unresolved = measure_noise(recording, segments, [(int(rows[a]), int(rows[b - 1]) + 1) for a, b in ranges])
    force, rate = (_core.sharpened(values, measured.time_s, EITHER) for values in (readings, measured.rate))
    assert noise.pose_rate_sigma is not None
    assert noise.rate_density is not None
    # Variance of rounding and of bridged clipping, in addition to that of any session.
    for k, (a, b) in enumerate(ranges):
        unresolved[k, 3] += measured.reading_variance[a:b].sum(axis=0) * measured.nominal_step_s**2
    pose_time_s = segments.time_mid_s
    # Undithered readings: noise and drift; the position of the bias inside the LSB is a column.
    is_coarse, coarse = measured.is_undithered, np.flatnonzero(measured.is_undithered)
    lasts_s = np.array([pose.stop - pose.start for pose in segments.poses]) * measured.nominal_step_s
    of_coarse = np.sqrt(measured.var_bias + measured.noise_density**2 / lasts_s[:, None])
    own = {
        "pose_rate_sigma": np.where(is_coarse, of_coarse, noise.pose_rate_sigma),
        "rate_density": np.where(is_coarse, measured.noise_density, noise.rate_density),
    }
    edges, moves_before = np.array(ranges, dtype=np.int64), np.array(before, dtype=np.int64)
    kept = np.concatenate([np.arange(a, b) for a, b in ranges])
    effects = _effects(recording, measured, readings, edges, kept)
    pose_rate, leans = np.where(is_coarse, measured.bias, measured.bias_read), np.zeros((len(pose_time_s), 2, 3))
    up = directions_of(measured.reading @ near[0].T + near[1])
    edges_of = [(pose, int(rows[a]), int(rows[b - 1]) + 1) for pose, (a, b) in zip(before, ranges, strict=True)]
    support = support_of(recording, segments.poses, edges_of, noise, (near[2], near[0], up), gravity_m_s2)
    if support is not None and support.yields:
        seen = pose_rate, own["pose_rate_sigma"], unresolved, moves_before
        pose_rate, own["pose_rate_sigma"], unresolved = support.applied(*seen, near[2])
        leans = support.leans
    inverse, earth = np.linalg.inv(near[2]), turned_with_earth(recording.latitude_deg, up)
    own["pose_rate_sigma"] = np.sqrt(own["pose_rate_sigma"] ** 2 + np.einsum("ai,nij,aj->na", inverse, earth, inverse))
    of_moves = left_by_earth(_wrt_room(measured, near[2], moves_before, edges), earth[moves_before])
    unresolved[:, 3] += np.outer(of_moves, np.sum(inverse**2, axis=1))
    moves = _core.SessionMoves(
        pose_time_s=pose_time_s,
        time_s=measured.time_s,
        force=force - force_origin,
        rate=rate - rate_origin,
        ranges=edges,
        before=moves_before,
        unresolved=unresolved,
        leans=leans,
    )
    return Observed(
        **(vars(noise) | own), gravity_m_s2=gravity_m_s2, force_origin=force_origin, rate_origin=rate_origin,
        pose_time_s=pose_time_s, pose_force=measured.reading - force_origin,
        pose_rate=pose_rate - rate_origin, moves=moves,
        before=moves_before, timing_s=(measured.sigma_time_s, measured.nominal_step_s),
        force_effect=effects[0], rate_effect=effects[1],
        effect_sigma=np.array([
            *measured.quantum[coarse] * np.sqrt(UNIFORM), EITHER, *np.ones(measured.shared_errors.shape[2]), DELAY_S,
        ]),
        effect_time_s=np.concatenate([pose_time_s, measured.time_s[kept]]), pose_lasts_s=lasts_s,
        effect_force=np.concatenate([measured.reading, readings[kept]]) - force_origin,
        n_hidden=len(coarse), earth_up_rad_s=earth_rate_up(recording.latitude_deg),
    )  # fmt: skip


def _wrt_room(measured: MoveMeasurements, S: FloatArray, before: IntArray, edges: IntArray) -> FloatArray:
    """Derivatives (m, 3, 3) of rotations over ``edges`` (m, 2) by a constant rate in the room, beside linear biases."""
    m, bias = len(edges), -measured.bias_read[before] @ S.T
    scales, ends_s, quiet = np.repeat(S[None], m, axis=0), np.tile([0.0, 1.0], (m, 1)), np.zeros(3)
    noise = _core.RateNoise(quiet, 0.0, np.inf)
    return _core.integrate_moves(measured.time_s, measured.rate, edges, ends_s, scales, bias, bias, 3, noise)[4]


def left_by_earth(wrt_room: FloatArray, earth: FloatArray) -> FloatArray:
    """Variances (m,) [rad²] along an axis that the Earth's rotation, of covariance ``earth`` (m, 3, 3) in the pose
    before, adds to moves beside biases that are linear between poses and contain it; ``wrt_room`` (m, 3, 3) is the
    derivative of their rotations by it."""
    return np.asarray(np.einsum("mij,mjk,mik->m", wrt_room, earth, wrt_room) / 3.0)


def _effects(
    recording: Recording, measured: MoveMeasurements, readings: FloatArray, edges: IntArray, kept: IntArray
) -> tuple[FloatArray, FloatArray]:
    """``force_effect`` and ``rate_effect`` of :class:`Observed`; ``readings`` (samples, 3) are the accelerometer's,
    ``edges`` (m, 2) and ``kept`` (k,) the samples of the moves."""
    n_poses = len(measured.reading)
    places = np.eye(3)[:, measured.is_undithered]
    force, rate = (
        (values - _core.sharpened(values, measured.time_s, 1.0))[kept] for values in (readings, measured.rate)
    )
    time_s = recording.with_distinct_timestamps().time_s[measured.rows]
    none = np.zeros((*force.shape, places.shape[1]))
    shared = measured.shared_errors[kept]
    slope = _core.move_derivative(time_s, readings, edges)[kept]
    of_force = np.concatenate([none, force[:, :, None], np.zeros(shared.shape), slope[:, :, None]], axis=2)
    hidden = measured.is_hidden[kept][:, :, None] * places
    of_rate = np.concatenate([hidden, rate[:, :, None], shared, np.zeros((*rate.shape, 1))], axis=2)
    at_rest = np.zeros((2, n_poses, *of_rate.shape[1:]))
    at_rest[1, :, :, : places.shape[1]] = places
    return np.concatenate([at_rest[0], of_force]), np.concatenate([at_rest[1], of_rate])


def with_prior(
    observed: Observed, S_a: FloatArray, b_a: FloatArray, S_w: FloatArray, *, is_given: bool, is_shown: bool
) -> Observed:
    """The session with a prior on both linear models: mean ``S_a`` (3, 3) lower-triangular, ``b_a`` (3,) m/s², ``S_w``
    (3, 3); σ is the norm of either scale, and |g| for ``b_a``. The accelerometer is fixed if it ``is_given``; turns
    show the gyro's scale if it ``is_shown``.
    """
    mean = np.concatenate([S_a[LOWER], b_a + S_a @ observed.force_origin, S_w.ravel()])
    sizes = float(np.linalg.norm(S_a, 2)), observed.gravity_m_s2, float(np.linalg.norm(S_w, 2))
    sigma = np.repeat(sizes, (6, 3, 9)) * np.repeat((HELD if is_given else 1.0, SHOWN if is_shown else 1.0), (9, 9))
    return replace(observed, prior=Prior(mean, np.diag(sigma**2), is_weak=True))
