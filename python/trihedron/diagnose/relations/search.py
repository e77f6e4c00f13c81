"""Relations tried beside the winner: columns, priors and price like those of an effect (METHODS 16, eq. 11.19)."""

from __future__ import annotations

from collections.abc import Iterator
from dataclasses import dataclass, replace

import numpy as np

from trihedron.diagnose.candidates import PRIOR_SCALES
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import Effect, Variant, force_only, rate_only
from trihedron.diagnose.hypothesis import Hypothesis, Term, again
from trihedron.diagnose.relations.signals import AXES, ROOM_VECTOR, Signal, room, signals

N_FITTED = 3
"""Relations whose strengths of noise are found anew before the best is chosen."""
MOST_RELATIONS = 3
"""A longer list is no law that a person would check."""


class Empirical(Effect):
    """What readings follow without a mechanism: an effect in all but the name."""

    id = "relation"

    def variants(self, context: Context) -> list[Variant]:
        """None of its own: the search makes them."""
        del context
        return []


EMPIRICAL = Empirical()


@dataclass(frozen=True, eq=False)
class Follows:
    """One relation: the variables, the axes (numbers) whose readings follow them, and its term of the hypothesis.

    Parameters run over the axes, for each of them over the names.
    """

    signal: Signal
    axes: tuple[int, ...]
    term: Term


@dataclass(frozen=True, eq=False)
class Related:
    """The hypothesis with all its relations."""

    model: Hypothesis
    relations: tuple[Follows, ...]
    steps: tuple[Hypothesis, ...]
    """What every relation was added to."""

    @property
    def score(self) -> float:
        """Twice the log-evidence of the whole, less what its terms cost."""
        return 2.0 * self.model.log_evidence - sum(term.paid for term in self.model.terms)


def related(model: Hypothesis, limit: float) -> Related:
    """Relations added to a hypothesis one at a time while the best scores more than ``limit``."""
    found: list[Follows] = []
    steps: list[Hypothesis] = []
    tried = list(_candidates(model.context)) if model.context.moves else []
    for _ in range(MOST_RELATIONS):
        best = _best(model, tried)
        if best is None:
            break
        larger = again(model, [*model.terms, best.term])
        if 2.0 * (larger.log_evidence - model.log_evidence) - best.term.paid <= limit:
            break
        found.append(best)
        steps.append(model)
        model = larger
        tried = [one for one in tried if one.signal is not best.signal]
    return Related(model, tuple(found), tuple(steps))


def _best(model: Hypothesis, tried: list[Follows]) -> Follows | None:
    """The relation that gains most of those that look best at fixed strengths, each family once."""
    if not tried:
        return None
    paid = 2.0 * float(np.log(len(tried) * len(PRIOR_SCALES)))
    gains = np.stack([one.gain for one in model.looked_at([one.term for one in tried], PRIOR_SCALES)])
    leading: dict[str, Follows] = {}
    for k in np.argsort(-gains.max(axis=(1, 2))).tolist():
        one, scale = tried[k], PRIOR_SCALES[int(gains[k].max(axis=1).argmax())]
        term = replace(one.term, sizes=one.term.sizes * scale, paid=paid)
        leading.setdefault(one.signal.family + one.signal.sensor, replace(one, term=term))
        if len(leading) == N_FITTED:
            break
    asked = model.asked([one.term for one in leading.values()])
    plain = model.plain([one.strengths for one in asked])
    scores = [2.0 * (one.log_evidence - plain) - paid for one in asked]
    return list(leading.values())[int(np.argmax(scores))] if max(scores) > 0.0 else None


def _candidates(context: Context) -> Iterator[Follows]:
    every = signals(context)
    for one in every:
        for axes in ((0,), (1,), (2,), (0, 1, 2)):
            yield _follows(context, one, axes)
    # ω on the accelerometer, and the turn that led to a pose, act on any axis by any axis.
    for sensor in ("accelerometer", "gyroscope"):
        for family in ("rate", "last turn", "rate products"):
            own = [one for one in every if one.sensor == sensor and one.family == family]
            for part in (own[:3], own[3:6]):
                if len(part) == 3:
                    values = np.hstack([one.values for one in part])
                    names = tuple(name for one in part for name in one.names)
                    yield _follows(context, replace(part[0], names=names, values=values), (0, 1, 2))
    yield from _room(context)


def _follows(context: Context, signal: Signal, axes: tuple[int, ...]) -> Follows:
    is_gyro = signal.sensor == "gyroscope"
    own = (context.gyro_axes if is_gyro else context.accel_axes)[:, list(axes)]
    columns = np.einsum("ia,nk->niak", own, signal.values).reshape(len(signal.values), 3, -1)
    names = tuple(f"{AXES[a]}: {name}" for a in axes for name in signal.names)
    variant = Variant((rate_only if is_gyro else force_only)(columns), names, (signal.unit,) * len(names))
    return Follows(signal, axes, Term(EMPIRICAL, variant, EMPIRICAL.sizes(context, variant)))


def _room(context: Context) -> Iterator[Follows]:
    """The rates that follow a vector fixed in the room, each gyro by itself.

    Its vertical part alone is a g-sensitivity, which has a name: that stands while the horizontal parts add nothing.
    """
    seen = room(context) if context.obs.raw_rate is not None else None
    if seen is not None:
        names = tuple(f"{ROOM_VECTOR} {AXES[j]}{h}" for j in range(3) for h in range(3))
        yield _follows(context, Signal("gyroscope", "room", names, seen.reshape(len(seen), -1), "1"), (0, 1, 2))
