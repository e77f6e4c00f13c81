"""From a log and a pose table to the filters and the command's files: matching, noise from the poses, recordings."""

import json
from dataclasses import replace

import numpy as np
import pytest
from scipy.optimize import least_squares

import trihedron
from trihedron import _core
from trihedron.cli import main
from trihedron.estimate.accelerometer.norm import calibrate_norm
from trihedron.estimate.kalman.identified import noise_from_identified
from trihedron.estimate.kalman.norm_invariant import calibrate_without_references
from trihedron.estimate.kalman.per_axis import shaping_model
from trihedron.estimate.kalman.session import calibrate_session, noise_from_poses, pose_readings
from trihedron.read import ReadError, read_axis_noise, read_pose_table
from trihedron.records import AxisNoise, PoseTable
from trihedron.segment import segment_recording
from trihedron.simulate import Clock, NoiseTerms, Scenario, dividing_head, long_static, scenario_by_name, simulate
from trihedron.simulate.accelerometer import Accelerometer
from twins_kalman import B_TRUE, DIVIDING_HEAD_ANGLES_DEG, GRAVITY, S_TRUE, normalised_error_squared

S_NORM = np.array([[0.0393, 0, 0], [0.0001, 0.0390, 0], [0.0001, 0.0002, 0.0385]])
B_NORM = np.array([-19.57, -22.47, -20.3])
LOWER = [0, 3, 4, 6, 7, 8, 9, 10, 11]
"""Places of the nine free parameters among S row by row and b."""
NOISE = AxisNoise(white=1.0, walk=0.01)


@pytest.fixture(scope="module")
def head():
    accelerometer = Accelerometer(S=S_TRUE, b=B_TRUE, noise=NoiseTerms(N=(0.005,) * 3))
    recording = simulate(Scenario(motion=dividing_head(), accelerometer=accelerometer), seed=1)[0]
    return recording, segment_recording(recording)


@pytest.fixture(scope="module")
def table():
    return PoseTable.from_angles(*DIVIDING_HEAD_ANGLES_DEG.T, gravity_m_s2=GRAVITY)


def test_a_simulated_dividing_head_gives_the_instrument_back(head, table):
    result = calibrate_session(*head, table)
    error = np.concatenate([(result.accelerometer.S - S_TRUE).ravel(), result.accelerometer.b - B_TRUE])
    # 12 degrees of freedom: mean 12, standard deviation 4.9; 40 is beyond the 99.99 % limit of 39.1.
    assert normalised_error_squared(error, result.accelerometer.covariance) < 40.0
    assert np.max(result.accelerometer.sigma_S) < 1e-3
    assert {f.code for f in result.findings} == {"noise-assumed"}


def test_pose_numbers_pick_poses_and_a_mismatch_is_said(head, table):
    recording, segments = head
    few = PoseTable(table.specific_force[::9], pose=np.arange(0, 324, 9))
    assert len(pose_readings(recording, segments, few).mean) == 36
    with pytest.raises(ValueError, match=r"has 36 rows, but .* has 324 poses"):
        pose_readings(recording, segments, PoseTable(table.specific_force[::9]))
    with pytest.raises(ValueError, match="pose 500 is requested"):
        pose_readings(recording, segments, PoseTable(table.specific_force[:1], pose=np.array([499])))
    with pytest.raises(ValueError, match="each once"):
        pose_readings(recording, segments, PoseTable(table.specific_force[:2], pose=np.array([3, 3])))
    late = PoseTable(table.specific_force[:1], start_s=np.array([1e6]), stop_s=np.array([2e6]))
    with pytest.raises(ValueError, match="0 readings"):
        pose_readings(recording, segments, late)


def test_a_coarse_converter_is_charged_with_its_step(head):
    recording, segments = head
    # As a resolution of 0.37 would have it, of noise far below.
    coarse = replace(recording, accelerometer=0.37 * np.round(recording.accelerometer / 0.37))
    # Readings are multiples of the step to rounding of the decimal.
    assert noise_from_poses(coarse, segments)[0].resolution == pytest.approx(0.37, rel=1e-9)
    assert noise_from_poses(recording, segments)[0].resolution == 0.0


def pose_table(path):
    return read_pose_table(path, gravity_m_s2=GRAVITY)


@pytest.mark.parametrize(
    ("text", "expected"),
    [
        ("pitch,roll\n0,0\n90,0\n0,90\n", [[0, 0, 1], [-1, 0, 0], [0, 1, 0]]),
        ("roll_deg;pitch_deg\n0;0\n0;90\n90;0\n", [[0, 0, 1], [-1, 0, 0], [0, 1, 0]]),
        ("pitch [deg]\n0\n90\n180\n", [[0, 0, 1], [-1, 0, 0], [0, 0, -1]]),
        ("pitch_rad,roll_rad\n0,0\n1.5707963267948966,0\n0,1.5707963267948966\n", [[0, 0, 1], [-1, 0, 0], [0, 1, 0]]),
        ("fx,fy,fz\n0,0,2\n-9.8,0,0\n0,1,0\n", [[0, 0, 1], [-1, 0, 0], [0, 1, 0]]),
    ],
)
def test_a_pose_table_is_read_by_its_header(tmp_path, text, expected):
    path = tmp_path / "poses.csv"
    path.write_text(text)
    np.testing.assert_allclose(pose_table(path).specific_force / GRAVITY, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("reader", "text", "message"),
    [
        (read_axis_noise, "white: 1", "not JSON"),
        (read_axis_noise, "[1, 2]", "as one object"),
        (read_axis_noise, '{"pink": 1}', "no noise term 'pink'"),
        (read_axis_noise, '{"white": [1, 2]}', "one number, or three"),
        (read_axis_noise, '{"white": "much"}', "one number, or three"),
        (read_axis_noise, '{"white": -1}', "white must be zero or positive"),
        (pose_table, "1,2\n3,4\n5,6\n", "no header"),
        (pose_table, "a,b\n3,4\n5,6\n", "neither angles .* nor a direction"),
        (pose_table, "pitch,theta\n3,4\n5,6\n", "both mean pitch"),
        (pose_table, "fx,fy,fz\n0,0,1\n0,0,0\n", "line 3: the direction has no length"),
        (pose_table, "pose,pitch\n0,0\n1,10\n", "count poses from 1"),
        (pose_table, "start,pitch\n0,0\n1,10\n", "both start and stop"),
        (pose_table, "start,stop,pitch\n0,1,0\n3,2,10\n", "stops before it starts"),
        (pose_table, "pitch,roll\n0,0\n10,nan\n", "roll is missing"),
    ],
)
def test_a_pose_table_or_a_noise_file_that_cannot_be_used_is_refused_in_plain_words(tmp_path, reader, text, message):
    path = tmp_path / "given"
    path.write_text(text)
    with pytest.raises(ReadError, match=message):
        reader(path)


def session(seed, *, n=24, S=S_NORM, b=B_NORM, noise=NOISE):
    rng = np.random.default_rng(seed)
    f = rng.standard_normal((n, 3))
    f *= GRAVITY / np.linalg.norm(f, axis=1)[:, None]
    start, pose = 8.0 * np.arange(n), np.full(n, 4.0)
    model = shaping_model(noise, session_s=float(start[-1] + 4.0), pose_s=4.0)
    covariance = _core.kalman_noise_covariance(model, start, pose, np.zeros(n))
    noise_now = np.linalg.cholesky(covariance) @ rng.standard_normal((n, 3))
    return (f - b) @ np.linalg.inv(S).T + noise_now, start, pose, covariance


def test_repeated_runs_end_at_the_batch_fit_with_the_full_noise_covariance():
    readings, start, pose, covariance = session(1)
    result = calibrate_without_references(readings, NOISE, start_s=start, pose_s=pose, gravity_m_s2=GRAVITY)
    S, b = result.accelerometer.S, result.accelerometer.b
    f = readings @ S.T + b
    along = (f / np.linalg.norm(f, axis=1)[:, None]) @ S
    of_norm = sum(np.outer(along[:, i], along[:, i]) * covariance for i in range(3))
    whitener = np.linalg.inv(np.linalg.cholesky(of_norm))
    triangle = np.tril_indices(3)

    def residual(p):
        trial = np.zeros((3, 3))
        trial[triangle] = p[:6]
        return whitener @ (np.linalg.norm(readings @ trial.T + p[6:], axis=1) - GRAVITY)

    at = np.concatenate([S[triangle], b])
    fit = least_squares(residual, at, x_scale=np.array([1e-4] * 6 + [0.1] * 3), xtol=1e-14, ftol=1e-14)
    sigma = np.sqrt(np.diag(result.accelerometer.covariance)[LOWER])
    # 0.02 σ: the filter corrects the mean lengthening of a noisy vector, tr(Σ)/2g = 4e-5 m/s²; the batch fit does not.
    np.testing.assert_allclose((fit.x - at) / sigma, 0.0, atol=0.02)
    np.testing.assert_allclose(np.sqrt(np.diag(np.linalg.inv(fit.jac.T @ fit.jac))) / sigma, 1.0, rtol=1e-3)
    assert "not-converged" not in [one.code for one in result.findings]


@pytest.fixture(scope="module")
def files(tmp_path_factory):
    folder = tmp_path_factory.mktemp("head")
    accelerometer = Accelerometer(S=S_TRUE, b=B_TRUE, noise=NoiseTerms(N=(0.01,) * 3, K=(0.001,) * 3))
    scenario = Scenario(motion=dividing_head(), accelerometer=accelerometer, clock=Clock(rate_hz=25.0))
    trihedron.convert(replace(simulate(scenario, 1)[0], gyroscope=None), folder / "log.csv")
    np.savetxt(folder / "angles.csv", DIVIDING_HEAD_ANGLES_DEG, "%g", ",", header="pitch,roll", comments="")
    (folder / "noise.json").write_text('{"white": 0.01, "walk": [0.001, 0.001, 0.001]}')
    return folder


def kalman(files, *words):
    return main(["kalman", str(files / "log.csv"), "--gravity", "9.80665", *map(str, words)])


def test_the_calibration_file_of_the_command_holds_the_truth(files, tmp_path):
    out = tmp_path / "calibration.json"
    status = kalman(files, "--reference", files / "angles.csv", "--noise", files / "noise.json", "-o", out)
    assert status == 0
    sensor = trihedron.read_calibration(out).accelerometer
    # Twelve standard normal numbers: 5 σ is beyond all of them but once in 10⁵ runs.
    assert np.max(np.abs(sensor.S - S_TRUE) / sensor.sigma_S) < 5.0
    assert np.max(np.abs(sensor.b - B_TRUE) / sensor.sigma_b) < 5.0


def test_the_noise_may_be_a_log_of_rest_or_the_json_of_allan(files, tmp_path, capsys):
    path = rest_log(tmp_path / "static.csv", 1200.0, N=(0.01,) * 3, K=(0.001,) * 3)
    assert main(["allan", str(path), "--json", str(tmp_path / "allan.json")]) == 0
    said = []
    for noise in (path, tmp_path / "allan.json"):
        capsys.readouterr()
        assert kalman(files, "--reference", files / "angles.csv", "--noise", noise, "--json") == 0
        said.append([axis["noise"] for axis in json.loads(capsys.readouterr().out)["axes"]])
    for axis in said[0]:
        # 30 000 samples show N to 0.4 %; the walk, seen over 20 minutes, to about 15 %.
        assert axis["white"] == pytest.approx(0.01, rel=0.03)
        assert axis["walk"] == pytest.approx(0.001, rel=0.6)
    # JSON keeps every digit.
    assert said[1] == said[0]


def test_noise_of_a_log_with_both_sensors_in_counts_is_that_of_the_accelerometer():
    motion = long_static(120.0)
    static = simulate(replace(scenario_by_name("static-hour"), motion=motion), seed=3)[0]
    noise = trihedron.allan(static)
    assert {axis.unit for axis in noise.axes} == {"counts"}
    of_accelerometer = [axis.fitted("N") for axis in noise.axes if axis.name.startswith("accel")]
    assert [axis.white for axis in noise_from_identified(noise.axes, "counts")] == of_accelerometer


def rest_log(path, seconds, **noise):
    accelerometer = Accelerometer(noise=NoiseTerms(**noise))
    scenario = Scenario(motion=long_static(seconds), accelerometer=accelerometer, clock=Clock(rate_hz=25.0))
    trihedron.convert(replace(simulate(scenario, 2)[0], gyroscope=None), path)
    return path


def test_a_log_of_rest_in_counts_of_another_range_is_refused(files, tmp_path, capsys):
    # Half the counts at twice the range: half the noise, which a quieter place has too, and half of gravity.
    rest = rest_log(tmp_path / "static.csv", 600.0, N=(0.01,) * 3)
    half = np.loadtxt(rest, delimiter=",", skiprows=1) * [1.0, 0.5, 0.5, 0.5]
    np.savetxt(rest, half, delimiter=",", header="t,ax [m/s^2],ay [m/s^2],az [m/s^2]", comments="", fmt="%.9g")
    assert kalman(files, "--reference", files / "angles.csv", "--noise", rest) == 1
    assert "another ADC, range or unit" in capsys.readouterr().err


def test_nine_poses_for_nine_parameters_test_nothing():
    poses = np.random.default_rng(3).normal(size=(9, 3))
    readings = (GRAVITY * poses / np.linalg.norm(poses, axis=1)[:, None] - B_NORM) @ np.linalg.inv(S_NORM).T
    at_s = 10.0 * np.arange(9)
    found = calibrate_without_references(readings, NOISE, start_s=at_s, pose_s=np.full(9, 4.0), gravity_m_s2=GRAVITY)
    assert found.consistency.n == 0
    assert {one.code for one in found.findings} == {"few-poses"}
    _, alone = calibrate_norm(readings, np.full((9, 3), 0.01), GRAVITY, raw_unit="counts")
    assert "few-poses" in {one.code for one in alone}


def test_the_filter_agrees_with_the_batch_fit_on_xsens_mti(real_data):
    """The batch fit knows one standard error per mean; the filter gets it as variance on top of next to nothing."""
    folder, gravity = real_data / "xsens_mti", 9.81744
    recording = trihedron.read(accelerometer_path=folder / "xsens_acc.txt", gyroscope_path=folder / "xsens_gyro.txt")
    poses = pose_readings(recording, segment_recording(recording))
    batch, _ = calibrate_norm(poses.mean, poses.sigma_mean, gravity)
    tiny = [AxisNoise(white=1e-3 * np.median(sigma) * np.sqrt(np.median(poses.pose_s))) for sigma in poses.sigma_mean.T]
    run = {"start_s": poses.start_s, "pose_s": poses.pose_s, "gravity_m_s2": gravity}
    got = calibrate_without_references(poses.mean, tiny, extra_variance=poses.sigma_mean**2, **run).accelerometer
    scale = np.concatenate([batch.sigma_S.ravel(), batch.sigma_b])
    difference = np.concatenate([(got.S - batch.S).ravel(), got.b - batch.b])
    free = scale > 0
    # Both minimise the same sum; the filter also corrects the lengthening of a noisy vector, tr(Σ)/2g ~ 1e-3 σ.
    assert np.max(np.abs(difference[free] / scale[free])) < 0.01
