"""Whether poses and moves of a scenario miss as the recording's do: chance is distinguished from difference."""

import numpy as np
import pytest

from trihedron.comparison.frames import AIMED_AT, missed_alike
from trihedron.probability import bdtrc

ALPHA = 0.01


class Drawn:
    """Mean squares of n poses and n moves of some mm/s² and mrad, simulations ``ratio`` times as far."""

    def __init__(self, rng, n, ratio=1.0, rejected=()):
        self.rng, self.n, self.ratio, self.rejected = rng, n, ratio, rejected
        self.poses, self.moves = self.of_one(), self.of_one()
        self.drawn = 0

    def of_one(self):
        return 1e-6 * self.rng.chisquare(self.n) / self.n

    def missed_by(self, _scenario, _seed):
        self.drawn += 1
        if self.drawn in self.rejected:
            return None, None
        return self.ratio**2 * self.of_one(), self.of_one()


@pytest.mark.parametrize("n", [6, 100])
def test_chance_is_called_a_difference_no_more_often_than_alpha(n):
    rng = np.random.default_rng(4711 + n)
    trials = 300
    rows = [row for _ in range(trials) for row in missed_alike(None, Drawn(rng, n), ALPHA)]
    wrong = sum(row.significant for row in rows)
    # Seen by chance once in a thousand runs if the rate is alpha.
    assert bdtrc(wrong - 1, 2 * trials, ALPHA) > 1e-3, wrong


@pytest.mark.parametrize(("n", "ratio"), [(20, 2.5), (20, 0.4), (100, 1.6)])
def test_a_ratio_beyond_chance_is_told_of_poses_and_not_of_moves(n, ratio):
    rng = np.random.default_rng(int(100 * ratio) + n)
    trials = 60
    found = [missed_alike(None, Drawn(rng, n, ratio), ALPHA) for _ in range(trials)]
    told = sum(poses.significant for poses, _ in found)
    assert told > 0.9 * trials
    assert sum(moves.significant for _, moves in found) <= 4
    one = next(poses for poses, _ in found if poses.significant)
    assert one.interval[1] < AIMED_AT[0] or one.interval[0] > AIMED_AT[1]
    assert one.p_value < ALPHA
    assert "simulations" in one.remark
