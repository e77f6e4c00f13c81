"""Bytes to frames: every protocol, every fault, whatever the pieces; frames of the simulated board."""

import random
import re
import struct

import numpy as np
import pytest

import trihedron
from board import DECLARED, counts_recording
from trihedron.api.capturing import column_namer
from trihedron.capture.sequence import Sequence
from trihedron.cli import main
from trihedron.protocols import decoder_factory, encoder_for
from trihedron.protocols.declared import read_frame_declaration
from trihedron.protocols.framing import CHECKSUMS, Frame, Sample
from trihedron.records import Recording
from trihedron.simulate.device.faults import Faults, Sent, parse_faults
from trihedron.simulate.device.serving import Device

COUNTED = [
    *(("xsens-mtdata2",) * 2, ("xio",) * 2, ("xio-text", "xio"), ("sparkfun-6dof",) * 2, ("sparkfun-6dof-text",) * 2),
    *(("lines",) * 2, ("lines-space", "lines"), ("lines-label", "lines"), ("lines-equals", "lines")),
    ("declared", "declared"),
    ("sbg", "sbg"),
]
UNCOUNTED = [("lines-bare", "lines"), ("razor", "razor"), ("lines-monitor", "lines"), ("vectornav",) * 2]
SLOW = {board: pytest.mark.slow for board, _ in COUNTED if board not in ("declared", "xio")}
RATES = [(*one, 100.0) for one in COUNTED]
RATES += [pytest.param(*one, 1000.0, marks=SLOW.get(one[0], ())) for one in COUNTED]


@pytest.fixture
def declaration(tmp_path):
    path = tmp_path / "board.toml"
    path.write_text(DECLARED)
    return read_frame_declaration(path)


def decode(decoder, data, seed):
    """Frames of bytes that come in pieces of any size."""
    pieces = random.Random(seed)
    frames, at = [], 0
    while at < len(data):
        n = pieces.randrange(1, 200)
        frames += decoder.feed(data[at : at + n])
        at += n
    return frames + decoder.finish()


def sequenced(numbers, modulus, rate_hz=0.0, text=str):
    """What a sequence counts of frames with these numbers, and where it puts them."""
    sequence, placed = Sequence(by_counter=True, modulus=modulus), []
    for number in numbers:
        arrival = number / rate_hz if rate_hz else 0.0
        placed += sequence.push([Frame(number % modulus, None, (0.0,), text(number))], arrival)
    placed += sequence.finish()
    return sequence.count, placed


def stream(protocol, declaration, n, rate_hz, faults):
    spoken = declaration if protocol == "declared" else protocol
    recording, sent = counts_recording(n, rate_hz), Sent()
    return recording, sent, sent_as(spoken, recording, faults, sent)


def sent_as(spoken, recording, faults=None, sent=None):
    device = Device(recording, spoken, faults or Faults(), seed=3)
    return b"".join(data for _, data in device.pieces(sent or Sent()))


def decoder_of(name, declaration):
    return decoder_factory(declaration if name == "declared" else name.removesuffix("-clock"), column_namer())()


@pytest.mark.parametrize(("board", "name"), [*COUNTED, *UNCOUNTED])
def test_every_frame_of_a_clean_line_is_read_with_its_values(board, name, declaration):
    recording, _, data = stream(board, declaration, 300, 200.0, Faults())
    decoder = decoder_of(name, declaration)
    frames = decode(decoder, data, 1)
    assert len(frames) == 300
    assert decoder.corrupt == 0
    column = [c.split("[")[0].strip().lower() for c in decoder.columns]
    z = next(i for i, c in enumerate(column) if c in ("acc_z", "az"))
    values = np.array([frame.values[z] for frame in frames])
    truth = recording.accelerometer[:, 2]
    # SI protocols state the reading times a scale, and round it to their digits.
    scale = float(values @ truth / (truth @ truth))
    assert np.allclose(values, scale * truth, atol=1e-4 + 1e-6 * abs(scale) * 1023)
    # The log keeps the digits: its text is the value again.
    assert np.allclose([float(frame.text.split(",")[z]) for frame in frames], values, rtol=1e-8)


@pytest.mark.parametrize(("board", "name", "rate_hz"), RATES)
def test_sent_is_saved_plus_lost_under_every_fault(board, name, rate_hz, declaration):
    n = 3000
    _, sent, data = stream(board, declaration, n, rate_hz, parse_faults("1%"))
    decoder = decoder_of(name, declaration)
    frames = decode(decoder, data, 2)
    by_counter, by_clock = frames[0].counter is not None, frames[0].ticks is not None
    modulus = decoder.counter_modulus if by_counter else decoder.clock_modulus
    sequence = Sequence(by_counter=by_counter, by_clock=by_clock, modulus=modulus, tick_s=decoder.tick_s)
    placed = sequence.push(frames, 0.0) + sequence.finish()
    assert sequence.count.saved == len(placed)
    # Frames before the first and after the last one saved are nobody's to count: at most a few.
    assert 0 <= n - (sequence.count.saved + sequence.count.lost) <= 5
    assert sequence.count.restarts == 0
    # A frame that no fault touched is not lost, but for the neighbour of a cut one whose bytes it merged with.
    assert sequence.count.saved >= len(sent.untouched) - sent.faults["cut"] - sent.faults["byte_lost"]


def test_a_garbled_counter_is_not_a_thousand_lost_frames_and_one_that_begins_anew_a_restart():
    count, placed = sequenced([*range(10), 5010, *range(11, 20)], 1 << 16)
    assert (count.lost, count.garbled) == (1, 1)
    assert [one.place for one in placed] == [*range(10), *range(11, 20)]
    count, _ = sequenced([*range(1000, 1050), *range(5, 60)], 1 << 32)
    assert (count.saved, count.lost, count.restarts) == (105, 0, 1)


@pytest.mark.parametrize(("modulus", "uncounted"), [(1 << 8, 1), (1 << 16, 0)])
def test_what_a_short_counter_counts_over_a_long_pause_is_a_lower_bound(modulus, uncounted):
    count, _ = sequenced([*range(500), *range(850, 900)], modulus, rate_hz=1000.0)
    # 350 frames are missing; a counter of one byte has gone round once and shows 94 of them.
    assert (count.lost, count.uncounted) == (350 - 256 * uncounted, uncounted)


@pytest.mark.parametrize("rate_hz", [0.0, 1000.0])
@pytest.mark.parametrize("lost", [195, 220, 250])
def test_new_frames_whose_short_counter_looks_like_a_stretch_sent_twice_are_kept(lost, rate_hz):
    # Where time says how much is missing, readings may even be those of before.
    numbers = [*range(500), *range(500 + lost, 580 + lost)]
    count, _ = sequenced(numbers, 256, rate_hz, text=(lambda _: "still") if rate_hz else str)
    assert count.saved == len(numbers)
    # What is missing cannot be counted, and that is said.
    assert count.is_least


def test_a_stretch_that_was_sent_twice_is_saved_once():
    count, placed = sequenced([*range(500), *range(470, 600)], 256)
    assert [one.frame.text for one in placed] == list(map(str, range(600)))
    assert (count.repeated, count.lost, count.restarts) == (30, 0, 0)


@pytest.mark.parametrize("modulus", [0, 1 << 16, 1 << 32])
def test_a_clock_that_wraps_or_stutters_loses_nothing(modulus):
    rng = random.Random(4)
    ticks = [round(60_000 + 10 * i + rng.uniform(-2.5, 2.5)) % (modulus or 1 << 62) for i in range(5000)]
    sequence = Sequence(by_clock=True, modulus=modulus, tick_s=1e-3)
    sequence.push([Frame(None, t, (0.0,), str(i)) for i, t in enumerate(ticks)], 0.0)
    sequence.finish()
    assert (sequence.count.saved, sequence.count.lost, sequence.count.restarts) == (5000, 0, 0)


def test_checksums_have_their_published_check_values():
    # Values over "123456789" of the catalogue of parametrised CRC algorithms.
    values = {kind: function(b"123456789") for kind, (_, function) in CHECKSUMS.items() if kind.startswith("crc")}
    assert values.pop("crc8") == 0xF4
    assert values.pop("crc32") == 0xCBF43926
    assert values == {"crc16-ccitt": 0x29B1, "crc16-modbus": 0x4B37, "crc16-kermit": 0x2189}


@pytest.mark.parametrize("kind", list(CHECKSUMS))
@pytest.mark.parametrize("endian", ["little", "big"])
def test_a_declared_frame_is_read_with_any_checksum_and_byte_order(kind, endian, tmp_path):
    path = tmp_path / "x.toml"
    path.write_text(DECLARED.replace('"crc16-ccitt"', f'"{kind}"').replace("sync", f'endian = "{endian}"\nsync'))
    declaration = read_frame_declaration(path)
    _, _, data = stream("declared", declaration, 50, 100.0, Faults())
    assert len(decode(decoder_factory(declaration)(), data, 0)) == 50


@pytest.mark.parametrize(
    ("change", "words"),
    [
        (("sync", "synk"), "no key 'synk'"),
        (('"AA 55"', '"XY"'), "not hexadecimal"),
        (("sync", "length = " + "9" * 5000 + "\nsync"), "is not a TOML file"),
        (('"u16"', '"u17"'), "no type 'u17'"),
        (('"crc16-ccitt"', '"md5"'), "no checksum 'md5'"),
        (('unit = "us"', ""), "needs its step"),
        (('kind = "crc16-ccitt"', 'kind = "crc16-ccitt"\nfrom = 99'), "does not fit"),
    ],
)
def test_a_wrong_declaration_is_refused_in_one_sentence_with_its_file(change, words, tmp_path):
    path = tmp_path / "x.toml"
    path.write_text(DECLARED.replace(*change))
    with pytest.raises(ValueError, match=r"x\.toml") as rejection:
        read_frame_declaration(path)
    assert words in str(rejection.value)


def test_xsens_fixed_point_and_double_formats_are_understood():
    def message(form, pack):
        body = bytes.fromhex("1020020007") + (0x4020 | form).to_bytes(2, "big") + bytes([len(pack)]) + pack
        head = bytes([0xFF, 0x36, len(body)])
        return b"\xfa" + head + body + bytes([-(sum(head) + sum(body)) & 0xFF])

    # 1.5 in 12.20 is 0x00180000; in 16.32 the fraction 0x80000000 comes before the whole part 0x0001.
    for form, one in ((1, bytes.fromhex("00180000")), (2, bytes.fromhex("800000000001"))):
        decoder = decoder_factory("xsens-mtdata2")()
        frames = [*decoder.feed(message(form, one * 3)), *decoder.finish()]
        assert frames[0].values == (1.5, 1.5, 1.5)


def test_the_published_example_of_an_inertial_message_is_read():
    # The example of the maker's manual: one second, one g on z.
    binary = bytes.fromhex("C940420F0000000000" + "00000000" * 5 + "0000803F" + "0A")
    decoder = decoder_factory("xio")()
    text = b"I,1000000,0.0000,0.0000,0.0000,0.0000,0.0000,1.0000\r\n"
    first, second = decoder.feed(binary + text)
    assert first.ticks == second.ticks == 1_000_000
    assert first.values == second.values == (0.0, 0.0, 0.0, 0.0, 0.0, 1.0)


BY_HAND = [
    ("sparkfun-6dof", "41 0005 0201 0200 0300 0204 0202 0203 5A", (513.0, 512.0, 768.0, 516.0, 514.0, 515.0)),
    # 0x0800 of 2^15 is one g of sixteen, 0x1000 is 250 deg/s of 2000, 0x09C4 is 25 degrees; the sums modulo 256.
    (
        "witmotion",
        "55 51 0008 0000 00F8 C409 73  55 52 0010 0000 00F0 0000 A7",
        (1.0, 0.0, -1.0, 250.0, 0.0, -250.0, 25.0),
    ),
]


@pytest.mark.parametrize(("protocol", "frame", "values"), BY_HAND)
def test_a_frame_written_by_hand_from_the_data_sheet_is_read(protocol, frame, values):
    decoder = decoder_factory(protocol)()
    (found,) = [*decoder.feed(bytes.fromhex(frame)), *decoder.finish()]
    assert found.values == values


@pytest.mark.parametrize("flipped", [b"1.0\x0c", b"1_0"])
def test_a_flipped_bit_that_python_reads_past_leaves_no_cell_that_the_log_cannot_hold(flipped):
    line = b"I,1000000,0.0,0.0,0.0,0.0,0.0,1.0\n"
    decoder = decoder_factory("xio")()
    frames = [*decoder.feed(line + line.replace(b"1.0\n", flipped + b"\n") + line), *decoder.finish()]
    assert [frame.text for frame in frames] == ["0.0,0.0,0.0,0.0,0.0,1.0"] * 2
    assert decoder.corrupt == 1


N = 300
# Half of the last digit: 16 g and 2000 deg/s in 2^15 steps, three and six digits, floats.
STEPS = [("witmotion", 0.0024, 5.4e-4), ("witmotion-clock", 0.0024, 5.4e-4), ("vectornav", 5.1e-4, 5.1e-7)]


def still(rate_hz=100.0) -> Recording:
    """A sensor that lies, in m/s^2 and rad/s, its readings all different."""
    rng = np.random.default_rng(4)
    force = [0.1, -0.2, 9.8] + 0.02 * rng.standard_normal((N, 3))
    return Recording(np.arange(N) / rate_hz, force, 0.01 * rng.standard_normal((N, 3)), rate_hz, "m/s^2", "rad/s")


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
    readings = np.hstack([force, rate])
    frames = [encode(Sample(k, float(t), *[readings[k]] * 2)) for k, t in enumerate(recording.time_s)]
    # One sample is gone whole, of another the last bytes.
    (tmp_path / "stream").write_bytes(b"".join(frames[:50] + frames[51:120] + [frames[120][:-20]] + frames[121:]))
    assert main(["capture", str(tmp_path / "stream"), "-o", str(tmp_path / "log.csv")]) == 0
    text = (tmp_path / "log.csv").read_text()
    assert f"{N - 2} saved / 2 lost by the device's clock" in text


def test_a_reader_that_joins_within_a_sample_has_its_clock_all_the_same():
    data = sent_as("witmotion-clock", still())
    frames = decode(decoder_factory("witmotion")(), data[11:], 1)
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
    counts = [1048576, -2097152, 9 * 1048576, per_rad_s, -per_rad_s // 2, 0, 6400]
    inner = struct.pack("<BBHIH6ih", 44, 0, 32, 5000, status, *counts)
    message = b"\xff\x5a" + inner + struct.pack("<HB", CHECKSUMS["crc16-kermit"][1](inner), 0x33)
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
