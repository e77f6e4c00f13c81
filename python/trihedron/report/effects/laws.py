"""What is said of laws of what stays unexplained, by the family of their variables."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Any

from trihedron.report.findings.wording import filled


@dataclass(frozen=True)
class FamilyWords:
    """``experiment`` that would prove a law of this family; ``resembles``: mechanisms that follow such variables."""

    experiment: str
    resembles: tuple[str, ...] = ()


FAMILIES: Mapping[str, FamilyWords] = MappingProxyType(
    {
        "room": FamilyWords(
            "hold the same poses with the table turned by 90° about the vertical, and once more with a magnet near by",
            ("a magnetic field",),
        ),
        "earth": FamilyWords(
            "hold the same poses with the table turned by 90° about the vertical, and once more with a magnet near by",
            ("the Earth's turn",),
        ),
        "force": FamilyWords("hold poses on edges and corners as well as on faces, each twice", ("unequal stiffness",)),
        "previous pose": FamilyWords(
            "reach one pose from six different ones, twice each", ("hysteresis", "creep after a turn")
        ),
        "last turn": FamilyWords(
            "reach one pose by turns of either sign, small and large, waiting unlike times",
            ("play or slip in a mounting", "memory of the readout"),
        ),
        "temperature": FamilyWords(
            "repeat a few poses while the temperature takes another course: up, down, and held",
            ("a thermal bias of another shape",),
        ),
        "supply": FamilyWords("repeat one pose at three supply voltages", ("a ratiometric readout",)),
        "vibration": FamilyWords("hold one pose with the shaking on and off", ("rectification",)),
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
"""By the family that the dictionary of variables gives (``diagnose/laws``); a family not named here has no words."""

SENTENCES: Mapping[str, str] = MappingProxyType(
    {
        "follows": "The {sensor}'s {is_at_rest:?zero|reading in motion} ({axes:&, }) follows {depends:and}: "
        "{share:.0f %} of the held-out misfit.",
        "follows-room": "The gyro's zero follows a vector fixed in the room, {inclination_deg:.0f}° ± "
        "{inclination_sigma_deg:.0f}° from the vertical: {share:.0f %} of the held-out misfit.",
        "form": "reading of {axes:&, } grows by {terms:& + }",
        "form-room": "zero = K Rᵀ m, m a unit vector fixed in the room",
        "angle-to-vertical": "angle to the vertical",
    }
)


def law_words(case: str, values: Mapping[str, Any]) -> str:
    """A sentence about a law.

    Raises
    ------
    KeyError
        When there is no such sentence, or a place of it has no value.
    """
    return filled(SENTENCES[case], values, {})


def family_words(family: str) -> FamilyWords:
    """Experiment and resemblances of a family of variables; empty for one that the catalogue does not hold."""
    return FAMILIES.get(family, FamilyWords(""))
