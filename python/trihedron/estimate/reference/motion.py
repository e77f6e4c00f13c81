"""The gyro's part: parameters of one or several recordings about a common point, and effects by their score."""

from __future__ import annotations

from collections.abc import Mapping
from dataclasses import dataclass, replace

import numpy as np
from scipy.optimize import brentq

from trihedron.arrays import FloatArray, IntArray
from trihedron.estimate.reference.beside import BLOCK_S, Beside, Point, SlowError, places
from trihedron.estimate.reference.likelihood import (
    TYPICAL,
    Fitted,
    Problem,
    at_the_point,
    equations,
    fit,
    most_likely,
    together,
)
from trihedron.records.reference import NAMED_FROM

ALWAYS = ("S", "b", "clock", "earth", "gyro-g-sensitivity")
"""What every hypothesis holds: g-sensitivity by the size that data sheets give it, named or not."""
EFFECTS = {"gyro-g-sensitivity": ("gyro-g-sensitivity",), "gyro-scale-nonlinearity": ("quadratic", "cubic")}
WIDER = (0.3, 1.0, 3.0, 10.0, 30.0)
"""Sizes, in those of data sheets, that a recording may ask for."""
MARGIN = 2.0
PAID = 2.0 * np.log(len(WIDER) * len(EFFECTS))
"""What a score pays for what was tried."""
LARGEST = 100.0
"""Effects beyond this many times the size in data sheets are no effects of a working part."""
RELINEARISED = 3
SHORTER = 0.5 ** np.arange(6)
"""Parts of a step that are tried: beyond a quarter of a period of the motion a clock's offset is not linear."""


@dataclass(frozen=True, eq=False)
class MotionFit:
    """Recordings in one fit: the point of each, places of their parameters, what was fitted about it."""

    sides: list[Beside]
    points: list[Point]
    places: list[dict[str, IntArray]]
    problems: list[Problem]
    fitted: Fitted
    wider: Mapping[str, float]

    def value(self, k: int, name: str) -> FloatArray:
        """(n,) a parameter of recording k, SI."""
        at = self.places[k][name]
        sigma = self.wider.get(name, 1.0) * self.sides[k].sigma(name)
        return np.asarray(self.sides[k].values(self.points[k], name) + sigma * self.fitted.mean[at])

    def covariance(self, k: int, names: tuple[str, ...]) -> FloatArray:
        """(n, n) covariance of parameters of recording k, SI."""
        at = np.concatenate([self.places[k][name] for name in names])
        sigma = np.concatenate([self.wider.get(name, 1.0) * self.sides[k].sigma(name) for name in names])
        return np.asarray(self.fitted.covariance[np.ix_(at, at)] * np.outer(sigma, sigma))


def fit_motion(
    sides: list[Beside], wanted: tuple[str, ...] = ALWAYS, wider: Mapping[str, float] | None = None,
    block_s: float = BLOCK_S, before: MotionFit | None = None,
) -> MotionFit:  # fmt: skip
    """Parameters and strengths of recordings that share the instrument's, relinearised until they stand."""
    wider = wider or {}
    # One instrument: one point to begin with.
    S = np.median([side.start.S for side in sides], axis=0)
    sides = [replace(side, start=replace(side.start, S=S)) for side in sides]
    where = places(sides, wanted)
    points = [side.start for side in sides] if before is None else before.points
    strengths = np.tile(TYPICAL, (len(sides), 1)) if before is None else before.fitted.strengths
    problems = _problems(sides, points, where, wider, block_s)
    for turn in range(RELINEARISED if before is None else 1):
        if turn:
            strengths, _ = most_likely(problems, strengths)
        mean = together(problems, [equations(p, s) for p, s in zip(problems, strengths, strict=True)]).mean
        # A linear model about another slow error is another model: heights are compared about the same.
        points = [
            point if side.reference.motion.attitude is None else replace(point, slow=slow_error(problem, s, mean))
            for side, point, problem, s in zip(sides, points, problems, strengths, strict=True)
        ]
        problems = _problems(sides, points, where, wider, block_s)
        height = at_the_point(problems, strengths)
        for shorter in SHORTER:
            ahead = [
                side.moved(point, {name: shorter * _si(side, name, wider) * mean[at] for name, at in own.items()})
                for side, point, own in zip(sides, points, where, strict=True)
            ]
            there = _problems(sides, ahead, where, wider, block_s)
            if at_the_point(there, strengths) > height:
                break
        else:
            break
        points, problems = ahead, there
    return MotionFit(sides, points, where, problems, fit(problems, strengths), wider)


def slow_error(problem: Problem, strengths: FloatArray, mean: FloatArray) -> SlowError:
    """The reference's slow error, smoothed under ``strengths`` (7,), of parameters (p,) with biases at the start."""
    *_, world, body = problem.blocks.smoothed(problem.table, np.exp(strengths).tolist())
    theta = np.append(-mean[problem.index], 1.0)
    return SlowError(problem.blocks.time_s(), *((one @ theta).reshape(-1, 3) for one in (world, body)))


def _si(side: Beside, name: str, wider: Mapping[str, float]) -> FloatArray:
    return wider.get(name, 1.0) * side.sigma(name)


def _problems(
    sides: list[Beside], points: list[Point], where: list[dict[str, IntArray]], wider: Mapping[str, float],
    block_s: float = BLOCK_S,
) -> list[Problem]:  # fmt: skip
    return [side.problem(point, own, wider, block_s) for side, point, own in zip(sides, points, where, strict=True)]


@dataclass(frozen=True, eq=False)
class Scored:
    """An effect's score: twice its gain in log evidence, what was tried paid for; the prior's width that gains most.

    The fits with it and ``without`` it stand under their own likeliest strengths.
    """

    ident: str
    score: float
    wider: float
    fitted: MotionFit
    without: MotionFit

    @property
    def is_accepted(self) -> bool:
        """Whether it is named."""
        return self.score > NAMED_FROM

    def shown_from(self) -> float:
        """Size of all its numbers, in those of data sheets, whose expected score is ``NAMED_FROM``; infinite if none.

        Beside a reference with information Λ of them, numbers of size s raise twice the log evidence by
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
            return float(np.sum(gain - np.log1p(gain)) - PAID - NAMED_FROM)

        return float(brentq(short, 0.0, LARGEST)) if short(LARGEST) > 0.0 else float("inf")


def scores(found: MotionFit) -> list[Scored]:
    """Score of every effect beside its absence, strengths tuned in both; best first."""
    out = []
    held = set().union(*(own for own in found.places))
    for ident, names in EFFECTS.items():
        if not any(side.has(name) for side in found.sides for name in names):
            continue
        base = tuple(held - set(names))
        without = _tuned(found, base, {})
        tried: list[MotionFit] = []
        for by in WIDER:
            tried.append(_tuned(found, (*base, *names), dict.fromkeys(names, by)))
            # Evidence falls off on both sides of the size that the recordings ask for.
            if len(tried) > 1 and tried[-1].fitted.evidence < tried[-2].fitted.evidence - MARGIN:
                break
        best = int(np.argmax([one.fitted.evidence for one in tried]))
        score = float(2.0 * (tried[best].fitted.evidence - without.fitted.evidence) - PAID)
        out.append(Scored(ident, score, WIDER[best], tried[best], without))
    return sorted(out, key=lambda one: -one.score)


def _tuned(found: MotionFit, names: tuple[str, ...], wider: Mapping[str, float]) -> MotionFit:
    """Another hypothesis about the same point but for its effects, under its own likeliest strengths."""
    points = [replace(p, g=np.zeros((3, 3)), bend=np.zeros(6)) for p in found.points]
    where = places(found.sides, names)
    problems = _problems(found.sides, points, where, wider)
    strengths, evidence = most_likely(problems, found.fitted.strengths, found.fitted.spread())
    all_of = together(problems, [equations(p, s) for p, s in zip(problems, strengths, strict=True)])
    fitted = Fitted(all_of.mean, all_of.covariance, evidence, strengths, strengths[None])
    return MotionFit(found.sides, points, where, problems, fitted, wider)
