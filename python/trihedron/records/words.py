"""Words of the catalogue: the only English text that a value of a finding, or a field beside it, may contain."""

from typing import Any

from trihedron.answers import ask


class Words(str):
    """Words of the catalogue under ``report/``; a stage passes them on and never writes any."""

    __slots__ = ()


def words(phrase: str, /, **values: Any) -> Words:
    """The catalogue's words for a phrase by its id, with values inserted (``report/findings/phrases.py``).

    Raises KeyError when the catalogue has no such phrase, or a placeholder of it has no value.
    """
    return Words(ask("phrase", phrase, values))


def effect_words(effect_id: str, case: str, /, **values: Any) -> Words:
    """The statement about an accepted effect, by its id and case, with values (``report/effects``).

    Raises KeyError when the catalogue has no such case, or a placeholder of it has no value.
    """
    return Words(ask("effect_words", effect_id, case, values))


def experiment_for(effect_id: str) -> Words:
    """The recording that separates an effect from others; empty where the catalogue has none."""
    return Words(ask("experiment", effect_id))


def why_not(name: str, /, **values: Any) -> Words:
    """Why a recording cannot show an effect, by its id (``report/effects/catalogue.py``).

    Raises KeyError when there is no such reason, or a placeholder of it has no value.
    """
    return Words(ask("why_not", name, values))


def relation_experiment(family: str) -> Words:
    """The experiment that tests an empirical relation of a family of variables; empty where the catalogue has none."""
    return Words(ask("family_words", family).experiment)


def relation_resembles(family: str) -> tuple[Words, ...]:
    """Mechanisms that depend on such variables."""
    return tuple(map(Words, ask("family_words", family).resembles))
