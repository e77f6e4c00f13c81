"""Turns on a table by known angles, on faces of a case and in any pose, and a turntable at known speed."""

from functools import cache

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from confidence.sensor import Truth as ConfidenceTruth
from confidence.sensor import lower
from test_gyroscope_moves import BIAS, SCALE
from trihedron import calibrate, segment
from trihedron.estimate.case_frame import TURN, OnFaces, across_faces, fit_case
from trihedron.records import Recording
from trihedron.simulate import Accelerometer, Gyroscope, NoiseTerms, Scenario, simulate, table_turns
from trihedron.simulate.sessions import FACES
from true_segments import codes, segments_from_truth, z_scores

DEG = np.pi / 180.0
IN_COUNTS = tuple(map(tuple, np.array(SCALE) * 1e-3))
QUARTERS = (90.0, -90.0)


def session(seed=0, S=SCALE, b=BIAS, unit="rad/s", turns_deg=QUARTERS, **motion):
    """A log of six faces of a case with turns on each, and its truth."""
    gyroscope = Gyroscope(S=S, b=b, unit=unit, noise=NoiseTerms(N=(2e-4,) * 3))
    accelerometer = Accelerometer(noise=NoiseTerms(N=(1e-3,) * 3))
    moved = table_turns(turns_deg=turns_deg, faces=FACES, **motion)
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


@pytest.mark.parametrize("tilt_deg", [0.02, 0.1])
def test_faces_out_of_flat_are_in_the_error_bars(tilt_deg):
    rng = np.random.default_rng(round(1000 * tilt_deg))
    scores = []
    for trial in range(60):
        faces = np.repeat((1, -1, 2, -2, 3, -3) if trial % 2 else (1, 2, 3), 2)
        angles = np.tile([np.pi, -np.pi], len(faces) // 2)
        normals = np.eye(3)[np.abs(faces) - 1] * np.sign(faces)[:, None]
        leans = np.repeat(rng.normal(size=(len(faces) // 2, 3)) * tilt_deg * DEG, 2, axis=0)
        normals += leans * (normals == 0.0)
        # Raw angles of a gyro without bias: a degree of noise in ten thousand.
        raw = (angles[:, None] * normals + 2e-4 * rng.normal(size=normals.shape)) @ np.linalg.inv(SCALE).T
        noise = 4e-8 * np.linalg.inv(SCALE) @ np.linalg.inv(SCALE).T * np.ones((len(faces), 1, 1))
        turns = OnFaces(raw, noise, faces, angles, np.zeros(len(faces)))
        axes = np.column_stack([np.abs(faces) - 1, across_faces(faces)])
        rows = turns.rows(np.array(SCALE), axes, 0, 12)
        at = np.arange(3 * len(faces)).reshape(-1, 3)
        leaning = {name: np.zeros((at.size, 2)) for name in turns.face_leans()}
        for name, columns in turns.face_leans().items():
            leaning[name][at[:, 1:].ravel()] = columns
        leaning[TURN] = np.zeros((at.size, 2 * len(faces)))
        leaning[TURN][at[:, 1:].ravel()] = np.eye(2 * len(faces)) / np.pi
        rows = type(rows)(rows.slope, rows.side, rows.noise, leaning)
        start = np.append(np.array(SCALE).ravel(), np.zeros(3))
        fit = fit_case(start, np.zeros((12, 12)), np.eye(12)[:, :9], rows)
        error = fit.values[:9] - np.array(SCALE).ravel()
        scores.append(error / np.sqrt(np.diag(fit.covariance)[:9]))
    scores = np.abs(scores)
    # Two turns of a face say nothing of what they share: without its prior up to 31 standard errors.
    assert np.mean(scores < 1.96) > 0.9
    assert scores.max() < 5.0


G, RATE_HZ = 9.81, 100.0


@cache
def segmented(seed):
    """A recording in counts, its segments and truth: rest, a turn about the table's axis, rest, by hand to any pose."""
    rng = np.random.default_rng(seed)
    axis = Rotation.from_euler("x", 0.5, degrees=True).apply([0.0, 0.0, 1.0])
    now = Rotation.random(random_state=seed)
    attitudes, pulls = [], []

    def add(turned, pull=None):
        attitudes.append(turned.as_quat())
        pulls.append(np.zeros((len(turned), 3)) if pull is None else pull)

    still = int(4.0 * RATE_HZ)
    for k, speed in enumerate([45.0, 90.0, -180.0] * 4):
        add(Rotation.concatenate([now] * still))
        ramp = np.linspace(0.0, 1.0, int(RATE_HZ))
        rate = np.concatenate([ramp, np.ones(int(8.0 * RATE_HZ)), ramp[::-1]]) * speed * DEG
        turned = Rotation.from_rotvec(axis * (np.cumsum(rate) / RATE_HZ)[:, None]) * now
        w = axis * rate[:, None]
        add(turned, np.cross(w, np.cross(w, turned.apply(0.03 * rng.normal(size=3)))))
        now = turned[-1]
        add(Rotation.concatenate([now] * still))
        after = Rotation.random(random_state=1000 * seed + k)
        s = np.linspace(0.0, 1.0, int(2.0 * RATE_HZ))[:, None]
        add(Rotation.from_rotvec((after * now.inv()).as_rotvec() * (10.0 * s**3 - 15.0 * s**4 + 6.0 * s**5)) * now)
        now = after
    add(Rotation.concatenate([now] * still))
    R = Rotation.from_quat(np.concatenate(attitudes))
    step = (R[:-1].inv() * R[1:]).as_rotvec() * RATE_HZ
    w = np.vstack([step[:1], 0.5 * (step[1:] + step[:-1]), step[-1:]])
    f = R.inv().apply(np.concatenate(pulls) + np.array([0.0, 0.0, G]))
    own_w, own_f = np.eye(3) + 0.02 * rng.normal(size=(3, 3)), np.eye(3) + 0.01 * rng.normal(size=(3, 3))
    b_w, b_f = rng.normal(size=3) * DEG, 0.2 * rng.normal(size=3)
    lsb_w, lsb_f = 1000.0 * DEG / 2**16, 8.0 * G / 2**16
    raw_w = np.round((w @ own_w.T + b_w + 0.1 * DEG * rng.normal(size=w.shape)) / lsb_w)
    raw_f = np.round((f @ own_f.T + b_f + 0.02 * rng.normal(size=f.shape)) / lsb_f)
    inverse_w, inverse_f = np.linalg.inv(own_w), np.linalg.inv(own_f)
    truth = ConfidenceTruth(inverse_f * lsb_f, -inverse_f @ b_f, inverse_w * lsb_w, -inverse_w @ b_w)
    units = {"accelerometer_unit": "counts", "gyroscope_unit": "counts"}
    recording = Recording(np.arange(len(raw_w)) / RATE_HZ, raw_f, raw_w, RATE_HZ, **units)
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
    with pytest.raises(ValueError, match=r"3 speeds were given and 12 steady turns were found \(seconds 5\.3-"):
        calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[45.0, 90.0, 180.0])
    with pytest.raises(ValueError, match="leave them, or the reference, out"):
        calibrate(recording, segments=segments, gravity_m_s2=G, turntable_deg_s=[45.0], reference=recording)
