"""Simulate a scenario: a recording and its truth."""

import hashlib
from types import MappingProxyType

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.errors import InputError
from trihedron.records import Recording, TrueSegment, Truth
from trihedron.simulate.accelerometer import Accelerometer
from trihedron.simulate.effects import effects_of
from trihedron.simulate.gyroscope import Gyroscope
from trihedron.simulate.motion.plan import Plan, plan_motion
from trihedron.simulate.noise import NoiseTerms, bias_in_moves, bias_of_poses, make_noise, stream
from trihedron.simulate.readout import sense_axes, triple
from trihedron.simulate.scenario import Clock, Environment, Scenario

Sensor = Accelerometer | Gyroscope

_DEFAULT_OVERSAMPLE = 8
# Fine samples before the first and after the last one, for the interpolation's neighbours.
_MARGIN = 4


def simulate(scenario: Scenario, seed: int = 0) -> tuple[Recording, Truth]:
    """Simulate the motion and the readings of both sensors; return the recording and, separately, the truth.

    Every stage draws from its own random stream keyed by ``seed`` and the stage's name: switching one stage on or off,
    or changing its size, does not change any sample of the others. Raises ``InputError`` when the scenario is
    impossible; the message names the value in one sentence.
    """
    plan = plan_motion(scenario.motion, stream(seed, "motion"))
    clock, place = scenario.clock, scenario.environment
    accel, gyro = scenario.accelerometer, scenario.gyroscope
    n = len(clock.instants_s) or int(np.floor(plan.duration_s * clock.true_rate_hz + 1e-9))
    if n < 1:
        raise InputError(f"the motion lasts {plan.duration_s:g} s, less than one sample at {clock.rate_hz:g} Hz")
    true_s = _sample_instants(clock, n, seed)
    gyro_s = true_s + clock.gyroscope_offset_s

    at_accel = plan.evaluate(true_s, place.gravity, place.earth_rate_level)
    same = clock.gyroscope_offset_s == 0.0
    at_gyro = at_accel if same else plan.evaluate(gyro_s, place.gravity, place.earth_rate_level)
    readings = {
        name: _read(sensor, name, plan, at_motion, time_s, scenario, seed)
        for name, sensor, at_motion, time_s in (
            ("accelerometer", accel, at_accel, true_s),
            ("gyroscope", gyro, at_gyro, gyro_s),
        )
    }
    kept = _kept(clock, true_s, seed)
    timestamps = _timestamps(clock, true_s, kept, seed)
    temperature = _pick(place.temperature.at(true_s), kept)
    supply = _pick(place.supply.at(true_s), kept)
    a, w = _pick(readings["accelerometer"], kept), _pick(readings["gyroscope"], kept)
    recording = Recording(
        time_s=timestamps,
        accelerometer=a,
        gyroscope=w,
        rate_hz=float(1.0 / np.median(np.diff(timestamps))) if len(timestamps) > 1 else clock.rate_hz,
        accelerometer_unit=accel.unit,
        gyroscope_unit=gyro.unit,
        temperature_degc=_steps(temperature, place.temperature.step_k) if place.temperature.logged else None,
        supply_v=_steps(supply, place.supply.step_v) if place.supply.logged else None,
        source=f"simulated: {scenario.name}, seed {seed}",
        sha256=_hash(a, w),
    )
    truth = Truth(
        accelerometer_time_s=_pick(true_s, kept),
        gyroscope_time_s=_pick(gyro_s, kept),
        specific_force_m_s2=_pick(at_accel[3], kept),
        angular_rate_rad_s=_pick(at_gyro[1], kept),
        attitude=_pick(at_accel[0], kept),
        segments=_segments(plan, _pick(true_s, kept)),
        accelerometer_S=np.array(accel.S),
        accelerometer_b=np.array(accel.b),
        gyroscope_S=np.array(gyro.S),
        gyroscope_b=np.array(gyro.b),
        gravity_m_s2=place.gravity,
        scenario=scenario.name,
        seed=seed,
        effects=effects_of(scenario),
        noise=MappingProxyType({"accelerometer": _terms(accel.noise), "gyroscope": _terms(gyro.noise)}),
        temperature_degc=temperature,
        supply_v=supply,
        kept=np.arange(n, dtype=np.int64)[kept],
    )
    return recording, truth


def _read(
    sensor: Sensor,
    name: str,
    plan: Plan,
    at_samples: tuple[FloatArray, FloatArray, FloatArray, FloatArray],
    time_s: FloatArray,
    scenario: Scenario,
    seed: int,
) -> FloatArray:
    """(n, 3) raw readings of one sensor at its sampling instants ``time_s`` (n,)."""
    clock, place = scenario.clock, scenario.environment
    dt = 1.0 / clock.true_rate_hz
    if sensor.is_dynamic:
        step = dt / (clock.oversample or _DEFAULT_OVERSAMPLE)
        first = float(time_s[0]) - _MARGIN * step
        count = int(np.ceil((float(time_s[-1]) - first) / step)) + _MARGIN
        fine_s: FloatArray = first + step * np.arange(count, dtype=np.float64)
        _, rate, change, force = plan.evaluate(fine_s, place.gravity, place.earth_rate_level)
        signal = sensor.sense((force, rate, change), fine_s, step, _die(sensor, place, fine_s, step))
        signal = sensor.electronics.smooth(np.ascontiguousarray(signal), step)
        signal = _core.simulate_resample(signal, first, step, np.ascontiguousarray(time_s))
    else:
        _, rate, change, force = at_samples
        signal = sensor.sense((force, rate, change), time_s, dt, _die(sensor, place, time_s, dt))
    noise = sensor.noise
    if any(any(getattr(noise, term)) for term in "QNBKR"):
        signal += sensor.noise_filter.apply(make_noise(noise, len(time_s), dt, seed, name), dt)
    if any(sensor.electronics.bias_repeatability):
        rng = stream(seed, f"{name}/zero scatter")
        signal = signal + bias_of_poses(plan.labels, time_s, sensor.electronics.bias_repeatability, rng)
    if any(sensor.electronics.bias_in_moves):
        rng = stream(seed, f"{name}/zero in moves")
        signal = signal + bias_in_moves(plan.labels, time_s, sensor.electronics.bias_in_moves, rng)
    _, gain = sense_axes(sensor.S, name)
    offset = -np.linalg.solve(np.asarray(sensor.S), np.asarray(sensor.b))
    raw = signal  # modified in place: ten million samples take 240 MB
    raw *= gain
    raw += offset
    if sensor.electronics.ratiometric:
        supply = place.supply.at(time_s) / place.supply.nominal_v
        raw *= 1.0 + sensor.electronics.ratiometric * (supply[:, None] - 1.0)
    adc = sensor.adc
    return adc.convert(raw, triple(offset)) if adc.is_there else raw


def _die(sensor: Sensor, place: Environment, time_s: FloatArray, dt: float) -> FloatArray | None:
    """(n,) die temperature above the reference [K], None where it always equals the reference."""
    if place.temperature.is_constant_reference:
        return None
    above = place.temperature.at(time_s) - place.temperature.reference_degc
    lag = sensor.electronics.thermal.lag_s
    if lag == 0.0:
        return above
    three = np.repeat(above[:, None], 3, axis=1)
    return _core.simulate_first_order(three, dt, [lag, 0.0, 0.0])[:, 0]


def _sample_instants(clock: Clock, n: int, seed: int) -> FloatArray:
    grid = np.array(clock.instants_s) if clock.instants_s else np.arange(n) / clock.true_rate_hz
    if clock.jitter_s == 0.0:
        return grid
    # Samples must stay in order: jitter is clipped at 0.45 of the sampling interval.
    limit = 0.45 / clock.true_rate_hz
    jitter = np.clip(clock.jitter_s * stream(seed, "clock/jitter").standard_normal(n), -limit, limit)
    return grid + jitter


def _kept(clock: Clock, true_s: FloatArray, seed: int) -> BoolArray:
    kept = np.ones(len(true_s), dtype=bool)
    for loss in clock.losses:
        first = int(np.searchsorted(true_s, loss.time_s))
        kept[first : first + loss.n] = False
    if clock.loss_probability > 0.0:
        kept &= stream(seed, "clock/loss").random(len(true_s)) >= clock.loss_probability
    if not kept.any():
        raise InputError("every sample is lost: lower the losses")
    return kept


def _timestamps(clock: Clock, true_s: FloatArray, kept: BoolArray, seed: int) -> FloatArray:
    n = int(np.count_nonzero(kept))
    index = np.arange(n) if clock.restamped else np.flatnonzero(kept)
    timestamps: FloatArray = index / clock.rate_hz
    if clock.instants_s and not clock.restamped:
        timestamps = np.array(clock.instants_s)[kept]
    elif clock.timestamps_show_jitter and not clock.restamped:
        timestamps = true_s[kept] * (1.0 + clock.rate_error)
    if clock.timestamp_jitter_s > 0.0:
        noise = clock.timestamp_jitter_s * stream(seed, "clock/timestamps").standard_normal(len(true_s))[kept]
        timestamps = np.maximum.accumulate(timestamps + noise)
    return np.asarray(timestamps - timestamps[0])


def _pick(values: FloatArray, kept: BoolArray) -> FloatArray:
    """Rows of the samples that were not lost; no copy where none was lost."""
    return values if kept.all() else values[kept]


def _hash(*arrays: FloatArray) -> str:
    digest = hashlib.sha256()
    for array in arrays:
        digest.update(np.ascontiguousarray(array).data)
    return digest.hexdigest()


def _steps(values: FloatArray, step: float) -> FloatArray:
    return np.round(values / step) * step if step > 0.0 else values


def _terms(noise: NoiseTerms) -> MappingProxyType[str, tuple[float, ...]]:
    return MappingProxyType({name: getattr(noise, name) for name in "QNBKR" if any(getattr(noise, name))})


def _segments(plan: Plan, time_s: FloatArray) -> tuple[TrueSegment, ...]:
    labels = plan.labels
    starts = np.searchsorted(time_s, [label.start_s for label in labels])
    starts[0] = 0
    # A step can be shorter than the sampling interval: its range is then empty.
    stops = [*(int(k) for k in starts[1:]), len(time_s)]
    return tuple(
        TrueSegment(label.kind, label.name, int(a), b, label.start_s, label.stop_s, label.axis, label.turn_rad)
        for label, a, b in zip(labels, starts, stops, strict=True)
    )
