"""Ready-made scenarios and sessions by name."""

import math
from collections.abc import Callable
from dataclasses import replace

import numpy as np

from trihedron.errors import InputError
from trihedron.simulate.accelerometer import Accelerometer
from trihedron.simulate.effects import with_effect
from trihedron.simulate.gyroscope import Gyroscope
from trihedron.simulate.motion.steps import Motion, Pose, Turn
from trihedron.simulate.profiles import ADIS, ANALOG_6DOF, MPU, TACTICAL, Profile
from trihedron.simulate.scenario import Environment, Scenario
from trihedron.simulate.sessions import (
    EDGES,
    FACES,
    dividing_head,
    hand_session,
    long_static,
    poses_in_order,
    rate_table,
    six_faces,
    table_turns,
)

SESSIONS: dict[str, Callable[..., Motion]] = {
    "hand": hand_session,
    "six-faces": six_faces,
    "table-turns": table_turns,
    "dividing-head": dividing_head,
    "rate-table": rate_table,
    "static": long_static,
}
"""Sessions that a scenario file can name, and the functions that make them."""


def _of(profile: Profile, motion: Motion, name: str = "", unit: int = 1) -> Scenario:
    return Scenario(motion, name, *profile.unit(unit), profile.clock)


def _linear() -> Scenario:
    scenario = _of(MPU, hand_session())
    accel, gyro = scenario.accelerometer, scenario.gyroscope
    return replace(
        scenario,
        accelerometer=Accelerometer(accel.S, accel.b, accel.unit),
        gyroscope=Gyroscope(gyro.S, gyro.b, gyro.unit),
    )


def _tactical() -> Scenario:
    scenario = _of(TACTICAL, hand_session(36, pose_s=10.0, first_pose_s=60.0, arm_m=0.15))
    return replace(scenario, environment=Environment(gravity_m_s2=0.0, latitude_deg=55.7, earth_rate=True))


def _manual() -> Scenario:
    poses = poses_in_order([*FACES, *EDGES], pose_s=6.0, move_s=3.0, wobble_deg=4.0)
    steps = list(poses.steps)
    for face in FACES[::2]:
        steps += poses_in_order([face], pose_s=4.0, move_s=3.0, arrive=True).steps
        for angle in (1440.0, -1440.0):
            steps += [Turn(face, angle, 16.0, ramp=0.25, wobble_deg=0.4), Pose(4.0, "static")]
    part = ANALOG_6DOF
    return Scenario(Motion(tuple(steps), start=poses.start), "", part.accelerometer, part.gyroscope, part.clock)


def _static_manual() -> Scenario:
    accel, gyro = ANALOG_6DOF.accelerometer, ANALOG_6DOF.gyroscope
    accel = replace(accel, adc=replace(accel.adc, lsb=0.0))
    gyro = replace(gyro, adc=replace(gyro.adc, lsb=0.0))
    return Scenario(long_static(7200.0), "", accel, gyro, ANALOG_6DOF.clock)


def _dividing_head() -> Scenario:
    scenario = _of(ADIS, dividing_head())
    step = 0.11 * math.sqrt(12.0)  # the rms of the rounding equals the published ADC noise of 0.11 m/s²
    accel = scenario.accelerometer
    lsb = step / float(np.abs(np.diag(np.asarray(accel.S))).mean())
    return replace(scenario, accelerometer=replace(accel, adc=replace(accel.adc, lsb=lsb)))


def _imperfect() -> Scenario:
    scenario = _of(MPU, hand_session(arm_m=0.1))
    scenario = with_effect(scenario, "accel-quadratic", k2=(2e-4, -3e-4, 1e-4))
    scenario = with_effect(scenario, "gyro-g-sensitivity", matrix=((2e-4, 0, 0), (0, -3e-4, 1e-4), (0, 0, 2e-4)))
    scenario = with_effect(scenario, "accel-size-effect", places_m=((0.004, 0, 0), (0, 0.004, 0), (0, 0, 0)))
    return with_effect(scenario, "accel-thermal-bias", per_k=(0.004, -0.006, 0.01), logged=False)


def _lossy() -> Scenario:
    scenario = with_effect(_of(MPU, hand_session()), "dropped-samples", losses=[(28.0, 7), (61.0, 25)])
    return with_effect(scenario, "timing-jitter", jitter_s=3e-4)


_SCENARIOS: dict[str, tuple[str, Callable[[], Scenario]]] = {
    "hand-session": ("24 poses by hand, consumer 16-bit part.", lambda: _of(MPU, hand_session())),
    "hand-session-tactical": (
        "36 poses by hand with a lever arm to the wrist, tactical unit, Earth turning.", _tactical,
    ),
    "linear-noiseless": (
        "The hand session without noise and ADC: what a perfect estimator inverts exactly.", _linear,
    ),
    "six-faces": ("Six faces, twice round, consumer 16-bit part.", lambda: _of(MPU, six_faces(2))),
    "table-turns": (
        "Turns of 90 and 360 deg against a wall on six faces, consumer 16-bit part.",
        lambda: _of(MPU, table_turns((90.0, -90.0, 360.0, -360.0), faces=FACES)),
    ),
    "manual-example": (
        "The laboratory manual's example: 18 poses, then turns by ±8π on three faces, 10-bit ADC, 50 Hz.", _manual,
    ),
    "dividing-head": (
        "324 poses of an optical dividing head, industrial part on a 12-bit ADC.", _dividing_head,
    ),
    "rate-table": (
        "Rate-table profile, ±30 to ±240 deg/s about each axis, industrial part.", lambda: _of(ADIS, rate_table()),
    ),
    "imperfect": (
        "24 poses by hand with several effects at once: what a linear model cannot reproduce.", _imperfect,
    ),
    "lossy-log": ("The hand session with lost samples whose timestamps were made anew, and jitter.", _lossy),
    "static-hour": ("One hour static, consumer 16-bit part.", lambda: _of(MPU, long_static(3600.0))),
    "static-manual": (
        "Two hours static, the manual's unit with a finer ADC, for Allan curves.", _static_manual,
    ),
    "static-industrial": ("10,000 s static, industrial 14-bit part.", lambda: _of(ADIS, long_static(10000.0))),
}  # fmt: skip


def list_scenarios() -> dict[str, str]:
    """Name and one sentence for each ready-made scenario."""
    return {name: about for name, (about, _) in _SCENARIOS.items()}


def scenario_by_name(name: str) -> Scenario:
    """A ready-made scenario; raises ``InputError`` when no scenario has that name."""
    if name not in _SCENARIOS:
        raise InputError(f"no scenario is called {name!r}; there are {', '.join(_SCENARIOS)}")
    return replace(_SCENARIOS[name][1](), name=name)
