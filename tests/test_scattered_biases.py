"""A gyro bias that differs at random from pose to pose, and changes during moves: named as that and nothing else."""

import itertools

import numpy as np
import pytest

import trihedron
from confidence.motion import G
from confidence.sensor import recorded
from confidence.sessions import hand


def scattered(seed, deg_s):
    """A session by hand whose gyro bias is constant in every pose and changes linearly during the moves."""
    f, w, rate, truth, motion = hand(seed, n_poses=24, move_s=2.0, pose_s=5.0)
    t = np.arange(len(w)) / rate
    own = np.radians(deg_s) * np.random.default_rng([21, seed]).standard_normal((len(motion.rests), 3))
    edges = list(itertools.chain.from_iterable(motion.rests))
    bias = np.column_stack([np.interp(t, edges, np.repeat(column, 2)) for column in own.T])
    return recorded(f, np.round(w + np.linalg.solve(truth.S_w, bias.T).T), rate)


@pytest.mark.parametrize("seed", [3, 4])
def test_random_biases_are_a_scatter_and_follow_nothing(seed):
    found = trihedron.diagnose(scattered(seed, 0.1), gravity_m_s2=G)
    assert [effect.id for effect in found.effects] == ["gyro-bias-repeatability"]
    assert found.relations == ()
    # A bias taken as linear from pose middle to pose middle left tilt errors of several standard errors here.
    assert {one.domain for one in found.remaining if one.disagrees} == set()
