"""Effects of the electronics, which both sensors may have: temperature, drift, clipping, lag, ADC."""

import math
from dataclasses import replace
from functools import partial
from typing import Any, Literal

import numpy as np

from trihedron.arrays import AXES
from trihedron.errors import InputError
from trihedron.simulate.effects.sizes import (
    LENGTH,
    SENSORS,
    Effects,
    Noted,
    NotSimulatedError,
    Parameters,
    Sensor,
    Size,
    along,
    axes,
    checked,
    nothing,
)
from trihedron.simulate.readout import Adc, Drift, Interference, Values, matrix3, triple
from trihedron.simulate.scenario import Scenario, Temperature


def electronics(scenario: Scenario, sensor: Sensor, **changes: Any) -> Scenario:
    part = getattr(scenario, checked(sensor))
    return replace(scenario, **{sensor: replace(part, electronics=replace(part.electronics, **changes))})


def asymmetry(scenario: Scenario, asymmetry: Values) -> Scenario:
    return electronics(scenario, "accelerometer", asymmetry=triple(asymmetry))


def _warmed(scenario: Scenario, warm_up_k: float, warm_up_tau_s: float, logged: bool) -> Scenario:
    temperature = scenario.environment.temperature
    if temperature.is_constant_reference:
        temperature = Temperature(warm_up_k=warm_up_k, warm_up_tau_s=warm_up_tau_s, logged=logged)
    else:
        temperature = replace(temperature, logged=logged)
    return replace(scenario, environment=replace(scenario.environment, temperature=temperature))


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


def diagnosed_drift(values: Parameters, variant: str) -> Size:
    if variant == "line":
        if LENGTH not in values:
            raise NotSimulatedError(
                "a straight drift needs the length of its session, which the diagnosis does not say"
            )
        return {"change": along(values, "drift"), "length_s": values[LENGTH]}
    if variant != "warm-up":
        raise NotSimulatedError("a slow curve of any shape belongs to that session")
    return {"amplitude": along(values, "warm_up"), "tau_s": values["time_constant"]}


def bias_repeatability(sensor: Sensor, scenario: Scenario, sigma: Values) -> Scenario:
    return electronics(scenario, sensor, bias_repeatability=triple(sigma))


def saturation(sensor: Sensor, scenario: Scenario, limit: Values) -> Scenario:
    return electronics(scenario, sensor, saturation=triple(limit))


def diagnosed_limit(values: Parameters, _variant: str) -> Size:
    limits = []
    for axis in AXES:
        seen = [abs(values[f"limit_{axis}{sign}"]) for sign in "+-" if f"limit_{axis}{sign}" in values]
        limits.append(min(seen) if seen else math.inf)
    return {"limit": tuple(limits)}


def lag(scenario: Scenario, sensor: Sensor, lag_s: Values = 0.0, cutoff_hz: float = 0.0, order: int = 2) -> Scenario:
    part = getattr(scenario, checked(sensor)).electronics
    return electronics(
        scenario, sensor, lag_s=triple(lag_s), filter=replace(part.filter, cutoff_hz=cutoff_hz, order=order)
    )


def diagnosed_lag(values: Parameters, _variant: str) -> Size:
    sensor = "accelerometer" if any(name.startswith("accelerometer") for name in values) else "gyroscope"
    symbol = "accelerometer_lag" if sensor == "accelerometer" else "gyro_lag"
    lag = (values[symbol],) * 3 if symbol in values else along(values, symbol)
    if min(lag) < 0.0:
        raise NotSimulatedError("its lag is negative: the other sensor lags")
    return {"sensor": sensor, "lag_s": lag}


def interference(scenario: Scenario, sensor: Sensor, frequency_hz: float, amplitude: Values) -> Scenario:
    part = getattr(scenario, checked(sensor)).electronics
    return electronics(
        scenario, sensor, interference=(*part.interference, Interference(frequency_hz, triple(amplitude)))
    )


def diagnosed_interference(values: Parameters, _variant: str) -> list[Size]:
    out: list[Size] = []
    for sensor, letter in (("accelerometer", "a"), ("gyroscope", "g")):
        amplitude = tuple(values.get(f"amplitude_{letter}{axis}", 0.0) for axis in AXES)
        if any(amplitude):
            out.append({"sensor": sensor, "frequency_hz": values["frequency"], "amplitude": amplitude})
    return out


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


ACCEL: Sensor = "accelerometer"
GYRO: Sensor = "gyroscope"
THERMAL_BIAS = axes(per_k="bias_per_kelvin", per_k2="bias_per_kelvin2")
THERMAL_SCALE = axes(per_k="scale_per_kelvin")
EFFECTS: Effects = {
    "accel-scale-asymmetry": (asymmetry, axes(asymmetry="half_difference")),
    "accel-thermal-bias": (partial(thermal, ACCEL, "bias"), THERMAL_BIAS),
    "accel-thermal-scale": (partial(thermal, ACCEL, "scale"), THERMAL_SCALE),
    "gyro-thermal-bias": (partial(thermal, GYRO, "bias"), THERMAL_BIAS),
    "gyro-thermal-scale": (partial(thermal, GYRO, "scale"), THERMAL_SCALE),
    "accel-bias-drift": (partial(drift, ACCEL), diagnosed_drift),
    "gyro-bias-drift": (partial(drift, GYRO), diagnosed_drift),
    "accel-bias-repeatability": (
        partial(bias_repeatability, ACCEL),
        lambda v, _: {"sigma": (v["sigma"],) * 3},
    ),
    "gyro-bias-repeatability": (partial(bias_repeatability, GYRO), axes(sigma="sigma")),
    "accel-saturation": (partial(saturation, ACCEL), diagnosed_limit),
    "gyro-saturation": (partial(saturation, GYRO), diagnosed_limit),
    "sensor-lag": (lag, diagnosed_lag),
    "periodic-interference": (interference, diagnosed_interference),
    "quantisation": (quantisation, nothing),
    "supply-sensitivity": (supply, nothing),
    "axis-handedness": (handedness, nothing),
}


def noted(scenario: Scenario) -> Noted:
    for name, prefix in SENSORS.items():
        sensor = getattr(scenario, name)
        yield from _of_electronics(scenario, name, prefix)
        # Quantisation matters where the noise of one sample does not dither the LSB.
        smear = max(sensor.noise.N) * math.sqrt(scenario.clock.rate_hz)
        coarse = 0.5 * sensor.adc.lsb * float(np.linalg.norm(np.asarray(sensor.S), axis=0).max()) > smear
        if sensor.adc.dead_band or sensor.adc.missing_every or (coarse and sensor.adc.lsb > 0.0):
            yield "quantisation", {name: (sensor.adc.lsb, sensor.adc.dead_band, sensor.adc.missing_every)}
        if np.linalg.det(np.asarray(sensor.S)) < 0.0:
            yield "axis-handedness", {name: "left-handed"}


def _of_electronics(scenario: Scenario, name: Sensor, prefix: str) -> Noted:
    part, temperature = getattr(scenario, name).electronics, scenario.environment.temperature
    if not temperature.is_constant_reference:
        for kind in ("bias", "scale"):
            linear, quadratic = getattr(part.thermal, f"{kind}_per_k"), getattr(part.thermal, f"{kind}_per_k2")
            if any(linear) or any(quadratic):
                yield f"{prefix}-thermal-{kind}", {"per_k": linear, "per_k2": quadratic, "logged": temperature.logged}
    if any(part.asymmetry) and prefix == "accel":  # a gyro's is one of its nonlinearities
        yield "accel-scale-asymmetry", {"asymmetry": part.asymmetry}
    if any(part.drift.amplitude):
        yield f"{prefix}-bias-drift", {"amplitude": part.drift.amplitude, "tau_s": part.drift.tau_s}
    if any(part.drift.change):
        yield f"{prefix}-bias-drift", {"change": part.drift.change, "length_s": part.drift.length_s}
    if any(part.bias_repeatability) or any(part.bias_in_moves):
        in_moves = {"in_moves": part.bias_in_moves} if any(part.bias_in_moves) else {}
        yield f"{prefix}-bias-repeatability", {"sigma": part.bias_repeatability, **in_moves}
    if any(math.isfinite(v) for v in part.saturation):
        yield f"{prefix}-saturation", {"limit": part.saturation}
    if any(part.lag_s) or part.filter.cutoff_hz:
        yield "sensor-lag", {name: (part.lag_s, part.filter.cutoff_hz, part.filter.order)}
    for line in part.interference:
        yield "periodic-interference", {name: (line.frequency_hz, line.amplitude)}
    if part.ratiometric:
        yield "supply-sensitivity", {name: part.ratiometric}
