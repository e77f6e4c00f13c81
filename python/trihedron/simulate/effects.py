"""The catalogue's effects switched on at the level of the mechanism, at a stated size, and read back as truth.

``with_effect(scenario, id, ...)`` returns a new scenario; sizes are SI. Nothing here is shared with an estimator.
"""

from __future__ import annotations

import math
from collections.abc import Callable, Sequence
from dataclasses import replace
from types import MappingProxyType
from typing import Any, Literal, TypeAlias

import numpy as np

from trihedron.simulate.accelerometer import ProofMass
from trihedron.simulate.motion import Disturb, Hold, Motion, Step, Turn, Vibrate
from trihedron.simulate.readout import NONE, Adc, Drift, Electronics, Interference, Matrix, Triple
from trihedron.simulate.scenario import Loss, Scenario, Temperature

Sensor: TypeAlias = Literal["accelerometer", "gyroscope"]
Change: TypeAlias = Callable[..., Scenario]
Values: TypeAlias = float | Sequence[float]


def _triple(value: Values) -> Triple:
    if isinstance(value, (int, float)):
        return (float(value), float(value), float(value))
    if len(value) != 3:
        raise ValueError(f"three numbers, one per axis, are wanted, got {list(value)}")
    return (float(value[0]), float(value[1]), float(value[2]))


def _matrix(rows: Sequence[Values]) -> Matrix:
    if len(rows) != 3:
        raise ValueError(f"three rows are wanted, got {len(rows)}")
    return (_triple(rows[0]), _triple(rows[1]), _triple(rows[2]))


def _electronics(scenario: Scenario, sensor: Sensor, **changes: Any) -> Scenario:
    part = getattr(scenario, _checked(sensor))
    return replace(scenario, **{sensor: replace(part, electronics=replace(part.electronics, **changes))})


def _checked(sensor: str) -> str:
    if sensor not in ("accelerometer", "gyroscope"):
        raise ValueError(f"sensor is 'accelerometer' or 'gyroscope', got {sensor!r}")
    return sensor


# Second- and third-order response of a suspension (s2, s3) read through the bridge, per deflection d: the input
# -referred output is a + K2 a² + K3 a³ + ... with K2 = -s2 d and K3 = d² (1/4 - s3 + 2 s2²).
def _suspension(deflection: float, k2: float, k3: float) -> tuple[float, float]:
    second = -k2 / deflection
    return second, 0.25 + 2.0 * second**2 - k3 / deflection**2


def _response(deflection: float, second: float, third: float) -> tuple[float, float]:
    return -second * deflection, deflection**2 * (0.25 - third + 2.0 * second**2)


def _with_response(mass: ProofMass, k2: Triple, k3: Triple) -> ProofMass:
    gap, second, third = list(mass.gap_m), [0.0] * 3, [0.0] * 3
    for k in range(3):
        omega2 = (2.0 * math.pi * mass.resonance_hz[k]) ** 2
        if k2[k] == 0.0 and k3[k] > 0.0:
            # The bridge alone bends the response: a gap in which ξ = d a with d²/4 = K3.
            gap[k] = 1.0 / (omega2 * 2.0 * math.sqrt(k3[k]))
        else:
            second[k], third[k] = _suspension(1.0 / (omega2 * gap[k]), k2[k], k3[k])
    return replace(mass, gap_m=_triple(gap), second=_triple(second), third=_triple(third), reads_bridge=True)


def _mass_response(mass: ProofMass) -> tuple[Triple, Triple]:
    if not mass.reads_bridge:
        return NONE, NONE
    pairs = [_response(float(mass.deflection[k]), mass.second[k], mass.third[k]) for k in range(3)]
    return _triple([p[0] for p in pairs]), _triple([p[1] for p in pairs])


def _accel_quadratic(scenario: Scenario, k2: Values) -> Scenario:
    accel = scenario.accelerometer
    _, k3 = _mass_response(accel.mass)
    return replace(scenario, accelerometer=replace(accel, mass=_with_response(accel.mass, _triple(k2), k3)))


def _accel_cubic(scenario: Scenario, k3: Values) -> Scenario:
    accel = scenario.accelerometer
    k2, _ = _mass_response(accel.mass)
    return replace(scenario, accelerometer=replace(accel, mass=_with_response(accel.mass, k2, _triple(k3))))


def _accel_asymmetry(scenario: Scenario, asymmetry: Values) -> Scenario:
    return _electronics(scenario, "accelerometer", asymmetry=_triple(asymmetry))


def _accel_hysteresis(
    scenario: Scenario,
    offset_m_s2: Values = 0.0,
    width_m_s2: Values = 2.0,
    creep_fraction: Values = 0.0,
    creep_tau_s: Values = 20.0,
) -> Scenario:
    memory = replace(
        scenario.accelerometer.hysteresis,
        offset_m_s2=_triple(offset_m_s2),
        width_m_s2=_triple(width_m_s2),
        creep_fraction=_triple(creep_fraction),
        creep_tau_s=_triple(creep_tau_s),
    )
    return replace(scenario, accelerometer=replace(scenario.accelerometer, hysteresis=memory))


def _warmed(scenario: Scenario, warm_up_k: float, warm_up_tau_s: float, logged: bool) -> Scenario:
    temperature = scenario.environment.temperature
    if temperature.is_constant_reference:
        temperature = Temperature(warm_up_k=warm_up_k, warm_up_tau_s=warm_up_tau_s, logged=logged)
    else:
        temperature = replace(temperature, logged=logged)
    return replace(scenario, environment=replace(scenario.environment, temperature=temperature))


def _thermal(sensor: Sensor, kind: Literal["bias", "scale"]) -> Change:
    def change(
        scenario: Scenario,
        per_k: Values,
        per_k2: Values = 0.0,
        warm_up_k: float = 12.0,
        warm_up_tau_s: float = 120.0,
        logged: bool = True,
    ) -> Scenario:
        thermal = getattr(scenario, sensor).electronics.thermal
        thermal = replace(thermal, **{f"{kind}_per_k": _triple(per_k), f"{kind}_per_k2": _triple(per_k2)})
        return _warmed(_electronics(scenario, sensor, thermal=thermal), warm_up_k, warm_up_tau_s, logged)

    return change


def _drift(sensor: Sensor) -> Change:
    def change(scenario: Scenario, amplitude: Values, tau_s: float = 120.0) -> Scenario:
        return _electronics(scenario, sensor, drift=Drift(_triple(amplitude), tau_s))

    return change


def _saturation(sensor: Sensor) -> Change:
    def change(scenario: Scenario, limit: Values) -> Scenario:
        return _electronics(scenario, sensor, saturation=_triple(limit))

    return change


def _g_sensitivity(scenario: Scenario, matrix: Sequence[Values]) -> Scenario:
    return replace(scenario, gyroscope=replace(scenario.gyroscope, g_sensitivity=_matrix(matrix)))


def _gyro_nonlinearity(scenario: Scenario, c2: Values = 0.0, c3: Values = 0.0) -> Scenario:
    # ω + c2 ω² + c3 ω³; a thousandth of the gap per rad/s unless the bridge alone makes the cubic.
    quadratic, cubic = _triple(c2), _triple(c3)
    deflection, second, third = [0.0] * 3, [0.0] * 3, [0.0] * 3
    for k in range(3):
        if quadratic[k] == 0.0 and cubic[k] > 0.0:
            deflection[k] = 2.0 * math.sqrt(cubic[k])
        elif quadratic[k] or cubic[k]:
            deflection[k] = 1e-3
            second[k], third[k] = _suspension(1e-3, quadratic[k], cubic[k])
    mode = replace(
        scenario.gyroscope.sense_mode,
        deflection_s_rad=_triple(deflection),
        second=_triple(second),
        third=_triple(third),
    )
    return replace(scenario, gyroscope=replace(scenario.gyroscope, sense_mode=mode))


def _lever_arm(scenario: Scenario, arm_m: Values) -> Scenario:
    arm = _triple(arm_m)
    return replace(scenario, accelerometer=replace(scenario.accelerometer, places_m=(arm, arm, arm)))


def _size_effect(scenario: Scenario, places_m: Sequence[Values]) -> Scenario:
    return replace(scenario, accelerometer=replace(scenario.accelerometer, places_m=_matrix(places_m)))


def _time_offset(scenario: Scenario, offset_s: float) -> Scenario:
    return replace(scenario, clock=replace(scenario.clock, gyroscope_offset_s=offset_s))


def _lag(scenario: Scenario, sensor: Sensor, lag_s: Values = 0.0, cutoff_hz: float = 0.0, order: int = 2) -> Scenario:
    part = getattr(scenario, _checked(sensor)).electronics
    return _electronics(
        scenario, sensor, lag_s=_triple(lag_s), filter=replace(part.filter, cutoff_hz=cutoff_hz, order=order)
    )


def _dropped(
    scenario: Scenario,
    losses: Sequence[Sequence[float]] = (),
    probability: float = 0.0,
    restamped: bool = True,
) -> Scenario:
    listed = tuple(Loss(float(t), int(n)) for t, n in losses)
    clock = replace(scenario.clock, losses=listed, loss_probability=probability, restamped=restamped)
    return replace(scenario, clock=clock)


def _jitter(scenario: Scenario, jitter_s: float = 0.0, rate_error: float = 0.0, shown: bool = False) -> Scenario:
    clock = replace(scenario.clock, jitter_s=jitter_s, rate_error=rate_error, stamps_show_jitter=shown)
    return replace(scenario, clock=clock)


def _earth_rate(scenario: Scenario, latitude_deg: float = 55.7, heading_deg: float = 0.0) -> Scenario:
    place = replace(scenario.environment, earth_rate=True, latitude_deg=latitude_deg, heading_deg=heading_deg)
    return replace(scenario, environment=place)


def _rectification(
    scenario: Scenario,
    sensor: Sensor,
    coefficient: Values,
    rms_m_s2: float = 2.0,
    low_hz: float = 20.0,
    high_hz: float = 40.0,
    every: int = 2,
) -> Scenario:
    """Every ``every``-th hold after the first stands on a machine that shakes."""
    part = replace(getattr(scenario, _checked(sensor)), rectification=_triple(coefficient))
    steps: list[Step] = []
    count = 0
    for step in scenario.motion.steps:
        if isinstance(step, Hold):
            count += 1
            if count > 1 and count % every == 0:
                shaken = Vibrate((1.0, 1.0, 1.0), rms_m_s2, low_hz, step.duration_s, high_hz=high_hz, name=step.name)
                steps.append(shaken)
                continue
        steps.append(step)
    return replace(scenario, **{sensor: part}, motion=replace(scenario.motion, steps=tuple(steps)))


def _interference(scenario: Scenario, sensor: Sensor, frequency_hz: float, amplitude: Values) -> Scenario:
    part = getattr(scenario, _checked(sensor)).electronics
    return _electronics(
        scenario, sensor, interference=(*part.interference, Interference(frequency_hz, _triple(amplitude)))
    )


def _quantisation(
    scenario: Scenario, sensor: Sensor, lsb: float = 0.0, dead_band: float = 0.0, missing_every: int = 0
) -> Scenario:
    """Raw units."""
    part = getattr(scenario, _checked(sensor))
    adc: Adc = replace(part.adc, dead_band=dead_band, missing_every=missing_every, lsb=lsb or part.adc.lsb)
    return replace(scenario, **{sensor: replace(part, adc=adc)})


def _supply(
    scenario: Scenario, sensor: Sensor, ratiometric: float = 1.0, sag_v: float = 0.15, sag_tau_s: float = 100.0
) -> Scenario:
    supply = replace(scenario.environment.supply, sag_v=sag_v, sag_tau_s=sag_tau_s, logged=True)
    scenario = replace(scenario, environment=replace(scenario.environment, supply=supply))
    return _electronics(scenario, sensor, ratiometric=ratiometric)


def _disturbed(scenario: Scenario, poses: Sequence[int], tilt_deg: float = 0.5, shift_m: float = 0.001) -> Scenario:
    """The holds of these numbers (from 0) are pushed in their middle."""
    steps: list[Step] = []
    count = 0
    for step in scenario.motion.steps:
        if isinstance(step, Hold):
            if count in poses:
                rest = max((step.duration_s - 0.6) / 2.0, 0.1)
                steps += [
                    replace(step, duration_s=rest),
                    Disturb(0.6, tilt_deg, shift_m),
                    replace(step, duration_s=rest),
                ]
            else:
                steps.append(step)
            count += 1
        else:
            steps.append(step)
    if any(not 0 <= p < count for p in poses):
        raise ValueError(f"the motion has holds 0 to {count - 1}, got {list(poses)}")
    return replace(scenario, motion=replace(scenario.motion, steps=tuple(steps)))


def _turn_errors(scenario: Scenario, errors_deg: Sequence[float]) -> Scenario:
    steps: list[Step] = []
    count = 0
    for step in scenario.motion.steps:
        if isinstance(step, Turn):
            step = replace(step, error_deg=float(errors_deg[count % len(errors_deg)]))
            count += 1
        steps.append(step)
    if count == 0:
        raise ValueError("turn-angle-error needs a motion with turns of stated angles, for instance table-turns")
    return replace(scenario, motion=replace(scenario.motion, steps=tuple(steps)))


def _table_tilt(scenario: Scenario, tilt_deg: Sequence[float]) -> Scenario:
    motion: Motion = replace(scenario.motion, table_tilt_deg=(float(tilt_deg[0]), float(tilt_deg[1])))
    return replace(scenario, motion=motion)


def _handedness(scenario: Scenario, sensor: Sensor, axis: int) -> Scenario:
    """``axis`` 1, 2 or 3 points against its documentation."""
    if axis not in (1, 2, 3):
        raise ValueError(f"axis is 1, 2 or 3, got {axis}")
    part = getattr(scenario, _checked(sensor))
    S = np.array(part.S)
    S[:, axis - 1] *= -1.0
    return replace(scenario, **{sensor: replace(part, S=_matrix(S.tolist()))})


_EFFECTS: dict[str, Change] = {
    "accel-quadratic": _accel_quadratic,
    "accel-cubic": _accel_cubic,
    "accel-scale-asymmetry": _accel_asymmetry,
    "accel-hysteresis": _accel_hysteresis,
    "accel-thermal-bias": _thermal("accelerometer", "bias"),
    "accel-thermal-scale": _thermal("accelerometer", "scale"),
    "gyro-thermal-bias": _thermal("gyroscope", "bias"),
    "gyro-thermal-scale": _thermal("gyroscope", "scale"),
    "accel-hidden-drift": _drift("accelerometer"),
    "gyro-hidden-drift": _drift("gyroscope"),
    "gyro-g-sensitivity": _g_sensitivity,
    "gyro-scale-nonlinearity": _gyro_nonlinearity,
    "gyro-saturation": _saturation("gyroscope"),
    "accel-saturation": _saturation("accelerometer"),
    "lever-arm": _lever_arm,
    "accel-size-effect": _size_effect,
    "accel-gyro-time-offset": _time_offset,
    "sensor-lag": _lag,
    "dropped-samples": _dropped,
    "timing-jitter": _jitter,
    "earth-rate": _earth_rate,
    "vibration-rectification": _rectification,
    "periodic-interference": _interference,
    "quantisation": _quantisation,
    "supply-sensitivity": _supply,
    "disturbed-pose": _disturbed,
    "turn-angle-error": _turn_errors,
    "table-tilt": _table_tilt,
    "axis-handedness": _handedness,
}

EFFECT_IDS: tuple[str, ...] = tuple(_EFFECTS)
"""Ids of the diagnosis catalogue that can be simulated: all of them."""


def with_effect(scenario: Scenario, effect_id: str, **size: Any) -> Scenario:
    """The same scenario with one effect of the catalogue switched on at a stated size.

    Raises
    ------
    ValueError
        When the id is unknown or its parameters are not what the effect takes.
    """
    if effect_id not in _EFFECTS:
        raise ValueError(f"no effect is called {effect_id!r}; there are {', '.join(_EFFECTS)}")
    try:
        return _EFFECTS[effect_id](scenario, **size)
    except TypeError as error:
        raise ValueError(f"effect {effect_id}: {str(error).split('() ', 1)[-1]}") from None


def effects_of(scenario: Scenario) -> MappingProxyType[str, MappingProxyType[str, object]]:
    """Every effect of the catalogue that a scenario contains, with its physical parameters."""
    found: dict[str, dict[str, object]] = {}
    accel, gyro, clock, place = scenario.accelerometer, scenario.gyroscope, scenario.clock, scenario.environment

    def note(effect_id: str, **parameters: object) -> None:
        found.setdefault(effect_id, {}).update(parameters)

    k2, k3 = _mass_response(accel.mass)
    # Rounding of the conversion leaves 1e-20 where nothing was asked.
    if any(abs(v) > 1e-12 for v in k2):
        note("accel-quadratic", k2=k2)
    if any(abs(v) > 1e-12 for v in k3):
        note("accel-cubic", k3=k3)
    memory = accel.hysteresis
    if any(memory.offset_m_s2) or any(memory.creep_fraction):
        note("accel-hysteresis", **{name: getattr(memory, name) for name in memory.__dataclass_fields__})
    mode = gyro.sense_mode
    if any(mode.deflection_s_rad):
        pairs = [_response(mode.deflection_s_rad[k], mode.second[k], mode.third[k]) for k in range(3)]
        note("gyro-scale-nonlinearity", c2=_triple([p[0] for p in pairs]), c3=_triple([p[1] for p in pairs]))
    if any(any(row) for row in gyro.g_sensitivity):
        note("gyro-g-sensitivity", matrix=gyro.g_sensitivity)
    places = np.asarray(accel.places_m)
    if places.any():
        if np.ptp(places, axis=0).max() == 0.0:
            note("lever-arm", arm_m=accel.places_m[0])
        else:
            note("accel-size-effect", places_m=accel.places_m)
    for prefix, sensor in (("accel", accel), ("gyro", gyro)):
        name = "accelerometer" if prefix == "accel" else "gyroscope"
        _note_electronics(note, prefix, name, sensor.electronics, place.temperature)
        if any(sensor.rectification):
            note("vibration-rectification", **{name: sensor.rectification})
        # A step matters when the noise of one sample does not smear it.
        smear = max(sensor.noise.N) * math.sqrt(clock.rate_hz)
        coarse = 0.5 * sensor.adc.lsb * float(np.linalg.norm(np.asarray(sensor.S), axis=0).max()) > smear
        if sensor.adc.dead_band or sensor.adc.missing_every or (coarse and sensor.adc.lsb > 0.0):
            note("quantisation", **{name: (sensor.adc.lsb, sensor.adc.dead_band, sensor.adc.missing_every)})
        if np.linalg.det(np.asarray(sensor.S)) < 0.0:
            note("axis-handedness", **{name: "left-handed"})
    if clock.gyroscope_offset_s:
        note("accel-gyro-time-offset", offset_s=clock.gyroscope_offset_s)
    if clock.losses or clock.loss_probability:
        note("dropped-samples", probability=clock.loss_probability, restamped=clock.restamped)
        note("dropped-samples", losses=tuple((loss.time_s, loss.n) for loss in clock.losses))
    if clock.jitter_s or clock.rate_error or clock.stamp_jitter_s:
        note("timing-jitter", jitter_s=clock.jitter_s, rate_error=clock.rate_error, stamps_s=clock.stamp_jitter_s)
    if place.earth_rate:
        note("earth-rate", latitude_deg=place.latitude_deg, heading_deg=place.heading_deg)
    _note_motion(note, scenario.motion)
    return MappingProxyType({name: MappingProxyType(values) for name, values in found.items()})


def _note_electronics(
    note: Callable[..., None], prefix: str, name: str, electronics: Electronics, temperature: Temperature
) -> None:
    thermal = electronics.thermal
    if not temperature.is_constant_reference:
        for kind in ("bias", "scale"):
            linear, quadratic = getattr(thermal, f"{kind}_per_k"), getattr(thermal, f"{kind}_per_k2")
            if any(linear) or any(quadratic):
                note(f"{prefix}-thermal-{kind}", per_k=linear, per_k2=quadratic, logged=temperature.logged)
    if any(electronics.asymmetry):
        note(f"{prefix}-scale-asymmetry", asymmetry=electronics.asymmetry)
    if any(electronics.drift.amplitude):
        note(f"{prefix}-hidden-drift", amplitude=electronics.drift.amplitude, tau_s=electronics.drift.tau_s)
    if any(math.isfinite(v) for v in electronics.saturation):
        note(f"{prefix}-saturation", limit=electronics.saturation)
    if any(electronics.lag_s) or electronics.filter.cutoff_hz:
        note("sensor-lag", **{name: (electronics.lag_s, electronics.filter.cutoff_hz, electronics.filter.order)})
    for line in electronics.interference:
        note("periodic-interference", **{name: (line.frequency_hz, line.amplitude)})
    if electronics.ratiometric:
        note("supply-sensitivity", **{name: electronics.ratiometric})


def _note_motion(note: Callable[..., None], motion: Motion) -> None:
    if any(motion.table_tilt_deg):
        note("table-tilt", tilt_deg=motion.table_tilt_deg)
    errors = [step.error_deg for step in motion.steps if isinstance(step, Turn)]
    if any(errors):
        note("turn-angle-error", errors_deg=tuple(errors))
    pose, disturbed = -1, []
    for before, step in zip((None, *motion.steps), motion.steps, strict=False):
        if isinstance(step, Hold) and not isinstance(before, Disturb):
            pose += 1
        elif isinstance(step, Disturb):
            disturbed.append(pose)
    if disturbed:
        note("disturbed-pose", poses=tuple(disturbed))
