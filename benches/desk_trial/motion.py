"""A session's motion: timetable, path, and what happens when a thing is set down or somebody leans on the table."""

from __future__ import annotations

from dataclasses import dataclass
from typing import Any

import numpy as np

from desk_trial.parts import Session
from desk_trial.paths import PATHS, Timetable
from desk_trial.turns import DEGREE, Array, exponential, level, minimum_jerk, product, stream


@dataclass(frozen=True)
class Motion:
    """(N,) s, (N, 4) attitude body → room, (N, 3) m, and the (begin, end) of every pose in s."""

    time: Array
    q: Array
    place: Array
    rests: list[tuple[float, float]]


def _timetable(s: Session, rate: float, rng: np.random.Generator) -> Timetable:
    n = s.poses
    holds = np.clip(s.hold_s * np.exp(0.18 * rng.normal(size=n)), 1.8, 16)
    holds[0] += rng.uniform(0.5, 3)
    moves = rng.uniform(*s.move_s, size=n - 1)
    gaps = rng.uniform(0.05, 0.3, size=n - 1)
    begin = np.concatenate([[0.0], np.cumsum(holds[:-1] + moves + gaps)])
    end = begin + holds
    return Timetable(begin, end, np.arange(int((end[-1] + 0.2) * rate)) / rate, rate)


def _ringing(x: Array, hz: float, decay_s: float, onset_s: float) -> Array:
    return np.asarray(np.exp(-x / decay_s) * np.sin(2 * np.pi * hz * x) * minimum_jerk(x / onset_s))


def _set_down(s: Session, seed: int, table: Timetable) -> tuple[Array, Array]:
    """(N, 3) rotation (rad) and shift (m): a knock, a rocking, the creep of a soft support, in every pose but the
    first.
    """
    rng = stream(seed, "down")
    t = table.time
    turn, shift = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    for i in range(1, s.poses):
        start = table.begin[i] - 0.03
        rows = (t > start) & (t < table.end[i] + 0.25)
        x = t[rows] - start
        until = minimum_jerk((table.end[i] + 0.25 - t[rows]) / 0.25)
        hz, decay = rng.uniform(20, 60), rng.uniform(0.015, 0.05)
        size = s.knock_m_s2 * rng.uniform(0.2, 1) / (2 * np.pi * hz) ** 2
        way = [0.3 * rng.normal(), 0.3 * rng.normal(), 1]
        shift[rows] += np.outer(size * _ringing(x, hz, decay, 0.03), way)
        hz, decay, heading = rng.uniform(3, 8), rng.uniform(0.06, 0.2), rng.uniform(0, 6.28)
        size = s.rock_deg * DEGREE * rng.uniform(0.2, 1)
        turn[rows] += np.outer(size * _ringing(x, hz, decay, 0.05), level(heading))
        decay, heading = rng.uniform(0.8, 3), rng.uniform(0, 6.28)
        size = s.creep_deg * DEGREE * rng.uniform(0, 1)
        creep = size * (1 - np.exp(-x / decay)) * until * minimum_jerk(x / 0.05)
        turn[rows] += np.outer(creep, level(heading))
    return turn, shift


def leanings(s: Session, seed: int, flaw: dict[str, Any]) -> list[dict[str, float]]:
    """Who leans on the table, when and how hard: a nuisance of one session in five, or the flaw itself."""
    rng = stream(seed, "bump")
    out: list[dict[str, float]] = []
    if s.is_bumped:
        out = [{"pose": int(rng.integers(2, s.poses - 1)), "at": rng.uniform(0.2, 0.5), "s": rng.uniform(0.8, 1.5),
                "deg": rng.uniform(0.05, 0.2), "heading": rng.uniform(0, 6), "mm": 0.2}]  # fmt: skip
    if flaw.get("id") == "disturbed-pose":
        poses = rng.choice(np.arange(1, s.poses), flaw["n"], replace=False)
        out = [{"pose": int(i), "at": 0.25, "s": 1.5, "deg": flaw["deg"], "heading": rng.uniform(0, 6), "mm": 3}
               for i in poses]  # fmt: skip
    return out


def motion(s: Session, seed: int, rate: float, flaw: dict[str, Any]) -> Motion:
    """On a fine clock of this rate (Hz)."""
    rng = stream(seed, "motion")
    table = _timetable(s, rate, rng)
    q, place = PATHS[s.style](s, seed, rng, table)
    turn, shift = _set_down(s, seed, table)
    for lean in leanings(s, seed, flaw):
        i = int(lean["pose"])
        x = table.time - (table.begin[i] + lean["at"] * (table.end[i] - table.begin[i]))
        bell = minimum_jerk(x / 0.25) * minimum_jerk((lean["s"] - x) / 0.25)
        turn += np.outer(lean["deg"] * DEGREE * bell, level(lean["heading"]))
        shift += np.outer(lean["mm"] * 1e-3 * bell * np.sin(2 * np.pi * 3 * x), [1, 0, 0])
    q = product(exponential(turn), q)
    q /= np.linalg.norm(q, axis=1)[:, None]
    return Motion(table.time, q, place + shift, list(zip(table.begin.tolist(), table.end.tolist(), strict=True)))
