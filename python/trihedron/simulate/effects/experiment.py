"""Effects of the clock, the environment and the motion."""

from collections.abc import Callable, Sequence
from dataclasses import replace
from typing import TypeVar

from trihedron.errors import InputError
from trihedron.simulate.effects.sizes import (
    SENSORS,
    Effects,
    Noted,
    NotSimulatedError,
    Parameters,
    Sensor,
    Size,
    along,
    checked,
    nothing,
    number,
)
from trihedron.simulate.motion.steps import Disturb, Motion, Pose, Step, Turn, Vibrate
from trihedron.simulate.readout import Values, triple
from trihedron.simulate.scenario import Loss, Scenario

Kind = TypeVar("Kind", Pose, Turn)


def time_offset(scenario: Scenario, offset_s: float) -> Scenario:
    return replace(scenario, clock=replace(scenario.clock, gyroscope_offset_s=offset_s))


def dropped(
    scenario: Scenario, losses: Sequence[Sequence[float]] = (), probability: float = 0.0, restamped: bool = True
) -> Scenario:
    listed = tuple(Loss(float(t), int(n)) for t, n in losses)
    clock = replace(scenario.clock, losses=listed, loss_probability=probability, restamped=restamped)
    return replace(scenario, clock=clock)


def jitter(scenario: Scenario, jitter_s: float = 0.0, rate_error: float = 0.0, shown: bool = False) -> Scenario:
    clock = replace(scenario.clock, jitter_s=jitter_s, rate_error=rate_error, timestamps_show_jitter=shown)
    return replace(scenario, clock=clock)


def earth_rate(scenario: Scenario, latitude_deg: float = 55.7, heading_deg: float = 0.0) -> Scenario:
    place = replace(scenario.environment, earth_rate=True, latitude_deg=latitude_deg, heading_deg=heading_deg)
    return replace(scenario, environment=place)


def rectification(
    scenario: Scenario,
    sensor: Sensor,
    coefficient: Values,
    rms_m_s2: float = 2.0,
    low_hz: float = 20.0,
    high_hz: float = 40.0,
    every: int = 2,
) -> Scenario:
    """Every ``every``-th pose, except the first, is on a vibrating support."""
    part = replace(getattr(scenario, checked(sensor)), rectification=triple(coefficient))

    def shaken(k: int, pose: Pose) -> list[Step]:
        if k == 0 or (k + 1) % every:
            return [pose]
        return [Vibrate((1.0, 1.0, 1.0), rms_m_s2, low_hz, pose.duration_s, high_hz=high_hz, name=pose.name)]

    return replace(scenario, **{sensor: part}, motion=_each(scenario.motion, Pose, shaken)[0])


def disturbed(scenario: Scenario, poses: Sequence[int], tilt_deg: float = 0.5, shift_m: float = 0.001) -> Scenario:
    """The poses of these numbers (from 0) are disturbed in their middle."""

    def pushed(k: int, pose: Pose) -> list[Step]:
        part = replace(pose, duration_s=max((pose.duration_s - 0.6) / 2.0, 0.1))
        return [part, Disturb(0.6, tilt_deg, shift_m), part] if k in poses else [pose]

    motion, count = _each(scenario.motion, Pose, pushed)
    if any(not 0 <= p < count for p in poses):
        raise InputError(f"the motion has poses 0 to {count - 1}, got {list(poses)}")
    return replace(scenario, motion=motion)


def turn_errors(scenario: Scenario, errors_deg: Sequence[float]) -> Scenario:
    motion, count = _each(
        scenario.motion, Turn, lambda k, turn: [replace(turn, error_deg=float(errors_deg[k % len(errors_deg)]))]
    )
    if count == 0:
        raise InputError("turn-angle-error needs a motion with turns of stated angles, for instance table-turns")
    return replace(scenario, motion=motion)


def _each(motion: Motion, kind: type[Kind], change: Callable[[int, Kind], list[Step]]) -> tuple[Motion, int]:
    """The motion with every step of a kind, numbered from 0, replaced by others; and their number."""
    steps: list[Step] = []
    count = 0
    for step in motion.steps:
        if isinstance(step, kind):
            steps += change(count, step)
            count += 1
        else:
            steps.append(step)
    return replace(motion, steps=tuple(steps)), count


def table_tilt(scenario: Scenario, tilt_deg: Sequence[float]) -> Scenario:
    motion: Motion = replace(scenario.motion, table_tilt_deg=(float(tilt_deg[0]), float(tilt_deg[1])))
    return replace(scenario, motion=motion)


def diagnosed_losses(values: Parameters, _variant: str) -> Size:
    losses = [
        (float(name[len("lost_at_") : -1]), round(value))
        for name, value in values.items()
        if name.startswith("lost_at_") and round(value) > 0
    ]
    if not losses:
        raise NotSimulatedError("no place of a loss is stated")
    return {"losses": losses}


def diagnosed_rectification(values: Parameters, variant: str) -> Size:
    if variant == "gyro":
        return {"sensor": "gyroscope", "coefficient": along(values, "gyro_bias_per_power")}
    return {"sensor": "accelerometer", "coefficient": along(values, "accel_bias_per_power")}


EFFECTS: Effects = {
    # The gyro sampling later under the same timestamp is equivalent to the accelerometer being delayed.
    "accel-gyro-time-offset": (time_offset, number("offset_s", "accelerometer_delay")),
    "dropped-samples": (dropped, diagnosed_losses),
    "timing-jitter": (jitter, number("jitter_s", "jitter")),
    "earth-rate": (earth_rate, lambda values, _: {"latitude_deg": values["latitude"], "heading_deg": 0.0}),
    "vibration-rectification": (rectification, diagnosed_rectification),
    "disturbed-pose": (disturbed, nothing),
    "turn-angle-error": (turn_errors, nothing),
    "table-tilt": (table_tilt, nothing),
}


def noted(scenario: Scenario) -> Noted:
    clock, place, motion = scenario.clock, scenario.environment, scenario.motion
    for name in SENSORS:
        if any(getattr(scenario, name).rectification):
            yield "vibration-rectification", {name: getattr(scenario, name).rectification}
    if clock.gyroscope_offset_s:
        yield "accel-gyro-time-offset", {"offset_s": clock.gyroscope_offset_s}
    if clock.losses or clock.loss_probability:
        losses = tuple((loss.time_s, loss.n) for loss in clock.losses)
        yield "dropped-samples", {"probability": clock.loss_probability, "restamped": clock.restamped, "losses": losses}
    if clock.jitter_s or clock.rate_error or clock.timestamp_jitter_s:
        errors = {"rate_error": clock.rate_error, "timestamps_s": clock.timestamp_jitter_s}
        yield "timing-jitter", {"jitter_s": clock.jitter_s, **errors}
    if place.earth_rate:
        yield "earth-rate", {"latitude_deg": place.latitude_deg, "heading_deg": place.heading_deg}
    if any(motion.table_tilt_deg):
        yield "table-tilt", {"tilt_deg": motion.table_tilt_deg}
    errors_deg = tuple(step.error_deg for step in motion.steps if isinstance(step, Turn))
    if any(errors_deg):
        yield "turn-angle-error", {"errors_deg": errors_deg}
    pose, poses = -1, []
    for before, step in zip((None, *motion.steps), motion.steps, strict=False):
        if isinstance(step, Pose) and not isinstance(before, Disturb):
            pose += 1
        elif isinstance(step, Disturb):
            poses.append(pose)
    if poses:
        yield "disturbed-pose", {"poses": tuple(poses)}
