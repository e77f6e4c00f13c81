"""Reading: any layout in, the same numbers out; what was assumed is said; what cannot be read is refused in words."""

import gzip

import numpy as np
import pytest

from trihedron.read import ReadError, read_recording
from trihedron.records import FindingCode


def readings(n: int = 200, seed: int = 1) -> np.ndarray:
    """(n, 7) time [s], accelerometer [m/s^2], gyro [rad/s] of a sensor lying still, rounded to what text holds."""
    rng = np.random.default_rng(seed)
    table = np.empty((n, 7))
    table[:, 0] = np.arange(n) / 100.0
    table[:, 1:4] = [0.1, -0.2, 9.8] + 0.02 * rng.standard_normal((n, 3))
    table[:, 4:] = [0.01, -0.02, 0.003] + 0.002 * rng.standard_normal((n, 3))
    return np.round(table, 6)


def write(path, table, header="", separator=",", decimal=".", lead="", end=""):
    lines = [lead + separator.join(repr(float(v)).replace(".", decimal) for v in row) + end for row in table]
    path.write_text(header + "\n".join(lines) + "\n")
    return path


@pytest.mark.parametrize(
    ("header", "separator", "decimal", "lead", "end"),
    [
        ("t,ax,ay,az,gx,gy,gz\n", ",", ".", "", ""),
        ("t\tax\tay\taz\tgx\tgy\tgz\n", "\t", ".", "", ""),
        ("t;ax;ay;az;gx;gy;gz\n", ";", ",", "", ""),
        ("", "   ", ".", "  ", "  "),
        ("# time tx ty tz wx wy wz\n", " ", ".", "", " "),
        ("t,ax,ay,az,gx,gy,gz\n", ",", ".", "", ","),
        ("Fs,100\nDevice,none\n\nt, ax, ay, az, gx, gy, gz\n", ", ", ".", "", ""),
    ],
    ids=["csv", "tsv", "decimal-comma", "blanks", "comment-header", "trailing-comma", "preamble"],
)
def test_every_text_layout_gives_the_numbers_that_were_written(tmp_path, header, separator, decimal, lead, end):
    table = readings()
    recording = read_recording(write(tmp_path / "log.txt", table, header, separator, decimal, lead, end))
    np.testing.assert_array_equal(recording.accelerometer, table[:, 1:4])
    np.testing.assert_array_equal(recording.gyroscope, table[:, 4:])
    # Times are made relative to the first stamp: one rounding.
    np.testing.assert_allclose(recording.time_s, table[:, 0] - table[0, 0], rtol=0, atol=1e-12)


def test_a_truncated_gzip_is_one_sentence(tmp_path):
    path = write(tmp_path / "log.csv", readings(2000), "t,ax,ay,az,gx,gy,gz\n")
    packed = tmp_path / "log.csv.gz"
    packed.write_bytes(gzip.compress(path.read_bytes())[:-2000])
    with pytest.raises(ReadError, match="copy the file again"):
        read_recording(packed)


def test_a_missing_rate_is_said_and_serious_with_a_gyro(tmp_path):
    path = write(tmp_path / "log.csv", readings()[:, 1:], "ax,ay,az,gx,gy,gz\n")
    recording = read_recording(path)
    assert [f.severity.value for f in recording.findings if f.code is FindingCode.RATE_ASSUMED] == ["serious"]
    assert FindingCode.RATE_ASSUMED not in {f.code for f in read_recording(path, rate_hz=50).findings}
