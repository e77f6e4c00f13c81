"""Runs of true values in a mask, as ranges ``[first, last)``."""

import numpy as np

from trihedron.arrays import BoolArray, IntArray

Range = tuple[int, int]


def edges_of(mask: BoolArray) -> IntArray:
    """(k, 2) first index of every run of true values in ``mask`` (n,), and the index after its last."""
    padded = np.zeros(len(mask) + 2, dtype=np.bool_)
    padded[1:-1] = mask
    edges: IntArray = np.flatnonzero(padded[1:] != padded[:-1]).astype(np.int64).reshape(-1, 2)
    return edges


def ranges_of(mask: BoolArray) -> list[Range]:
    """The same as a list, for loops over few runs."""
    return [(first, last) for first, last in edges_of(mask).tolist()]


def grown(mask: BoolArray, part: Range) -> Range:
    """``part`` widened on both sides over true values of ``mask`` (n,) that touch it."""
    first, last = part
    while first > 0 and mask[first - 1]:
        first -= 1
    while last < len(mask) and mask[last]:
        last += 1
    return first, last
