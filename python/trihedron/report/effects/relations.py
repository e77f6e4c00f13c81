"""Experiments that test an empirical relation, and mechanisms that it resembles, by the family of its variables."""

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType


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
        "telegraph": FamilyWords(
            "record a static log of an hour: a histogram of means over a second has two peaks",
            ("burst noise (popcorn noise) of the readout",),
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
        "angular acceleration": FamilyWords(
            "pivot about a fixed point, starting and stopping briskly, then smoothly", ("a lever arm",)
        ),
        "force rate": FamilyWords("shake along one axis without turning"),
    }
)
"""Words by family of variables, as defined in ``diagnose/relations``; other families have none."""


def family_words(family: str) -> FamilyWords:
    """Experiment and resembling mechanisms of a family of variables; empty for one not in the catalogue."""
    return FAMILIES.get(family, FamilyWords(""))
