"""Relations tried beside accepted effects, with columns, priors and penalty alike (docs/relations.md, eq. 11.19)."""

from __future__ import annotations

from collections.abc import Collection, Iterator
from dataclasses import dataclass, replace
from itertools import chain

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.diagnose.candidates import N_LEADERS, PRIOR_SCALES
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only, rate_only
from trihedron.diagnose.hypothesis import Hypothesis, Term, again
from trihedron.diagnose.relations.signals import HISTORY, NOT_TURNED, WORLD_VECTOR, Signal, signals, world_vector
from trihedron.diagnose.relations.telegraph import TELEGRAPH, telegraphs
from trihedron.records.domains import Domain

ALL_AXES = (0, 1, 2)
ANY_BY_ANY = ("rate", HISTORY, "rate products")
"""Families of vectors: three of their variables together may act on any axis."""
MOST_RELATIONS = 3
"""A longer list is no relation that a person would check."""


class Empirical(Effect):
    """Dependence of readings on a variable without a mechanism: an effect that is in no catalogue."""

    id = ""


EMPIRICAL = Empirical()


Name = tuple[str, tuple[str, ...]]
"""Sensor and variables of a relation."""


@dataclass(frozen=True, eq=False)
class Follows:
    """One relation: its variables, the numbers of the axes that depend on them, its term of the hypothesis, and its
    ``score``.

    Parameters run over the axes, and for each over the names.
    """

    signal: Signal
    axes: tuple[int, ...]
    term: Term
    score: float = 0.0

    @property
    def name(self) -> Name:
        return self.signal.sensor, self.signal.names

    @property
    def domain(self) -> Domain:
        """The domain of residuals in which it shows."""
        is_gyro, is_motion = self.signal.sensor == "gyroscope", self.signal.is_motion
        if is_motion:
            return "moves" if is_gyro else "dynamics"
        return "static-gyro" if is_gyro else "static-accel"


@dataclass(frozen=True, eq=False)
class Related:
    """The hypothesis with all its relations."""

    model: Hypothesis
    relations: tuple[Follows, ...]
    steps: tuple[Hypothesis, ...]
    """The hypothesis that each relation was added to."""

    score: float
    """Twice the log-evidence of the whole, less the penalties of its terms."""

    @property
    def has_own_likelihood(self) -> bool:
        """Whether a score is not that of the evidence."""
        return any(one.signal.family == TELEGRAPH for one in self.relations)

    @property
    def names(self) -> set[Name]:
        return {one.name for one in self.relations}


def related(model: Hypothesis, limit: float) -> Related:
    """Relations added to a hypothesis one at a time while the best scores more than ``limit``."""
    found: list[Follows] = []
    steps: list[Hypothesis] = []
    score = 2.0 * model.log_evidence - sum(term.cost for term in model.terms)
    while len(found) < MOST_RELATIONS and model.context.moves:
        known = {one.name for one in found}
        leading = [*_by_evidence(model, known), *_by_levels(model.context, known)]
        best = max(leading, key=lambda one: one.score, default=None)
        if best is None or best.score <= limit:
            break
        found.append(best)
        steps.append(model)
        model = again(model, [*model.terms, best.term])
        score += best.score
    return Related(model, tuple(found), tuple(steps), score)


def _by_evidence(model: Hypothesis, known: Collection[Name]) -> Iterator[Follows]:
    """The relation whose columns gain most in evidence, if they predict what is held out."""
    best = _best(model, known)
    larger = None if best is None else again(model, [*model.terms, best.term])
    if best is not None and larger is not None and larger.is_shown(model, len(model.terms)):
        yield replace(best, score=2.0 * (larger.log_evidence - model.log_evidence) - best.term.cost)


def _by_levels(context: Context, known: Collection[Name]) -> Iterator[Follows]:
    """Every random telegraph signal, which has a score of its own."""
    for signal, axis, score in telegraphs(context):
        found = replace(_follows(context, signal, (axis,)), score=score)
        if found.name not in known:
            yield found


def _best(model: Hypothesis, known: Collection[Name]) -> Follows | None:
    """The relation that gains most, noise strengths refitted, of the leading ones at fixed strengths."""
    context = model.context
    leading: list[list[Leader]] = []
    n_tried = 0
    # One family at a time: all columns together need more memory than the log.
    for whole in _families(context):
        signal = whole.signal
        ways = [way for way in _ways(signal) if (signal.sensor, tuple(signal.names[k] for k in way[0])) not in known]
        m = len(signal.names)
        parts = [[a * m + k for a in axes for k in names] for names, axes in ways]
        looks = model.gains([whole.term], PRIOR_SCALES, parts)
        n_tried += len(ways)
        leading = _led(leading, signal, ways, [look.gain for look in looks])
    cost = 2.0 * float(np.log(max(n_tried, 1) * len(PRIOR_SCALES)))
    # The same relation may lead at several strengths: the one with the largest gain, the last, is kept.
    ahead = {(id(one[1]), one[2]): one for one in sorted(chain(*leading), key=lambda one: one[0])}.values()
    each = [_part(context, signal, way, scale, cost) for gain, signal, way, scale in ahead if 2.0 * gain > cost]
    if not each:
        return None
    asked = model.with_added([one.term for one in each])
    plain = model.plain([one.strengths for one in asked])
    scores = [2.0 * (one.log_evidence - plain) - cost for one in asked]
    best = int(np.argmax(scores))
    return each[best] if scores[best] > 0.0 else None


def _led(leading: list[list[Leader]], signal: Signal, ways: list[Way], gains: list[FloatArray]) -> list[list[Leader]]:
    """The leaders at every noise strength, with the best way of one more family added.

    At low noise strengths relations of many columns gain most, at high ones those of one.
    """
    if not ways:
        return leading
    stacked = np.stack(gains)  # (ways, scales, strengths)
    out = leading or [[] for _ in range(stacked.shape[2])]
    for look, kept in enumerate(out):
        way, scale = np.unravel_index(int(stacked[:, :, look].argmax()), stacked.shape[:2])
        kept.append((float(stacked[way, scale, look]), signal, ways[way], PRIOR_SCALES[scale]))
        # Columns are computed again for the leading ways only.
        out[look] = sorted(kept, key=lambda one: -one[0])[:N_LEADERS]
    return out


Way = tuple[tuple[int, ...], tuple[int, ...]]
"""Numbers of the variables, and of the axes that depend on them."""
Leader = tuple[float, Signal, Way, float]
"""Gain in log-evidence, signal, way, and prior scale."""


def _ways(signal: Signal) -> list[Way]:
    """Each variable on each axis and on all of them; of vectors three together, as any axis by any axis."""
    if signal.family == "world":
        return [(tuple(range(len(signal.names))), ALL_AXES)]
    always = tuple(k for k, name in enumerate(signal.names) if name == NOT_TURNED)
    n = len(signal.names) - len(always)
    ways: list[Way] = [((k, *always), axes) for k in range(n) for axes in ((0,), (1,), (2,), ALL_AXES)]
    if signal.family in ANY_BY_ANY:
        ways += [((k, k + 1, k + 2, *always), ALL_AXES) for k in range(0, n - 2, 3)]
    return ways


def _families(context: Context) -> Iterator[Follows]:
    """All variables of a family on all axes, in one set of columns."""
    every = signals(context)
    for sensor, family in dict.fromkeys((one.sensor, one.family) for one in every):
        own = [one for one in every if (one.sensor, one.family) == (sensor, family)]
        names = tuple(name for one in own for name in one.names)
        units = tuple(unit for one in own for unit in one.units)
        together = replace(own[0], names=names, units=units, values=np.hstack([one.values for one in own]))
        yield _follows(context, together, ALL_AXES)
    yield from _world_vector(context)


def _part(context: Context, whole: Signal, way: Way, scale: float, cost: float) -> Follows:
    """Some variables of a family with their prior scale, and the penalty of the choice."""
    names, axes = way
    signal = replace(
        whole, names=tuple(whole.names[k] for k in names), units=tuple(whole.units[k] for k in names),
        values=whole.values[:, names],
    )  # fmt: skip
    one = _follows(context, signal, axes)
    return replace(one, term=replace(one.term, sizes=scale * one.term.sizes, cost=cost))


def _follows(context: Context, signal: Signal, axes: tuple[int, ...]) -> Follows:
    is_gyro = signal.sensor == "gyroscope"
    own = (context.gyro_axes if is_gyro else context.accel_axes)[:, list(axes)]
    columns = np.einsum("ia,nk->niak", own, signal.values).reshape(len(signal.values), 3, -1)
    names = tuple(f"{AXES[a]}: {name}" for a in axes for name in signal.names)
    variant = Variant((rate_only if is_gyro else force_only)(columns), names, signal.units * len(axes))
    return Follows(signal, axes, Term(EMPIRICAL, variant, EMPIRICAL.sizes(context, variant)))


def _world_vector(context: Context) -> Iterator[Follows]:
    """Rates that depend on a vector fixed in the world frame, each gyro separately.

    Its vertical part alone is a g-sensitivity, an effect of the catalogue: the horizontal parts must add to it.
    """
    seen = world_vector(context) if context.obs.raw_rate is not None else None
    if seen is not None:
        names = tuple(f"{WORLD_VECTOR} {AXES[j]}{h}" for j in range(3) for h in range(3))
        yield _follows(context, Signal("gyroscope", "world", names, seen.reshape(len(seen), -1), ("1",) * 9), ALL_AXES)
