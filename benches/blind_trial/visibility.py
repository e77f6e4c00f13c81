"""Whether an effect stands out of the noise at all: the best test there could be, from two simulations of one seed.

The simulator draws its noise from streams that an effect does not touch. Two recordings of one seed, with and without
the effect, therefore differ by the effect alone. What any method may use of that difference: the length of gravity and
the mean rate in every pose, gravity carried through every move, the velocity gained in it. What a linear calibration
absorbs is projected out; white noise and bias instability are as the instrument has them. The result bounds every test
from above (true poses and true noise are known to it), and needs nothing of the diagnosis.
"""

from __future__ import annotations

from typing import Any

import numpy as np
import numpy.typing as npt
from scipy.spatial.transform import Rotation
from scipy.stats import chi2, ncx2

from trihedron.records import Recording
from trihedron.records.truth import Truth
from trihedron.simulate import Scenario, simulate
from trihedron.simulate.effects import with_effect

FloatArray = npt.NDArray[np.float64]

PARAMETERS = {"earth-rate": 3, "gyro-g-sensitivity": 9, "accel-size-effect": 6, "supply-sensitivity": 6}
"""Parameters that a test must pay for; three where not listed."""
OF_THE_MEANS = (
    "accel-quadratic", "accel-cubic", "accel-scale-asymmetry", "accel-hysteresis", "accel-thermal-bias",
    "accel-thermal-scale", "gyro-thermal-bias", "gyro-thermal-scale", "accel-bias-drift", "gyro-bias-drift",
    "gyro-g-sensitivity", "gyro-scale-nonlinearity", "accel-size-effect", "earth-rate", "supply-sensitivity",
    "vibration-rectification", "accel-saturation", "gyro-saturation",
)  # fmt: skip
"""Effects that show in means and sums. The others are seen sample by sample and are always counted as visible."""
LEVEL = 0.01 / 2.0 / 30.0
"""Half of alpha, shared by the catalogue: what the diagnosis asks of one effect."""


def ideal_sigma(effect: str, healthy: Scenario, size: dict[str, Any], seed: int) -> float | None:
    """Square root of the noncentrality of the ideal test; None for effects that are not seen in means."""
    if effect not in OF_THE_MEANS:
        return None
    flawed = with_effect(healthy, effect, **size)
    if effect == "vibration-rectification":
        # The machine shakes either way.
        healthy = with_effect(healthy, effect, **(size | {"coefficient": 0.0}))
    one, truth = simulate(flawed, seed)
    other, _ = simulate(healthy, seed)
    force = (readings(one)[0] - readings(other)[0]) @ truth.accelerometer_S.T
    rate = (readings(one)[1] - readings(other)[1]) @ truth.gyroscope_S.T
    return float(np.sqrt(_noncentrality(force, rate, truth, healthy)))


def readings(log: Recording) -> tuple[FloatArray, FloatArray]:
    """Both sensors' readings of a simulated log, which has both."""
    assert log.accelerometer is not None
    assert log.gyroscope is not None
    return log.accelerometer, log.gyroscope


def is_visible(effect: str, sigma: float | None, power: float = 0.95) -> bool:
    """Whether the ideal test, paying for the search, would find the effect with this power."""
    if sigma is None:
        return True
    k = PARAMETERS.get(effect, 3)
    return float(ncx2.sf(chi2.isf(LEVEL, k), k, sigma**2)) >= power


def _noncentrality(force: FloatArray, rate: FloatArray, truth: Truth, scenario: Scenario) -> float:
    g = truth.gravity_m_s2
    to_level = Rotation.from_quat(truth.attitude[:, [1, 2, 3, 0]]).as_matrix()  # scalar last
    up = to_level[:, 2]
    t = truth.accelerometer_time_s
    noise_f, noise_w = scenario.accelerometer.noise, scenario.gyroscope.noise
    lengths, rates, rows_f, weight_f, weight_w = [], [], [], [], []
    angles, columns_w, weight_m, speeds, weight_s = [], [], [], [], []
    for part in truth.segments:
        cut = slice(part.start, part.stop)
        duration = part.stop_s - part.start_s
        if part.stop - part.start < 5:
            continue
        if part.kind in ("pose", "vibration"):
            u = up[part.start]
            lengths.append(float(force[cut].mean(axis=0) @ u))
            rows_f.append([u[i] * u[j] for i in range(3) for j in range(i + 1)] + list(u))
            rates.append(rate[cut].mean(axis=0))
            weight_f.append(1.0 / np.sqrt(noise_f.N[0] ** 2 / duration + noise_f.B[0] ** 2))
            weight_w.append(1.0 / np.sqrt(noise_w.N[0] ** 2 / duration + noise_w.B[0] ** 2))
        elif part.kind in ("move", "turn"):
            dt = float(np.median(np.diff(t[cut])))
            R = to_level[cut]
            angles.append((R @ rate[cut][:, :, None])[:, :2, 0].sum(axis=0) * dt)
            omega = truth.angular_rate_rad_s[cut]
            sums = np.einsum("nki,nj->kij", R, np.c_[omega, np.ones(len(omega))]) * dt
            columns_w.append(sums[:2].reshape(2, -1))
            before, after = force[max(part.start - 1, 0)], force[min(part.stop, len(force) - 1)]
            tilt = (R[-1] @ after - R[0] @ before)[:2] / g
            angles[-1] = angles[-1] + np.array([tilt[1], -tilt[0]])
            sigma = np.sqrt(noise_w.N[0] ** 2 * duration + 2.0 * (noise_f.N[0] / g) ** 2 / 4.0)
            weight_m.append(1.0 / sigma)
            speeds.append((R @ force[cut][:, :, None])[:, :, 0].sum(axis=0) * dt)
            weight_s.append(1.0 / np.sqrt(noise_f.N[0] ** 2 * duration + (g * sigma * duration / 2.0) ** 2))
    total = _left(np.array(lengths), np.array(rows_f), np.array(weight_f))
    for axis in range(3):
        total += _left(np.array(rates)[:, axis], np.ones((len(rates), 1)), np.array(weight_w))
    if angles:
        total += _left(np.concatenate(angles), np.concatenate(columns_w), np.repeat(weight_m, 2))
        total += float(((np.array(speeds) * np.array(weight_s)[:, None]) ** 2).sum())
    return total


def _left(values: FloatArray, columns: FloatArray, weights: FloatArray) -> float:
    """Weighted sum of squares that the columns do not absorb."""
    a, b = columns * weights[:, None], values * weights
    fitted, *_ = np.linalg.lstsq(a, b, rcond=None)
    return float(((b - a @ fitted) ** 2).sum())
