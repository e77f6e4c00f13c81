"""calibrate, verify and diagnose answer with one model; what the diagnosis says of real recordings."""

from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest
from scipy.spatial.transform import Rotation

from diagnosed_session import nearest_pose, simulated
from small_session import G
from small_session import simulated as of_motion
from trihedron import _core, calibrate, diagnose
from trihedron.diagnose.bias_strengths import noise_bounds
from trihedron.diagnose.hypothesis import hypothesis
from trihedron.diagnose.session.observations import observe
from trihedron.diagnose.session.solve import folds
from trihedron.diagnose.session.starting_point import start_state
from trihedron.estimate.attitude import integrate_rate
from trihedron.estimate.session.observed import left_by_earth
from trihedron.gravity import EARTH_RATE_RAD_S, earth_rate_up, turned_with_earth
from trihedron.read import read_recording
from trihedron.records.published import published_figures
from trihedron.report.calibration_fit import figures_table
from trihedron.report.machine import calibration_record
from trihedron.segment import segment_recording
from trihedron.session.model import MOVES
from trihedron.simulate import hand_session

SENSORS = (("accelerometer", "acc"), ("gyroscope", "gyro"))
GRAVITY = {"gravity_m_s2": float(G)}


@pytest.fixture(scope="module")
def healthy():
    recording = of_motion(hand_session(18, layout=118), 118)
    return recording, float(G), calibrate(recording, **GRAVITY), diagnose(recording, **GRAVITY)


def test_calibrate_and_diagnose_agree_on_every_parameter_within_a_tenth_of_its_error(healthy):
    _, _, result, diagnosis = healthy
    for sensor, model in (
        (result.accelerometer, diagnosis.baseline.accelerometer),
        (result.gyroscope, diagnosis.baseline.gyroscope),
    ):
        free = sensor.sigma_S > 0.0
        apart = np.abs(sensor.S - np.array(model["S"]))[free] / sensor.sigma_S[free]
        assert apart.max() < 0.1
        assert (np.abs(sensor.b - np.array(model["b"])) / sensor.sigma_b).max() < 0.1
        # One measuring of noise, one of strengths: uncertainties differ by what single precision of a grid leaves.
        wider = sensor.sigma_S[free] / np.array(model["sigma_S"])[free]
        assert 0.95 < wider.min() <= wider.max() < 1.05


def test_calibrate_and_diagnose_publish_the_same_figures_in_print_and_in_json(healthy):
    _, _, result, diagnosis = healthy
    figures = published_figures(result.calibration)
    assert diagnosis.to_dict()["figures"] == figures
    assert calibration_record(result.calibration, result.segments, result.recording)["figures"] == figures
    assert set(figures) == {"gravity_error_in_static_poses", "tilt_error_after_rotations"}
    table = figures_table(result.calibration, {})
    assert table is not None
    assert table.head[1:3] == ("S and b, in sample", "cross-validated")
    # Of a calibration the errors in sample are in the table of its diagnosis, beside the cross-validated ones.
    for text, first in ((str(result), 2), (str(diagnosis), 1)):
        flat = " ".join(text.split())
        assert all(value in flat for row in table.rows for value in row[first:])


def fitted_to(recording, gravity):
    segments = segment_recording(recording)
    calibration = calibrate(recording, segments=segments, gravity_m_s2=gravity).calibration
    obs = observe(recording, segments)
    return hypothesis(obs, start_state(obs, calibration), None, within=noise_bounds(obs)).fitted, calibration


def test_gravity_is_carried_through_moves_where_zeros_differ_between_poses(real_data):
    paths = {f"{sensor}_path": real_data / f"getovermassif/session4_{stem}.txt" for sensor, stem in SENSORS}
    recording = read_recording(**paths)
    fitted, calibration = fitted_to(recording, 9.803)
    # imu_tk found 1.000 on the log's own unit; shrunk by its biases' scatter it was 0.816, moves 4.70 deg.
    assert fitted.state.gyro_S[0, 0] == pytest.approx(1.0, abs=0.01)
    missed = np.linalg.norm(fitted.core.moves()[0][:, :2], axis=1)
    assert np.degrees(np.sqrt(np.mean(np.square(missed))) / 9.803) < 0.35
    # The calibration is the same estimator's, and publishes what its own moves miss.
    assert calibration.gyroscope.S[0, 0] == pytest.approx(1.0, abs=0.01)
    assert published_figures(calibration)["tilt_error_after_rotations"]["rms"] < 0.35


def test_chain_and_dense_algebra_give_the_same_covariance_leverage_projection_and_prediction():
    recording, truth = simulated(seed=3, n_poses=12, grade="adis")
    fitted, _ = fitted_to(recording, truth.gravity_m_s2)
    J, r = fitted.core.jacobian(), fitted.system.residual
    size = np.linalg.norm(J, axis=0)
    scaled = J / size
    eye = np.eye(len(size))
    inverse = np.linalg.inv(scaled.T @ scaled + 1e-12 * eye)
    covariance = inverse / np.outer(size, size)
    # Two factorisations of one matrix of condition 1e6: ten digits are left, the ridge takes the rest.
    np.testing.assert_allclose(fitted.covariance(), covariance[:18, :18], rtol=1e-6, atol=0)
    np.testing.assert_allclose(fitted.leverage, np.einsum("ri,ij,rj->r", scaled, inverse, scaled), atol=1e-8)
    blocks = folds(fitted)
    found, log_det, *_ = fitted.core.held_out(blocks)
    for k, held in enumerate(blocks):
        train = scaled[~held]
        cov = np.linalg.inv(train.T @ train + 1e-9 * eye)
        spread = scaled[held] @ cov @ scaled[held].T + np.eye(held.sum())
        innovation = r[held] - scaled[held] @ (cov @ (train.T @ r[~held]))
        value, vector = np.linalg.eigh(spread)
        known = value < 1e7
        chi2 = float(((vector.T @ innovation)[known] ** 2 / value[known]).sum())
        assert found[k].sum() == pytest.approx(chi2, rel=1e-6)
        # In the readings' own units: whitened moves bring the determinant of their whitening.
        own = np.unique(fitted.system.segment[held & (fitted.system.domain == MOVES)]).astype(int)
        whitening = np.log(np.einsum("mii->mi", fitted.core.whitening()[own])).sum()
        assert log_det[k] == pytest.approx(np.log(value[known]).sum() - 2.0 * whitening, abs=1e-6)


@pytest.mark.parametrize(("name", "expected_mm_s2"), [("adxl355", 3.0), ("bmi160", 2.6)])
def test_the_joint_answer_leaves_at_rest_what_it_prints_and_no_more_than_poses_alone(real_data, name, expected_mm_s2):
    # Moves of this log miss by degrees (lost samples, timestamps of arrival). Over the accelerometer they left 19
    # and 24 mm/s² where the report said 3.7 and 10.4; the poses alone, with biases that are lines in time, leave 2.79
    # and 2.09: the second accelerometer drifts by 40 mm/s².
    result = calibrate(read_recording(real_data / "openaxes" / f"{name}.csv"), gravity_m_s2=9.8127)
    sensor, segments = result.calibration.accelerometer, result.segments
    assert sensor.method == "joint"
    force = segments.accelerometer_mean @ sensor.S.T + sensor.b
    error = np.linalg.norm(force, axis=1) - 9.8127
    assert 1e3 * np.sqrt(np.mean(error**2)) == pytest.approx(1e3 * sensor.quality.rms, rel=1e-9)
    up, time_s = force / np.linalg.norm(force, axis=1, keepdims=True), np.asarray(segments.time_mid_s)
    line = np.column_stack([up, up * (time_s - time_s.mean())[:, None]])
    left = error - line @ np.linalg.lstsq(line, error, rcond=None)[0]
    assert 1e3 * np.sqrt(np.mean(left**2)) < expected_mm_s2
    assert 1.0 < sensor.quality.held_out_rms / sensor.quality.rms < 2.0  # 33 poses for nine parameters


def test_scatter_of_the_zeros_is_found_and_does_not_spoil_the_answer():
    scores = []
    for seed in range(3):
        recording, truth = simulated(seed=seed + 20, n_poses=16, grade="adis")
        segments = segment_recording(recording)
        rng = np.random.default_rng(seed)
        scale = np.cbrt(abs(np.linalg.det(truth.gyroscope_S)))
        force_scale = np.cbrt(abs(np.linalg.det(truth.accelerometer_S)))
        of_pose = rng.standard_normal((2, segments.n_poses, 3))
        bias = of_pose[:, nearest_pose(segments.poses, recording.n_samples)]
        moved = replace(
            recording,
            gyroscope=recording.gyroscope + np.radians(0.05) / scale * bias[0],
            accelerometer=recording.accelerometer + 3e-3 / force_scale * bias[1],
        )
        found = calibrate(moved, segments=segment_recording(moved), gravity_m_s2=truth.gravity_m_s2).calibration
        pairs = ((found.accelerometer, truth.accelerometer_S), (found.gyroscope, truth.gyroscope_S))
        error = np.concatenate([(s.S - S)[s.sigma_S > 0.0] for s, S in pairs])
        scores.append(error / np.concatenate([s.sigma_S[s.sigma_S > 0.0] for s, _ in pairs]))
    squares = np.array(scores) ** 2
    # 45 correlated scores of unit variance: their mean square lies in 1 ± 0.35 (15 a session, three sessions).
    assert 0.5 < squares.mean() < 1.6


def diagnosed(gravity: float, first: float = 0.0, last: float = 1.0, **arguments: object):
    """The diagnosis of a log, or of a part of its rows."""
    recording = read_recording(**arguments)
    rows = slice(int(first * recording.n_samples), int(last * recording.n_samples))
    readings = {name: getattr(recording, name) for name in ("accelerometer", "gyroscope", "temperature_degc")}
    readings = {name: column[rows] for name, column in readings.items() if column is not None}
    recording = replace(recording, time_s=recording.time_s[rows] - recording.time_s[rows.start], **readings)
    return diagnose(recording, gravity_m_s2=gravity)


@pytest.fixture(scope="module")
def xsens(real_data: Path):
    recording = read_recording(**{f"{s}_path": real_data / f"xsens_mti/xsens_{stem}.txt" for s, stem in SENSORS})
    return calibrate(recording, gravity_m_s2=9.81744)


@pytest.mark.slow
def test_xsens_holds_g_sensitivity_and_gravity_after_moves_gains(xsens) -> None:
    d = diagnose(xsens.recording, segments=xsens.segments, gravity_m_s2=9.81744)
    assert d.verdict == "missing-physics"
    first = d.effects[0]
    assert first.id == "gyro-g-sensitivity"
    matrix = {p.name: p.value for p in first.parameters}
    assert abs(matrix["G_yx"]) * 9.80665 == pytest.approx(np.radians(0.16), rel=0.1)  # deg/s per g
    moves = next(h for h in first.held_out if h.domain == "moves")
    # Before, biases of any scatter take up a part of it, 0.44° with none. χ², which noise enters, falls sixfold.
    assert moves.rms_before > 2.3 * moves.rms_after
    assert moves.rms_after < 0.14
    assert moves.chi2_per_dof_before > 5.0 * moves.chi2_per_dof_after


def test_a_session_with_wild_rotation_at_its_end_is_healthy_but_for_the_range(real_data: Path) -> None:
    d = diagnosed(9.8184, first=0.4, path=real_data / "mimu4444/exp_2.npz", instance=1)
    assert [e.id for e in d.effects] == ["gyro-saturation"]
    agree = {t.domain: t.chi2_per_dof for t in d.remaining if not t.disagrees}
    assert {"static-accel", "static-gyro", "moves", "dynamics"} <= set(agree)


def test_a_rate_that_steps_between_samples_is_charged_with_what_its_integral_misses() -> None:
    rng = np.random.default_rng(5)
    step, n, moves = 0.01, 200, 300
    jumps = rng.normal(size=(moves, 3))
    at = (100.0 + rng.random(moves)) * step  # where between two samples
    t = np.arange(n) * step
    rate = np.where(t[None, :, None] >= at[:, None, None], jumps[:, None, :], 0.0).reshape(-1, 3)
    # Sum of the samples less the true integral, both up to the last sample.
    missed = rate.reshape(moves, n, 3).sum(axis=1) * step - jumps * (n * step - at)[:, None]
    missed += 0.5 * jumps * step  # the first sample after the jump comes half a step late in the mean
    ranges = tuple((k * n + 50, k * n + 150) for k in range(moves))
    poses = [(k * n + 5, k * n + 45) for k in range(moves)]
    time_s = step * np.arange(len(rate))
    charged = _core.unresolved_variance(rate, (np.array(ranges), np.array(poses)), time_s, step, np.zeros(3))
    # 900 squares of a jump times a phase have a mean certain to 7 %: two of those, and a tenth for the width of the
    # band, over which a step's power is above that at its middle.
    assert np.mean(missed**2) == pytest.approx(np.mean(charged), rel=0.25)


@pytest.mark.slow
def test_moves_left_out_at_a_limit_explain_only_what_they_disagree_by_more_than_others(real_data: Path) -> None:
    d = diagnosed(9.8127, path=real_data / "openaxes/adxl355.csv")
    share = {e.id: e.share for e in d.effects}
    assert share["accel-saturation"] < share["accel-cubic"]


def test_an_answer_that_poses_support_stands_though_moves_are_spoilt(real_data: Path) -> None:
    # Pooled with moves that lost samples or hold an unknown arm, it was thrown out again.
    paths = {f"{sensor}_path": real_data / f"getovermassif/session2_{stem}.txt" for sensor, stem in SENSORS}
    d = diagnosed(9.803, last=0.5, **paths)
    assert d.effects[0].id == "gyro-g-sensitivity"
    held = next(h for h in d.effects[0].held_out if h.domain == "static-gyro")
    # Without the motion of a support that yields, which is larger about the vertical than the noise of the gyro.
    assert held.rms_before > 1.2 * held.rms_after
    assert held.chi2_per_dof_after < 1.5


def test_the_readme_gives_the_figures_of_the_calibration_of_xsens(xsens) -> None:
    figures, quality = published_figures(xsens.calibration), xsens.calibration.accelerometer.quality
    readme = (Path(__file__).parents[1] / "README.md").read_text()
    row = next(line for line in readme.splitlines() if line.startswith("| Xsens MTi"))
    assert f"| {1e3 * quality.held_out_rms:.2f} mm/s² cross-validated (noise alone {1e3 * quality.floor:.2f})" in row
    assert f"tilt {figures['tilt_error_after_rotations']['held_out_rms']:.3f}° after unseen rotations" in row


def _drawn(n_poses: int, seed: int):
    return of_motion(hand_session(n_poses=n_poses, pose_s=3.0, move_s=2.5, first_pose_s=5.0), seed)


def test_gravity_errors_of_a_joint_fit_have_the_degrees_of_freedom_that_moves_leave_them() -> None:
    found = [calibrate(_drawn(12, k), **GRAVITY).accelerometer.quality for k in range(8)]
    chi2, dof = (sum(getattr(one, name) for one in found) for name in ("chi2", "dof"))
    # The poses alone would leave 3 each; χ² of all scatters by sqrt(2 dof), dof is a whole number of each.
    assert dof > 8 * 5
    assert abs(chi2 - dof) < 3.0 * np.sqrt(2.0 * dof) + 0.5 * np.sqrt(8.0)
    held = [one.held_out_rms / one.floor for one in found]
    assert np.median(held) < 1.6  # a twelfth pose is predicted by eleven and their moves


@pytest.mark.parametrize(
    ("n_poses", "verdict"), [(6, "not-testable"), (10, "consistent")], ids=["undetermined", "one-row-left-by-the-norms"]
)
def test_few_poses_are_consistent_only_where_they_determine_the_model(n_poses: int, verdict: str) -> None:
    assert diagnose(_drawn(n_poses, 7001), **GRAVITY).verdict == verdict


@pytest.mark.parametrize("latitude_deg", [60.0, -20.0, None])
def test_the_earth_rate_that_a_pose_of_unknown_heading_reads_is_in_the_error_of_its_mean(latitude_deg):
    rng = np.random.default_rng(8)
    S = np.radians(np.diag([0.9, 1.1, 1.0]) + 0.1 * rng.standard_normal((3, 3)))
    body = Rotation.random(200_000, random_state=8)
    up = body.inv().apply([0.0, 0.0, 1.0])
    # At any place: latitudes are uniform over the sphere.
    latitude = np.arcsin(rng.uniform(-1.0, 1.0, len(up))) if latitude_deg is None else np.radians(latitude_deg)
    world = np.stack(np.broadcast_arrays(np.cos(latitude), 0.0 * up[:, 0], np.sin(latitude)), axis=1)
    read = EARTH_RATE_RAD_S * body.inv().apply(world) - earth_rate_up(latitude_deg) * up
    inverse = np.linalg.inv(S)
    variance = np.einsum("ai,nij,aj->na", inverse, turned_with_earth(latitude_deg, up), inverse)
    # Of 200 000 poses the mean square is certain to 0.5 %.
    np.testing.assert_allclose(np.mean((read @ inverse.T) ** 2, axis=0), variance.mean(axis=0), rtol=0.02)


def test_the_earth_rate_that_a_slow_move_turns_away_from_a_linear_bias_is_in_the_error_of_its_rotation():
    time_s = np.linspace(0.0, 30.0, 601)
    rate = np.sin(np.pi * time_s / 30.0)[:, None] * [0.08, -0.05, 0.03]
    attitude = integrate_rate(time_s, rate)
    rng = np.random.default_rng(3)
    earth = EARTH_RATE_RAD_S / np.sqrt(3.0) * rng.standard_normal((2000, 3))
    read = np.einsum("nij,ki->knj", attitude, earth)
    linear = read[:, :1] + (time_s / 30.0)[:, None] * (read[:, -1:] - read[:, :1])
    left = np.einsum("nij,knj->kni", attitude, read - linear).sum(axis=1) * 0.05
    whole, none, quiet = np.array([[0, 601]]), np.zeros((1, 3)), _core.RateNoise(np.zeros(3), 0.0, np.inf)
    found = _core.integrate_moves(time_s, rate, whole, np.array([[0.0, 30.0]]), np.eye(3)[None], none, none, 3, quiet)
    variance = left_by_earth(found[4], EARTH_RATE_RAD_S**2 / 3.0 * np.eye(3)[None])
    # Of 2000 times three the mean square is certain to 2 %.
    assert np.mean(left**2) == pytest.approx(variance[0], rel=0.1)
