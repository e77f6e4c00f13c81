"""What poses and moves of a scenario miss, beside a recording's: a ratio and what chance makes of it."""

from __future__ import annotations

import math
from collections.abc import Iterator
from dataclasses import dataclass, replace
from typing import Literal

import numpy as np

from trihedron.pipeline.driving import MovedAlike
from trihedron.probability import stdtrit
from trihedron.records.diagnosis import Diagnosis, NoiseDifference
from trihedron.simulate import Scenario
from trihedron.units import degrees_from_radians

AIMED_AT = (0.9, 1.1)
"""Ratio of what poses and moves miss, simulation over recording, within which the two are called alike."""
SEEDS = range(60, 76)
"""Simulations by which a ratio is told, none of those by which an improvement matched its scatter. What sixteen scatter
by is known to a fifth."""
FEWEST = 8
"""Of them that a calibration must carry: their scatter is known to a quarter."""
WHAT: tuple[tuple[Literal["poses", "moves"], Literal["accelerometer", "gyroscope"], str], ...] = (
    ("poses", "accelerometer", "m/s^2"),
    ("moves", "gyroscope", "deg"),
)
WORDS = {"poses": "in the length of gravity at rest", "moves": "when gravity is carried through them"}


@dataclass(frozen=True)
class MissRatio:
    """What a scenario's poses or moves miss (rms) over what the recording's do.

    ``value`` is the geometric mean over simulations; within ``interval`` lies the ratio of the two instruments, at
    chance ``1 - alpha``: the recording is one draw, and scatters by chance as the simulations do among themselves.
    """

    value: float
    interval: tuple[float, float]
    model: float
    recording: float

    @property
    def is_good(self) -> bool:
        """Whether the ratio itself is as aimed at."""
        return AIMED_AT[0] <= self.value <= AIMED_AT[1]

    @property
    def may_be_chance(self) -> bool:
        """Whether a ratio as aimed at is within the interval."""
        return self.interval[0] <= AIMED_AT[1] and self.interval[1] >= AIMED_AT[0]


def miss_ratios(scenario: Scenario, beside: MovedAlike, alpha: float) -> dict[str, MissRatio]:
    """Ratios of ``poses`` and ``moves``, those that both sides tell (eq. 9.5)."""
    seen = {"poses": beside.poses, "moves": beside.moves}
    out: dict[str, MissRatio] = {}
    drawn = beside.draws(scenario, SEEDS)
    for k, (what, square) in enumerate(seen.items()):
        found = miss_ratio([one[k] for one in drawn], square, alpha)
        if found is not None:
            out[what] = found
    return out


def miss_ratio(made: list[float | None], square: float | None, alpha: float) -> MissRatio | None:
    """Ratio of the mean squares that simulations ``made`` to the recording's; ``None`` where too few tell."""
    squares = np.array([one for one in made if one is not None and one > 0.0])
    if square is None or square <= 0.0 or len(squares) < FEWEST:
        return None
    roots = 0.5 * np.log(squares / square)
    n = len(roots)
    # One more draw of the same kind is what the recording would be: Student's prediction interval.
    wide = stdtrit(n - 1, 1.0 - 0.5 * alpha) * float(roots.std(ddof=1)) * math.sqrt(1.0 + 1.0 / n)
    value = float(roots.mean())
    return MissRatio(
        math.exp(value),
        (math.exp(value - wide), math.exp(value + wide)),
        math.exp(value) * math.sqrt(square),
        math.sqrt(square),
    )


def misses_compared(scenario: Scenario, beside: MovedAlike, alpha: float) -> Iterator[NoiseDifference]:
    """The ratios as differences: significant where chance does not make one as aimed at look like that."""
    ratios = miss_ratios(scenario, beside, alpha)
    for what, sensor, unit in WHAT:
        if what not in ratios:
            continue
        one = ratios[what]
        factor = degrees_from_radians(1.0) if unit == "deg" else 1.0
        remark = (
            f"{what.capitalize()} of the model miss {one.value:.2f} times ({one.interval[0]:.2f} to "
            f"{one.interval[1]:.2f}) what the recording's do {WORDS[what]}: what inside the poses looks like noise is "
            "not all that makes them miss, or not as much."
        )
        yield NoiseDifference(
            sensor, "", what, factor * one.model, factor * one.recording, one.value, one.interval, unit, None,
            not one.may_be_chance, remark if not one.may_be_chance else "",
        )  # fmt: skip


def held_to_misses(found: Diagnosis, scenario: Scenario, beside: MovedAlike, alpha: float) -> Diagnosis:
    """A diagnosis that found a scenario consistent, which it stays where its poses and moves miss alike."""
    compared = tuple(misses_compared(scenario, beside, alpha))
    differ = any(one.significant for one in compared)
    return replace(
        found,
        noise_compared=(*found.noise_compared, *compared),
        verdict="parameters-differ" if differ else found.verdict,
    )
