"""What a whole turn on a leaning table shows: against gravity carried round a case written out here."""

import numpy as np
import pytest

from trihedron import Recording
from trihedron.api.reading import segments_of
from trihedron.estimate.gravity_circle import opposite_headings

G, RATE = 9.81, 100.0
LEAN = np.array([0.05, -0.08])  # m/s² in the level axes of the first heading


def on_a_table(rng, *, wobble=0.0, arm=0.0, speed_s=4.0):
    """A case with z up: rest, one turn of 360° with smooth ends, rest; gravity goes round."""
    t = np.arange(0.0, 8.0 + speed_s, 1.0 / RATE)
    x = np.clip((t - 4.0) / speed_s, 0.0, 1.0)
    angle = 2.0 * np.pi * (x - np.sin(2.0 * np.pi * x) / (2.0 * np.pi))
    rate = np.gradient(angle, t)
    turned = np.stack(
        [
            np.cos(angle) * LEAN[0] + np.sin(angle) * LEAN[1] - arm * rate**2 + wobble * np.sin(3.0 * angle),
            -np.sin(angle) * LEAN[0] + np.cos(angle) * LEAN[1] + arm * np.gradient(rate, t),
            np.full(len(t), G),
        ],
        axis=1,
    )
    w = np.stack([0 * rate, 0 * rate, rate], axis=1) + 1e-3 * rng.standard_normal((len(t), 3))
    return Recording(t, turned + 0.01 * rng.standard_normal((len(t), 3)), w, RATE)


def found(recording, angle=360.0):
    segments = segments_of(None, recording)
    moves = [move for move in segments.moves if move.stop - move.start > 100]
    assert len(moves) == 1
    return segments, opposite_headings(recording, segments, moves, [angle])


@pytest.mark.parametrize("arm", [0.0, 0.05])
def test_the_reading_half_a_turn_on_is_that_of_the_opposite_lean(arm):
    scores = []
    for seed in range(20):
        _, opposite = found(on_a_table(np.random.default_rng([41, seed]), arm=arm))
        assert opposite.pose.tolist() == [0]
        sigma = np.sqrt(np.diagonal(opposite.noise, axis1=1, axis2=2))
        scores.append(((opposite.values - [*(-LEAN), G]) / sigma)[0, :2])
    # 40 scores: no more scatter than stated (1 + 3 √(2/40)), and not bars without meaning.
    assert 0.02 < np.mean(np.square(scores)) < 1.7


def test_an_uneven_table_widens_what_is_said():
    def bars(wobble):
        _, opposite = found(on_a_table(np.random.default_rng(3), wobble=wobble))
        return float(np.sqrt(opposite.noise[0, 0, 0]))

    assert bars(0.1) > 5.0 * bars(0.0)


@pytest.mark.parametrize("angle", [0.0, 180.0])
def test_turns_that_are_not_whole_show_nothing(angle):
    assert found(on_a_table(np.random.default_rng(5)), angle)[1] is None
