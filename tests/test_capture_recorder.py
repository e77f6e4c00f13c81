"""Bytes to a log over a real pseudo-terminal, a socket, a file and a pipe; faults, clocks, gaps, errors."""

import os
import re
import signal
import subprocess
import sys
import time
from pathlib import Path

import numpy as np
import pytest

import trihedron
from board import Board, counts_recording
from trihedron.api.capturing import column_namer, open_device
from trihedron.arrivals import ClockFit, paced
from trihedron.capture.detection import find_protocol
from trihedron.capture.errors import CaptureError
from trihedron.capture.log import GrowingLog
from trihedron.capture.recorder import Recorder
from trihedron.capture.sources import open_source
from trihedron.cli import main
from trihedron.protocols import decoder_factory
from trihedron.simulate.device.faults import Faults, Sent, parse_faults
from trihedron.simulate.device.serving import Device

pytestmark = pytest.mark.skipif(sys.platform == "win32", reason="pseudo-terminals are POSIX")
INPUT_ERRORS = [
    (["capture", "/dev/ttyUSB97", "-o", "LOG"], "there is no port /dev/ttyUSB97"),
    (["capture", "tcp://127.0.0.1:1", "-o", "LOG"], "no connection"),
    (["capture", "tcp://nowhere", "-o", "LOG"], "tcp://host:port"),
    (["capture", "EMPTY", "-o", "LOG"], "it is empty"),
    (["capture", "NOISE", "-o", "LOG"], "no known protocol"),
    (["capture", "NOISE", "--protocol", "morse", "-o", "LOG"], "there is no protocol 'morse'"),
    (["capture", "NOISE", "--protocol", "none.toml", "-o", "LOG"], "there is no such file"),
    (["capture", "NOISE", "-o", "EXISTS"], "the file exists and was left alone"),
    (["capture", "NOISE", "-o", "missing/log.csv"], "there is no folder"),
    (["capture", "NOISE"], "name the log to write"),
    (["capture", "FOLDER", "-o", "LOG"], "this is a directory"),
]


def capture(port, path, **options):
    source, found = open_device(port, protocol=options.pop("protocol", None), baud=options.pop("baud", None))
    recorder = Recorder(source, found.make_decoder, path, first_bytes=found.first_bytes, **options)
    blocks = list(recorder)
    return recorder, blocks


def sent(path, *device):
    """A file of what a simulated board sends."""
    path.write_bytes(b"".join(piece for _, piece in Device(*device).pieces(Sent())))
    return str(path)


@pytest.mark.parametrize("where", ["tcp", "file", "stdin"])
def test_any_stream_of_bytes_is_a_source(where, tmp_path):
    recording = counts_recording(300, 100.0)
    log = tmp_path / "log.csv"
    if where == "tcp":
        with Board(recording, "xio", tcp=True) as board:
            recorder, _ = capture(board.port, log, wait_for_return_s=0.0)
        assert recorder.count.saved == 300
        return
    raw = sent(tmp_path / "raw.txt", recording, "lines")
    if where == "file":
        recorder, _ = capture(raw, log)
        assert recorder.count.saved == 300
    else:
        command = [sys.executable, "-m", "trihedron", "capture", "-", "-o", str(log)]
        subprocess.run(command, input=Path(raw).read_bytes(), check=True, capture_output=True, timeout=60)
    back = trihedron.read(log)
    assert back.n_samples == 300
    assert np.array_equal(back.accelerometer, recording.accelerometer)
    assert np.array_equal(back.gyroscope, recording.gyroscope)


def test_losses_stand_in_the_log_where_they_were(tmp_path):
    raw = tmp_path / "raw.bin"
    frames = [piece for _, piece in Device(counts_recording(200, 100.0), "sparkfun-6dof").pieces(Sent())]
    raw.write_bytes(b"".join(frames[:50] + frames[53:120] + frames[121:]))
    recorder, blocks = capture(str(raw), tmp_path / "log.csv", rate_hz=100.0)
    assert (recorder.count.saved, recorder.count.lost) == (196, 4)
    remarks = [line for line in (tmp_path / "log.csv").read_text().splitlines() if "lost" in line and "before" in line]
    assert [re.findall(r"lost (\d+) before frame (\d+)", line)[0] for line in remarks] == [("3", "53"), ("1", "121")]
    # The time of what follows a loss is right: the hole is in the time column.
    times = np.concatenate([block.time_s for block in blocks])
    assert times[-1] == pytest.approx(1.99, abs=1e-9)


def test_an_unplugged_board_goes_on_in_the_same_file_with_gaps_said_and_cut_frames_counted(tmp_path):
    faults = Faults(disconnect_s=(0.4, 0.8), away_s=0.3)
    board = Board(counts_recording(360, 300.0), "xio", faults=faults, speed=1.0, link=tmp_path / "tty")
    # The port is open before the first byte: nothing is lost for want of a reader.
    source = open_source(board.port)
    with board:
        make = decoder_factory("xio", column_namer())
        recorder = Recorder(source, make, tmp_path / "log.csv", wait_for_return_s=1.5)
        blocks = list(recorder)
    text = (tmp_path / "log.csv").read_text()
    assert "went away (unplugged)" in text
    assert "is back at" in text
    assert recorder.count.disconnections == 3  # the last is for good
    times = np.concatenate([block.time_s for block in blocks])
    assert len(times) + recorder.count.lost == 360
    assert sum(map(int, re.findall(r"lost (\d+) before frame", text))) == recorder.count.lost > 0
    # The index of every frame is the one that the device gave it, whatever was cut.
    assert blocks[-1].index[-1] == 359
    steps = np.sort(np.diff(times))
    assert steps[0] > 0
    # Two gaps as long as the board was away, to the pace at which a port is looked for again.
    assert 0.2 < steps[-2] < steps[-1] < 1.0
    assert steps[-3] < 0.02
    assert trihedron.read(tmp_path / "log.csv").n_samples == len(times)


def test_the_baud_rate_is_found_by_itself():
    with Board(counts_recording(1000, 250.0), "lines", speed=1.0, baud=57_600) as board:
        source, found = open_device(board.port)
        assert source.baud == 57_600
        assert found.protocol == "lines"
        source.close()


def test_a_device_clock_in_error_is_found_within_its_error_bar():
    rng = np.random.default_rng(0)
    ratios = []
    for _ in range(30):
        fit = ClockFit()
        for d in np.arange(0.0, 40.0, 0.02):
            fit.add(float(d), float(d) * (1 - 50e-6) + float(rng.exponential(0.002)) + 0.02 * (rng.random() < 0.02))
        line = fit.line()
        ratios.append((1.0 / (1 - 50e-6) - 1.0 - line.rate_ppm * 1e-6) / (line.sigma_ppm * 1e-6))
    # Thirty z-scores: their rms is 1 within 26 % (two standard errors); minima are not Gaussian, so half of it more.
    assert 0.5 < np.sqrt(np.mean(np.square(ratios))) < 1.6


def test_a_board_on_a_pseudo_terminal_becomes_a_log_that_reads_and_a_slow_disk_loses_nothing(tmp_path, monkeypatch):
    write = GrowingLog._write
    monkeypatch.setattr(GrowingLog, "_write", lambda log, text: (time.sleep(0.4), write(log, text)))
    with Board(counts_recording(900, 1000.0), "xsens-mtdata2", speed=1.0) as board:
        recorder, blocks = capture(board.port, tmp_path / "log.csv", wait_for_return_s=0.0)
    n = sum(len(block.time_s) for block in blocks)
    assert recorder.count.lost == 0
    back = trihedron.read(tmp_path / "log.csv")
    # The start may be lost to the reader that was not there yet; what is saved is in steps of the board's clock.
    assert back.n_samples == n == recorder.count.saved > 300
    assert np.allclose(np.diff(back.time_s), 0.001, atol=1e-9)
    assert back.auxiliary.keys() >= {"host_s", "frame", "device_ticks"}
    assert f"# frames: {n} saved / 0 lost" in (tmp_path / "log.csv").read_text()


def test_a_full_disk_says_what_is_saved_and_leaves_a_whole_file(tmp_path):
    # The limit of the size of a file represents the disk.
    raw = sent(tmp_path / "raw.txt", counts_recording(5000, 100.0), "lines")
    code = (
        "import resource, sys; resource.setrlimit(resource.RLIMIT_FSIZE, (60000, 60000));"
        "from trihedron.cli import main; sys.exit(main(sys.argv[1:]))"
    )
    log = tmp_path / "log.csv"
    done = subprocess.run(
        [sys.executable, "-c", code, "capture", raw, "-o", str(log)], capture_output=True, text=True, timeout=60
    )
    assert done.returncode == 2
    assert "the disk is full" in done.stderr
    saved = int(re.search(r"(\d+) rows are saved", done.stderr).group(1))
    assert log.read_bytes().endswith(b"\n")
    assert trihedron.read(log).n_samples == saved > 500


def test_kill_9_loses_at_most_a_second_and_the_file_reads(tmp_path):
    log = tmp_path / "log.csv"
    with Board(counts_recording(6000, 1000.0), "xsens-mtdata2", speed=1.0, link=tmp_path / "tty") as board:
        process = subprocess.Popen(
            [sys.executable, "-m", "trihedron", "capture", board.port, "-o", str(log), "--protocol", "xsens-mtdata2"],
            stderr=subprocess.DEVNULL,
        )
        until = time.monotonic() + 20
        while time.monotonic() < until and not (log.exists() and log.stat().st_size > 50_000):
            time.sleep(0.02)
        process.kill()
        process.wait()
    assert process.returncode == -signal.SIGKILL
    back = trihedron.read(log)
    assert back.n_samples > 300


@pytest.mark.parametrize(("words", "sentence"), INPUT_ERRORS)
def test_bad_input_is_refused_in_one_sentence_with_status_1(words, sentence, tmp_path, capsys):
    (tmp_path / "empty").write_bytes(b"")
    (tmp_path / "noise").write_bytes(np.random.default_rng(0).bytes(3000))
    (tmp_path / "exists.csv").write_text("mine")
    names = {"LOG": "log.csv", "EMPTY": "empty", "NOISE": "noise", "EXISTS": "exists.csv", "FOLDER": "."}
    status = main([str(tmp_path / names[word]) if word in names else word for word in words])
    said = capsys.readouterr().err.strip()
    assert status == 1
    assert sentence in said
    assert "\n" not in said
    assert (tmp_path / "exists.csv").read_text() == "mine"
    assert not (tmp_path / "log.csv").exists()


def test_a_silent_board_is_told_from_a_wrong_protocol_and_a_busy_port_is_named():
    import pty

    master, slave = pty.openpty()
    source = open_source(os.ttyname(slave))
    with pytest.raises(CaptureError, match="in use by another program"):
        open_source(os.ttyname(slave))
    with pytest.raises(CaptureError, match="not one byte came in"):
        find_protocol(source, baud=115_200, silence_s=0.5)
    source.close()
    os.close(master)
    os.close(slave)


def test_what_a_board_says_at_start_is_no_frame(tmp_path):
    raw = sent(tmp_path / "raw.txt", counts_recording(100, 100.0), "lines-label", parse_faults("text"))
    recorder, _ = capture(raw, tmp_path / "log.csv")
    assert recorder.count.saved == 100
    assert recorder.count.corrupt <= 1


def test_frames_without_a_clock_are_paced_by_all_of_their_arrivals_when_their_log_is_read():
    # Pieces of 8 frames, late by up to 20 ms; four seconds away after the third of ten; a counter that went on there.
    rng, rate_hz = np.random.default_rng(0), 416.0
    frame = np.arange(8000)
    sent_s = frame / rate_hz + np.where(frame < 2400, 0.0, 4.0)
    last = (frame // 8) * 8 + 7
    host_s = sent_s[last] + rng.exponential(4e-3, 1000)[frame // 8]
    host_s = np.maximum.accumulate(host_s)
    time_s = paced(frame.astype(float), host_s)
    assert np.all(np.diff(time_s) > 0.0)
    for part in (slice(0, 2400), slice(2400, 8000)):
        assert np.polyfit(sent_s[part], time_s[part], 1)[0] == pytest.approx(1.0, abs=1e-4)
    # Two stretches begin each within the lateness of their earliest piece.
    assert time_s[2400] - time_s[2399] == pytest.approx(4.0 + 1.0 / rate_hz, abs=2e-3)
