"""Words of the catalogue: the only English that a value of a finding, or a field beside it, may hold."""

from __future__ import annotations

from typing import Any

from trihedron.answers import ask


class Words(str):
    """Words that the catalogue under ``report/`` has written; a stage hands them on and never writes any."""

    __slots__ = ()


def words(phrase: str, /, **values: Any) -> Words:
    """The catalogue's words for a phrase by its id, with values in its places (``report/findings/phrases.py``).

    Raises
    ------
    KeyError
        When the catalogue has no such phrase, or a place of it has no value.
    """
    return Words(ask("phrase", phrase, values))


def effect_words(effect_id: str, case: str, /, **values: Any) -> Words:
    """What is said of an effect that is accepted, by its id and case, with values (``report/effects``).

    Raises
    ------
    KeyError
        When the catalogue has no such case, or a place of it has no value.
    """
    return Words(ask("effect_words", effect_id, case, values))


def experiment_for(effect_id: str, *, at_rest: bool = False) -> Words:
    """What to record so that an effect cannot be mistaken for another; empty where the catalogue has none."""
    return Words(ask("experiment", effect_id, at_rest=at_rest))


def why_not(name: str, /, **values: Any) -> Words:
    """Why a recording cannot show an effect, by its id (``report/effects/reasons.py``).

    Raises
    ------
    KeyError
        When there is no such reason, or a place of it has no value.
    """
    return Words(ask("why_not", name, values))


def relation_experiment(family: str) -> Words:
    """What would prove a law of a family of variables; empty where the catalogue has none."""
    return Words(ask("family_words", family).experiment)


def relation_resembles(family: str) -> tuple[Words, ...]:
    """Mechanisms that follow such variables."""
    return tuple(map(Words, ask("family_words", family).resembles))
