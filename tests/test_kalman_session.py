"""From a log and a pose table to the filters: matching, noise from the poses, recordings."""

from dataclasses import dataclass, replace

import numpy as np
import pytest

import trihedron
from trihedron.estimate.accelerometer.norm import calibrate_norm
from trihedron.estimate.kalman.identified import noise_from_identified
from trihedron.estimate.kalman.norm_invariant import calibrate_without_references
from trihedron.estimate.kalman.session import (
    calibrate_session,
    noise_from_poses,
    pose_readings,
)
from trihedron.read import ReadError, read_pose_table
from trihedron.records import AxisNoise, FindingCode, PoseTable
from trihedron.segment import segment_recording
from trihedron.simulate import Accelerometer, NoiseTerms, Scenario, dividing_head, simulate
from twins_kalman import DIVIDING_HEAD_ANGLES_DEG, normalised_error_squared

GRAVITY = 9.80665
S_TRUE = np.array([[0.98, 0.01, -0.02], [0.005, 1.03, 0.008], [-0.01, 0.012, 0.99]])
B_TRUE = np.array([0.2, -0.3, 0.1])


def head_session(seed):
    accelerometer = Accelerometer(
        S=tuple(map(tuple, S_TRUE)),
        b=tuple(B_TRUE),
        noise=NoiseTerms(N=(0.005,) * 3),
    )
    recording = simulate(Scenario(motion=dividing_head(), accelerometer=accelerometer), seed=seed)[0]
    return recording, segment_recording(recording)


@pytest.fixture(scope="module")
def head():
    return head_session(1)


@pytest.fixture(scope="module")
def table():
    return PoseTable.from_angles(*DIVIDING_HEAD_ANGLES_DEG.T, gravity_m_s2=GRAVITY)


def test_a_simulated_dividing_head_gives_the_instrument_back(head, table):
    result = calibrate_session(*head, table)
    error = np.concatenate([(result.accelerometer.S - S_TRUE).ravel(), result.accelerometer.b - B_TRUE])
    # 12 degrees of freedom: mean 12, standard deviation 4.9; 40 is beyond the 99.99 % limit of 39.1.
    assert normalised_error_squared(error, result.accelerometer.covariance) < 40.0
    assert np.max(result.accelerometer.sigma_S) < 1e-3
    assert {f.code for f in result.findings} == {FindingCode.NOISE_ASSUMED}


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
    with pytest.raises(ValueError, match="0 readings"):
        pose_readings(
            recording, segments, PoseTable(table.specific_force[:1], start_s=np.array([1e6]), stop_s=np.array([2e6]))
        )


def test_a_coarse_converter_is_charged_with_its_step(head):
    recording, segments = head
    # As a resolution of 0.37 would have it, of noise far below.
    coarse = replace(recording, accelerometer=0.37 * np.round(recording.accelerometer / 0.37))
    # Readings are multiples of the step to rounding of the decimal.
    assert noise_from_poses(coarse, segments)[0].resolution == pytest.approx(0.37, rel=1e-9)
    assert noise_from_poses(recording, segments)[0].resolution == 0.0


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


@pytest.mark.parametrize("run", [1, 2])
def test_the_filter_trusts_a_session_where_calibrate_does(real_data, run):
    recording = trihedron.read(real_data / "kim" / f"kim_imu_good{run}.txt")
    by_fit = trihedron.calibrate(recording, gravity_m_s2=9.79871).calibration
    by_filter = trihedron.kalman(recording, gravity_m_s2=9.79871).calibration
    assert by_filter.is_trustworthy == by_fit.is_trustworthy == (run == 2)
    advised = [sensor.accelerometer.observability.advice for sensor in (by_fit, by_filter)]
    assert advised[0] == advised[1]


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
    table = read_pose_table(path, gravity_m_s2=GRAVITY)
    np.testing.assert_allclose(table.specific_force / GRAVITY, expected, atol=1e-12)


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("1,2\n3,4\n5,6\n", "no header"),
        ("a,b\n3,4\n5,6\n", "neither angles .* nor a direction"),
        ("pitch,theta\n3,4\n5,6\n", "both mean pitch"),
        ("fx,fy,fz\n0,0,1\n0,0,0\n", "line 3: the direction has no length"),
        ("pose,pitch\n0,0\n1,10\n", "count poses from 1"),
        ("start,pitch\n0,0\n1,10\n", "both start and stop"),
        ("start,stop,pitch\n0,1,0\n3,2,10\n", "stops before it starts"),
        ("pitch,roll\n0,0\n10,nan\n", "roll is missing"),
    ],
)
def test_a_pose_table_that_cannot_be_used_is_refused_in_plain_words(tmp_path, text, message):
    path = tmp_path / "poses.csv"
    path.write_text(text)
    with pytest.raises(ReadError, match=message):
        read_pose_table(path, gravity_m_s2=GRAVITY)


@dataclass(frozen=True)
class Identified:
    """An axis as the identification describes it."""

    name: str
    unit: str
    terms: dict
    sample_sigma: float = 0.02
    resolution: float = 0.001
    gauss_markov: object = None

    def fitted(self, symbol):
        return self.terms.get(symbol, 0.0)


def test_identified_noise_is_taken_in_the_raw_unit():
    axes = [Identified("gx", "rad/s", {"N": 1.0})] + [
        Identified(name, "m/s^2", {"N": 0.02, "K": 0.001, "R": -1e-6}) for name in ("ax", "ay", "az")
    ]
    in_g = noise_from_identified(axes, "g")
    assert in_g[2].white == pytest.approx(0.02 / 9.80665)
    assert in_g[0].ramp == pytest.approx(1e-6 / 9.80665)
    assert noise_from_identified(axes, "m/s^2")[1] == AxisNoise(
        white=0.02, walk=0.001, ramp=1e-6, resolution=0.001, sample_sigma=0.02
    )
