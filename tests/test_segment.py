"""Still poses and moves found in simulated sessions, against the truth."""

import numpy as np
import pytest

from trihedron.records import FindingCode, Recording
from trihedron.segment import segment_recording
from trihedron.simulate import scenario_by_name, simulate


def codes(segments):
    return {finding.code for finding in segments.findings}


@pytest.fixture(scope="module")
def session():
    return simulate(scenario_by_name("hand-session"), seed=1)


def test_every_true_hold_is_found_once_and_no_sample_of_a_move_is_averaged(session):
    recording, truth = session
    segments = segment_recording(recording)
    assert segments.n_holds == len(truth.holds)
    for found, true in zip(segments.holds, truth.holds, strict=True):
        assert true.start <= found.start < found.stop <= true.stop
        # Half a window and one block at each end is all that may be given away.
        assert found.stop - found.start >= true.stop - true.start - 2 * 0.6 * recording.rate_hz


def test_moves_join_neighbouring_holds_without_loss(session):
    recording, _ = session
    segments = segment_recording(recording)
    assert len(segments.moves) == segments.n_holds - 1
    for move in segments.moves:
        assert move.start == segments.holds[move.hold_before].stop
        assert move.stop == segments.holds[move.hold_after].start


@pytest.mark.parametrize("only", ["accelerometer", "gyroscope"])
def test_one_sensor_alone_finds_the_same_holds(session, only):
    recording, truth = session
    alone = Recording(
        time_s=recording.time_s,
        accelerometer=recording.accelerometer if only == "accelerometer" else None,
        gyroscope=recording.gyroscope if only == "gyroscope" else None,
        rate_hz=recording.rate_hz,
    )
    segments = segment_recording(alone)
    assert segments.n_holds == len(truth.holds)
    assert (segments.gyroscope_mean is None) == (only == "accelerometer")


def test_a_log_that_never_rests_is_a_serious_finding():
    rng = np.random.default_rng(3)
    walk = np.cumsum(rng.normal(size=(3000, 6)), axis=0)
    moving = Recording(np.arange(3000) / 100.0, walk[:, :3], walk[:, 3:], 100.0)
    segments = segment_recording(moving)
    assert segments.n_holds == 0
    assert FindingCode.NOT_STATIC in codes(segments)


def test_a_log_of_nothing_but_rest_is_one_hold_and_few_poses():
    rng = np.random.default_rng(4)
    still = Recording(np.arange(6000) / 100.0, rng.normal(size=(6000, 3)), rng.normal(size=(6000, 3)), 100.0)
    segments = segment_recording(still)
    assert segments.n_holds == 1
    assert FindingCode.FEW_POSES in codes(segments)
    assert segments.duration_s[0] > 58.0
