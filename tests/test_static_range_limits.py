"""A coarse gyro's bias inside its LSB, recognised by moves: what stands still at their ends says nothing of it."""

import numpy as np
import pytest

from trihedron.estimate.gyroscope.turn_rounding import resting_ends, unseen_rotation

AXES = np.array([True, True, True])


def still_of(codes, first, stop):
    return resting_ends(codes, np.ones(3), np.zeros(3), AXES, np.array([[first, stop]]))


LAWS = {
    "settles": lambda n, scale: scale * np.exp(-n / 12.0),
    "as the square of time": lambda n, scale: scale * np.maximum(1.0 - n / 60.0, 0.0) ** 2,
    "as time": lambda n, scale: scale * np.maximum(1.0 - n / 60.0, 0.0),
}


@pytest.mark.parametrize("law", LAWS)
def test_what_a_zero_inside_its_step_turns_at_an_end_is_that_of_the_readings_left(law):
    """Sum of rate - (code static) over an end, both ways: the bias times what is not still, to first order."""
    n, zero, lasted, told = np.arange(200.0), 0.1, 0.0, 0.0
    for way in (1.0, -1.0):
        for scale in np.linspace(20.0, 40.0, 41):
            rate = way * LAWS[law](n, scale)
            codes = np.round(rate + zero)
            still = still_of(np.repeat(codes[:, None], 3, 1), 0, 200)
            # An offset of -zero on readings that are not still must make up for what the codes miss.
            told += np.sum(codes - rate)
            lasted += np.count_nonzero(~still[:, 0])
            assert not still[:5, 0].any()
    # The mean over the ways; 200 readings all along would show a bias a fifth to four fifths too small.
    assert told / lasted == pytest.approx(zero, rel=0.15)


def test_an_axis_that_never_leaves_its_step_is_as_still_as_the_body():
    rate = np.zeros((300, 3))
    rate[100:200, 0] = 30.0 * np.sin(np.pi * np.arange(100) / 100.0)
    rate[90:210, 1] = 30.0 * np.sin(np.pi * np.arange(120) / 120.0)
    still = still_of(np.round(rate + 0.2), 80, 220)
    assert np.array_equal(still[:, 2], still[:, 0] & still[:, 1])
    assert still[80:88].all()
    assert still[213:220].all()
    assert not still[102:198].any()
    assert not still[:80].any()
    assert not still[220:].any()
    # Where nothing is seen to rotate, any rate inside the LSB is possible: all readings of the move share the error.
    still = still_of(np.zeros((100, 3)), 10, 90)
    assert still[10:90].all()
    assert not still[:10].any()
    variance = unseen_rotation(still, np.full(3, 2.0), np.array([[10, 90]]))
    assert variance[10:90].sum(axis=0) == pytest.approx(np.full(3, 80.0**2 * 2.0**2 / 12.0))


def test_an_axis_that_turns_slowly_beside_a_quick_one_is_as_still_as_itself_shows():
    """Its place must not act on what codes miss, nor on an axis that leaves its step long after the others do."""
    places = (np.arange(400) + 0.5) / 400.0 - 0.5
    u = np.clip((np.arange(260) - 30.0) / 200.0, 0.0, 1.0)[:, None]
    rng, told = np.random.default_rng(5), []
    for place in places:
        rate = 16.0 * u**2 * (1.0 - u) ** 2 * np.array([90.0, 12.0, 5.0]) * rng.choice((-1.0, 1.0), 3)
        rate *= rng.uniform(0.8, 1.25, 3)
        codes = np.round(rate + place)
        told.append(np.sum(np.where(still_of(codes, 0, 260), -rate, codes - rate - place), axis=0))
    # Readings in which the place still acts, of 260, ± 1, ± 1.4 on the slowest axis. With the quickest axis'
    # stillness for all it acted for 10, 13 and 19 of them.
    assert np.abs(np.array(told).T @ places / (places @ places)).max() < 5.0
