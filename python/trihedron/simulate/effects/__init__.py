"""Effects of the diagnosis catalogue, simulated by their mechanism at a stated size, and read back as truth.

``with_effect(scenario, id, ...)`` returns a new scenario; sizes are SI. No formula is shared with an estimator.
"""

import inspect
from collections.abc import Mapping, Sequence
from functools import partial
from typing import Any, Literal

from trihedron.errors import InputError
from trihedron.sanitise import meant
from trihedron.simulate.effects import experiment, found, sensor
from trihedron.simulate.effects.found import Found, Size
from trihedron.simulate.effects.sizes import Change
from trihedron.simulate.effects.truth import effects_of
from trihedron.simulate.scenario import Scenario

__all__ = ["EFFECT_IDS", "diagnosed_sizes", "effects_of", "with_effect"]

A: Literal["accelerometer"]
G: Literal["gyroscope"]
A, G = "accelerometer", "gyroscope"
EFFECTS: dict[str, tuple[Change, Found]] = {
    "accel-quadratic": (sensor.accel_quadratic, found.axes(k2="K2")),
    "accel-cubic": (sensor.accel_cubic, found.axes(k3="K3")),
    "accel-scale-asymmetry": (sensor.accel_asymmetry, found.axes(asymmetry="half_difference")),
    "accel-hysteresis": (sensor.accel_hysteresis, found.hysteresis),
    "accel-thermal-bias": (partial(sensor.thermal, A, "bias"), found.thermal_bias),
    "accel-thermal-scale": (partial(sensor.thermal, A, "scale"), found.thermal_scale),
    "gyro-thermal-bias": (partial(sensor.thermal, G, "bias"), found.thermal_bias),
    "gyro-thermal-scale": (partial(sensor.thermal, G, "scale"), found.thermal_scale),
    "accel-bias-drift": (partial(sensor.drift, A), found.drift),
    "gyro-bias-drift": (partial(sensor.drift, G), found.drift),
    "accel-bias-repeatability": (partial(sensor.bias_repeatability, A), found.one_sigma),
    "gyro-bias-repeatability": (partial(sensor.bias_repeatability, G), found.axes(sigma="sigma")),
    "gyro-g-sensitivity": (sensor.g_sensitivity, found.g_sensitivity),
    "gyro-scale-nonlinearity": (sensor.gyro_nonlinearity, found.axes(c2="quadratic", c3="cubic")),
    "gyro-saturation": (partial(sensor.saturation, G), found.limit),
    "accel-saturation": (partial(sensor.saturation, A), found.limit),
    "lever-arm": (sensor.lever_arm, found.axes(arm_m="r")),
    "accel-size-effect": (sensor.size_effect, found.places),
    # The gyro sampling later under the same timestamp is equivalent to the accelerometer being delayed.
    "accel-gyro-time-offset": (experiment.time_offset, found.number("offset_s", "accelerometer_delay")),
    "sensor-lag": (sensor.lag, found.lag),
    "dropped-samples": (experiment.dropped, found.losses),
    "timing-jitter": (experiment.jitter, found.number("jitter_s", "jitter")),
    "earth-rate": (experiment.earth_rate, found.earth_rate),
    "vibration-rectification": (experiment.rectification, found.rectification),
    "periodic-interference": (sensor.interference, found.interference),
    "quantisation": (sensor.quantisation, found.nothing),
    "supply-sensitivity": (sensor.supply, found.nothing),
    "disturbed-pose": (experiment.disturbed, found.nothing),
    "turn-angle-error": (experiment.turn_errors, found.nothing),
    "table-tilt": (experiment.table_tilt, found.nothing),
    "axis-handedness": (sensor.handedness, found.nothing),
}
"""How each effect of the catalogue is added to a scenario, and its size from the parameters of a diagnosis."""

EFFECT_IDS: tuple[str, ...] = tuple(EFFECTS)
"""Ids of the diagnosis catalogue that can be simulated: all of them."""


def with_effect(scenario: Scenario, effect_id: str, **size: Any) -> Scenario:
    """The scenario with one effect of the catalogue added at a stated size.

    Raises ``InputError`` when the id is unknown, or a parameter is unknown, missing or invalid.
    """
    if effect_id not in EFFECTS:
        raise InputError(
            f"no effect is called {effect_id!r}{meant(effect_id, EFFECTS)}; there are {', '.join(EFFECTS)}"
        )
    change, _ = EFFECTS[effect_id]
    takes = dict(list(inspect.signature(change).parameters.items())[1:])
    words = ", ".join(name if p.default is p.empty else f"{name} (may be left out)" for name, p in takes.items())
    if unknown := [name for name in size if name not in takes]:
        raise InputError(f"effect {effect_id} has no {unknown[0]!r}{meant(unknown[0], takes)}; it takes {words}")
    if missing := [name for name, p in takes.items() if p.default is p.empty and name not in size]:
        raise InputError(f"effect {effect_id} needs {', '.join(missing)}; it takes {words}")
    try:
        return change(scenario, **size)
    except TypeError as error:
        raise InputError(f"effect {effect_id}: {str(error).split('() ', 1)[-1]}") from None


def diagnosed_sizes(
    effects: Sequence[Mapping[str, Any]], length_s: float | None = None
) -> tuple[list[tuple[str, Size]], dict[str, str]]:
    """Accepted effects as ids and sizes of mechanisms (keys of :func:`with_effect`), and why others are excluded.

    ``length_s`` is the duration of the recording in which the effects were found.
    """
    out: list[tuple[str, Size]] = []
    left_out: dict[str, str] = {}
    for effect in effects:
        effect_id = str(effect["id"])
        values = {str(p["name"]): float(p["value"]) for p in effect["parameters"] if p["value"] is not None}
        if length_s is not None:
            values[found.LENGTH] = length_s
        variant = str(effect.get("model", {}).get("variant", ""))
        _, of_diagnosis = EFFECTS.get(effect_id, (None, found.nothing))
        try:
            size = of_diagnosis(values, variant)
        except found.NotSimulatedError as why:
            left_out[effect_id] = str(why)
        else:
            out += [(effect_id, one) for one in (size if isinstance(size, list) else [size])]
    return out, left_out
