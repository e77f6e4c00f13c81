"""Turns on a table by known angles, on faces of a case and in any pose, and a turntable at known speed."""

from functools import cache

import numpy as np
import pytest

from confidence.motion import G, Step, attitude, move
from confidence.sensor import lower, read_out, recorded
from confidence.sessions import directions
from test_gyroscope_moves import BIAS, SCALE
from trihedron import calibrate, segment
from trihedron.records import Recording
from trihedron.simulate import Accelerometer, Gyroscope, NoiseTerms, Scenario, simulate, table_turns
from trihedron.simulate.sessions import FACES
from true_segments import codes, segments_from_truth, z_scores

DEG = np.pi / 180.0
IN_COUNTS = tuple(map(tuple, np.array(SCALE) * 1e-3))
QUARTERS = (90.0, -90.0)


def session(seed=0, S=SCALE, b=BIAS, unit="rad/s", turns_deg=QUARTERS, faces=FACES, **motion):
    """A log of six faces of a case with turns on each, and its truth."""
    gyroscope = Gyroscope(S=S, b=b, unit=unit, noise=NoiseTerms(N=(2e-4,) * 3))
    accelerometer = Accelerometer(noise=NoiseTerms(N=(1e-3,) * 3))
    moved = table_turns(turns_deg=turns_deg, faces=faces, **motion)
    return simulate(Scenario(motion=moved, accelerometer=accelerometer, gyroscope=gyroscope), seed)


def on_faces(recording, truth, turns_deg=None, **given):
    segments = segments_from_truth(recording, truth)
    known = {"gravity_m_s2": truth.gravity_m_s2, "method": "faces", "turns_deg": turns_deg, **given}
    return calibrate(recording, segments=segments, **known)


def test_whole_turns_in_counts_are_recognised_and_stated_ones_need_no_nominal_scale():
    turns = (90.0, 1440.0, -1440.0)
    recording, truth = session(1, IN_COUNTS, unit="counts", turns_deg=turns, speed_deg_s=360.0)
    found = on_faces(recording, truth, gyroscope_nominal=1.03e-3)
    assert np.abs(z_scores(found.gyroscope, truth)).max() < 4.0
    said = on_faces(recording, truth, turns * 6, gyroscope_nominal=2.2e-3)
    # The same answer, whatever nominal scale is claimed beside them: within a tenth of its uncertainty or so.
    assert np.abs((said.gyroscope.S - found.gyroscope.S) / found.gyroscope.sigma_S).max() < 0.3


def with_wrong_turn(recording, truth, turn, error_rad):
    """The same turn, further by ``error_rad``: the gyro turned on, evenly, while it turned."""
    segments = segments_from_truth(recording, truth)
    mean = segments.accelerometer_mean
    level = [m for m in segments.moves if np.linalg.norm(mean[m.pose_after] - mean[m.pose_before]) < 0.5]
    move, gyroscope = level[turn], recording.gyroscope.copy()
    axis = int(np.argmax(np.abs(mean[move.pose_before])))
    gyroscope[move.start : move.stop, axis] += error_rad * recording.rate_hz / (move.stop - move.start)
    return Recording(
        recording.time_s, recording.accelerometer, gyroscope, recording.rate_hz,
        accelerometer_unit=recording.accelerometer_unit, gyroscope_unit=recording.gyroscope_unit,
    )  # fmt: skip


@pytest.mark.parametrize("error_deg", [2.0, 5.0])
def test_one_wrong_turn_is_named_with_its_error_and_left_out(error_deg):
    recording, truth = session()
    found = on_faces(with_wrong_turn(recording, truth, 1, error_deg * DEG), truth)
    (named,) = (one.numbers for one in found.findings if one.code == "turn-not-a-multiple")
    assert named["turn"] == 2
    # Quarter turns in 0.02 °/√s of noise: to some hundredths of a degree, and the gyro's scale of two per cent.
    assert named["deviation_rad"] == pytest.approx(error_deg * DEG, rel=0.05)
    assert np.abs(z_scores(found.gyroscope, truth)).max() < 4.0


def test_a_turn_without_a_wall_is_no_multiple_of_a_right_angle_and_believed_where_stated():
    recording, truth = session(turns_deg=(90.0, -60.0, 330.0))
    found = on_faces(recording, truth)
    assert "turn-not-a-multiple" in codes(found)
    assert np.abs(z_scores(found.gyroscope, truth)).max() < 4.0
    stated = on_faces(recording, truth, (90.0, -60.0, 330.0) * 6)
    assert "turn-not-a-multiple" not in codes(stated)
    assert np.abs(z_scores(stated.gyroscope, truth)).max() < 4.0
    with pytest.raises(ValueError, match="turned the other way in turn 2"):
        on_faces(recording, truth, (90.0, 60.0, 330.0, *(90.0, -60.0, 330.0) * 5))


def test_faces_out_of_flat_are_in_the_error_bars():
    scores = []
    for seed in range(3):
        leant = np.array(FACES) + 0.1 * DEG * np.random.default_rng(seed).normal(size=(6, 3))
        recording, truth = session(seed, faces=tuple(map(tuple, leant)))
        scores.append(z_scores(on_faces(recording, truth).gyroscope, truth))
    # 36 normal numbers; what the turns of a face share is its lean, without which the largest is 16.
    assert np.abs(scores).max() < 4.0


@cache
def segmented(seed):
    """A recording in counts, its segments and truth: rest, a turn about the table's axis, rest, by hand to any pose."""
    rng = np.random.default_rng(seed)
    first, *others = (attitude(up, rng.uniform(0.0, 6.28)) for up in directions(13, rng))
    steps = [Step(4.0)]
    for speed, after in zip([45.0, 90.0, -180.0] * 4, others, strict=True):
        # At this speed but for a twelfth of its time at either end.
        steps += [Step(10.0, turn=9.2 * speed), Step(4.0), Step(2.0, to=after), Step(4.0)]
    motion, per = move(steps, first, rng, 100.0, tilt=0.5 * DEG)
    force, rate, rate_hz, truth = read_out(motion, per, rng, gyro_density=0.015 * DEG, accel_density=2e-3)
    recording = recorded(force, rate, rate_hz)
    return recording, segment(recording), lower(truth)


def test_known_speeds_in_unknown_orientations_make_a_gyro_three_times_as_certain():
    scores = []
    for recording, segments, truth in (segmented(0), segmented(1)):
        plain = calibrate(recording, segments=segments, gravity_m_s2=G).gyroscope
        result = calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[45.0, 90.0, 180.0] * 4)
        gyro = result.gyroscope
        assert result.is_trustworthy
        assert np.mean(np.diag(plain.sigma_S) / np.diag(gyro.sigma_S)) > 2.5
        assert np.linalg.eigvalsh(result.calibration.covariance).min() > -1e-18
        scores += [*((gyro.S - truth.S_w) / gyro.sigma_S).ravel(), *((gyro.b - truth.b_w) / gyro.sigma_b)]
    # 12 scores a unit, as good as independent: their mean square within four standard errors of 1.
    assert abs(np.mean(np.square(scores)) - 1.0) < 4.0 * np.sqrt(2.0 / len(scores))
    assert np.abs(scores).max() < 4.0


def test_the_uncertainty_of_the_speed_is_in_every_scale():
    recording, segments, truth = segmented(0)
    said = [45.09, 90.18, -180.36] * 4
    stated = {"turntable_deg_s": said, "turntable_sigma": 0.002}
    gyro = calibrate(recording, segments=segments, gravity_m_s2=G, **stated).gyroscope
    assert np.abs((gyro.S - truth.S_w) / gyro.sigma_S).max() < 4.0
    # Two parts in a thousand beside one in ten thousand from the moves: the table shows what axes have to each other.
    assert np.diag(gyro.sigma_S / gyro.S).min() > 5e-5


def test_speeds_that_the_rest_of_the_log_contradicts_are_said_and_do_no_harm():
    recording, segments, truth = segmented(0)
    result = calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[47.0, 94.0, 188.0] * 4)
    said = next(one for one in result.findings if one.code == "turntable")
    # 45 °/s where 47 are stated, with a noise of a part in a thousand; rms is that of the same differences.
    assert abs(said.numbers["common_percent"] - 100.0 * (45.0 / 47.0 - 1.0)) < 0.1
    assert said.numbers["rms"] >= abs(said.numbers["common_percent"]) / 100.0
    assert np.abs((result.gyroscope.S - truth.S_w) / result.gyroscope.sigma_S).max() < 4.0


def test_another_number_of_speeds_is_refused_with_the_turns_that_were_found():
    recording, segments, _ = segmented(0)
    with pytest.raises(ValueError, match=r"3 speeds were given and 12 steady turns were found \(seconds \d+\.\d-"):
        calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[45.0, 90.0, 180.0])
    with pytest.raises(ValueError, match="leave them, or the reference, out"):
        calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[45.0], reference=recording)
