"""Runs of true values in a mask, as ranges ``[first, last)``."""

from collections.abc import Iterable

import numpy as np

from trihedron.arrays import BoolArray, IntArray

Range = tuple[int, int]


def edges_of(mask: BoolArray) -> IntArray:
    """(k, 2) first index of every run of true values in ``mask`` (n,), and the index after its last."""
    padded = np.zeros(len(mask) + 2, dtype=np.bool_)
    padded[1:-1] = mask
    return np.flatnonzero(padded[1:] != padded[:-1]).astype(np.int64).reshape(-1, 2)


def ranges_of(mask: BoolArray) -> list[Range]:
    """Runs of true values in ``mask`` (n,) as a list of ranges, for loops over few runs."""
    return [(first, last) for first, last in edges_of(mask).tolist()]


def grown(mask: BoolArray, part: Range) -> Range:
    """``part`` widened on both sides over true values of ``mask`` (n,) that touch it."""
    first, last = part
    while first > 0 and mask[first - 1]:
        first -= 1
    while last < len(mask) and mask[last]:
        last += 1
    return first, last


def merged(ranges: Iterable[Range]) -> list[Range]:
    """Ranges in order, those that overlap or touch as one."""
    out: list[Range] = []
    for first, last in sorted(ranges):
        if out and first <= out[-1][1]:
            out[-1] = (out[-1][0], max(last, out[-1][1]))
        else:
            out.append((first, last))
    return out


def rows_beside(ranges: IntArray, beside: int, n: int) -> tuple[IntArray, IntArray]:
    """Rows (r,) of ``n`` inside half-open ``ranges`` (m, 2) or within ``beside`` rows of one, range after range, and
    the position of each range among these rows, (m, 2).

    For a long log these are the only rows that a fit needs once the means of its poses are computed.
    """
    wide = np.clip(ranges + np.array([-beside, beside]), 0, n)
    before = np.cumsum(wide[:, 1] - wide[:, 0]) - (wide[:, 1] - wide[:, 0])
    rows = np.concatenate([np.arange(a, b, dtype=np.int64) for a, b in wide.tolist()])
    return rows, np.ascontiguousarray(ranges + (before - wide[:, 0])[:, None], dtype=np.int64)
