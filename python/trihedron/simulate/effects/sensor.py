"""Effects of the two sensors."""

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import Literal

import numpy as np

from trihedron.errors import InputError
from trihedron.simulate.accelerometer import Hysteresis
from trihedron.simulate.effects.sizes import (
    Sensor,
    checked,
    electronics,
    mass_response,
    suspension,
    with_response,
)
from trihedron.simulate.readout import Adc, Drift, Interference, Values, matrix3, triple
from trihedron.simulate.scenario import Scenario, Temperature


def accel_quadratic(scenario: Scenario, k2: Values) -> Scenario:
    accel = scenario.accelerometer
    _, k3 = mass_response(accel.mass)
    return replace(scenario, accelerometer=replace(accel, mass=with_response(accel.mass, triple(k2), k3)))


def accel_cubic(scenario: Scenario, k3: Values) -> Scenario:
    accel = scenario.accelerometer
    k2, _ = mass_response(accel.mass)
    return replace(scenario, accelerometer=replace(accel, mass=with_response(accel.mass, k2, triple(k3))))


def accel_asymmetry(scenario: Scenario, asymmetry: Values) -> Scenario:
    return electronics(scenario, "accelerometer", asymmetry=triple(asymmetry))


def accel_hysteresis(
    scenario: Scenario,
    offset_m_s2: Values = 0.0,
    width_m_s2: Values = 2.0,
    creep_fraction: Values = 0.0,
    creep_tau_s: Values = 20.0,
) -> Scenario:
    memory = Hysteresis(triple(offset_m_s2), triple(width_m_s2), triple(creep_fraction), triple(creep_tau_s))
    return replace(scenario, accelerometer=replace(scenario.accelerometer, hysteresis=memory))


def _warmed(scenario: Scenario, warm_up_k: float, warm_up_tau_s: float, logged: bool) -> Scenario:
    temperature = scenario.environment.temperature
    if temperature.is_constant_reference:
        temperature = Temperature(warm_up_k=warm_up_k, warm_up_tau_s=warm_up_tau_s, logged=logged)
    else:
        temperature = replace(temperature, logged=logged)
    return replace(scenario, environment=replace(scenario.environment, temperature=temperature))


def bias_repeatability(sensor: Sensor, scenario: Scenario, sigma: Values) -> Scenario:
    return electronics(scenario, sensor, bias_repeatability=triple(sigma))


def thermal(
    sensor: Sensor,
    kind: Literal["bias", "scale"],
    scenario: Scenario,
    per_k: Values,
    per_k2: Values = 0.0,
    warm_up_k: float = 12.0,
    warm_up_tau_s: float = 120.0,
    logged: bool = True,
) -> Scenario:
    thermal = getattr(scenario, sensor).electronics.thermal
    thermal = replace(thermal, **{f"{kind}_per_k": triple(per_k), f"{kind}_per_k2": triple(per_k2)})
    return _warmed(electronics(scenario, sensor, thermal=thermal), warm_up_k, warm_up_tau_s, logged)


def drift(
    sensor: Sensor,
    scenario: Scenario,
    amplitude: Values = 0.0,
    tau_s: float = 120.0,
    change: Values = 0.0,
    length_s: float = 300.0,
) -> Scenario:
    if not (tau_s > 0.0 and length_s > 0.0):
        raise InputError(f"a drift needs a positive tau_s and length_s, got {tau_s} and {length_s}")
    drift = Drift(triple(amplitude), tau_s, triple(change), length_s)
    if not (any(drift.amplitude) or any(drift.change)):
        raise InputError("a drift needs an amplitude that dies away, or a change over length_s")
    return electronics(scenario, sensor, drift=drift)


def saturation(sensor: Sensor, scenario: Scenario, limit: Values) -> Scenario:
    return electronics(scenario, sensor, saturation=triple(limit))


def g_sensitivity(scenario: Scenario, matrix: Sequence[Values]) -> Scenario:
    return replace(scenario, gyroscope=replace(scenario.gyroscope, g_sensitivity=matrix3(matrix)))


def gyro_nonlinearity(scenario: Scenario, c2: Values = 0.0, c3: Values = 0.0) -> Scenario:
    # ω + c2 ω² + c3 ω³; the deflection is 1/1000 of the gap per rad/s unless the bridge alone makes the cubic.
    quadratic, cubic = triple(c2), triple(c3)
    deflection, second, third = [0.0] * 3, [0.0] * 3, [0.0] * 3
    for k in range(3):
        if quadratic[k] == 0.0 and cubic[k] > 0.0:
            deflection[k] = 2.0 * math.sqrt(cubic[k])
        elif quadratic[k] or cubic[k]:
            deflection[k] = 1e-3
            second[k], third[k] = suspension(1e-3, quadratic[k], cubic[k])
    mode = replace(
        scenario.gyroscope.sense_mode, deflection_s_rad=triple(deflection), second=triple(second), third=triple(third)
    )
    return replace(scenario, gyroscope=replace(scenario.gyroscope, sense_mode=mode))


def lever_arm(scenario: Scenario, arm_m: Values) -> Scenario:
    arm = triple(arm_m)
    return replace(scenario, accelerometer=replace(scenario.accelerometer, places_m=(arm, arm, arm)))


def size_effect(scenario: Scenario, places_m: Sequence[Values]) -> Scenario:
    return replace(scenario, accelerometer=replace(scenario.accelerometer, places_m=matrix3(places_m)))


def lag(scenario: Scenario, sensor: Sensor, lag_s: Values = 0.0, cutoff_hz: float = 0.0, order: int = 2) -> Scenario:
    part = getattr(scenario, checked(sensor)).electronics
    return electronics(
        scenario, sensor, lag_s=triple(lag_s), filter=replace(part.filter, cutoff_hz=cutoff_hz, order=order)
    )


def interference(scenario: Scenario, sensor: Sensor, frequency_hz: float, amplitude: Values) -> Scenario:
    part = getattr(scenario, checked(sensor)).electronics
    return electronics(
        scenario, sensor, interference=(*part.interference, Interference(frequency_hz, triple(amplitude)))
    )


def quantisation(
    scenario: Scenario, sensor: Sensor, lsb: float = 0.0, dead_band: float = 0.0, missing_every: int = 0
) -> Scenario:
    """``lsb`` and ``dead_band`` are in raw units; ``lsb`` 0 keeps the ADC's own."""
    part = getattr(scenario, checked(sensor))
    adc: Adc = replace(part.adc, dead_band=dead_band, missing_every=missing_every, lsb=lsb or part.adc.lsb)
    return replace(scenario, **{sensor: replace(part, adc=adc)})


def supply(
    scenario: Scenario, sensor: Sensor, ratiometric: float = 1.0, sag_v: float = 0.15, sag_tau_s: float = 100.0
) -> Scenario:
    supply = replace(scenario.environment.supply, sag_v=sag_v, sag_tau_s=sag_tau_s, logged=True)
    scenario = replace(scenario, environment=replace(scenario.environment, supply=supply))
    return electronics(scenario, sensor, ratiometric=ratiometric)


def handedness(scenario: Scenario, sensor: Sensor, axis: int) -> Scenario:
    """``axis`` 1, 2 or 3 (X, Y, Z) points opposite to its documentation."""
    if axis not in (1, 2, 3):
        raise InputError(f"axis is 1, 2 or 3 (X, Y, Z), got {axis}")
    part = getattr(scenario, checked(sensor))
    S = np.array(part.S)
    S[:, axis - 1] *= -1.0
    return replace(scenario, **{sensor: replace(part, S=matrix3(S.tolist()))})
