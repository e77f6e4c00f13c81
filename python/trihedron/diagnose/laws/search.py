"""Candidates of the dictionary tried on a misfit, one term after another; what is accepted has paid for the search."""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass

import numpy as np
import numpy.typing as npt
from scipy.special import fdtrc

from trihedron.arrays import FloatArray
from trihedron.diagnose.laws.misfit import Columns, Judged, Misfit

MAX_P = 1e-4
"""Largest p-value of a law, paid for by the number of candidates: structured noise passes 1 % with ease."""
MIN_GAIN, MIN_GAIN_SMOOTH = 10.0, 20.0
"""Held-out log-likelihood that a law must win; what changes slowly in time is imitated by drift."""
NESTED_GAIN = 10.0
"""What a larger group, or a vector fixed in the room over gravity alone, must win beyond the smaller one."""
MIN_SHARE = 0.2
"""Share of the held-out sum of squares that a law must remove."""
SURE_GAIN = 40.0
"""From this gain on the shift test is not asked of variables that jump from pose to pose."""
SHIFT_P, SHIFT_SQUARES = 0.05, 0.75
MAX_TERMS = 4
"""Terms of one law: each is the best of all that were tried, and a longer one is no law that a person would check."""


@dataclass(frozen=True, eq=False)
class Candidate:
    """One term: ``target`` axis it is read by, ``names`` of its variables, its columns, and the same moved along poses.

    ``moved`` (order (units,)) → phi of the law as if the signal had come in another order.
    """

    target: str
    family: str
    names: tuple[str, ...]
    unit: str
    columns: Columns
    moved: Callable[[npt.NDArray[np.intp]], FloatArray]
    is_smooth: bool = False
    is_known: bool = False
    """A mechanism of the catalogue: a competitor that is no law."""


@dataclass(frozen=True, eq=False)
class Term:
    """An accepted term with its coefficients."""

    candidate: Candidate
    value: FloatArray
    sigma: FloatArray


@dataclass(frozen=True, eq=False)
class Accepted:
    """Terms accepted on one misfit, with the standing of all of them together."""

    terms: tuple[Term, ...]
    judged: Judged


def search(misfit: Misfit, candidates: list[Candidate], n_tried: int) -> Accepted | None:
    """Terms one after another, each earning its place beside those before it; ``None`` where nothing does."""
    taken: list[Candidate] = []
    together: Columns | None = None
    best_gain, standing = 0.0, None
    for _ in range(MAX_TERMS):
        tried: list[tuple[float, Candidate, Columns, Judged]] = []
        for one in candidates:
            if one in taken or not _may_join(one, taken):
                continue
            both = one.columns if together is None else together.beside(one.columns)
            judged = misfit.judge(both)
            if judged is None:
                continue
            # A group of k columns competes at the price of its extra columns.
            tried.append((judged.gain - NESTED_GAIN * (len(one.names) > 1), one, both, judged))
        if not tried:
            break
        _, one, both, judged = max(tried, key=lambda item: item[0])
        if not _earns(misfit, one, judged, together, best_gain, standing, n_tried):
            break
        taken.append(one)
        together, best_gain, standing = both, judged.gain, judged
    if standing is None or all(one.is_known for one in taken):
        return None
    sigma = np.sqrt(np.maximum(np.diag(standing.covariance), 0.0))
    terms, first = [], 0
    for one in taken:
        span = slice(first, first + len(one.names))
        first += len(one.names)
        terms.append(Term(one, standing.value[span], sigma[span]))
    return Accepted(tuple(terms), standing)


def _may_join(one: Candidate, taken: list[Candidate]) -> bool:
    """No variable twice on one axis: T beside (T, T²) is the same law."""
    return not any(one.target == t.target and set(one.names) & set(t.names) for t in taken)


def _earns(
    misfit: Misfit,
    one: Candidate,
    judged: Judged,
    together: Columns | None,
    best_gain: float,
    standing: Judged | None,
    n_tried: int,
) -> bool:
    gain = judged.gain - best_gain
    needed = MIN_GAIN_SMOOTH if one.is_smooth else MIN_GAIN
    if gain < needed:
        return False
    share = judged.share if standing is None else 1.0 - judged.held_after / standing.held_after
    if share < MIN_SHARE:
        return False
    k = len(one.names)
    before = misfit.square if together is None else misfit.squares_with(together)
    dof = misfit.dof - judged.rank
    ratio = (before - judged.squares) / k / max(judged.squares / dof, 1e-300)
    if float(fdtrc(k, dof, max(ratio, 0.0))) * n_tried > MAX_P:
        return False
    if one.is_smooth or gain < SURE_GAIN:
        return stands_out_of_shifts(misfit, one.moved, judged.squares, together)
    return True


def stands_out_of_shifts(
    misfit: Misfit,
    moved: Callable[[npt.NDArray[np.intp]], FloatArray],
    squares: float,
    together: Columns | None,
) -> bool:
    """Whether the law, moved along the poses forwards and reversed, does far worse than where it belongs (eq. L.5)."""
    n = len(np.unique(misfit.unit))
    orders = [np.roll(np.arange(n), s) for s in range(2, n - 1)]
    orders += [np.roll(np.arange(n)[::-1], s) for s in range(n)]
    found = []
    for order in orders:
        columns = misfit.columns(moved(order))
        found.append(misfit.squares_with(columns if together is None else together.beside(columns)))
    p = (1 + sum(value <= squares for value in found)) / (1 + len(found))
    return bool(p <= SHIFT_P and squares <= SHIFT_SQUARES * min(found))
