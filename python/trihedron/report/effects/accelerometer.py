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
        "accelerometers respond to the cube of specific force, as a differential capacitive bridge does",
        "add tilts between the faces (20° steps): an odd curve bends between level and 1 g",
    ),
    EffectWords(
        "accel-quadratic",
        "accelerometers respond to the square of specific force",
        BOTH_SIDES_OF_LEVEL,
    ),
    EffectWords(
        "accel-scale-asymmetry",
        "accelerometers scale positive and negative force differently",
        BOTH_SIDES_OF_LEVEL,
    ),
    EffectWords(
        "accel-hysteresis",
        "accelerometer offsets remember the previous orientation",
        "reach the same pose from opposite directions, twice each",
    ),
    EffectWords(
        "accel-size-effect",
        "the three accelerometers do not sit at one point",
        "spin and shake the sensor about each axis in turn",
    ),
    EffectWords(
        "accel-thermal-bias",
        "accelerometer bias follows the temperature",
        UP_AND_DOWN,
        follows_temperature("accelerometer", "mm/s²"),
        "repeat the cycle with the sensor turned over",
    ),
    EffectWords(
        "accel-thermal-scale",
        "accelerometer scale follows the temperature",
        TWO_TEMPERATURES,
    ),
    EffectWords(
        "accel-hidden-drift",
        "accelerometer bias drifts smoothly in time though no logged channel explains it",
        LOG_TEMPERATURE,
        drifts("accelerometer", "mm/s²", "as a walk", " A support that settles does the same across gravity."),
    ),
    EffectWords(
        "accel-zero-scatter",
        "the accelerometer's bias is another in every pose",
        COME_BACK,
        MappingProxyType(
            {
                "scatter": "The accelerometer's bias is another in every pose, by {sigma:.2g mm/s²} per axis (one "
                "standard deviation), beyond noise and drift; no pose or temperature accounts for it."
            }
        ),
    ),
    saturates("accel-saturation", "accelerometer"),
    EffectWords(
        "lever-arm",
        "the accelerometers sit away from the centre of rotation",
        "turn about another point: an arm follows the centre of rotation, a displacement inside the case does not",
        MappingProxyType(
            {
                "arm": "The accelerometers sit {arm_m:.1f cm} from the centre of rotation: one arm predicts "
                "{share:.0f %} of the acceleration in moves it was not fitted to (what hands do most weighs least)."
            }
        ),
    ),
)
