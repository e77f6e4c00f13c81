"""Words of the accelerometers' effects."""

from __future__ import annotations

from types import MappingProxyType

from trihedron.report.effects.entry import EffectWords
from trihedron.report.effects.shared import (
    BOTH_SIDES_OF_LEVEL,
    COME_BACK,
    LOG_TEMPERATURE,
    TWO_TEMPERATURES,
    UP_AND_DOWN,
    drifts,
    follows_temperature,
    saturates,
)

ENTRIES = (
    EffectWords(
        "accel-cubic",
        "the accelerometers have a cubic nonlinearity, as a differential capacitive bridge does",
        "add tilts between the faces (20° steps): an odd curve bends between level and 1 g",
    ),
    EffectWords("accel-quadratic", "the accelerometers have a quadratic nonlinearity", BOTH_SIDES_OF_LEVEL),
    EffectWords(
        "accel-scale-asymmetry",
        "the accelerometer scale differs between positive and negative force",
        BOTH_SIDES_OF_LEVEL,
    ),
    EffectWords(
        "accel-hysteresis",
        "the accelerometer bias depends on the previous orientation",
        "reach the same pose from opposite directions, twice each",
    ),
    EffectWords(
        "accel-size-effect",
        "the three accelerometers do not sit at one point",
        "spin and shake the sensor about each axis in turn",
    ),
    EffectWords(
        "accel-thermal-bias",
        "the accelerometer bias depends on temperature",
        UP_AND_DOWN,
        follows_temperature("accelerometer", "mm/s²"),
        "repeat the cycle with the sensor turned over",
    ),
    EffectWords("accel-thermal-scale", "the accelerometer scale depends on temperature", TWO_TEMPERATURES),
    EffectWords(
        "accel-bias-drift",
        "the accelerometer bias drifts smoothly in time; no logged channel explains it",
        LOG_TEMPERATURE,
        drifts("accelerometer", "mm/s²", "as a random walk", " A settling support has the same effect across gravity."),
    ),
    EffectWords(
        "accel-bias-repeatability",
        "the accelerometer bias changes from pose to pose",
        COME_BACK,
        MappingProxyType(
            {
                "scatter": "The accelerometer bias repeats only to {sigma:.2g mm/s²} per axis (1 σ) from pose to pose, "
                "beyond noise and drift; neither orientation nor temperature explains it."
            }
        ),
    ),
    saturates("accel-saturation", "accelerometer"),
    EffectWords(
        "lever-arm",
        "the accelerometers sit away from the centre of rotation",
        "turn about another point: a lever arm changes with the centre of rotation, a displacement does not",
        MappingProxyType(
            {
                "arm": "The accelerometers sit {arm_m:.1f cm} from the centre of rotation: one arm predicts "
                "{share:.0f %} of the acceleration in cross-validated moves."
            }
        ),
    ),
)
