"""What the two sensors make of a motion: misaligned, offset, noisy, rounded to the LSB."""

from dataclasses import dataclass

import numpy as np

from confidence.motion import G
from trihedron.records import Recording

DEG = np.pi / 180.0


@dataclass
class Truth:
    """Direct models (raw to SI) in the body's own frame."""

    S_f: np.ndarray
    b_f: np.ndarray
    S_w: np.ndarray
    b_w: np.ndarray


def one_over_f(n, rate_hz, rng):
    """(n, 3) noise whose spectrum is B²/(2πf) with B = 1, by filtering in the frequency domain on twice the length."""
    size = 2 * n
    f = np.fft.rfftfreq(size, 1.0 / rate_hz)
    gain = np.zeros_like(f)
    gain[1:] = np.sqrt(1.0 / (2.0 * np.pi * f[1:]))
    white = np.fft.rfft(rng.normal(size=(size, 3)) * np.sqrt(rate_hz), axis=0)
    # One-sided density 1/(2πf) of unit B is half of it on each side.
    x = np.fft.irfft(white * gain[:, None] / np.sqrt(2.0), size, axis=0)[:n]
    # The zero that a calibration can know is that of its day; what it does on other days is the noise curve's to say.
    return x - x.mean(axis=0)


def read_out(
    motion,
    per,
    rng,
    gyro_bits=16,
    accel_bits=16,
    gyro_density=0.005 * DEG,
    accel_density=1.2e-3,
    gyro_flicker=2.0 / 3600.0 * DEG,
    accel_flicker=2e-4,
    gyro_range=500.0 * DEG,
    accel_range=2.2 * G,
    g_sensitivity=0.0,
):
    """Counts (n, 3) of accelerometer and gyro, the rate [Hz] and the truth.

    A density N in unit/√Hz gives readings of variance N² · rate; flicker is the coefficient B; elements of the
    g-sensitivity are drawn with the standard deviation given.
    """
    rate_hz = 1.0 / (motion.step * per)
    at = np.arange(0, len(motion.w) - 1, per)
    R = motion.q[at].as_matrix()
    # Rate at a node: mean of the steps on both sides.
    before = np.maximum(at - 1, 0)
    w = 0.5 * (motion.w[before] + motion.w[at])
    f = np.einsum("nji,nj->ni", R, motion.a[at] + np.array([0.0, 0.0, G]))
    n = len(at)
    w_step = 2.0 * gyro_range / 2**gyro_bits
    f_step = 2.0 * accel_range / 2**accel_bits
    own_w = np.eye(3) + rng.normal(size=(3, 3)) * 0.01
    own_f = np.eye(3) + rng.normal(size=(3, 3)) * 0.01
    zero_w = rng.normal(size=3) * 0.7 * DEG
    zero_f = rng.normal(size=3) * 0.3
    if g_sensitivity:
        w = w + f @ rng.normal(size=(3, 3)).T * g_sensitivity
    w = w @ own_w.T + zero_w
    f = f @ own_f.T + zero_f
    w += rng.normal(size=(n, 3)) * gyro_density * np.sqrt(rate_hz) + gyro_flicker * one_over_f(n, rate_hz, rng)
    f += rng.normal(size=(n, 3)) * accel_density * np.sqrt(rate_hz) + accel_flicker * one_over_f(n, rate_hz, rng)
    w_counts = np.clip(np.round(w / w_step), -(2 ** (gyro_bits - 1)), 2 ** (gyro_bits - 1) - 1)
    f_counts = np.clip(np.round(f / f_step), -(2 ** (accel_bits - 1)), 2 ** (accel_bits - 1) - 1)
    inverse_w, inverse_f = np.linalg.inv(own_w), np.linalg.inv(own_f)
    truth = Truth(inverse_f * f_step, -inverse_f @ zero_f, inverse_w * w_step, -inverse_w @ zero_w)
    return f_counts, w_counts, rate_hz, truth


def lower(truth):
    """The same truth in the frame in which S_f is lower triangular with a positive diagonal (own QL by reversal)."""
    flip = np.eye(3)[::-1]
    Q, R = np.linalg.qr(flip @ truth.S_f @ flip)
    L = flip @ R @ flip
    U = (flip @ Q @ flip).T
    signs = np.diag(np.sign(np.diag(L)))
    U = signs @ U
    return Truth(U @ truth.S_f, U @ truth.b_f, U @ truth.S_w, U @ truth.b_w)


def recorded(f, w, rate_hz, time_s=None):
    """Counts (n, 3) as a log; an even clock where no timestamps are given."""
    t = np.arange(len(f)) / rate_hz if time_s is None else time_s
    return Recording(t, f, w, rate_hz, accelerometer_unit="counts", gyroscope_unit="counts")
