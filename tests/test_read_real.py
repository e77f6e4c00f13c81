"""Every real recording reads with the right shape, order and unit, and the audit finds what is wrong with it."""

import numpy as np
import pytest

from test_read import codes, finding
from trihedron.read import ReadError, read_recording
from trihedron.records import FindingCode, Severity
from trihedron.units import AccelerationUnit, RateUnit

QUIET = {FindingCode.COLUMNS_RECOGNISED, FindingCode.UNIT_DETECTED, FindingCode.TIME_UNIT_DETECTED}


def static_norm(recording, samples=slice(0, 100)) -> float:
    return float(np.linalg.norm(recording.accelerometer[samples].mean(axis=0)))


def test_mimu4444_one_of_eight_devices(real_data):
    path = real_data / "mimu4444" / "exp_3.npz"
    with pytest.raises(ReadError, match="8 devices"):
        read_recording(path)
    recording = read_recording(path, instance=5)
    with np.load(path) as archive:
        np.testing.assert_array_equal(recording.accelerometer, archive["counts"][:, 4, :3])
        np.testing.assert_array_equal(recording.gyroscope, archive["counts"][:, 4, 3:])
    assert recording.rate_hz == pytest.approx(62.5, rel=1e-3)
    assert recording.accelerometer_unit is AccelerationUnit.COUNTS
    assert static_norm(recording) == pytest.approx(2048, rel=0.1)
    # The last 100 s are violent: the gyro leaves its range on every axis.
    clipped = finding(recording, FindingCode.CLIPPING)
    assert clipped.numbers["sample"] > 0.75 * recording.n_samples
    assert {clipped.numbers[f"{axis}_high_value"] for axis in "xyz"} == {32767.0}
    assert {clipped.numbers[f"{axis}_low_value"] for axis in "xyz"} == {-32768.0}
    assert "gyro" in clipped.seen


def test_mpu9150_without_header_or_time(real_data):
    path = real_data / "mpu9150" / "imu0.log"
    recording = read_recording(path)
    expected = np.loadtxt(path)
    np.testing.assert_array_equal(recording.accelerometer, expected[:, :3])
    np.testing.assert_array_equal(recording.gyroscope, expected[:, 3:])
    assert recording.accelerometer_unit is AccelerationUnit.M_S2
    assert recording.gyroscope_unit is RateUnit.RAD_S
    assert finding(recording, FindingCode.RATE_ASSUMED).severity is Severity.SERIOUS
    assert finding(recording, FindingCode.COLUMNS_ASSUMED).severity is Severity.NOTE
    given = read_recording(path, rate_hz=100)
    assert codes(given) <= QUIET | {FindingCode.COLUMNS_ASSUMED, FindingCode.RATE_STATED, FindingCode.RAW_LSB}
    # Counts of 9.81/2048 m/s^2 and 2000/32768 deg/s, of which the file's five decimals cut up to a five-hundredth off.
    np.testing.assert_allclose(given.facts.of("accelerometer").step, 9.81 / 2048, rtol=1e-6)
    np.testing.assert_allclose(given.facts.of("gyroscope").step, np.radians(2000 / 32768), rtol=1e-6)


def test_adis16405_puts_the_gyro_last_where_the_file_has_it_first(real_data):
    path = real_data / "adis16405" / "adis16405_imu1.npz"
    recording = read_recording(path)
    with np.load(path) as archive:
        np.testing.assert_array_equal(recording.accelerometer, archive["counts"][:, 3:])
        np.testing.assert_array_equal(recording.gyroscope, archive["counts"][:, :3])
    assert finding(recording, FindingCode.RATE_STATED).numbers["rate_hz"] == 100
    assert finding(recording, FindingCode.COLUMNS_ASSUMED).severity is Severity.WARNING
    assert FindingCode.CLIPPING not in codes(recording)
    assert FindingCode.STUCK_VALUES not in codes(recording)


def test_cats_tag_has_temperature_and_an_unusual_gyro_unit(real_data):
    path = real_data / "cats_tag" / "cats_temperature_2poses.csv.gz"
    recording = read_recording(path)
    assert recording.n_samples == 183600
    assert recording.rate_hz == pytest.approx(1, rel=1e-6)
    assert 4 < recording.temperature_degc.min() < recording.temperature_degc.max() < 30
    assert set(recording.auxiliary) == {"mx", "my", "mz", "depth_m"}
    assert recording.accelerometer_unit is AccelerationUnit.M_S2
    # A bias of 36 deg/s is no gyro's: mrad/s, but as requested.
    assert recording.gyroscope_unit is RateUnit.MRAD_S
    assert finding(recording, FindingCode.UNIT_ASSUMED).severity is Severity.WARNING
    assert read_recording(path, gyroscope_unit="mrad/s").gyroscope_unit is RateUnit.MRAD_S


@pytest.mark.parametrize("run", [1, 3])
def test_analog6dof_has_its_gyro_axes_in_odd_order_and_a_coarse_converter(real_data, run):
    path = real_data / "analog6dof" / f"imuRaw{run}.csv"
    recording = read_recording(path)
    written = np.loadtxt(path, delimiter=",", skiprows=1)
    np.testing.assert_array_equal(recording.accelerometer, written[:, 1:4])
    np.testing.assert_array_equal(recording.gyroscope, written[:, [5, 6, 4]])
    assert recording.start_epoch_s == pytest.approx(written[0, 0])
    assert recording.rate_hz == pytest.approx(99.95, abs=0.1)
    assert {FindingCode.COARSE_RESOLUTION, FindingCode.TIME_JITTER} <= codes(recording)
    assert FindingCode.CLIPPING not in codes(recording)
    stuck = [f for f in recording.findings if f.code is FindingCode.STUCK_VALUES]
    if run != 3:
        # The gyro's z channel freezes at 382 for over a second while the board is turned.
        assert [f.numbers["axis"] for f in stuck] == [2.0]
        start, length = int(stuck[0].numbers["sample"]), int(stuck[0].numbers["longest_run"])
        assert set(recording.gyroscope[start : start + length, 2]) == {382.0}
        assert length > 100
    else:
        assert stuck == []


@pytest.mark.parametrize(
    ("name", "n", "clipped"), [("tomi_example_data_calibration", 10245, True), ("tomi_imu_static_test", 9986, False)]
)
def test_mpu6050_tomi_preamble_and_clipping(real_data, name, n, clipped):
    recording = read_recording(real_data / "mpu6050_tomi" / f"{name}.csv")
    assert recording.accelerometer.shape == (n, 3)
    assert recording.accelerometer_unit is AccelerationUnit.COUNTS
    assert finding(recording, FindingCode.RATE_STATED).numbers["rate_hz"] == 100
    assert (FindingCode.CLIPPING in codes(recording)) is clipped
    if clipped:
        assert finding(recording, FindingCode.CLIPPING).numbers["x_low_value"] == -32768
        # The whole word: two samples at one end of x, ten at the other, six of z.
        numbers = finding(recording, FindingCode.CLIPPING).numbers
        assert (numbers["x_high_value"], numbers["x_high_count"]) == (32767, 2)
        assert (numbers["x_low_count"], numbers["z_low_count"]) == (10, 6)
        assert "line 3916" in finding(recording, FindingCode.CLIPPING).seen


def test_kim_is_even_behind_stamps_of_5_ms_ticks(real_data):
    path = real_data / "kim" / "kim_imu_good2.txt"
    recording = read_recording(path)
    written = np.loadtxt(path)
    np.testing.assert_array_equal(recording.accelerometer, written[:, 1:4])
    np.testing.assert_array_equal(recording.gyroscope, written[:, 4:7])
    assert recording.accelerometer_unit is AccelerationUnit.M_S2
    assert recording.gyroscope_unit is RateUnit.RAD_S
    assert recording.start_epoch_s == pytest.approx(written[0, 0], abs=0.01)
    jitter = finding(recording, FindingCode.TIME_JITTER)
    assert jitter.numbers["jitter_s"] == pytest.approx(1.17e-3, rel=0.02)
    assert jitter.numbers["median_rate_hz"] == pytest.approx(97.6, abs=0.1)
    # The few steps of 15.3 ms (three ticks) were once counted as gaps; ticks of 5.12 ms make 5, 10 and 15 ms of an even
    # 10.000 ms, and the turns of the log follow the even clock, not its timestamps.
    assert FindingCode.TIME_GAP not in codes(recording)
    even = finding(recording, FindingCode.EVEN_CLOCK)
    assert even.numbers["period_s"] == pytest.approx(0.0100001, abs=5e-8)
    assert recording.sampling.n_lost == 0
    assert set(recording.auxiliary) == {"qx", "qy", "qz", "qw", "mx", "my", "mz", "logged time after the first [s]"}
    np.testing.assert_allclose(
        recording.auxiliary["logged time after the first [s]"], written[:, 0] - written[0, 0], rtol=0, atol=1e-6
    )


@pytest.mark.parametrize("name", ["allan_curves/adis_av.csv", "analog6dof/viconRot1.csv"])
def test_a_table_that_is_no_log_is_refused_by_its_columns(real_data, name):
    with pytest.raises(ReadError, match="no accelerometer and no gyro columns recognised among"):
        read_recording(real_data / name)
