"""Effects of proof mass and sense mass, and of their places."""

import math
from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from trihedron.arrays import AXES
from trihedron.simulate.accelerometer import Hysteresis, ProofMass
from trihedron.simulate.effects.sizes import Effects, Noted, Parameters, Size, along, axes
from trihedron.simulate.readout import NONE, Triple, Values, matrix3, triple
from trihedron.simulate.scenario import Scenario

# Parameters of suspension and bridge from the second and third order of a response (docs/simulation.md, eq. 3).


# A suspension (s2, s3) with deflection d per unit input, read through the bridge, has the input-referred output
# a + K2 a² + K3 a³ + ... with K2 = -s2 d and K3 = d² (1/4 - s3 + 2 s2²).
def suspension(deflection: float, k2: float, k3: float) -> tuple[float, float]:
    second = -k2 / deflection
    return second, 0.25 + 2.0 * second**2 - k3 / deflection**2


def response(deflection: float, second: float, third: float) -> tuple[float, float]:
    return -second * deflection, deflection**2 * (0.25 - third + 2.0 * second**2)


def with_response(mass: ProofMass, k2: Triple, k3: Triple) -> ProofMass:
    gap, second, third = list(mass.gap_m), [0.0] * 3, [0.0] * 3
    for k in range(3):
        omega2 = (2.0 * math.pi * mass.resonance_hz[k]) ** 2
        if k2[k] == 0.0 and k3[k] > 0.0:
            # The bridge alone makes the cubic: the gap is chosen so that ξ = d a with d²/4 = K3.
            gap[k] = 1.0 / (omega2 * 2.0 * math.sqrt(k3[k]))
        else:
            second[k], third[k] = suspension(1.0 / (omega2 * gap[k]), k2[k], k3[k])
    return replace(mass, gap_m=triple(gap), second=triple(second), third=triple(third), reads_bridge=True)


def mass_response(mass: ProofMass) -> tuple[Triple, Triple]:
    if not mass.reads_bridge:
        return NONE, NONE
    pairs = [response(float(mass.deflection[k]), mass.second[k], mass.third[k]) for k in range(3)]
    return triple([p[0] for p in pairs]), triple([p[1] for p in pairs])


def accel_quadratic(scenario: Scenario, k2: Values) -> Scenario:
    accel = scenario.accelerometer
    _, k3 = mass_response(accel.mass)
    return replace(scenario, accelerometer=replace(accel, mass=with_response(accel.mass, triple(k2), k3)))


def accel_cubic(scenario: Scenario, k3: Values) -> Scenario:
    accel = scenario.accelerometer
    k2, _ = mass_response(accel.mass)
    return replace(scenario, accelerometer=replace(accel, mass=with_response(accel.mass, k2, triple(k3))))


def accel_hysteresis(
    scenario: Scenario,
    offset_m_s2: Values = 0.0,
    width_m_s2: Values = 2.0,
    creep_fraction: Values = 0.0,
    creep_tau_s: Values = 20.0,
) -> Scenario:
    memory = Hysteresis(triple(offset_m_s2), triple(width_m_s2), triple(creep_fraction), triple(creep_tau_s))
    return replace(scenario, accelerometer=replace(scenario.accelerometer, hysteresis=memory))


def diagnosed_hysteresis(values: Parameters, variant: str) -> Size:
    if variant == "creep":
        return {"creep_fraction": along(values, "creep"), "creep_tau_s": values["time_constant"]}
    return {"offset_m_s2": along(values, "offset"), "width_m_s2": values["half_width"]}


def lever_arm(scenario: Scenario, arm_m: Values) -> Scenario:
    arm = triple(arm_m)
    return replace(scenario, accelerometer=replace(scenario.accelerometer, places_m=(arm, arm, arm)))


def size_effect(scenario: Scenario, places_m: Sequence[Values]) -> Scenario:
    return replace(scenario, accelerometer=replace(scenario.accelerometer, places_m=matrix3(places_m)))


def diagnosed_places(values: Parameters, _variant: str) -> Size:
    rows = [tuple(values.get(f"r{j}{axis}-r1{axis}", 0.0) for axis in AXES) for j in (2, 3)]
    return {"places_m": ((0.0, 0.0, 0.0), *rows)}


def g_sensitivity(scenario: Scenario, matrix: Sequence[Values]) -> Scenario:
    return replace(scenario, gyroscope=replace(scenario.gyroscope, g_sensitivity=matrix3(matrix)))


def diagnosed_g_sensitivity(values: Parameters, _variant: str) -> Size:
    return {"matrix": tuple(tuple(values.get(f"G_{i}{j}", 0.0) for j in AXES) for i in AXES)}


def gyro_nonlinearity(scenario: Scenario, c2: Values = 0.0, c3: Values = 0.0, asymmetry: Values = 0.0) -> Scenario:
    # ω + c2 ω² + c3 ω³, gain 1 ± asymmetry in either sense; the deflection is 1/1000 of the gap per rad/s unless the
    # bridge alone makes the cubic.
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
    electronics = replace(scenario.gyroscope.electronics, asymmetry=triple(asymmetry))
    return replace(scenario, gyroscope=replace(scenario.gyroscope, sense_mode=mode, electronics=electronics))


EFFECTS: Effects = {
    "accel-quadratic": (accel_quadratic, axes(k2="K2")),
    "accel-cubic": (accel_cubic, axes(k3="K3")),
    "accel-hysteresis": (accel_hysteresis, diagnosed_hysteresis),
    "lever-arm": (lever_arm, axes(arm_m="r")),
    "accel-size-effect": (size_effect, diagnosed_places),
    "gyro-g-sensitivity": (g_sensitivity, diagnosed_g_sensitivity),
    "gyro-scale-nonlinearity": (gyro_nonlinearity, axes(c2="quadratic", c3="cubic", asymmetry="half_difference")),
}


def noted(scenario: Scenario) -> Noted:
    accel = scenario.accelerometer
    k2, k3 = mass_response(accel.mass)
    # Rounding of the conversion leaves 1e-20 where the coefficient is 0.
    if any(abs(v) > 1e-12 for v in k2):
        yield "accel-quadratic", {"k2": k2}
    if any(abs(v) > 1e-12 for v in k3):
        yield "accel-cubic", {"k3": k3}
    if accel.mass.moves:
        yield "sensor-lag", {"proof_mass": (accel.mass.resonance_hz, accel.mass.quality)}
    softer = (accel.mass.spring_per_k, accel.mass.gap_per_k)
    if any(map(any, softer)) and not scenario.environment.temperature.is_constant_reference:
        # Both reduce the scale; this is their contribution to the linear coefficient.
        yield "accel-thermal-scale", {"mechanism_per_k": tuple(-a - b for a, b in zip(*softer, strict=True))}
    memory = accel.hysteresis
    if any(memory.offset_m_s2) or any(memory.creep_fraction):
        yield "accel-hysteresis", {name: getattr(memory, name) for name in memory.__dataclass_fields__}
    places = np.asarray(accel.places_m)
    if places.any():
        if np.ptp(places, axis=0).max() == 0.0:
            yield "lever-arm", {"arm_m": accel.places_m[0]}
        else:
            yield "accel-size-effect", {"places_m": accel.places_m}
    gyro, mode = scenario.gyroscope, scenario.gyroscope.sense_mode
    if mode.bandwidth_hz:
        yield "sensor-lag", {"sense_mode": (mode.bandwidth_hz, mode.quality)}
    two_scales = gyro.electronics.asymmetry
    if any(mode.deflection_s_rad) or any(two_scales):
        own = zip(mode.deflection_s_rad, mode.second, mode.third, strict=True)
        c2, c3 = (triple(one) for one in zip(*(response(*axis) for axis in own), strict=True))
        yield "gyro-scale-nonlinearity", {"c2": c2, "c3": c3, "asymmetry": two_scales}
    if any(any(row) for row in gyro.g_sensitivity):
        yield "gyro-g-sensitivity", {"matrix": gyro.g_sensitivity}
