"""Drones, cars and walks: strapped sensors with known vibration, residual calibration error, bias random walk and
warming, and a truth of attitude and position whose own error is known too. Independent of the package: the parts of an
error over a horizon are computed here.
"""

from dataclasses import dataclass

import numpy as np
from scipy.spatial.transform import Rotation

from motion import running_product

HZ, TRACK_HZ, G = 100, 50, 9.81
EARTH = 7.292e-5 * np.array([0.0, np.cos(0.8), np.sin(0.8)])
"""Earth's rate [rad/s] at 46 degrees of latitude, in the world."""
KINDS = ("drone", "car", "walk")


@dataclass(frozen=True)
class Drawn:
    """Log (n,) s, (n, 3) m/s² and rad/s, (n,) °C; truth (k,) s, (k, 3, 3), (k, 3) m; and what is true."""

    t: np.ndarray
    force: np.ndarray
    rate: np.ndarray
    truth_t: np.ndarray
    degrees: np.ndarray
    truth: np.ndarray
    position: np.ndarray
    gyroscope: "Sensor"
    accelerometer: "Sensor"


@dataclass(frozen=True)
class Sensor:
    """Static white density as given, and with vibration as it is [SI/√Hz]; random walk [SI/√s]; mean square
    [rad², (m/s)²] by horizon and cause."""

    static_N: float
    N: float
    K: float
    parts: dict[float, dict[str, float]]


def smooth(rng, n, low, high):
    """(n, 3) of unit rms between two frequencies [Hz]."""
    spectrum = np.fft.rfft(rng.normal(size=(n, 3)), axis=0)
    f = np.fft.rfftfreq(n, 1 / HZ)
    x = np.fft.irfft(spectrum * ((f > low) & (f < high))[:, None], n, axis=0)
    return x / x.std()


def rates(rng, kind, t):
    """(n, 3) rad/s of a motion."""
    n = len(t)
    if kind == "drone":
        return 0.5 * smooth(rng, n, 0.05, 1.0)
    if kind == "car":
        return smooth(rng, n, 0.02, 0.2) * [0.02, 0.02, 0.25] + 0.05 * smooth(rng, n, 0.5, 2.0) * [1.0, 1.0, 0.2]
    step = np.sin(2 * np.pi * 1.8 * t[:, None] + rng.uniform(0, 6, 3)) * rng.uniform(0.3, 0.8, 3)
    return step + 0.4 * smooth(rng, n, 0.03, 0.3)


def slow_error(rng, time, sigma, tau):
    """(k, 3) a Matérn-3/2 process by its exact steps."""
    h, lam = time[1] - time[0], np.sqrt(3) / tau
    decay = np.exp(-lam * h)
    F = decay * np.array([[1 + lam * h, h], [-(lam**2) * h, 1 - lam * h]])
    P = sigma**2 * np.diag([1.0, lam**2])
    root, out = np.linalg.cholesky(P - F @ P @ F.T + 1e-14 * P), []
    x = np.linalg.cholesky(P) @ rng.normal(size=(2, 3))
    for _ in time:
        out.append(x[0])
        x = F @ x + root @ rng.normal(size=(2, 3))
    return np.array(out)


def drawn(seed, kind, seconds, horizons):
    """One log of that length [s] and its truth."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, 1 / HZ)
    w = rates(rng, kind, t)
    C = running_product(np.vstack([np.zeros(3), w / HZ]))
    N, K, V, sigma = np.exp(rng.uniform(np.log([1e-4, 3e-6, 3e-4, 5e-4]), np.log([4e-4, 1e-4, 2e-3, 5e-3])))
    V = V if kind == "drone" else 0.3 * V
    tau, white, steady = rng.uniform(3, 15), 3e-4, 2e-3
    throttle = np.maximum(1 + 0.7 * smooth(rng, len(t), 0.0, 0.05)[:, 0], 0.1)
    throttle = throttle**2 / np.mean(throttle**2)
    shaking = {"drone": 0.1, "car": 0.02, "walk": 0.05}[kind] * smooth(rng, len(t), 30, 48) * np.sqrt(throttle)[:, None]
    degrees = 25.0 + rng.uniform(0.0, 8.0) * (1 - np.exp(-t / rng.uniform(40, 200)))
    warm = (degrees - degrees.mean())[:, None] * 3e-4 * rng.normal(size=3)
    M = np.eye(3) + rng.uniform(-0.01, 0.01, (3, 3))
    of_force = np.radians(0.1) / G * rng.normal(size=(3, 3))
    middle = C[:-1] * Rotation.from_rotvec(0.5 * w / HZ)
    path, pushed = moved(rng, len(t))
    force = middle.inv().apply(pushed + np.array([0, 0, G]))
    bias = 0.02 * rng.normal(size=3) + warm
    raw = (w + middle.inv().apply(EARTH) + shaking) @ M.T + force @ of_force.T + bias + noise(rng, N, V, K, throttle)
    k = np.arange(0, len(t), HZ // TRACK_HZ)
    truth_t = t[k] - 0.5 / HZ
    off = slow_error(rng, truth_t, sigma, tau) + white * rng.normal(size=(len(k), 3))
    left = {"calibration": w @ M.T @ left_over(M).T, "g-sensitivity": force @ of_force.T}
    parts = {}
    for h in horizons:
        x = np.sqrt(3) * h / tau
        parts[h] = {
            **of_noise(N, V, K, h),
            "temperature": warmed(warm, middle, h),
            "reference": 6 * sigma**2 * (1 - (1 + x) * np.exp(-x)) + 6 * white**2 / TRACK_HZ,
            **{cause: carried(wrong, middle, h) for cause, wrong in left.items()},
        }
    gyroscope = Sensor(N * np.exp(0.05 * rng.normal()), float(np.hypot(N, V)), K, parts)
    seen = (Rotation.from_rotvec(off) * C[k]).as_matrix()
    N, K, V = np.exp(rng.uniform(np.log([1e-3, 5e-5, 3e-3]), np.log([4e-3, 2e-3, 3e-2])))
    V = V if kind == "drone" else 0.3 * V
    M = np.eye(3) + rng.uniform(-0.005, 0.005, (3, 3))
    shaking = 0.5 * smooth(rng, len(t), 30, 48) * np.sqrt(throttle)[:, None]
    force = (force + shaking) @ M.T + 0.05 * rng.normal(size=3) + noise(rng, N, V, K, throttle)
    tilt = {h: 2 * G**2 * sigma**2 * twice_summed(h, tau) for h in horizons}
    warm = (degrees - degrees.mean())[:, None] * 3e-3 * rng.normal(size=3)
    force = force + warm
    parts = {
        h: {
            **of_noise(N, V, K, h),
            "temperature": warmed(warm, middle, h),
            "reference": 12 * steady**2 / TRACK_HZ + tilt[h] + 2 * G**2 * white**2 / TRACK_HZ * h,
        }
        for h in horizons
    }
    accelerometer = Sensor(N * np.exp(0.05 * rng.normal()), float(np.hypot(N, V)), K, parts)
    where = 0.5 * (path[np.maximum(k - 1, 0)] + path[k]) + steady * rng.normal(size=(len(k), 3))
    return Drawn(
        t, force, raw, truth_t, degrees + 0.05 * rng.normal(size=len(t)), seen, where, gyroscope, accelerometer
    )  # fmt: skip


def noise(rng, N, V, K, throttle):
    """(n, 3) static white noise, white noise that follows the throttle, and a random walk."""
    size = (len(throttle), 3)
    white = np.sqrt(N**2 + V**2 * throttle)[:, None] * np.sqrt(HZ) * rng.normal(size=size)
    return white + K / np.sqrt(HZ) * np.cumsum(rng.normal(size=size), axis=0)


def of_noise(N, V, K, h):
    """Mean squares over a horizon of the three axes together."""
    return {"static": 3 * N**2 * h, "vibration": 3 * V**2 * h, "bias": K**2 * h**3}


def moved(rng, n):
    """(n, 3) a path [m] and its acceleration, both at the samples."""
    pushed = 0.5 * smooth(rng, n, 0.1, 2.0)
    f = np.fft.rfftfreq(n, 1 / HZ)
    spectrum = np.fft.rfft(pushed, axis=0)
    spectrum[1:] /= -((2 * np.pi * f[1:, None]) ** 2)
    return np.fft.irfft(spectrum, n, axis=0), pushed


def twice_summed(h, tau):
    """Variance of the integral over h of a Matérn-3/2 process of variance one."""
    lag = (np.arange(2000) + 0.5) * h / 2000
    x = np.sqrt(3) * lag / tau
    return 2 * np.mean((h - lag) * (1 + x) * np.exp(-x)) * h


def warmed(wrong, attitude, h):
    """Mean square angle [rad²] over a horizon of a bias (n, 3) that was right at its start."""
    ahead = round(h * HZ)
    so_far = np.cumsum(attitude.as_matrix(), axis=0) / HZ
    angle = np.cumsum(attitude.apply(wrong), axis=0) / HZ
    known = np.einsum("nij,nj->ni", so_far[ahead:] - so_far[:-ahead], wrong[:-ahead])
    return float(np.mean(np.sum((angle[ahead:] - angle[:-ahead] - known) ** 2, axis=1)))


def left_over(M):
    """(3, 3) what one scale and square axes lack of the correction of a gyro that reads M w."""
    S = np.linalg.inv(M)
    u, _, vt = np.linalg.svd(S)
    return S - u @ vt


def carried(wrong, attitude, h):
    """Mean square angle [rad²] of wrong rates (n, 3) over a horizon, their mean, which a filter finds, off."""
    angle = np.cumsum(attitude.apply(wrong - wrong.mean(axis=0)), axis=0) / HZ
    ahead = round(h * HZ)
    return float(np.mean(np.sum((angle[ahead:] - angle[:-ahead]) ** 2, axis=1)))
