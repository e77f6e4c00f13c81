"""From a scenario to a recording and its truth."""

from __future__ import annotations

import hashlib
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from trihedron.records.recording import Recording
from trihedron.records.truth import TrueSegment, Truth
from trihedron.simulate.motion import Plan, plan_motion
from trihedron.simulate.noise import NoiseTerms, make_noise, stream
from trihedron.simulate.scenario import Scenario
from trihedron.simulate.sensors import sense_axes

FloatArray = npt.NDArray[np.float64]


def simulate(scenario: Scenario, seed: int = 0) -> tuple[Recording, Truth]:
    """Move the instrument, sample it, and keep the truth apart.

    Every stage draws from its own stream keyed by ``seed`` and the stage's name: switching one stage on or off, or
    changing its size, leaves all others as they were, sample by sample.
    """
    plan = plan_motion(scenario.motion, stream(seed, "motion"))
    clock = scenario.clock
    n = max(1, int(np.floor(plan.duration_s * clock.rate_hz)))
    time_s = np.arange(n) / clock.rate_hz
    g = scenario.environment.gravity_m_s2
    attitude, rate, _, force = plan.evaluate(time_s, g)

    accel, gyro = scenario.accelerometer, scenario.gyroscope
    readings = []
    for sensor, name, signal in ((accel, "accelerometer", force), (gyro, "gyroscope", rate)):
        directions, gain = sense_axes(sensor.S, name)
        offset = -np.linalg.solve(np.asarray(sensor.S), np.asarray(sensor.b))
        sensed = signal @ directions.T + make_noise(sensor.noise, n, 1.0 / clock.rate_hz, seed, name)
        readings.append(sensor.adc.convert(gain * sensed + offset))
    recording = Recording(
        time_s=time_s,
        accelerometer=readings[0],
        gyroscope=readings[1],
        rate_hz=clock.rate_hz,
        accelerometer_unit=accel.unit,
        gyroscope_unit=gyro.unit,
        source=f"simulated: {scenario.name}, seed {seed}",
        sha256=hashlib.sha256(readings[0].tobytes() + readings[1].tobytes()).hexdigest(),
    )
    truth = Truth(
        accelerometer_time_s=time_s,
        gyroscope_time_s=time_s,
        specific_force_m_s2=force,
        angular_rate_rad_s=rate,
        attitude=attitude,
        segments=_segments(plan, time_s),
        accelerometer_S=np.array(accel.S),
        accelerometer_b=np.array(accel.b),
        gyroscope_S=np.array(gyro.S),
        gyroscope_b=np.array(gyro.b),
        gravity_m_s2=g,
        scenario=scenario.name,
        seed=seed,
        noise=MappingProxyType({"accelerometer": _terms(accel.noise), "gyroscope": _terms(gyro.noise)}),
    )
    return recording, truth


def _terms(noise: NoiseTerms) -> MappingProxyType[str, tuple[float, ...]]:
    return MappingProxyType({name: getattr(noise, name) for name in "QNBKR" if any(getattr(noise, name))})


def _segments(plan: Plan, time_s: FloatArray) -> tuple[TrueSegment, ...]:
    labels = plan.labels
    starts = np.searchsorted(time_s, [label.start_s for label in labels])
    # A step may last shorter than a sample: its range is then empty.
    stops = [*(int(k) for k in starts[1:]), len(time_s)]
    return tuple(
        TrueSegment(label.kind, label.name, int(a), b, label.start_s, label.stop_s, label.axis, label.turn_rad)
        for label, a, b in zip(labels, starts, stops, strict=True)
    )
