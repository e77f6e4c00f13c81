"""Logs larger than memory: the same results as of the whole, in bounded memory."""

import json
import subprocess
import sys
import tempfile

import numpy as np
import polars
import pytest

import trihedron
from hand_made_sessions import G, Instrument, recorded
from small_session import rejected
from trihedron.api import streaming
from trihedron.cli import main
from trihedron.read.on_disk import log_on_disk

COLUMNS = "ax,ay,az,gx,gy,gz"


@pytest.fixture(scope="module")
def whole():
    return recorded(Instrument(), 5, rate_hz=100.0)


def saved(log, out):
    """The readings alone, as an array or a table."""
    table = np.hstack([log.accelerometer, log.gyroscope])
    if out.suffix == ".npy":
        np.save(out, table)
    elif out.suffix == ".csv":
        polars.DataFrame(table, schema=COLUMNS.split(",")).write_csv(out)
    else:
        polars.DataFrame(table, schema=COLUMNS.split(",")).write_parquet(out)
    return out


@pytest.fixture(scope="module")
def path(whole, tmp_path_factory):
    return saved(whole, tmp_path_factory.mktemp("large") / "log.npy")


def opened(path):
    return log_on_disk(path, columns=COLUMNS, rate_hz=100.0, accelerometer_unit="m/s^2", gyroscope_unit="rad/s")


@pytest.mark.parametrize(("ending", "piece"), [("npy", 1 << 18), ("npy", 250), ("parquet", 250), ("csv", 250)])
def test_segments_of_pieces_are_those_of_the_whole_to_the_last_bit(whole, tmp_path, ending, piece, monkeypatch):
    monkeypatch.setattr(streaming, "PIECE_ROWS", piece)
    found = streaming.segment_file(opened(saved(whole, tmp_path / f"log.{ending}")))
    wanted = trihedron.segment(whole)
    assert found.poses == wanted.poses
    assert found.moves == wanted.moves
    for name in ("accelerometer_mean", "gyroscope_mean", "accelerometer_sigma_mean", "gyroscope_sigma_mean"):
        np.testing.assert_array_equal(getattr(found, name), getattr(wanted, name))
    np.testing.assert_array_equal(found.n_averaged, wanted.n_averaged)


def test_a_log_on_disk_is_calibrated_as_the_whole_is(whole, path):
    found = streaming.calibrate_file(opened(path), gravity_m_s2=G).calibration
    wanted = trihedron.calibrate(whole, gravity_m_s2=G).calibration
    # The same rows but those between the edges of poses and moves: none here.
    np.testing.assert_allclose(found.accelerometer.S, wanted.accelerometer.S, rtol=0, atol=1e-12)
    np.testing.assert_allclose(found.gyroscope.S, wanted.gyroscope.S, rtol=0, atol=1e-9)


def test_corrected_readings_are_those_of_the_whole(whole, path, tmp_path, monkeypatch):
    monkeypatch.setattr(streaming, "PIECE_ROWS", 1000)
    calibration = trihedron.calibrate(whole, gravity_m_s2=G)
    out = tmp_path / "si.npy"
    assert streaming.apply_file(calibration, opened(path), out) == whole.n_samples
    si = np.load(out)
    wanted = trihedron.apply(calibration, whole)
    np.testing.assert_array_equal(si[:, 1:4], wanted.accelerometer)
    np.testing.assert_array_equal(si[:, 4:7], wanted.gyroscope)
    with pytest.raises(ValueError, match="exists"):
        streaming.apply_file(calibration, opened(path), out)


def test_memory_stays_bounded(tmp_path):
    """20 MB of counts, 1.7 million rows at 1 kHz: 80 MB as float64, of which no more than the blocks may stay."""
    rng = np.random.default_rng(1)
    n = 1_700_000
    mapped = np.lib.format.open_memmap(tmp_path / "long.npy", mode="w+", dtype=np.int16, shape=(n, 6))
    for start in range(0, n, 100_000):
        mapped[start : start + 100_000] = np.round(rng.normal([0, 0, 2048, 0, 0, 0], 5.0, (100_000, 6)))
    mapped.flush()
    del mapped
    script = (
        "import resource, sys\n"
        "from trihedron.api import streaming\n"
        "from trihedron.read.on_disk import log_on_disk\n"
        "import trihedron.segment\n"
        "low = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss\n"
        "log = log_on_disk(sys.argv[1], columns='ax,ay,az,gx,gy,gz', rate_hz=1000.0)\n"
        "segments = streaming.segment_file(log)\n"
        "print(segments.n_poses, (resource.getrusage(resource.RUSAGE_SELF).ru_maxrss - low) / 1024)\n"
    )
    done = subprocess.run(
        [sys.executable, "-c", script, str(tmp_path / "long.npy")], capture_output=True, text=True, check=True
    )
    poses, megabytes = done.stdout.split()
    assert int(poses) == 1
    # A piece is 2^18 rows: 12 MB as float64, twice; 17 000 blocks of 1 kB: 17 MB; what arithmetic needs beside them.
    assert float(megabytes) < 75.0


def test_the_command_streams_and_says_what_it_needs(whole, path, tmp_path, capsys):
    said = ["--stream", "--columns", COLUMNS, "--rate", "100", "--accel-unit", "m/s^2", "--gyro-unit", "rad/s"]
    out = tmp_path / "c.json"
    assert main(["calibrate", str(path), *said, "--gravity", str(G), "-o", str(out)]) == 0
    assert main(["segment", str(path), *said, "--json"]) == 0
    document = json.loads(capsys.readouterr().out.split("\n{", 1)[1].join(["{", ""]))
    assert len(document["poses"]) == 20
    assert main(["apply", str(out), str(path), *said, "-o", str(tmp_path / "si.npy")]) == 0
    assert np.load(tmp_path / "si.npy", mmap_mode="r").shape == (whole.n_samples, 7)
    capsys.readouterr()
    assert "--columns" in rejected(capsys, "segment", path, "--stream")


@pytest.mark.parametrize(
    ("text", "said"),
    [
        ("t,ax,ay,az\n0,1,2,3\n0.01,4,x,6\n0.02,1,2,3\n", "not every row is 4 numbers"),
        ("0,1,2,3\n# pause\n0.02,4,3,6\n0.03,4,3,6\n", "not every row is 4 numbers"),
        ("t ax ay az\n0 1 2 3\n1 1 1 1\n", "comma, a semicolon or a tab"),
        ("t,ax,ay,az\n# mm\n0,1,2,3\n0.01,4,3,6\n0.02,4,3,6\n", "line 2 above the rows"),
        ("all words\nand no numbers\n", "read in pieces"),
    ],
)
def test_a_text_that_is_no_table_of_numbers_is_refused_and_leaves_nothing(tmp_path, monkeypatch, text, said):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    log = tmp_path / "log.csv"
    log.write_text(text)
    with pytest.raises(ValueError, match=said):
        log_on_disk(log, columns="-,ax,ay,az", rate_hz=100.0)
    assert list(tmp_path.iterdir()) == [log]


def test_a_text_with_decimal_commas_missing_fields_and_a_byte_order_mark_is_read_as_it_stands(tmp_path, monkeypatch):
    monkeypatch.setattr(tempfile, "tempdir", str(tmp_path))
    log = tmp_path / "log.csv"
    log.write_bytes("\ufefft;ax;ay;az\r\n0;1,5;2;3\r\n0,01;-4;;6\r\n0,02;nan;8;9\r\n".encode())
    held = log_on_disk(log, columns="-,ax,ay,az", rate_hz=100.0)
    np.testing.assert_array_equal(held.accelerometer[0:3], [[1.5, 2, 3], [-4, np.nan, 6], [np.nan, 8, 9]])
    del held
    assert list(tmp_path.iterdir()) == [log]
