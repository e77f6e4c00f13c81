"""Axes or a range that change inside a log, as after a driver's reset."""

import re

import numpy as np
import pytest

import trihedron
from hand_made_sessions import motion
from trihedron.read.audit.orientation import Intervals
from trihedron.records import Severity

FLIP_Y = np.diag([1.0, -1.0, 1.0])
EXCHANGE = np.array([[0.0, 1.0, 0.0], [1.0, 0.0, 0.0], [0.0, 0.0, 1.0]])


def changes(change, sensor, at=0.5, seed=1, bias=0.0):
    """Findings on a log whose readings of one sensor are multiplied by ``change`` (3, 3) from a part of it on."""
    t, force, rate = motion(50.0, seed, n_poses=14)
    k = round(at * len(t))
    readings = {"acc": force, "gyr": rate + np.array(bias)}
    readings[sensor][k:] = readings[sensor][k:] @ np.asarray(change).T
    found = trihedron.read({"time_s": t, **readings}).findings
    return t[k], [f for f in found if f.severity is Severity.SERIOUS]


@pytest.mark.parametrize("at", [0.3, 0.5, 0.75])
@pytest.mark.parametrize(
    ("sensor", "change", "words"),
    [
        ("gyr", FLIP_Y, r"axes of the gyro change .* Y reads what −Y read"),
        ("acc", FLIP_Y, "axes of the accelerometer change .* Y reads what −Y read"),
        ("gyr", EXCHANGE, "axes of the gyro change .* X reads what Y read, Y reads what X read"),
        ("gyr", 2.0 * np.eye(3), "scale of the gyro changes .* reads 2 times"),
        ("acc", 0.5 * np.eye(3), "scale of the accelerometer changes .* reads 0.5 times"),
    ],
)
def test_axes_or_a_scale_that_change_inside_a_log_are_one_serious_finding_with_axis_and_time(at, sensor, change, words):
    at_s, found = changes(change, sensor, at)
    (one,) = found
    assert one.code == "axes-changed"
    assert re.search(words, one.seen)
    # Poses of 2.5 s and moves of 1.5 s: a move that the change leaves as it is lies on either side.
    assert one.numbers["from_s"] - 4.0 <= at_s <= one.numbers["to_s"] + 4.0
    assert one.numbers["to_s"] - one.numbers["from_s"] < 8.0


@pytest.mark.parametrize("seed", range(4))
def test_axes_that_do_not_change_are_not_reported(seed):
    assert not changes(np.eye(3), "gyr", seed=seed)[1]
    # Axes of other directions than the names say are alike throughout.
    assert not changes(EXCHANGE, "gyr", 0.0, seed)[1]


def test_axes_that_change_beside_a_bias_that_turns_as_far_as_a_move_are_found():
    # 10 °/s, some 15° in a move.
    _, (one,) = changes(FLIP_Y, "gyr", bias=(0.15, -0.1, 0.12))
    assert one.code == "axes-changed"


@pytest.mark.parametrize("seed", range(4))
def test_moves_so_slow_that_gravity_hardly_changes_in_a_tenth_of_a_second_change_no_axes(seed):
    t, force, rate = motion(50.0, seed, n_poses=14, turn_s=12.0)
    found = trihedron.read({"time_s": t, "acc": force + 1.0, "gyr": rate}).findings
    assert not [f for f in found if f.severity is Severity.SERIOUS]
    # One interval for each pose: the first, and one after every move.
    assert len(Intervals(force, 50.0).edges) == 15


@pytest.mark.parametrize("seed", range(3))
def test_gravity_that_leaps_from_one_sample_to_the_next_is_said_with_its_place(seed):
    t, force, rate = motion(50.0, seed, n_poses=14)
    at = next(k for k in range(len(t) // 2, len(t)) if np.ptp(force[k - 40 : k + 40], axis=0).max() < 0.5)
    for turned in (FLIP_Y @ EXCHANGE, EXCHANGE @ FLIP_Y):
        # Both sensors: the driver was started anew with other axes.
        both = [np.concatenate([one[:at], one[at:] @ turned.T]) for one in (force, rate)]
        found = trihedron.read({"time_s": t, "acc": both[0], "gyr": both[1]}).findings
        (said,) = [one for one in found if one.code == "axes-changed"]
        assert said.numbers["sample"] == at
    # Rows that were cut out, and the time written anew.
    kept = np.r_[0:at, at + 200 : len(t)]
    found = trihedron.read({"time_s": t[: len(kept)], "acc": force[kept], "gyr": rate[kept]}).findings
    assert [one.numbers["sample"] for one in found if one.code == "axes-changed"] == [at]
    # With the time of the rows the clock misses them.
    found = trihedron.read({"time_s": t[kept], "acc": force[kept], "gyr": rate[kept]}).findings
    assert "axes-changed" not in {one.code for one in found}
