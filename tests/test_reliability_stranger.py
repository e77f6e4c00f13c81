"""What a stranger's system does to a command: signals, closed streams, odd locales, two writers, a log that grows."""

import json
import os
import re
import signal
import subprocess
import sys
import threading
import time
from dataclasses import replace

import numpy as np
import pytest

import trihedron
from small_session import G, copied, leftovers, made_once, run, started, usual
from trihedron import _core
from trihedron.documents import DocumentError, parse_json
from trihedron.read import read_recording

# C without UTF-8; an unknown locale, no home and a dumb terminal.
ENVIRONMENTS = (
    {"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    {"LC_ALL": "xx_YY.foo", "HOME": "", "TERM": "dumb", "COLUMNS": "0"},
)
pytestmark = pytest.mark.skipif(os.name != "posix", reason="signals of POSIX")
ONE_SECOND = 1.0
LOADED = 4.0
"""A machine with ten busy processes on two cores gives a process a fifth of one."""


def test_the_answer_does_not_depend_on_locale_home_or_terminal(tmp_path):
    folder = copied(tmp_path)
    said = [run("segment", "log.csv", "--json", "-", cwd=folder, env=env) for env in ({}, *ENVIRONMENTS)]
    plain, *odd = (re.sub(r'"(made_at|created)": "[^"]*"', "", out) for _, out, _ in said)
    assert [status for status, _, _ in said] == [0, 0, 0]
    assert json.loads(plain)
    assert odd == [plain, plain]


@pytest.mark.parametrize(("closed", "status", "is_written"), [("<&- 2>&-", 0, True), ("<&- >&- 2>&-", 0, None)])
def test_closed_streams_lose_no_result_and_reach_no_file(tmp_path, closed, status, is_written):
    folder = copied(tmp_path)
    line = f"{sys.executable} -m trihedron calibrate log.csv --gravity {G} -o new.json {closed}"
    environment = {**os.environ, "PYTHONPATH": os.pathsep.join(p for p in sys.path if p)}
    done = subprocess.run(line, shell=True, cwd=folder, env=environment, capture_output=True, timeout=120)
    assert done.returncode == status
    if is_written:
        assert b"Calibration" in done.stdout
    new = folder / "new.json"
    # Whole where it is there: what is said to a closed stream never lands in a file that took its number.
    assert not is_written or new.exists()
    assert not new.exists() or json.loads(new.read_text())["is_trustworthy"] is not None
    assert leftovers(folder) == []


def test_a_log_that_grows_while_it_is_read_is_what_it_was_at_some_moment(tmp_path):
    folder = copied(tmp_path)
    log = folder / "log.csv"
    head, *rows = log.read_text().splitlines(keepends=True)
    log.write_text(head + "".join(rows[:1000]))
    with log.open("a") as stream:
        for k in range(1000, len(rows), 400):
            # The last line is cut in its middle, as a logger's buffer leaves it.
            text = "".join(rows[k : k + 400])
            stream.write(text[:-7])
            stream.flush()
            recording = read_recording(log)
            assert recording.rows_read + recording.rows_reported == recording.rows_in_file
            assert abs(recording.rows_in_file - min(k + 400, len(rows))) <= 1
            stream.write(text[-7:])
            stream.flush()


@pytest.mark.parametrize("text", ['[{"b": {"a": 1, "a": 1}}]', '{"\\u0061": 1, "a": 2}'])
def test_a_key_given_twice_is_refused_and_not_the_last_taken(text):
    with pytest.raises(DocumentError, match="gives 'a' twice"):
        parse_json(text)


@pytest.mark.skipif(sys.platform != "linux", reason="names of any bytes")
def test_names_of_files_break_no_line_of_a_repr_and_those_that_are_no_text_are_spelled_out(tmp_path):
    folder = copied(tmp_path)
    log = folder / "a\nb\x1b[2J\t.csv"
    (folder / "log.csv").rename(log)
    recording = trihedron.read(log)
    calibrated, judged = trihedron.calibrate(recording, gravity_m_s2=float(G)), trihedron.check(recording)
    diagnosed = replace(usual()[2], recording=recording)
    time_s, force, rate = (of[:600] for of in (recording.time_s, recording.accelerometer, recording.gyroscope))
    still = trihedron.allan(replace(recording, time_s=time_s, accelerometer=force, gyroscope=rate))
    for result in (recording, calibrated, calibrated.calibration, judged, still, diagnosed):
        assert repr(result).isprintable(), result
        assert "a\\nb\\x1b[2J\\t.csv" in repr(result)
    os.rename(log, os.fsencode(folder) + b"/\xff\xfe.csv")
    out = os.fsencode(folder) + b"/\xff.json"
    names = os.fsdecode(b"\xff\xfe.csv"), "--gravity", G, "-o", os.fsdecode(b"\xff.json")
    status, said, _ = run("calibrate", *names, cwd=folder)
    assert status == 0
    assert "\\udcff\\udcfe.csv" in said
    with open(out, encoding="utf-8") as stream:
        assert json.load(stream)


@pytest.fixture(scope="module")
def long_log(tmp_path_factory):
    """Five million rows: every command on it takes seconds."""
    import polars

    path = tmp_path_factory.mktemp("long") / "long.csv"
    rng = np.random.default_rng(1)
    n = 5_000_000
    noise = np.round(rng.normal([0.0, 0.0, 9.8, 0.0, 0.0, 0.0], 0.01, (1000, 6)), 4)
    columns = {"t": np.arange(n) / 1000.0}
    columns |= {name: np.tile(noise[:, k], n // 1000) for k, name in enumerate(("ax", "ay", "az", "gx", "gy", "gz"))}
    polars.DataFrame(columns).write_csv(path)
    return path


def interrupted(process, number, after_s):
    """Status, stderr and how long the process lived on, from when it has its handlers: it starts for some 50 ms."""
    caught = 0
    while not caught >> (signal.SIGTERM - 1) & 1 and process.poll() is None:
        with open(f"/proc/{process.pid}/status") as now:
            caught = next(int(line.split()[1], 16) for line in now if line.startswith("SigCgt"))
        time.sleep(0.005)
    time.sleep(after_s)
    if process.poll() is not None:
        process.communicate()
        pytest.fail("the command ended before it was interrupted")
    began = time.monotonic()
    process.send_signal(number)
    _, err = process.communicate(timeout=30)
    return process.returncode, err.decode(), time.monotonic() - began


@pytest.mark.parametrize(("number", "status", "after_s"), [(signal.SIGINT, 130, 0.0), (signal.SIGTERM, 143, 0.5)])
def test_a_command_ends_within_a_second_and_says_so(long_log, tmp_path, number, status, after_s):
    target = tmp_path / "c.json"
    target.write_text("old")
    process = started("calibrate", long_log, "--gravity", "9.8", "-o", target, "--force")
    ended, err, took = interrupted(process, number, after_s)
    assert ended == status, err
    assert err.count("interrupted") == 1
    assert "Traceback" not in err
    # One line, or the erased remains of a progress bar before it.
    assert err.strip().splitlines()[-1].endswith("interrupted; what was not finished was not written.")
    assert took < (ONE_SECOND if os.getloadavg()[0] < 2 else LOADED)
    assert target.read_text() == "old"
    assert leftovers(tmp_path) == []


def test_a_library_that_does_not_listen_is_ended_all_the_same():
    # A mutex locked twice holds the main thread for ever, whatever signals come, as a busy library would for minutes.
    code = (
        "import ctypes, trihedron.interruption as i; i.install(); c = ctypes.CDLL(None); m = bytes(64); "
        "c.pthread_mutex_lock(m); print('ready', flush=True); c.pthread_mutex_lock(m)"
    )
    process = subprocess.Popen([sys.executable, "-c", code], stdout=subprocess.PIPE, stderr=subprocess.PIPE)
    assert process.stdout.readline() == b"ready\n"
    ended, err, took = interrupted(process, signal.SIGTERM, 0.1)
    assert ended == 143
    assert took < (ONE_SECOND if os.getloadavg()[0] < 2 else LOADED)
    assert err == "trihedron: interrupted; what was not finished was not written.\n"


def test_a_long_kernel_ends_between_blocks_when_python_is_interrupted():
    # Half a minute of noise; the signal comes from a thread, the handler runs in the kernel's binding.
    n = 30_000_000
    # A shell's background job begins with SIGINT ignored.
    before = signal.signal(signal.SIGINT, signal.default_int_handler)
    threading.Timer(0.4, lambda: os.kill(os.getpid(), signal.SIGINT)).start()
    # In seconds of the processor, of which a loaded machine gives no more.
    began = time.process_time()
    with pytest.raises(KeyboardInterrupt):
        _core.simulate_noise(n, 0.01, [[1.0, 1.0, 1.0, 1.0, 0.0]] * 3, [[1, 2, 3, 4]] * 3)
    signal.signal(signal.SIGINT, before)
    assert time.process_time() - began < (0.4 + LOADED) * os.cpu_count()
    # And the next one is not harmed.
    assert _core.simulate_noise(5, 0.01, [[1.0, 1.0, 1.0, 1.0, 0.0]] * 3, [[1, 2, 3, 4]] * 3).shape == (5, 3)


def test_nothing_is_said_about_an_interruption_that_was_told_to_be_ignored():
    # nohup and background jobs of a shell start commands with SIGINT ignored.
    with started(
        "segment", made_once() / "log.csv", preexec_fn=lambda: signal.signal(signal.SIGINT, signal.SIG_IGN)
    ) as process:
        time.sleep(0.2)
        process.send_signal(signal.SIGINT)
        out, err = process.communicate(timeout=60)
    assert process.returncode == 0, err
    assert out
