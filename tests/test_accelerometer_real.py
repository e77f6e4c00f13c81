"""Accelerometer calibration of real recordings against what was published about them."""

import json

import numpy as np
import pytest
from scipy import stats

from trihedron.estimate.accelerometer import calibrate_faces, calibrate_norm
from trihedron.read import read_recording
from trihedron.records import FindingCode, Severity
from trihedron.segment import segment_recording
from trihedron.sensor_model import other_form


def still_poses(recording):
    segments = segment_recording(recording)
    return segments.accelerometer_mean, segments.accelerometer_sigma_mean


def block_mean(samples: np.ndarray, n_blocks: int) -> tuple[np.ndarray, np.ndarray]:
    """Mean (3,) and its standard error from the scatter of block means: slow noise counts."""
    blocks = samples[: len(samples) // n_blocks * n_blocks].reshape(n_blocks, -1, 3).mean(axis=1)
    return samples.mean(axis=0), blocks.std(axis=0, ddof=1) / np.sqrt(n_blocks)


def test_xsens_agrees_with_the_published_calibration(real_data):
    folder = real_data / "xsens_mti"
    recording = read_recording(accelerometer_path=folder / "xsens_acc.txt", gyroscope_path=folder / "xsens_gyro.txt")
    means, sigma = still_poses(recording)
    assert len(means) >= 34
    sensor, findings = calibrate_norm(means, sigma, 9.81744)
    published = json.loads((folder / "published_imu_tk.json").read_text())["acc"]
    S = np.array(published["misalignment"]) @ np.diag(published["scale"])
    # Lengths of the columns of S do not depend on the frame.
    np.testing.assert_allclose(np.linalg.norm(sensor.S, axis=0), np.linalg.norm(S, axis=0), rtol=1e-3)
    zero = other_form(sensor.S, sensor.b)[1]
    np.testing.assert_allclose(zero, published["bias"], atol=10.0)
    assert sensor.quality.rms_dof <= 1.3e-3
    assert not any(finding.severity is Severity.SERIOUS for finding in findings)


@pytest.mark.parametrize("unit", [0, 1, 2])
def test_mpu9150_residuals_are_at_the_noise_floor(real_data, unit):
    means, sigma = still_poses(read_recording(real_data / "mpu9150" / f"imu{unit}.log", rate_hz=100.0))
    sensor, _ = calibrate_norm(means, sigma, 9.81, raw_unit="m/s^2")
    # Both limits: a χ² that is too small means standard errors of the means stated too large.
    low, high = stats.chi2.ppf([0.005, 0.995], sensor.quality.dof)
    assert low < sensor.quality.chi2 < high


def test_ctu_pose_means_fit_to_half_a_milli_g(real_data):
    means = np.genfromtxt(real_data / "ctu" / "measured_accelerations.csv", delimiter=",", skip_header=1)
    # Only means are published: their noise is not, so that the residual itself has to say it.
    sensor, _ = calibrate_norm(means, 3e-4, 9.81, raw_unit="g")
    assert len(means) == 24
    assert 1e3 * sensor.quality.rms_dof / 9.80665 <= 0.6
    assert sensor.quality.held_out_rms < 2 * sensor.quality.rms_dof


REGIONS = {  # annotated samples of the session; the axis that points up
    1: (540, 1271),
    -1: (1620, 2361),
    2: (2814, 3298),
    -2: (3740, 4152),
    3: (4522, 4975),
    -3: (5376, 5983),
}


def test_annotated_faces_reproduce_the_published_matrices_and_method_2_refuses_them(real_data):
    folder = real_data / "imucal_ferraris"
    recording = read_recording(folder / "example_ferraris_session.csv", rate_hz=102.4)
    pairs = [block_mean(recording.accelerometer[first:last], 20) for first, last in REGIONS.values()]
    means, sigma = (np.array(part) for part in zip(*pairs, strict=True))
    sensor, _ = calibrate_faces(means, sigma, 9.81, raw_unit="m/s^2", up=list(REGIONS))
    published = json.loads((folder / "ferraris_result_imucal260.json").read_text())
    S_a, b_a = other_form(sensor.S, sensor.b)
    np.testing.assert_allclose(S_a, np.array(published["K_a"]) @ np.array(published["R_a"]), atol=3e-3)
    np.testing.assert_allclose(b_a, published["b_a"], atol=3e-3)
    automatic, _ = calibrate_faces(means, sigma, 9.81, raw_unit="m/s^2")
    np.testing.assert_array_equal(automatic.S, sensor.S)

    refused, findings = calibrate_norm(means, sigma, 9.81, raw_unit="m/s^2")
    refusal = next(f for f in findings if f.code is FindingCode.NOT_OBSERVABLE)
    assert refusal.severity is Severity.SERIOUS
    assert "6 of the 9" in refusal.seen
    assert refused.observability.rank == 6
    assert len(refused.observability.advice) >= 3


def test_automatic_holds_of_six_faces_are_refused_by_method_2_without_running_away(real_data):
    recording = read_recording(real_data / "imucal_ferraris" / "example_ferraris_session.csv", rate_hz=102.4)
    means, sigma = still_poses(recording)
    sensor, findings = calibrate_norm(means, sigma, 9.81, raw_unit="m/s^2")
    assert any(f.code is FindingCode.NOT_OBSERVABLE and f.severity is Severity.SERIOUS for f in findings)
    # The published scales: unseen angles may not drag them along.
    np.testing.assert_allclose(np.diag(sensor.S), 1 / np.array([0.99675, 1.00244, 1.02340]), atol=5e-3)
    by_faces, _ = calibrate_faces(means, sigma, 9.81, raw_unit="m/s^2")
    np.testing.assert_allclose(np.diag(by_faces.S), 1 / np.array([0.99675, 1.00244, 1.02340]), atol=3e-3)


def test_mpu6050_scales_agree_with_the_published_ones(real_data):
    means, sigma = still_poses(read_recording(real_data / "mpu6050_tomi" / "tomi_example_data_calibration.csv"))
    sensor, _ = calibrate_norm(means, sigma, 9.81)
    np.testing.assert_allclose(np.diag(sensor.S), [0.00060201, 0.00059684, 0.00058592], rtol=1e-2)


def test_the_six_faces_of_the_phone_give_the_published_means_and_betray_the_table(real_data):
    folder = real_data / "phone"
    published = json.loads((folder / "published_results.json").read_text())
    names = ["X_down_300_sec_", "X_up_300_sec_", "Y_down_300_sec_", "Y_up_300sec_", "z_down_300_sec_", "z_up_310_sec_"]
    pairs = []
    for name in names:
        samples = np.genfromtxt(folder / f"imu_rec_{name}_Acceleration.csv", delimiter=",", skip_header=1)[:, 1:]
        # The middle half: the sensor is laid down and picked up within the file.
        pairs.append(block_mean(samples[len(samples) // 4 : 3 * len(samples) // 4], 20))
    means, sigma = (np.array(part) for part in zip(*pairs, strict=True))
    # The files are named after another pair of axes than the published table: x of the names is y of the readings.
    table = published["six_face_means_acc"]
    expected = [
        [table[f"{face}_acc_{axis}_mean"] for axis in "xyz"]
        for face in ("y_down", "y_up", "x_up", "x_down", "z_down", "z_up")
    ]
    np.testing.assert_allclose(means, expected, atol=5e-3)
    sensor, findings = calibrate_faces(means, sigma, 9.7974, raw_unit="m/s^2")
    tilt = next(f for f in findings if f.code is FindingCode.TABLE_TILT)
    assert 0.1 < tilt.numbers["tilt_deg"] < 2.0
    norm = np.linalg.norm(means @ sensor.S.T + sensor.b, axis=1) - 9.7974
    assert np.abs(norm).max() < 2e-3
    # The published norm-method result leaves the very spread of the raw readings: it corrects nothing.
    M, B = np.array(published["norm_method_M"]), np.array(published["norm_method_B"])
    for corrected in (means @ M.T + B, (means - B) @ M.T):
        assert np.ptp(np.linalg.norm(corrected, axis=1)) > 0.05
