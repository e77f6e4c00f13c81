"""The closed catalogue of sentences about effects, by effect and case."""

from collections.abc import Mapping
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


def experiment(effect_id: str, *, is_static: bool) -> str:
    """The recording that separates the effect from others; empty for one from outside the package."""
    entry = CATALOGUE.get(effect_id)
    return "" if entry is None else entry.static_experiment if is_static else entry.experiment


def why_not(name: str, values: Mapping[str, Any]) -> str:
    """Why a recording cannot show an effect.

    Raises
    ------
    KeyError
        When there is no such reason, or a placeholder of it has no value.
    """
    return filled(REASONS[name], values, {})
