"""Effects of the diagnosis catalogue, simulated by their mechanism at a stated size, and read back as truth.

``with_effect(scenario, id, ...)`` returns a new scenario; sizes are SI. No formula is shared with an estimator.
"""

from __future__ import annotations

import inspect
from typing import Any

from trihedron.errors import RefusedError
from trihedron.sanitise import meant
from trihedron.simulate.effects import experiment, sensor
from trihedron.simulate.effects.sizes import Change
from trihedron.simulate.effects.truth import effects_of
from trihedron.simulate.scenario import Scenario

__all__ = ["EFFECT_IDS", "effects_of", "with_effect"]

_EFFECTS: dict[str, Change] = {
    "accel-quadratic": sensor.accel_quadratic,
    "accel-cubic": sensor.accel_cubic,
    "accel-scale-asymmetry": sensor.accel_asymmetry,
    "accel-hysteresis": sensor.accel_hysteresis,
    "accel-thermal-bias": sensor.thermal("accelerometer", "bias"),
    "accel-thermal-scale": sensor.thermal("accelerometer", "scale"),
    "gyro-thermal-bias": sensor.thermal("gyroscope", "bias"),
    "gyro-thermal-scale": sensor.thermal("gyroscope", "scale"),
    "accel-bias-drift": sensor.drift("accelerometer"),
    "gyro-bias-drift": sensor.drift("gyroscope"),
    "accel-bias-repeatability": sensor.bias_repeatability("accelerometer"),
    "gyro-bias-repeatability": sensor.bias_repeatability("gyroscope"),
    "gyro-g-sensitivity": sensor.g_sensitivity,
    "gyro-scale-nonlinearity": sensor.gyro_nonlinearity,
    "gyro-saturation": sensor.saturation("gyroscope"),
    "accel-saturation": sensor.saturation("accelerometer"),
    "lever-arm": sensor.lever_arm,
    "accel-size-effect": sensor.size_effect,
    "accel-gyro-time-offset": experiment.time_offset,
    "sensor-lag": sensor.lag,
    "dropped-samples": experiment.dropped,
    "timing-jitter": experiment.jitter,
    "earth-rate": experiment.earth_rate,
    "vibration-rectification": experiment.rectification,
    "periodic-interference": sensor.interference,
    "quantisation": sensor.quantisation,
    "supply-sensitivity": sensor.supply,
    "disturbed-pose": experiment.disturbed,
    "turn-angle-error": experiment.turn_errors,
    "table-tilt": experiment.table_tilt,
    "axis-handedness": sensor.handedness,
}

EFFECT_IDS: tuple[str, ...] = tuple(_EFFECTS)
"""Ids of the diagnosis catalogue that can be simulated: all of them."""


def with_effect(scenario: Scenario, effect_id: str, **size: Any) -> Scenario:
    """The scenario with one effect of the catalogue added at a stated size.

    Raises ``RefusedError`` when the id is unknown, or a parameter is unknown, missing or invalid.
    """
    if effect_id not in _EFFECTS:
        raise RefusedError(
            f"no effect is called {effect_id!r}{meant(effect_id, _EFFECTS)}; there are {', '.join(_EFFECTS)}"
        )
    takes = dict(list(inspect.signature(_EFFECTS[effect_id]).parameters.items())[1:])
    words = ", ".join(name if p.default is p.empty else f"{name} (may be left out)" for name, p in takes.items())
    if unknown := [name for name in size if name not in takes]:
        raise RefusedError(f"effect {effect_id} has no {unknown[0]!r}{meant(unknown[0], takes)}; it takes {words}")
    if missing := [name for name, p in takes.items() if p.default is p.empty and name not in size]:
        raise RefusedError(f"effect {effect_id} needs {', '.join(missing)}; it takes {words}")
    try:
        return _EFFECTS[effect_id](scenario, **size)
    except TypeError as error:
        raise RefusedError(f"effect {effect_id}: {str(error).split('() ', 1)[-1]}") from None
