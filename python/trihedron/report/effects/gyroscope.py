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
        "gyro bias depends on specific force: the rate read at rest changes with the pose",
        "hold each of the six faces for a minute; turn the table by 180° under a level sensor to rule out Earth rate",
    ),
    EffectWords(
        "gyro-scale-nonlinearity",
        "gyro scale depends on the rate",
        "turn by the same angle slowly and fast, both ways, about each axis",
    ),
    EffectWords(
        "gyro-thermal-bias",
        "gyro bias follows the temperature",
        UP_AND_DOWN,
        follows_temperature("gyro", "°/s"),
    ),
    EffectWords(
        "gyro-thermal-scale",
        "gyro scale follows the temperature",
        TWO_TEMPERATURES,
    ),
    EffectWords(
        "gyro-hidden-drift",
        "gyro bias drifts smoothly in time though no logged channel explains it",
        LOG_TEMPERATURE,
        drifts("gyro", "°/s", "as a walk, beyond its noise"),
    ),
    EffectWords(
        "gyro-zero-scatter",
        "the gyro's bias is another in every pose",
        COME_BACK,
        MappingProxyType(
            {
                "scatter": "The gyro's bias is another in every pose, by {sigma:all .2g °/s} (x, y, z; one standard "
                "deviation), beyond noise and drift; it follows neither gravity nor a logged temperature."
            }
        ),
    ),
    saturates("gyro-saturation", "gyro"),
    EffectWords(
        "earth-rate",
        "the gyros see the Earth turn",
        "turn the level sensor by 180° on the table: Earth rate changes its horizontal part, g-sensitivity does not",
        MappingProxyType(
            {
                "latitude": "the gyros see the Earth turn (at its one rate that is a latitude of "
                "{latitude_deg:abs .0f}° ± {latitude_std_deg:.1g}°; north lies {azimuth_deg:.0f}° ± "
                "{azimuth_std_deg:.1g}° from the first pose's x)."
            }
        ),
    ),
)
