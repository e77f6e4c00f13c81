"""A simulated session of a named part, as short as a diagnosis allows."""

from dataclasses import replace
from itertools import pairwise

import numpy as np

import trihedron
from trihedron.simulate import Scenario, hand_session, simulate
from trihedron.simulate.effects import with_effect
from trihedron.simulate.profiles import profile_by_name


def unit_of(motion, unit=1, grade="mpu", is_wide=False):
    """A scenario of one unit of a part; a wide one has the gyro's next range, which hand moves do not leave."""
    profile = profile_by_name(grade)
    scenario = Scenario(motion, "session", *profile.unit(unit), profile.clock)
    if not is_wide:
        return scenario
    gyro = scenario.gyroscope
    return replace(scenario, gyroscope=replace(gyro, S=tuple(map(tuple, 2.0 * np.array(gyro.S)))))


def simulated(effect_id="", seed=1, n_poses=24, grade="mpu", unit=None, **size):
    """Recording and truth of a hand session with an effect of a stated size, or healthy; ``unit`` None is ``seed``."""
    scenario = unit_of(hand_session(n_poses, layout=seed), unit or seed, grade)
    return simulate(with_effect(scenario, effect_id, **size) if effect_id else scenario, seed)


def diagnosed(effect_id="", seed=1, n_poses=24, grade="mpu", **size):
    recording, truth = simulated(effect_id, seed, n_poses, grade, **size)
    return trihedron.diagnose(recording, gravity_m_s2=truth.gravity_m_s2)


def nearest_pose(poses, n):
    """(n,) number of the pose nearest to each sample: what is drawn per pose changes in the middle of a move."""
    return np.searchsorted([(a.stop + b.start) / 2 for a, b in pairwise(poses)], np.arange(n))


def with_scatter(recording, poses, sigma):
    """The gyro's bias is another in every pose, by ``sigma`` in its raw unit."""
    bias = sigma * np.random.default_rng(3).normal(size=(len(poses), 3))
    return replace(recording, gyroscope=recording.gyroscope + bias[nearest_pose(poses, recording.n_samples)])
