"""Streams of makers whose protocol is public are read by themselves; others are rejected by their name."""

import re
import struct

import numpy as np
import pytest

import trihedron
from trihedron.capture.protocols import decoder_factory
from trihedron.cli import main
from trihedron.records import Recording
from trihedron.simulate.device.encoders import encoder_for
from trihedron.simulate.device.faults import Faults, Sent
from trihedron.simulate.device.serving import Device

N = 300
# Half of the last digit: 16 g and 2000 deg/s in 2^15 steps, three and six digits, floats.
STEPS = [("witmotion", 0.0024, 5.4e-4), ("witmotion-clock", 0.0024, 5.4e-4), ("vectornav", 5.1e-4, 5.1e-7)]


def still(rate_hz=100.0) -> Recording:
    """A sensor that lies, in m/s^2 and rad/s, its readings all different."""
    rng = np.random.default_rng(4)
    force = [0.1, -0.2, 9.8] + 0.02 * rng.standard_normal((N, 3))
    return Recording(np.arange(N) / rate_hz, force, 0.01 * rng.standard_normal((N, 3)), rate_hz, "m/s^2", "rad/s")


def sent_as(board: str, recording: Recording, faults: Faults | None = None) -> bytes:
    return b"".join(data for _, data in Device(recording, board, faults or Faults(), seed=3).pieces(Sent()))


@pytest.mark.parametrize(("board", "force", "rate"), [*STEPS, ("sbg", 1e-6, 1e-8)])
def test_a_stream_of_a_known_maker_is_recognised_and_keeps_every_reading(board, force, rate, tmp_path):
    recording = still()
    (tmp_path / "stream").write_bytes(sent_as(board, recording))
    assert main(["capture", str(tmp_path / "stream"), "-o", str(tmp_path / "log.csv"), "--rate", "100"]) == 0
    log = trihedron.read(tmp_path / "log.csv")
    assert log.n_samples == N
    in_si = (9.80665, np.pi / 180) if board.startswith("witmotion") else (1.0, 1.0)
    np.testing.assert_allclose(log.accelerometer * in_si[0], recording.accelerometer, atol=force)
    np.testing.assert_allclose(log.gyroscope * in_si[1], recording.gyroscope, atol=rate)
    assert log.rate_hz == pytest.approx(100.0, rel=1e-3)
    expected = ("g", "deg/s") if board.startswith("witmotion") else ("m/s^2", "rad/s")
    assert (log.accelerometer_unit.value, log.gyroscope_unit.value) == expected


@pytest.mark.parametrize("board", ["witmotion-clock", "sbg"])
def test_what_a_clock_says_is_lost_stands_in_the_log(board, tmp_path):
    recording = still()
    encode = encoder_for(board)
    force, rate = recording.accelerometer / 100, recording.gyroscope
    frames = [encode(k, float(t), force[k], rate[k]) for k, t in enumerate(recording.time_s)]
    # One sample is gone whole, of another the last bytes.
    (tmp_path / "stream").write_bytes(b"".join(frames[:50] + frames[51:120] + [frames[120][:-20]] + frames[121:]))
    assert main(["capture", str(tmp_path / "stream"), "-o", str(tmp_path / "log.csv")]) == 0
    text = (tmp_path / "log.csv").read_text()
    assert f"{N - 2} saved / 2 lost by the device's clock" in text


def test_a_reader_that_joins_within_a_sample_has_its_clock_all_the_same():
    data = sent_as("witmotion-clock", still())
    decoder = decoder_factory("witmotion")()
    frames = [*decoder.feed(data[11:]), *decoder.finish()]
    assert len(frames) == N - 1
    assert frames[0].ticks is not None


@pytest.mark.parametrize("check", ["*66", "*A157"])
def test_the_lines_of_a_vectornav_are_checked_by_either_checksum(check):
    line = "$VNIMU,-00.0350,+00.4222,-00.6643,-00.015,+00.019,+09.948,+00.002066,-00.008442,-00.044656,+20.7,+084.322"
    decoder = decoder_factory("vectornav")()
    (frame,) = decoder.feed(f"{line}{check}\r\n".encode())
    assert frame.values[3:] == (-0.015, 0.019, 9.948, 0.002066, -0.008442, -0.044656)
    assert decoder.feed(f"{line.replace('9.948', '9.949')}{check}\r\n".encode()) == []
    assert decoder.corrupt == 1


@pytest.mark.parametrize(("status", "per_rad_s"), [(0x3FF, 67108864), (0x7FF, 12304174)])
def test_counts_of_an_sbg_are_as_large_as_its_status_says(status, per_rad_s):
    from trihedron.capture.protocols.framing import CHECKSUM_OF

    counts = [1048576, -2097152, 9 * 1048576, per_rad_s, -per_rad_s // 2, 0, 6400]
    inner = struct.pack("<BBHIH6ih", 44, 0, 32, 5000, status, *counts)
    message = b"\xff\x5a" + inner + struct.pack("<HB", CHECKSUM_OF["crc16-kermit"](inner), 0x33)
    decoder = decoder_factory("sbg")()
    (frame,) = [*decoder.feed(message), *decoder.finish()]
    assert frame.values == pytest.approx((1.0, -2.0, 9.0, 1.0, -0.5, 0.0, 25.0), rel=1e-7)
    assert frame.ticks == 5000


def of_words(body: bytes, n: int) -> bytes:
    return b"".join(body + np.random.default_rng(k).bytes(n) for k in range(40))


FOREIGN = {
    "video": (b"\0\0\0\x14ftypmp41" + bytes(3000), "a video.*gopro-telemetry"),
    "gpmf": (b"DEVC\0\x01\x12\x34" + bytes(3000), "a GoPro GPMF.*gopro-telemetry"),
    "angles": ((40 * b"$VNYPR,+010.071,+000.278,-002.026*60\r\n"), r"VectorNav text without.*\$VNIMU"),
    "vectornav binary": (of_words(b"\xfa\x01\x21\x01", 60), "VectorNav binary output.*VNIMU"),
    "sbg": (of_words(b"\xff\x5a\x06\x00\x1c\x00", 33), "SBG sbgECom without IMU data.*switch"),
    "witmotion": (40 * (b"\x55\x53" + bytes(8) + b"\xa8"), "WitMotion packets without.*switch"),
    "bluetooth": (of_words(b"\x55\x61", 18), "WitMotion's Bluetooth.*serial"),
    "nmea": ((40 * b"$GPGGA,123519,4807.038,N,01131.000,E,1,08,0.9,545.4,M,46.9,M,,*47\r\n"), "NMEA.*no IMU"),
    "mtdata": (of_words(b"\xfa\xff\x32\x1c", 29), "Xsens MTData of the old kind.*MTData2"),
}


@pytest.mark.parametrize("kind", list(FOREIGN))
def test_a_stream_that_is_not_decoded_is_refused_by_its_name_with_the_way_in(kind, tmp_path, capsys):
    data, words = FOREIGN[kind]
    (tmp_path / "stream").write_bytes(data)
    assert main(["capture", str(tmp_path / "stream"), "-o", str(tmp_path / "log.csv")]) == 1
    said = capsys.readouterr().err
    assert re.search(rf"this is {words}", said), said
    assert not (tmp_path / "log.csv").exists()
