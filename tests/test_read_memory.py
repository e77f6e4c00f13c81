"""Readings in memory are read as a file's are; every real recording reads with the right shape, order and unit."""

import numpy as np
import polars as pl
import pytest

import trihedron
from small_session import rejected
from test_read import HEADER, assert_same, finding, readings, write
from trihedron.cli import main
from trihedron.read import ReadError, read_recording
from trihedron.records import Recording, Severity
from trihedron.units import AccelerationUnit, RateUnit

NAMES = ["t", "ax", "ay", "az", "gx", "gy", "gz"]
TABLE = readings()
NAMED = dict(zip(NAMES, TABLE.T, strict=True))


def by_axis(first):
    return dict(zip("xyz", TABLE[:, first : first + 3].T, strict=True))


def pandas_frame():
    return pytest.importorskip("pandas").DataFrame(NAMED)


def two_levels(frame):
    frame.columns = pytest.importorskip("pandas").MultiIndex.from_tuples(
        [("t", ""), *((sensor, axis) for sensor in ("acc", "gyr") for axis in "xyz")]
    )
    return frame


CARRIERS = {
    "array": lambda: TABLE,
    "list": lambda: TABLE.tolist(),
    "structured": lambda: np.rec.fromarrays(list(TABLE.T), names=",".join(NAMES)),
    "masked-without-mask": lambda: np.ma.masked_array(TABLE),
    "dict-of-columns": lambda: NAMED,
    "dict-of-triads": lambda: {"t": TABLE[:, 0], "acc": TABLE[:, 1:4], "gyr": TABLE[:, 4:]},
    "polars": lambda: pl.DataFrame(NAMED),
    "polars-lazy": lambda: pl.DataFrame(NAMED).lazy(),
    "rows": lambda: pl.DataFrame(NAMED).to_dicts(),
    "nested-dict": lambda: {"t": TABLE[:, 0], "acc": by_axis(1), "gyr": by_axis(4)},
    "pandas": pandas_frame,
    "pandas-with-time-index": lambda: pandas_frame().set_index("t"),
    "pandas-with-index-of-two-levels": lambda: pandas_frame().set_index(["t", "ax"]),
    "pandas-with-names-of-two-levels": lambda: two_levels(pandas_frame()),
    "pandas-nullable": lambda: pandas_frame().convert_dtypes(),
    "arrow": lambda: pytest.importorskip("pyarrow").table({k: v.tolist() for k, v in NAMED.items()}),
}


@pytest.mark.parametrize("carrier", CARRIERS.values(), ids=CARRIERS.keys())
def test_every_carrier_gives_the_numbers_that_it_holds(carrier):
    assert_same(trihedron.read(carrier()), TABLE)


def test_dates_of_frames_are_the_clock():
    pandas = pytest.importorskip("pandas")
    frame = pandas_frame().drop(columns="t")
    frame.index = pandas.Timestamp("2024-03-01") + pandas.to_timedelta(TABLE[:, 0], unit="s")
    recording = trihedron.read(frame)
    assert recording.rate_hz == pytest.approx(100.0, rel=1e-6)
    assert recording.start_epoch_s == pytest.approx(1709251200.0)


def test_masked_readings_are_missing_readings():
    mask = np.zeros(TABLE.shape, dtype=bool)
    mask[50:60, 3] = True
    wild = TABLE.copy()
    wild[50:60, 3] = 1e6
    for data in (
        np.ma.masked_array(wild, mask),
        dict(zip(NAMES, [np.ma.masked_array(wild[:, k], mask[:, k]) for k in range(7)], strict=True)),
    ):
        recording = trihedron.read(data)
        assert np.isnan(recording.accelerometer[50:60, 2]).all()
        assert np.isfinite(np.delete(recording.accelerometer, np.s_[50:60], axis=0)).all()
        assert any(f.code == "non-finite" for f in recording.findings)
    made = Recording.from_arrays(TABLE[:, 0], np.ma.masked_array(wild, mask)[:, 1:4], TABLE[:, 4:])
    assert np.isnan(made.accelerometer[50:60, 2]).all()


def test_arrays_make_an_audited_recording_in_their_units():
    arrays = TABLE[:, 0], TABLE[:, 1:4], np.degrees(TABLE[:, 4:])
    recording = Recording.from_arrays(*arrays, gyroscope_unit="deg/s", temperature_degc=np.arange(200.0))
    assert recording.gyroscope_unit is RateUnit.DEG_S
    assert recording.accelerometer_unit is AccelerationUnit.M_S2
    assert recording.temperature_degc is not None
    assert recording.rate_hz == pytest.approx(100.0)
    wrong = Recording.from_arrays(None, TABLE[:, 1:4], rate_hz=50.0, accelerometer_unit="g")
    assert wrong.rate_hz == 50.0
    assert any(f.code == "unit-contradicted" for f in wrong.findings)


@pytest.mark.parametrize(
    ("data", "complaint"),
    [
        (3, "takes a file name, an array .*got int"),
        (np.zeros((4, 4, 4)), r"got shape \(4, 4, 4\)"),
        (np.array(["a", "b"]), "got shape"),
        (np.array([["a", "b"]]), "contains numbers, got dtype"),
        ({"t": np.arange(5), "ax": np.arange(4)}, "differ in length"),
        ({"acc": np.zeros((3, 500))}, "give its transpose"),
        ({"t": ["x", "y"]}, "no column of numbers"),
        ({"ax": 1j * np.arange(5)}, "complex"),
        ({"t": np.arange(9.0), "u": np.arange(9.0)}, 'columns="time=1,ax=2'),
    ],
)
def test_what_is_no_log_is_a_value_error_in_the_words_of_python(data, complaint):
    with pytest.raises(ValueError, match=complaint) as caught:
        trihedron.read(data)
    assert "--" not in str(caught.value)


# Written to the nanosecond; seconds since 1970 are known to a quarter of a microsecond in 64 bits.
@pytest.mark.parametrize(
    ("suffix", "start_s", "atol"),
    [(".csv", 0.0, 1e-9), (".npz", 0.0, 1e-9), (".parquet", 0.0, 1e-9), (".csv", 1_535_632_344.25, 1e-6)],
)
def test_a_converted_log_is_read_again_as_the_same_on_its_own_clock(tmp_path, suffix, start_s, atol, capsys):
    table = np.column_stack([readings(), np.round(20.0 + 0.01 * np.arange(200), 2), np.arange(200)])
    table[:, 0] += start_s
    table[40:45, 2] = np.nan  # what is missing stays missing
    log = write(tmp_path / "log.txt", table, HEADER.replace("gx,gy,gz", "gx [rad/s],gy [rad/s],gz [rad/s],temp_C,lux"))
    out = tmp_path / f"out{suffix}"
    assert main(["convert", str(log), "-o", str(out)]) == 0
    said = capsys.readouterr()
    assert "200 rows in the file = 200 read + 0 reported" in said.err
    assert said.out == ""
    first, second = trihedron.read(log), trihedron.read(out)
    assert np.isnan(second.accelerometer[40:45, 1]).all()
    np.testing.assert_array_equal(first.accelerometer, second.accelerometer)
    np.testing.assert_array_equal(first.gyroscope, second.gyroscope)
    np.testing.assert_allclose(first.time_s, second.time_s, rtol=0, atol=atol)
    assert second.start_epoch_s == pytest.approx(first.start_epoch_s, rel=0, abs=atol)
    np.testing.assert_array_equal(second.auxiliary["lux"], np.arange(200))
    assert first.gyroscope_unit is second.gyroscope_unit
    np.testing.assert_allclose(second.temperature_degc, first.temperature_degc, rtol=0, atol=1e-9)
    assert main(["convert", str(log), "-o", str(out)]) == 1
    assert "give it one of these endings" in rejected(capsys, "convert", log, "-o", tmp_path / "out.xlsx")


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
    assert np.linalg.norm(recording.accelerometer[:100].mean(axis=0)) == pytest.approx(2048, rel=0.1)


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
    assert finding(recording, "unit-assumed").severity is Severity.WARNING
    assert read_recording(path, gyroscope_unit="mrad/s").gyroscope_unit is RateUnit.MRAD_S


@pytest.mark.parametrize("kind", ["frame", "parquet"])
def test_words_of_a_frame_name_sensors_and_devices_as_those_of_a_text_do(tmp_path, kind):
    rng = np.random.default_rng(1)
    axes = dict(zip("xyz", rng.normal(size=(3, 800)), strict=True))
    frame = pl.DataFrame({"t": np.repeat(np.arange(400) / 50.0, 2), "sensor": ["acc", "gyro"] * 400, **axes})
    log = frame
    if kind == "parquet":
        log = tmp_path / "log.parquet"
        frame.with_columns(note=pl.Series([["a"]] * 800)).write_parquet(log)
    recording = read_recording(log, accelerometer_unit="counts", gyroscope_unit="counts")
    np.testing.assert_array_equal(recording.accelerometer, frame.select("x", "y", "z").to_numpy()[::2])
    assert recording.gyroscope.shape == (400, 3)
    assert recording.rows_in_file == recording.rows_read + recording.rows_reported
