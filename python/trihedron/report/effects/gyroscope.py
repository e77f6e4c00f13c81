"""Words of the gyros' effects."""

from __future__ import annotations

from types import MappingProxyType

from trihedron.report.effects.entry import EffectWords
from trihedron.report.effects.shared import (
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
        "gyro-g-sensitivity",
        "the gyro bias depends on specific force: the static rate changes with the pose",
        "keep each of the six faces up for a minute; turn the table by 180° to rule out Earth rate",
    ),
    EffectWords(
        "gyro-scale-nonlinearity",
        "the gyro scale depends on rate",
        "turn by the same angle slowly and fast, both ways, about each axis",
    ),
    EffectWords(
        "gyro-thermal-bias", "the gyro bias depends on temperature", UP_AND_DOWN, follows_temperature("gyro", "°/s")
    ),
    EffectWords("gyro-thermal-scale", "the gyro scale depends on temperature", TWO_TEMPERATURES),
    EffectWords(
        "gyro-bias-drift",
        "the gyro bias drifts smoothly in time; no logged channel explains it",
        LOG_TEMPERATURE,
        drifts("gyro", "°/s", "as a random walk, beyond its noise"),
    ),
    EffectWords(
        "gyro-bias-repeatability",
        "the gyro bias changes from pose to pose",
        COME_BACK,
        MappingProxyType(
            {
                "scatter": "The gyro bias repeats only to {sigma:all .2g °/s} (X, Y, Z; 1 σ) from pose to pose, beyond "
                "noise and drift; it follows neither gravity nor a logged temperature."
            }
        ),
    ),
    saturates("gyro-saturation", "gyro"),
    EffectWords(
        "earth-rate",
        "the gyros measure the rotation of the Earth",
        "turn the level sensor by 180° on the table: Earth rate changes its horizontal part, g-sensitivity does not",
        MappingProxyType(
            {
                "latitude": "the gyros measure the rotation of the Earth (at its rate that is a latitude of "
                "{latitude_deg:abs .0f}° ± {latitude_std_deg:.1g}°; north lies {azimuth_deg:.0f}° ± "
                "{azimuth_std_deg:.1g}° from X of the first pose)."
            }
        ),
    ),
)
