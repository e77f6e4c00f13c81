"""Method 2 for gyros: recovery, honesty, observability."""

import re
from dataclasses import replace

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

import trihedron
from small_session import log_text, rows_of, simulated
from trihedron.estimate.gyroscope.findings import handedness
from trihedron.estimate.session.solved import calibrate_moves
from trihedron.records import SensorCalibration, Severity
from trihedron.simulate import Accelerometer, Gyroscope, Motion, MoveTo, NoiseTerms, Scenario, hand_session, simulate
from trihedron.simulate import Pose as SimulatedPose
from trihedron.units import RateUnit
from true_segments import codes, segments_from_truth, z_scores

SCALE = ((1.02, 0.01, -0.015), (0.005, 0.98, 0.02), (-0.01, 0.008, 1.01))
BIAS = (0.01, -0.02, 0.005)
SWAP = np.eye(3)[:, [0, 2, 1]]


def scenario(motion: Motion, gyro_noise=2e-4, accel_noise=1e-3, S=SCALE, b=BIAS, **gyroscope):
    return Scenario(
        motion=motion,
        gyroscope=Gyroscope(S=S, b=b, noise=NoiseTerms(N=(gyro_noise,) * 3), **gyroscope),
        accelerometer=Accelerometer(noise=NoiseTerms(N=(accel_noise,) * 3)),
    )


def calibrated(recording, segments, truth, nominal=None, error=None, covariance=None):
    """The gyro beside an accelerometer that is known, or off by ``error`` of a stated covariance."""
    error = np.zeros(12) if error is None else error
    S, b = truth.accelerometer_S + error[:9].reshape(3, 3), truth.accelerometer_b + error[9:]
    stated = np.zeros((12, 12)) if covariance is None else covariance
    given = SensorCalibration(S, b, stated, "m/s^2", "m/s^2", "given")
    return calibrate_moves(recording, segments, given, truth.gravity_m_s2, nominal)


@pytest.fixture(scope="module")
def quiet():
    recording, truth = simulate(scenario(hand_session(18, pose_s=3.0, first_pose_s=5.0)), seed=1)
    return recording, truth, segments_from_truth(recording, truth)


@pytest.mark.parametrize("draws", [5, pytest.param(12, marks=pytest.mark.slow)])
def test_a_wrong_accelerometer_inside_its_error_bars_leaves_the_gyro_inside_its_own(draws):
    rng = np.random.default_rng(7)
    recording, truth = simulate(scenario(hand_session(14, pose_s=2.0, first_pose_s=3.0)), seed=4)
    segments = segments_from_truth(recording, truth)
    sigma = np.array([1e-3] * 9 + [5e-3] * 3)
    distance = []
    for _ in range(draws):
        error = rng.normal(size=12) * sigma
        found, _ = calibrated(recording, segments, truth, None, error, np.diag(sigma**2))
        e = np.concatenate([(found.S - truth.gyroscope_S).ravel(), found.b - truth.gyroscope_b])
        distance.append(e @ np.linalg.solve(found.covariance, e))
    # Draws of χ²(12), whose variance is 24: four standard deviations of their sum.
    assert abs(sum(distance) - 12.0 * draws) < 4.0 * np.sqrt(24.0 * draws)


@pytest.mark.parametrize(
    ("accelerometer", "gyro", "said"),
    [
        # Each row: the axes of both sensors on a right-handed board, and what is named.
        (np.eye(3), np.eye(3), None),
        (np.diag([-1, 1, 1]), np.diag([-1, 1, 1]), "both sensors"),
        (np.eye(3), np.diag([1, 1, -1]), "gyro Z turns against accelerometer Z"),
        (np.diag([-1, 1, 1]), np.eye(3), "accelerometer X points against gyro X"),
        (SWAP, np.eye(3), "gyro x, y and z turn about accelerometer x, z, y"),
        (np.eye(3), SWAP, "gyro x, y and z turn about accelerometer x, z, y"),
        (np.eye(3), np.eye(3)[:, [1, 2, 0]], "gyro x, y and z turn about accelerometer"),
    ],
)
def test_axes_that_are_reversed_or_exchanged_are_named(accelerometer, gyro, said):
    # The calibration takes the accelerometer's columns as they are: its body frame R f is mirrored where they are
    # left-handed, and a rate, an axial vector, is det(R) R ω there.
    R = accelerometer.T
    found = [one.seen.lower() for one in handedness(np.linalg.det(R) * R @ gyro * 1e-4, R @ accelerometer * 2.0)]
    assert ([said.lower() in one for one in found] == [True]) if said else not found
    # With the signs stated as they are nothing is left to say of the accelerometer.
    if np.count_nonzero(accelerometer - np.diag(np.diag(accelerometer))) == 0:
        stated = [one.seen for one in handedness(gyro * 1e-4, accelerometer * 2.0)]
        assert bool(stated) == bool((accelerometer != gyro).any())


def about(angle_deg, axis=(0.0, 0.0, 1.0)):
    return Rotation.from_rotvec(np.radians(angle_deg) * np.asarray(axis) / np.linalg.norm(axis)).as_matrix()


@pytest.mark.parametrize("mirror", [1.0, -1.0])
def test_a_gyro_turned_by_fifty_degrees_is_right_handed_unless_it_is_mirrored(mirror):
    S = np.array(SCALE) @ about(50.0) * np.array([1.0, 1.0, mirror])
    recording, truth = simulate(scenario(hand_session(16, pose_s=2.0), S=tuple(map(tuple, S))), seed=2)
    calibration = trihedron.calibrate(recording, gravity_m_s2=truth.gravity_m_s2)
    (said,) = (one for one in calibration.findings if one.code == "left-handed")
    assert said.severity is (Severity.NOTE if mirror > 0.0 else Severity.WARNING)
    assert np.abs(z_scores(calibration.gyroscope, truth)).max() < 4.0
    assert mirror < 0.0 or said.numbers["angle_deg"] == pytest.approx(50.0, abs=1.5)
    diagnosis = trihedron.diagnose(recording, gravity_m_s2=truth.gravity_m_s2)
    assert [one.id for one in diagnosis.effects] == ["axis-handedness"] * (mirror < 0.0)


@pytest.mark.parametrize(("sensor", "order"), [(0, [1, 0, 2]), (1, [0, 2, 1]), (1, [1, 2, 0])])
def test_columns_in_another_order_are_mended_by_the_columns_that_are_named(tmp_path, sensor, order):
    table = rows_of(simulated(hand_session(n_poses=14, pose_s=2.0, move_s=1.0)))
    columns = 1 + 3 * sensor + np.arange(3)
    table[:, columns] = table[:, columns[order]]
    log = tmp_path / "log.csv"
    log.write_text(log_text(table))
    found = trihedron.calibrate(trihedron.read(log), gravity_m_s2=9.80665)
    said = next(one for one in found.findings if one.code == "left-handed")
    mapping = re.search(r"columns=\"([^\"]*)\"", said.action)[1]
    mended = trihedron.calibrate(trihedron.read(log, columns=mapping), gravity_m_s2=9.80665)
    assert "left-handed" not in codes(mended.findings)


def test_moves_about_one_axis_are_called_not_observable_with_the_moves_to_add():
    up = ((0.0, 0.0, 1.0), (0.0, 1.0, 0.2), (0.0, 0.3, -1.0), (0.0, -1.0, 0.1), (0.0, 0.1, 1.0), (0.0, 1.0, 0.5))
    steps = [SimulatedPose(4.0)]
    for direction in up[1:]:
        steps += [MoveTo(direction, 2.0, wobble_deg=0.0), SimulatedPose(3.0)]
    recording, truth = simulate(scenario(Motion(tuple(steps))), seed=1)
    segments = segments_from_truth(recording, truth)
    found, findings = calibrated(recording, segments, truth, 1.0)
    finding = next(f for f in findings if f.code == "not-observable")
    turns = finding.action.split(": ")[1]
    assert [axis for axis in "XYZ" if f"{axis}, " in turns or f"{axis} twice" in turns] == ["Y", "Z"], turns
    # What was turned about is known; what was not has uncertainties as large as the scale itself.
    assert found.sigma_S[0, 0] < 0.2 * found.sigma_S[:, 1:].max()
    assert found.sigma_S[:, 1:].max() > 0.3


def test_a_disturbed_hold_costs_its_two_moves_and_is_named(quiet):
    recording, truth, segments = quiet
    mean = segments.accelerometer_mean.copy()
    mean[7] += [0.4, -0.3, 0.2]
    found, findings = calibrated(recording, replace(segments, accelerometer_mean=mean), truth)
    named = {int(f.numbers["move"]) for f in findings if f.code == "outlier-move"}
    assert named == {7, 8}
    assert np.abs(z_scores(found, truth)).max() < 4.0
    assert list(np.flatnonzero(found.quality.weights == 0.0)) == [6, 7]


def test_a_clipped_move_is_bridged_and_weighs_less(quiet):
    recording, truth, segments = quiet
    speed = np.abs(recording.gyroscope[:, 0])
    limit = np.sort(speed)[-6]
    clipped = replace(recording, gyroscope=np.clip(recording.gyroscope, [-limit, -9, -9], [limit, 9, 9]))
    found, findings = calibrated(clipped, segments, truth)
    assert "clipping" in codes(findings)
    assert np.abs(z_scores(found, truth)).max() < 4.0
    hard = np.clip(recording.gyroscope, -0.3 * limit, 0.3 * limit)
    with pytest.raises(ValueError, match="rotate at less than"):
        calibrated(replace(recording, gyroscope=hard), segments, truth)


def test_a_bias_that_follows_gravity_is_found_and_leaves_the_answer_as_it_was(quiet):
    recording, truth, segments = quiet
    A = np.array([[0.0, 3e-4, 0.0], [4e-4, 0.0, 0.0], [0.0, 0.0, -2e-4]])
    tilted = replace(recording, gyroscope=recording.gyroscope + truth.specific_force_m_s2 @ A.T)
    means = segments.gyroscope_mean + segments.accelerometer_mean @ A.T
    found, findings = calibrated(tilted, replace(segments, gyroscope_mean=means), truth)
    (finding,) = [one for one in findings if one.code == "gyro-g-sensitivity"]
    shown, per_g = finding.numbers, 9.80665 * np.abs(found.S @ A).max()
    assert abs(shown["per_g_rad_s"] - per_g) < 4.0 * shown["sigma_per_g_rad_s"]
    assert shown["sigma_per_g_rad_s"] < 0.05 * per_g
    assert np.abs(z_scores(found, truth)).max() < 4.0
    # As a part of the session it costs the scale no certainty that a walk of the bias would.
    alone, _ = calibrated(recording, segments, truth)
    assert (found.sigma_S < 1.2 * alone.sigma_S).all()
    # Left in, it would miss by several times the noise of a move.
    assert found.quality.held_out_rms < 1.5 * found.quality.floor


def test_a_zero_that_drifts_is_followed_and_reported(quiet):
    recording, truth, segments = quiet
    drift = 0.01 * recording.time_s / recording.time_s[-1]
    drifting = replace(recording, gyroscope=recording.gyroscope + drift[:, None])
    means = np.array([drifting.gyroscope[h.start : h.stop].mean(axis=0) for h in segments.poses])
    found, findings = calibrated(drifting, replace(segments, gyroscope_mean=means), truth)
    # 0.6 °/s turns a move of two seconds by 1°, far above its noise: b of this log is not b of the next.
    assert [f.severity for f in findings if f.code == "gyro-bias-drift"] == [Severity.WARNING]
    assert np.abs(z_scores(found, truth)[:9]).max() < 4.0


def test_held_out_moves_are_predicted_as_well_as_the_error_bars_say(quiet):
    recording, truth, segments = quiet
    quality = calibrated(recording, segments, truth)[0].quality
    z = quality.held_out / quality.held_out_sigma
    # 51 scores, two thirds independent: mean square 1 with standard deviation √(2/34); four of them.
    assert abs(np.mean(z**2) - 1.0) < 1.0
    assert quality.held_out_rms > quality.rms
    # ‖residual‖ against the prediction: 34 numbers less 9, three standard deviations of their root mean square.
    assert abs(quality.rms_dof / quality.floor - 1.0) < 0.45


def test_a_missing_sensor_or_missing_moves_are_refused_in_one_sentence(quiet):
    recording, truth, segments = quiet
    rows = {name: getattr(recording, name)[:500] for name in ("time_s", "accelerometer", "gyroscope")}
    for log, parts, words in (
        (replace(recording, gyroscope=None), segments, "no gyroscope"),
        (recording, replace(segments, moves=()), "no move between two poses"),
        (replace(recording, **rows), segments, "another log"),
    ):
        with pytest.raises(ValueError, match=words):
            calibrated(log, parts, truth)


@pytest.mark.parametrize("axes", [np.eye(3), -SWAP])
def test_counts_of_quick_turns_with_strong_accelerations_are_calibrated(axes):
    motion = hand_session(16, pose_s=2.0, move_s=0.5, first_pose_s=3.0, wobble_deg=15.0, travel_m=0.8, layout=5)
    recording, truth = simulate(scenario(motion), seed=5)
    counts = np.round(recording.gyroscope @ axes.T * 900.0)
    raw = replace(recording, gyroscope=counts, gyroscope_unit=RateUnit.COUNTS)
    found = trihedron.calibrate(raw, gravity_m_s2=truth.gravity_m_s2)
    assert found.is_trustworthy
    # The largest of nine normal numbers is below 4 in 1999 of 2000 draws.
    score = (found.gyroscope.S - truth.gyroscope_S @ axes.T / 900.0) / found.gyroscope.sigma_S
    assert np.abs(score).max() < 4.0
