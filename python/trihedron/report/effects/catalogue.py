"""The closed catalogue of sentences about effects, by effect and case, and about empirical relations, by family."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from trihedron.report.effects.words import ACCELEROMETER, GYROSCOPE, SESSION, EffectWords
from trihedron.report.findings.wording import filled

CATALOGUE: Mapping[str, EffectWords] = MappingProxyType(ACCELEROMETER | GYROSCOPE | SESSION)
OF_ANY: Mapping[str, str] = MappingProxyType(
    {
        "strongest": "{mechanism} (strongest term {name}: {value:.3g} ± {std:.1g} {unit:unit}).",
        "only-model": "Only the model has it: {statement}{has_reason:? Of the recording {reason}, and nothing in it "
        "drifts by as much.|}",
    }
)
"""Sentences that any effect may use, by case."""
REASONS: Mapping[str, str] = MappingProxyType(
    {
        "no-gyro": "the log has no gyro",
        "no-moves": "the log has no moves with a gyro",
        "six-moves": "fewer than six moves with a gyro",
        "no-temperature": "the log has no temperature",
        "steady-temperature": "the temperature changes by less than {least_k:g} °C",
        "no-supply": "the log has no supply voltage",
        "steady-supply": "the supply voltage does not change",
        "even-vibration": "no pose vibrates more than the others",
        "no-table-turns": "the session has no turns on a table against a wall",
        "six-poses": "fewer than six poses",
        "few-orientations": "the log has too few orientations",
    }
)
"""Why a recording cannot show an effect: the words of a candidate that was not tried."""


def effect_words(effect_id: str, case: str, values: Mapping[str, Any]) -> str:
    """The sentence about an effect; an effect from outside the package has only those of ``OF_ANY``.

    Raises
    ------
    KeyError
        When the catalogue has no such case, or a placeholder of it has no value.
    """
    entry = CATALOGUE.get(effect_id)
    if case in OF_ANY:
        known = {} if entry is None else {"mechanism": entry.mechanism}
        return filled(OF_ANY[case], {**values, **known}, {})
    if entry is None:
        raise KeyError(effect_id)
    return filled(entry.said[case], values, entry.lines)


def experiment(effect_id: str) -> str:
    """The recording that separates the effect from others; empty for one from outside the package."""
    entry = CATALOGUE.get(effect_id)
    return "" if entry is None else entry.experiment


def why_not(name: str, values: Mapping[str, Any]) -> str:
    """Why a recording cannot show an effect.

    Raises
    ------
    KeyError
        When there is no such reason, or a placeholder of it has no value.
    """
    return filled(REASONS[name], values, {})


@dataclass(frozen=True)
class FamilyWords:
    """``experiment`` that tests a relation of this family; ``resembles``: mechanisms with such variables."""

    experiment: str
    resembles: tuple[str, ...] = ()


_TURNED_TABLE = (
    "record the same poses with the table turned by 90° about the vertical, and once more with a magnet nearby"
)
FAMILIES: Mapping[str, FamilyWords] = MappingProxyType(
    {
        "world": FamilyWords(_TURNED_TABLE, ("a magnetic field",)),
        "force": FamilyWords(
            "record poses on edges and corners as well as on faces, each twice", ("unequal stiffness",)
        ),
        "previous pose": FamilyWords(
            "reach one pose from six different ones, twice each", ("hysteresis", "settling after a rotation")
        ),
        "last rotation": FamilyWords(
            "reach one pose by turns of either sign, small and large, waiting unlike times",
            ("play or slip in a mounting", "memory of the readout"),
        ),
        "decaying rotation": FamilyWords(
            "turn by 90° at a time, both ways, and wait half a minute in every pose",
            ("creep of the sensing element or its mounting", "self-heating"),
        ),
        "telegraph": FamilyWords(
            "record a static log of an hour: a histogram of means over a second has two peaks",
            ("burst noise (popcorn noise) of the readout",),
        ),
        "noise": FamilyWords(
            "record the same poses again with sources of interference (motors, radio, chargers) off, then on",
            ("interference",),
        ),
        "temperature": FamilyWords(
            "repeat a few poses while the temperature takes another course: up, down, and constant",
            ("a thermal bias of another shape",),
        ),
        "rate products": FamilyWords(
            "turn about one axis at a time, then about two at once, at three rates; pivot about a fixed point",
            ("coupled drive modes", "displaced accelerometers"),
        ),
        "rate": FamilyWords("turn about each axis at three rates, both ways"),
        "rate times force": FamilyWords(
            "turn about a level and about a vertical axis at the same rate", ("a drive frame bent by weight",)
        ),
        "scale": FamilyWords(
            "repeat the session with a warm sensor, and log its temperature and its supply voltage",
            ("a scale that follows temperature or supply", "a mounting that slips"),
        ),
    }
)
"""Words by family of variables, as defined in ``diagnose/relations``; other families have none."""


def family_words(family: str) -> FamilyWords:
    """Experiment and resembling mechanisms of a family of variables; empty for one not in the catalogue."""
    return FAMILIES.get(family, FamilyWords(""))
