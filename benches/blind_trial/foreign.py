"""Mechanisms that the catalogue does not hold and none of its entries mimics, added to the true motion's readings.

Each is sized against the noise of the grade, so that it is plain in the domain named, and drawn at random. Sums of
readings, not of a model's terms: the tool has to say `unexplained`, with that domain disagreeing.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, replace

import numpy as np
import numpy.typing as npt

from blind_trial.sizes import sample_noise
from trihedron.records import Recording
from trihedron.records.truth import Truth
from trihedron.simulate import Scenario
from trihedron.simulate.profiles import Profile
from trihedron.simulate.readout import sense_axes

FloatArray = npt.NDArray[np.float64]
Signal = Callable[[Truth, FloatArray, float, "np.random.Generator"], FloatArray]


@dataclass(frozen=True)
class Foreign:
    """``signal`` (truth, rates or forces along channels, noise of a 5 s mean, generator) → (n, 3) SI per channel."""

    sensor: str
    domains: tuple[str, ...]
    signal: Signal

    def added_to(
        self, log: Recording, truth: Truth, scenario: Scenario, profile: Profile, rng: np.random.Generator
    ) -> Recording:
        """The log of an instrument that also does this; readings are rounded to the LSB again."""
        part = getattr(scenario, self.sensor)
        directions, gain = sense_axes(part.S, self.sensor)
        motion = truth.angular_rate_rad_s if self.sensor == "gyroscope" else truth.specific_force_m_s2
        noise = sample_noise(profile)[self.sensor] / np.sqrt(5.0 * scenario.clock.rate_hz)
        extra = self.signal(truth, motion @ directions.T, noise, rng)
        raw = getattr(log, self.sensor)
        if part.adc.lsb > 0.0:
            # What an ADC has rounded already would round less than half a step away: nothing would be added.
            raw = raw + part.adc.lsb * rng.uniform(-0.5, 0.5, raw.shape)
        raw = raw + extra * gain
        if part.adc.lsb > 0.0:
            raw = np.clip(np.round(raw / part.adc.lsb) * part.adc.lsb, part.adc.low, part.adc.high)
        return replace(log, **{self.sensor: raw})


def telegraph(t: FloatArray, dwell_s: float, rng: np.random.Generator) -> FloatArray:
    """(n,) ±1, switching after exponentially distributed times."""
    out, sign, k = np.empty(len(t)), float(rng.choice((-1.0, 1.0))), 0
    while k < len(t):
        stop = int(np.searchsorted(t, t[k] + rng.exponential(dwell_s))) + 1
        out[k:stop] = sign
        sign, k = -sign, stop
    return out


def popcorn(truth: Truth, along: FloatArray, noise: float, rng: np.random.Generator) -> FloatArray:
    """Random telegraph bias of one channel, about one switch per pose: a trap in the readout. No curve is smooth so."""
    out = np.zeros_like(along)
    out[:, rng.integers(3)] = rng.uniform(8, 14) * noise * telegraph(truth.accelerometer_time_s, 9.0, rng)
    return out


def rate_product(_truth: Truth, along: FloatArray, noise: float, rng: np.random.Generator) -> FloatArray:
    """Every channel reads the product of the two other rates (drive modes that couple), with one coefficient.

    Lags that differ from axis to axis leave such products too, but with coefficients that add up to nothing.
    """
    product = np.stack([along[:, (k + 1) % 3] * along[:, (k + 2) % 3] for k in range(3)], axis=1)
    # Over a move of 2 s the white noise of the angle is 2 s x sqrt(5/2) times that of a 5 s mean.
    typical = float(np.sqrt(np.mean(product[np.abs(product) > 0.05] ** 2)))
    return rng.choice((-1.0, 1.0)) * rng.uniform(20, 40) * noise / typical * product


def turn_memory(truth: Truth, along: FloatArray, noise: float, rng: np.random.Generator) -> FloatArray:
    """The bias of one gyro depends on which way it last turned: a readout with play. Only accelerometers have that."""
    k = int(rng.integers(3))
    out, state = np.zeros_like(along), 1.0
    for part in truth.segments:
        if part.kind == "move":
            middle = (part.start + part.stop) // 2
            out[part.start : middle, k] = state
            state = float(np.sign(along[part.start : part.stop, k].sum()))
            out[middle : part.stop, k] = state
        else:
            out[part.start : part.stop, k] = state
    return rng.uniform(8, 14) * noise * out


def scale_by_force(truth: Truth, along: FloatArray, noise: float, rng: np.random.Generator) -> FloatArray:
    """The scale of one gyro follows the specific force across it: weight bends the drive frame."""
    k = int(rng.integers(3))
    other = (k + 1) % 3
    f = truth.specific_force_m_s2[:, other] / truth.gravity_m_s2
    out = np.zeros_like(along)
    moving = np.abs(along[:, k]) > 0.2
    typical = float(np.sqrt(np.mean((f * along[:, k])[moving] ** 2)))
    out[:, k] = rng.choice((-1.0, 1.0)) * rng.uniform(60, 120) * noise / typical * f * along[:, k]
    return out


def magnetic(truth: Truth, _along: FloatArray, noise: float, rng: np.random.Generator) -> FloatArray:
    """Gyro biases follow the Earth's field (magnets in the readout): horizontal, so that no force resembles it."""
    w, x, y, z = truth.attitude.T
    heading = float(rng.uniform(0, 2 * np.pi))
    # A horizontal unit vector of the level frame, seen from the body: rows of the matrix body to level.
    first = np.stack([1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y)], axis=1)
    second = np.stack([2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x)], axis=1)
    field = np.cos(heading) * first + np.sin(heading) * second
    coupling = rng.normal(0, 1, (3, 3))
    return rng.uniform(15, 30) * noise * field @ coupling.T


def cross_product(truth: Truth, along: FloatArray, noise: float, rng: np.random.Generator) -> FloatArray:
    """An accelerometer reads the product of the two cross-axis forces (K_ip f_i f_p of IEEE Std 1293)."""
    k = int(rng.integers(3))
    product = along[:, (k + 1) % 3] * along[:, (k + 2) % 3] / truth.gravity_m_s2**2
    out = np.zeros_like(along)
    # A third of the poses are oblique; there the length of gravity changes by about a tenth of the coefficient.
    out[:, k] = rng.choice((-1.0, 1.0)) * rng.uniform(120, 240) * noise * product
    return out


FOREIGN: dict[str, Foreign] = {
    # A bias that jumps from pose to pose is wrong in the moves between them too: angles of a gyro, speeds of a mass.
    "gyro-telegraph": Foreign("gyroscope", ("static-gyro", "moves"), popcorn),
    "accel-telegraph": Foreign("accelerometer", ("static-accel", "dynamics"), popcorn),
    "gyro-rate-product": Foreign("gyroscope", ("moves",), rate_product),
    "gyro-turn-memory": Foreign("gyroscope", ("static-gyro", "moves"), turn_memory),
    "gyro-scale-by-force": Foreign("gyroscope", ("moves",), scale_by_force),
    "gyro-magnetic": Foreign("gyroscope", ("static-gyro",), magnetic),
    "accel-cross-product": Foreign("accelerometer", ("static-accel",), cross_product),
}
"""Name → mechanism; ``domains``: any of these must disagree."""
