"""Fit of the gyro: parameters of one or several recordings, and effects by their score."""

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq
from scipy.special import chdtrc

from trihedron.arrays import FloatArray, IntArray
from trihedron.estimate.reference.beside import Beside, Point, SlowError, places, without_effects
from trihedron.estimate.reference.likelihood import (
    TYPICAL,
    Fitted,
    Problem,
    fit,
    most_likely,
    together,
)
from trihedron.records.reference import NAMED_FROM

ALWAYS = ("S", "b", "clock", "earth", "gyro-g-sensitivity")
"""Parameters of every hypothesis: g-sensitivity with a data-sheet prior, reported or not."""
EFFECTS = {"gyro-g-sensitivity": ("gyro-g-sensitivity",), "gyro-scale-nonlinearity": ("quadratic", "cubic")}
WIDER = (0.3, 1.0, 3.0, 10.0, 30.0)
"""Factors on the data-sheet prior σ of an effect that are tried."""
MARGIN = 2.0
SEARCH_COST = 2.0 * np.log(len(WIDER) * len(EFFECTS))
"""Correction of a score for multiple testing."""
LARGEST = 100.0
"""Largest size of an effect of a working part, in data-sheet sizes."""
RELINEARISED = 3
SURPRISE = 1e-6
"""False alarm rate of a deviating block, divided by the number of blocks."""
MOST_ROUNDS = 6
"""Rounds of excluding deviating blocks: a large deviation conceals smaller ones."""


@dataclass(frozen=True, eq=False)
class MotionFit:
    """Recordings in one fit: point of linearisation of each, indices of its parameters, fit about the points."""

    sides: list[Beside]
    points: list[Point]
    places: list[dict[str, IntArray]]
    problems: list[Problem]
    fitted: Fitted
    wider: Mapping[str, float]

    def value(self, k: int, name: str) -> FloatArray:
        """Value (n,) of a parameter of recording k, SI."""
        at = self.places[k][name]
        sigma = self.sides[k].sigma(name, self.wider)
        return np.asarray(self.sides[k].values(self.points[k], name) + sigma * self.fitted.mean[at])

    def covariance(self, k: int, names: tuple[str, ...]) -> FloatArray:
        """(n, n) covariance of parameters of recording k, SI."""
        at = np.concatenate([self.places[k][name] for name in names])
        sigma = np.concatenate([self.sides[k].sigma(name, self.wider) for name in names])
        return np.asarray(self.fitted.covariance[np.ix_(at, at)] * np.outer(sigma, sigma))


def fit_motion(
    sides: list[Beside], wanted: tuple[str, ...] = ALWAYS, wider: Mapping[str, float] | None = None,
    before: MotionFit | None = None,
) -> MotionFit:  # fmt: skip
    """Fit parameters and strengths of recordings of one instrument, relinearised up to ``RELINEARISED`` times, and anew
    after every exclusion of deviating blocks."""
    wider = wider or {}
    # One instrument: a common initial S.
    S = np.median([side.start.S for side in sides], axis=0)
    sides = [replace(side, start=replace(side.start, S=S)) for side in sides]
    where = places(sides, wanted)
    points = [side.start for side in sides] if before is None else before.points
    strengths = np.tile(TYPICAL, (len(sides), 1)) if before is None else before.fitted.strengths
    problems = _problems(sides, points, where, wider)
    turn = rounds = 0
    is_new = True
    while turn < (RELINEARISED if before is None else 1):
        if turn:
            strengths, _ = most_likely(problems, strengths, is_everywhere=is_new)
        mean = together(problems, strengths).mean
        lost = [np.zeros(0)] * len(sides)
        if turn and rounds < MOST_ROUNDS:
            lost = [_deviating(problem, s, mean) for problem, s in zip(problems, strengths, strict=True)]
        is_new = any(len(one) for one in lost) or not turn
        turn, rounds = (1, rounds + 1) if turn and is_new else (turn + 1, rounds)
        points = [
            replace(
                side.moved(point, {name: side.sigma(name, wider) * mean[at] for name, at in own.items()}),
                lost_s=np.append(point.lost_s, one),
                slow=None if side.reference.motion.attitude is None else slow_error(problem, s, mean),
            )
            for side, point, problem, own, s, one in zip(sides, points, problems, where, strengths, lost, strict=True)
        ]
        problems = _problems(sides, points, where, wider)
    return MotionFit(sides, points, where, problems, fit(problems, strengths), wider)


def _deviating(problem: Problem, strengths: FloatArray, mean: FloatArray) -> FloatArray:
    """Times (k,) of blocks whose innovation the fit does not explain."""
    normal = problem.blocks.normal(problem.table, np.exp(strengths).tolist())
    left = (normal.innovations @ np.append(-mean[problem.index], 1.0)).reshape(-1, 3)
    p = chdtrc(3.0, np.sum(left**2, axis=1))
    return np.asarray(problem.blocks.time_s()[p < SURPRISE / max(normal.rows, 1)])


def slow_error(problem: Problem, strengths: FloatArray, mean: FloatArray) -> SlowError:
    """The reference's smoothed slow error under ``strengths`` (8,), at parameters ``mean`` with biases at the start."""
    *_, world, body = problem.blocks.smoothed(problem.table, np.exp(strengths).tolist())
    theta = np.append(-mean[problem.index], 1.0)
    return SlowError(problem.blocks.time_s(), *((one @ theta).reshape(-1, 3) for one in (world, body)))


def _problems(
    sides: list[Beside], points: list[Point], where: list[dict[str, IntArray]], wider: Mapping[str, float]
) -> list[Problem]:
    return [side.problem(point, own, wider) for side, point, own in zip(sides, points, where, strict=True)]


@dataclass(frozen=True, eq=False)
class Scored:
    """Score of an effect: twice its gain in log evidence, corrected for multiple testing; best factor on its prior σ.

    The fits with it and ``without`` it have their own most likely strengths.
    """

    ident: str
    score: float
    wider: float
    fitted: MotionFit
    without: MotionFit

    @property
    def is_accepted(self) -> bool:
        """Whether the effect is reported."""
        return self.score > NAMED_FROM

    def shown_from(self) -> float:
        """Size of all its elements, in data-sheet sizes, with expected score ``NAMED_FROM``; infinite if none.

        With information Λ (eigenvalues λ) about them, elements of size s increase twice the log evidence by
        Σ λs² - ln(1 + λs²) on average.
        """
        names = EFFECTS[self.ident]
        own = next(own for own in self.fitted.places if all(name in own for name in names))
        at = np.concatenate([own[name] for name in names])
        prior = np.eye(len(at))
        told = np.linalg.eigvalsh(np.linalg.inv(self.fitted.fitted.covariance[np.ix_(at, at)]) - prior)
        told = np.maximum(told, 0.0) / self.wider**2

        def short(size: float) -> float:
            gain = told * size**2
            return float(np.sum(gain - np.log1p(gain)) - SEARCH_COST - NAMED_FROM)

        return float(brentq(short, 0.0, LARGEST)) if short(LARGEST) > 0.0 else float("inf")


def scores(found: MotionFit) -> list[Scored]:
    """Score of every effect against its absence, with strengths optimised in both; best first."""
    out = []
    held = set().union(*(own for own in found.places))
    for ident, names in EFFECTS.items():
        if not any(side.has(name) for side in found.sides for name in names):
            continue
        base = tuple(held - set(names))
        start = found.fitted.strengths
        without = _tuned(found, base, {}, start)
        tried: list[MotionFit] = []
        for by in WIDER:
            tried.append(_tuned(found, (*base, *names), dict.fromkeys(names, by), start))
            # The evidence has one maximum over the size: stop beyond it.
            if len(tried) > 1 and tried[-1].fitted.evidence < tried[-2].fitted.evidence - MARGIN:
                break
        best = int(np.argmax([one.fitted.evidence for one in tried]))
        # An effect must not win by strengths that its absence was not tried with.
        again = _tuned(found, base, {}, tried[best].fitted.strengths)
        without = max(without, again, key=lambda one: one.fitted.evidence)
        score = float(2.0 * (tried[best].fitted.evidence - without.fitted.evidence) - SEARCH_COST)
        out.append(Scored(ident, score, WIDER[best], tried[best], without))
    return sorted(out, key=lambda one: -one.score)


def _tuned(found: MotionFit, names: tuple[str, ...], wider: Mapping[str, float], start: FloatArray) -> MotionFit:
    """Another hypothesis about the same points under its own strengths, sought from ``start``."""
    points = [without_effects(point) for point in found.points]
    problems = _problems(found.sides, points, places(found.sides, names), wider)
    strengths, _ = most_likely(problems, start, found.fitted.spread())
    return under(found.sides, points, names, strengths, wider)


def under(
    sides: list[Beside], points: list[Point], names: tuple[str, ...], strengths: FloatArray,
    wider: Mapping[str, float] | None = None,
) -> MotionFit:  # fmt: skip
    """Fit of the named parameters about ``points``, under given strengths (recordings, 8)."""
    where = places(sides, names)
    problems = _problems(sides, points, where, wider or {})
    all_of = together(problems, strengths)
    fitted = Fitted(all_of.mean, all_of.covariance, all_of.evidence, strengths, strengths[None])
    return MotionFit(sides, points, where, problems, fitted, wider or {})
