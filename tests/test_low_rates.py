"""Healthy logs at 20 to 50 Hz with ordinary low-pass filters and quick hand moves need no effect.

The logs are made here, from a quaternion at 2 kHz and above, and not by the simulator: filter, sample, round.
"""

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
import pytest

import trihedron
from trihedron.diagnose.effects.timing_jitter import SURE, common_time_variance
from trihedron.diagnose.session.observations import observe

Floats = npt.NDArray[np.float64]

G = 9.80665
ACCEL_LSB, GYRO_LSB = G / 32768, np.radians(1 / 262)
ACCEL_NOISE, GYRO_NOISE = 1.5e-3, 1.4e-4
"""m/s² and rad/s per √Hz: a hobby board."""
CONJUGATE = np.array([1.0, -1.0, -1.0, -1.0])


@dataclass(frozen=True)
class Log:
    """One log: ``mean`` and ``pole`` are a running mean [samples] and the pole of a low-pass at the output rate,
    ``corner`` of a second-order low-pass before sampling [of the rate]; ``tremor`` in degrees, ``late`` the scatter of
    the sampling instants [of the interval].
    """

    seed: int
    rate_hz: int
    move_s: float
    tremor: float = 0.0
    mean: int = 1
    pole: float = 0.0
    corner: float = 0.0
    late: float = 0.0


def _product(p: Floats, q: Floats) -> Floats:
    a, u, b, v = p[:, :1], p[:, 1:], q[:, :1], q[:, 1:]
    scalar = a * b - (u * v).sum(axis=1, keepdims=True)
    return np.hstack([scalar, a * v + b * u + np.cross(u, v)])


def _turned(vector: Floats) -> Floats:
    half = 0.5 * np.linalg.norm(vector, axis=1, keepdims=True)
    return np.hstack([np.cos(half), 0.5 * vector * np.sinc(half / np.pi)])


def _in_body(q: Floats, vector: Floats) -> Floats:
    pure = np.hstack([np.zeros((len(q), 1)), vector])
    return _product(_product(q * CONJUGATE, pure), q)[:, 1:]


def _motion(log: Log, rng: np.random.Generator, fine_hz: int) -> tuple[Floats, Floats]:
    """Force and rate (n, 3) at ``fine_hz``: twelve poses, and moves with a wobble, a tremor and travel of the hand."""
    rests = rng.uniform(3.0, 5.0, 12)
    starts = np.cumsum(rests[:-1]) + log.move_s * np.arange(11)
    t = np.arange(int((rests.sum() + 11 * log.move_s) * fine_hz)) / fine_hz
    q, hand = np.tile(_turned(rng.normal(size=(1, 3))), (len(t), 1)), np.zeros((len(t), 3))
    for start in starts:
        rows = slice(int(start * fine_hz), int((start + log.move_s) * fine_hz) + 2)
        u = np.clip((t[rows] - start) / log.move_s, 0.0, 1.0)[:, None]
        shape = np.sin(np.pi * u) ** 4
        axis, beside, shaken, travel = (v / np.linalg.norm(v) for v in rng.normal(size=(4, 3)))
        hertz, phase = rng.uniform(6.0, 9.0, 3), rng.uniform(0.0, 2.0 * np.pi, 3)
        trembles = np.sin(2.0 * np.pi * hertz * u * log.move_s + phase) * shape
        main = rng.uniform(0.9, 2.2) * axis * u**3 * (10.0 - 15.0 * u + 6.0 * u**2)
        wobble = 0.3 * beside * np.sin(2.0 * np.pi * u) * shape
        for part in (main, wobble, np.radians(log.tremor) * shaken * trembles):
            q[rows] = _product(q[rows], _turned(part))
        q[rows.stop :] = q[rows.stop - 1]
        hand[rows] = 0.05 * travel * shape + 0.001 * log.tremor * trembles
    step = _product(q[:-2] * CONJUGATE, q[2:])
    rate = np.pad(2.0 * step[:, 1:] * np.sign(step[:, :1]) * 0.5 * fine_hz, ((1, 1), (0, 0)))
    acceleration = np.gradient(np.gradient(hand, axis=0), axis=0) * fine_hz**2
    arm, spin = 0.03 * rng.normal(size=3) / np.sqrt(3.0), np.gradient(rate, axis=0) * fine_hz
    force = _in_body(q, acceleration + np.array([0.0, 0.0, G]))
    return force + np.cross(spin, arm) + np.cross(rate, np.cross(rate, arm)), rate


def _filtered(x: Floats, log: Log, fine_hz: int, at: npt.NDArray[np.intp], noise: Floats) -> Floats:
    if log.corner:
        # Butterworth, by its frequency response: the log begins and ends at rest.
        s = 1j * np.fft.rfftfreq(2 * len(x), 1.0 / fine_hz) / (log.corner * log.rate_hz)
        whole = np.fft.rfft(np.vstack([x, x[::-1]]), axis=0) / (1.0 + np.sqrt(2.0) * s + s * s)[:, None]
        x = np.fft.irfft(whole, axis=0)[: len(x)]
    y = x[at] + noise
    if log.mean > 1:
        y = np.apply_along_axis(lambda c: np.convolve(c, np.ones(log.mean) / log.mean, "valid"), 0, y)
    for k in range(1, len(y) if log.pole else 0):
        y[k] += log.pole * (y[k - 1] - y[k])
    return y


def made(log: Log) -> tuple[trihedron.Recording, Floats]:
    """The recording and the gyro's true S."""
    rng, fine = np.random.default_rng(log.seed), -(-2000 // log.rate_hz)
    force, rate = _motion(log, rng, fine * log.rate_hz)
    n = len(force) // fine
    late = np.round(log.late * fine * rng.normal(size=n)).astype(np.intp)
    at = np.clip(fine * np.arange(n, dtype=np.intp) + late, 0, len(force) - 1)
    columns, S_w = [], np.eye(3) + 0.01 * rng.normal(size=(3, 3))
    for x, bias, density, lsb in (
        (force, 0.1, ACCEL_NOISE, ACCEL_LSB), (rate @ np.linalg.inv(S_w).T, 0.005, GYRO_NOISE, GYRO_LSB)
    ):  # fmt: skip
        noise = density * np.sqrt(0.5 * log.rate_hz) * rng.normal(size=(n, 3))
        y = _filtered(x, log, fine * log.rate_hz, at, noise) + bias * rng.normal(size=3)
        columns.append(np.round(y / lsb) * lsb)
    time_s = np.arange(len(columns[0])) / log.rate_hz
    force, rate = columns
    return trihedron.Recording(time_s=time_s, rate_hz=float(log.rate_hz), accelerometer=force, gyroscope=rate), S_w


LOGS = [
    pytest.param(Log(1, 20, 0.9, mean=4), id="running mean over four samples"),
    pytest.param(Log(2, 20, 1.4, tremor=0.3, pole=0.28), id="first order"),
    pytest.param(Log(3, 50, 1.2, tremor=2.0, corner=0.3), id="second order, with a tremor"),
]
REAL = {"lever-arm"}
"""An arm between the centre of rotation and the sensor is part of every log."""


@pytest.mark.parametrize("log", LOGS)
def test_filtered_samples_of_quick_moves_are_explained_without_an_effect(log: Log) -> None:
    recording, S_w = made(log)
    result = trihedron.diagnose(recording, gravity_m_s2=G)
    assert {effect.id for effect in result.effects} <= REAL
    assert result.verdict in ("consistent", "missing-physics")
    found, covariance = result.calibration.gyroscope, result.calibration.covariance
    assert found is not None
    # Nine parameters, of which one in 10⁴ exceeds four standard errors.
    assert (np.abs(found.S - S_w).ravel() < 4.0 * np.sqrt(np.diag(covariance)[12:21])).all()


def test_averaging_is_the_variance_of_the_filter() -> None:
    recording, _ = made(Log(1, 20, 0.9, mean=4))
    calibration = trihedron.calibrate(recording, gravity_m_s2=G).calibration
    # (n² - 1)/12 squared intervals for n samples; its error in such a log is about a tenth.
    assert calibration.averaging == pytest.approx(15.0, rel=0.3)


@pytest.mark.parametrize(("tremor", "late"), [(0.0, 0.0), (2.0, 0.0), (0.0, 0.04), (2.0, 0.1)])
def test_jitter_is_seen_with_and_without_a_tremor_which_is_none(tremor: float, late: float) -> None:
    recording, _ = made(Log(14, 50, 1.4, tremor=tremor, late=late))
    value, spread, _ = common_time_variance(observe(recording, trihedron.segment(recording)))
    assert (value / spread > SURE) == (late > 0.0)
