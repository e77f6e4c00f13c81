"""Shortcuts for what most logs are (no gap, no missing reading, no bump) say to the bit what the long way says."""

from __future__ import annotations

import numpy as np

from trihedron.read.clock.losses import UNMOVED, _is_unmoved
from trihedron.segment.channels import mean_present
from trihedron.segment.runs import Run
from trihedron.session.aliasing import LENGTH, _between_gaps


def test_ranges_without_gaps_are_their_own_pieces() -> None:
    rng = np.random.default_rng(5)
    start = np.cumsum(rng.integers(30, 60, size=50))
    ranges = np.stack([start, start + rng.integers(1, 3 * LENGTH, size=50)], axis=1).astype(np.int64)
    time_s = 0.01 * np.arange(int(ranges.max()) + 20)
    # A gap behind the last range makes it take the long way, and cuts nothing.
    beyond = time_s.copy()
    beyond[-5:] += 1.0
    for got, wanted in zip(_between_gaps(ranges, time_s, 0.01), _between_gaps(ranges, beyond, 0.01), strict=True):
        assert got.dtype == wanted.dtype
        np.testing.assert_array_equal(got, wanted)
    lengths = ranges[:, 1] - ranges[:, 0]
    assert (lengths < LENGTH).any()
    assert len(_between_gaps(ranges, None, 0.01)[0]) == np.count_nonzero(lengths >= LENGTH)


def test_a_mean_passes_over_missing_rows() -> None:
    rows = np.random.default_rng(6).normal(size=(37, 3))
    np.testing.assert_array_equal(mean_present(rows), np.nanmean(rows, axis=0))
    rows[4, 1] = np.nan
    np.testing.assert_array_equal(mean_present(rows), np.nanmean(rows, axis=0))
    assert np.isfinite(mean_present(rows)).all()


def test_quiet_ranges_with_and_without_bumps() -> None:
    assert Run(3, 9).quiet_ranges() == [(3, 9)]
    assert Run(3, 3).quiet_ranges() == []
    assert Run(3, 9, ((5, 6),)).quiet_ranges() == [(3, 5), (6, 9)]


def test_a_stamp_that_moves_either_way_is_seen() -> None:
    still = 0.4 * UNMOVED * np.random.default_rng(7).uniform(-1.0, 1.0, size=300_000)
    assert _is_unmoved(still)
    for by in (1.5 * UNMOVED, -1.5 * UNMOVED, np.nan):
        moved = still.copy()
        moved[-1] = moved[-2] + by
        assert not _is_unmoved(moved)
    assert not _is_unmoved(still[:1])
