"""Digital twin of a recording: a scenario with its poses, moves, timestamps, noise and ADC.

Poses have the directions of gravity measured in the calibrated poses. Moves replay the calibrated rates and
accelerations, with a slow rotation about a level axis added so that each ends in the next pose. The recording and its
digital twin therefore differ by what the calibration does not explain.
"""

from collections.abc import Mapping
from typing import Any

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.records import Calibration, Recording, Segments, SensorCalibration
from trihedron.records.channel_facts import ChannelFacts
from trihedron.sensor_model import correct
from trihedron.simulate.accelerometer import Accelerometer
from trihedron.simulate.gyroscope import Gyroscope
from trihedron.simulate.motion.attitude import VERTICAL, attitude_with_up, rotation_of, shortest_turn, unit
from trihedron.simulate.motion.plan import attitudes_of_replay
from trihedron.simulate.motion.steps import Motion, Pose, Quaternion, Replay, Step
from trihedron.simulate.noise import NoiseTerms
from trihedron.simulate.readout import Adc, Smoother, matrix3, triple
from trihedron.simulate.scenario import Clock, Environment, Scenario


def twin_motion(recording: Recording, segments: Segments, calibration: Calibration) -> Motion:
    """The poses and moves of a recording.

    Raises ``InputError`` when the recording lacks a sensor or has no pose, or the calibration has no gyro.
    """
    if recording.accelerometer is None or recording.gyroscope is None or calibration.gyroscope is None:
        raise InputError("a digital twin needs both sensors in the recording and in the calibration")
    if not segments.poses:
        raise InputError("a digital twin needs at least one pose; the recording has none")
    facts = recording.facts
    # Motion that exceeded a sensor's range must exceed it again.
    force = unclipped(_filled(recording.accelerometer), facts.of("accelerometer"))
    rate = unclipped(_filled(recording.gyroscope), facts.of("gyroscope"))
    return _motion(recording.time_s, (force, rate), segments, calibration)


def twin_scenario(
    recording: Recording,
    segments: Segments,
    calibration: Calibration,
    noise: Mapping[str, tuple[NoiseTerms, Smoother]],
) -> Scenario:
    """A scenario whose simulation repeats a recording with the ``noise`` and low-pass of each sensor.

    Raises ``InputError`` as :func:`twin_motion`.
    """
    motion = twin_motion(recording, segments, calibration)
    assert calibration.gyroscope is not None  # twin_motion checks it

    def sensed(sensor: SensorCalibration, name: str) -> dict[str, Any]:
        raw, step, S = _filled(getattr(recording, name)), recording.facts.of(name).common_step, matrix3(sensor.S)
        terms, low_pass = noise[name]
        adc = Adc(step, *(recording.facts.of(name).adc_range(raw) or ()))
        unit = getattr(recording, f"{name}_unit")
        return {"S": S, "b": triple(sensor.b), "unit": unit, "noise": terms, "noise_filter": low_pass, "adc": adc}

    return Scenario(
        motion=motion,
        name=f"digital twin of {recording.source}",
        accelerometer=Accelerometer(**sensed(calibration.accelerometer, "accelerometer")),
        gyroscope=Gyroscope(**sensed(calibration.gyroscope, "gyroscope")),
        clock=Clock(recording.rate_hz, instants_s=tuple(recording.time_s.tolist())),
        environment=Environment(gravity_m_s2=calibration.gravity_m_s2),
    )


def _motion(
    time_s: FloatArray, readings: tuple[FloatArray, FloatArray], segments: Segments, calibration: Calibration
) -> Motion:
    gyro = calibration.gyroscope
    assert gyro is not None  # twin_motion checks it
    force = correct(readings[0], calibration.accelerometer.S, calibration.accelerometer.b)
    rate = correct(readings[1], gyro.S, gyro.b)
    poses = segments.poses
    ups = [unit(force[pose.samples()].mean(axis=0)) for pose in poses]
    still = [rate[pose.samples()].mean(axis=0) for pose in poses]
    g = calibration.gravity_m_s2
    begin = [float(time_s[pose.start]) for pose in poses]
    end = [float(time_s[pose.stop - 1]) for pose in poses]
    start = attitude = attitude_with_up(ups[0])
    step_s = float(np.median(np.diff(time_s)))
    steps: list[Step] = []
    for i in range(len(poses)):
        first = float(time_s[0]) if i == 0 else begin[i]
        steps.append(Pose(max(end[i] - first, step_s), name=f"pose {i + 1}"))
        is_last = i + 1 == len(poses)
        stop_s = float(time_s[-1]) + step_s if is_last else begin[i + 1]
        if stop_s - end[i] < 2.0 * step_s:
            continue
        bias = still[i] if is_last else 0.5 * (still[i] + still[i + 1])
        # A knot per sample: the kinks of fewer would be errors of time that both sensors share, and smooth the jolt of
        # setting the case down. The recording's noise in moves is replayed as motion.
        knots = np.linspace(end[i], stop_s, max(3, round((stop_s - end[i]) / step_s) + 1))
        turning, f = _at(knots, time_s, rate - bias), _at(knots, time_s, force)
        if not is_last:
            turning = _ending_in(turning, attitude, stop_s - end[i], ups[i + 1])
        path = _attitudes(turning, attitude, stop_s - end[i])
        acceleration = np.einsum("nij,nj->ni", rotation_of(path).as_matrix(), f) - [0.0, 0.0, g]
        acceleration[0] = 0.0
        if not is_last:
            acceleration[-1] = 0.0
            acceleration = _coming_to_rest(acceleration)
        steps.append(Replay(turning, acceleration, stop_s - end[i], name=f"move {i + 1}"))
        w, x, y, z = path[-1].tolist()
        attitude = (w, x, y, z)
    return Motion(tuple(steps), start=start)


def _at(knots: FloatArray, time_s: FloatArray, values: FloatArray) -> FloatArray:
    """(m, 3) values (n, 3) at the knots (m,)."""
    return np.column_stack([np.interp(knots, time_s, axis) for axis in values.T])


def _attitudes(rate: FloatArray, start: Quaternion, duration_s: float) -> FloatArray:
    """(m, 4) attitude quaternion at every knot of a replay; ``rate`` (m, 3) [rad/s]."""
    row = [0.0, duration_s, *start, 1.0, 0.0, 0.0, 0.0, 0.5, *[0.0] * 6, 0.5]
    return attitudes_of_replay(row, np.column_stack([np.zeros(len(rate)), rate, np.zeros_like(rate)]))


def _ending_in(rate: FloatArray, start: Quaternion, duration_s: float, up: FloatArray) -> FloatArray:
    """(m, 3) rate with a constant rotation about a level axis added, so that the move ends with ``up`` vertical.

    If ω makes the attitude R(t), then ω + R(t)ᵀ c makes exp(c t) R(t), exactly; c [rad/s] is level and small.
    """
    for _ in range(3):
        R = rotation_of(_attitudes(rate, start, duration_s)).as_matrix()
        c = shortest_turn(unit(R[-1] @ up), VERTICAL) / duration_s
        rate = rate + R.transpose(0, 2, 1) @ c
    return rate


def _coming_to_rest(acceleration: FloatArray) -> FloatArray:
    """(m, 3) acceleration less a sin² pulse, so that the velocity after the move is 0, as before it.

    A remaining velocity is an error of the recording (a delayed sensor, a scale error), not motion: if replayed, every
    simulation would inherit it.
    """
    m = len(acceleration)
    hump = np.sin(np.pi * np.arange(m) / (m - 1)) ** 2
    return np.asarray(acceleration - hump[:, None] * (acceleration.sum(axis=0) / hump.sum()))


def _filled(raw: FloatArray) -> FloatArray:
    """(n, 3) readings with missing values interpolated linearly."""
    if np.isfinite(raw).all():
        return raw
    out = raw.copy()
    index = np.arange(len(raw))
    for k in range(3):
        good = np.isfinite(raw[:, k])
        out[:, k] = np.interp(index, index[good], raw[good, k])
    return out


# Motion beyond a sensor's range, extrapolated from the readings before and after it.


def unclipped(readings: FloatArray, facts: ChannelFacts) -> FloatArray:
    """(n, 3) readings with the peaks clipped at a range limit restored, raw units.

    Each clipped run is replaced by a cubic through the last reading before and the first after it, with their slopes;
    never inside the limit, and never further beyond it than the limit is from the channel's median. The height of the
    peak is a guess; that the motion exceeded the range is certain.
    """
    if not facts.limits:
        return readings
    out, index = readings.copy(), np.arange(len(readings), dtype=np.float64)
    for limit in facts.limits:
        away, sign = abs(limit.value - float(np.nanmedian(readings[:, limit.axis]))), 1.0 if limit.is_high else -1.0
        for first, stop in limit.runs.tolist():
            found = limit.bridged(index, readings, first, stop)
            if found is not None:
                beyond = np.clip(sign * (found[0] - limit.value), 0.0, away)
                out[first:stop, limit.axis] = limit.value + sign * beyond
    return out
