"""Whatever lies behind the name of an input, a command ends in a sentence; a child by fork computes or says why not."""

import gzip
import io
import json
import multiprocessing
import os
import subprocess
import sys
import zipfile
from pathlib import Path

import numpy as np
import pytest

from small_session import made_elsewhere
from trihedron import _core
from trihedron.documents import read_text
from trihedron.errors import InputError
from trihedron.files.calibration import CalibrationFileError, read_calibration, write_calibration
from trihedron.files.noise import NoiseFileError, read_noise
from trihedron.read import ReadError, open_chunks, read_recording
from trihedron.sanitise import escaped, escaped_json
from trihedron.simulate.scenario_file import read_scenario

READERS = [(read_calibration, CalibrationFileError), (read_noise, NoiseFileError), (read_scenario, ValueError)]


@pytest.mark.parametrize(("reader", "error"), READERS)
def test_what_is_no_plain_file_of_sane_size_is_refused_at_once(tmp_path, reader, error):
    pipe, large = tmp_path / "pipe", tmp_path / "large"
    os.mkfifo(pipe)
    with large.open("wb") as stream:
        stream.truncate(10**9)
    for path, words in ((pipe, "plain file"), ("/dev/zero", "plain file"), (large, "1000 MB"), (tmp_path, "directory")):
        with pytest.raises(error, match=words):
            reader(path)
    for name in ("n" * 300, "a\0b", tmp_path / "none"):
        with pytest.raises(InputError):
            read_text(name, "calibration file")


@pytest.mark.parametrize("text", ["[" * 100_000, "9" * 400, "1e999", "NaN", "[" * 70 + "]" * 70, "{", '"', "a,b\n1,2"])
@pytest.mark.parametrize(("reader", "error"), READERS)
def test_depth_and_numbers_beyond_any_document_are_refused(tmp_path, reader, error, text):
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(error, match=r"x\.json") as caught:
        reader(path)
    assert "\n" not in str(caught.value)


def test_a_header_that_lies_about_an_array_is_refused(tmp_path):
    path = tmp_path / "a.npy"
    np.save(path, np.zeros((100, 7)))
    good = path.read_bytes()
    for lie in (b"(-10, 7)", b"(10**9, 7)", b"(1000, 7)", b"(99, 7)"):
        path.write_bytes(good.replace(b"(100, 7)", lie.ljust(8)[:8] if len(lie) <= 8 else lie, 1))
        with pytest.raises(ReadError):
            read_recording(path)
    path.write_bytes(good[:2000])
    with pytest.raises(ReadError, match="another length"):
        read_recording(path)


def test_archives_that_unpack_to_harm_are_refused(tmp_path):
    bomb = tmp_path / "bomb.csv.gz"
    bomb.write_bytes(gzip.compress(b"t,ax,ay,az\n") + 12 * gzip.compress(b"1,2,3,4\n" * (1 << 20)))
    with pytest.raises(ReadError, match="which no log does"):
        read_recording(bomb)
    archive = tmp_path / "bomb.npz"
    buffer = io.BytesIO()
    np.save(buffer, np.zeros((2_000_000, 8)))
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as made:
        made.writestr("data.npy", buffer.getvalue())
    with pytest.raises(ReadError, match="which no log does"):
        read_recording(archive)


def test_what_a_log_is_called_sends_nothing_to_a_terminal_from_a_calibration_that_is_shown(tmp_path):
    known = json.loads((made_elsewhere() / "c.json").read_text())
    known["recording"] = {"source": "a\x1b[2J\x9b\u202eb.csv", "sha256": ""}
    (tmp_path / "named.json").write_text(json.dumps(known))
    calibration = read_calibration(tmp_path / "named.json")
    write_calibration(calibration, tmp_path / "again.json")
    text = (tmp_path / "again.json").read_text()
    assert escaped(text) == text
    assert escaped("a\x1b[2J\x9b\u202eb\n\t") == "a\\x1b[2J\\x9b\\u202eb\n\t"
    assert escaped_json('"\x9b"') == '"\\u009b"'
    assert read_calibration(tmp_path / "again.json").recording_source == calibration.recording_source


@pytest.mark.parametrize("step_s", [1e-300, 5e-324, 1e-30, 1e-11])
def test_a_time_that_hardly_moves_is_refused(tmp_path, step_s):
    rng = np.random.default_rng(1)
    rows = [f"{k * step_s!r},{a[0]:.4f},{a[1]:.4f},{a[2]:.4f}" for k, a in enumerate(rng.normal(9.8, 0.1, (300, 3)))]
    (tmp_path / "log.csv").write_text("t,ax,ay,az\n" + "\n".join(rows) + "\n")
    with pytest.raises(ReadError, match="which no log does"):
        read_recording(tmp_path / "log.csv")


@pytest.mark.parametrize(
    ("line", "words"),
    [
        ('"a","x","y","z","q"', "line 200 has 5 fields"),
        ('"1.97","oops","0.1","9.8"', "line 200, column 'ax': 'oops'"),
        ('"1.97","0.1","0.1","9.8', "line 200 opens a quote"),
        ('"1.97","0,1","0.1","9.8"', "line 200, column 'ax': '0,1'"),
    ],
)
@pytest.mark.parametrize("blank_before", [False, True])
def test_a_damaged_line_of_a_quoted_table_is_named_by_its_number(tmp_path, line, words, blank_before):
    rng = np.random.default_rng(1)
    lines = ['"t","ax","ay","az"']
    lines += [
        f'"{k / 100}","{a[0]:.4f}","{a[1]:.4f}","{a[2]:.4f}"' for k, a in enumerate(rng.normal(9.8, 0.1, (300, 3)))
    ]
    if blank_before:
        lines.insert(50, "")
    lines[199] = line
    (tmp_path / "log.csv").write_text("\n".join(lines) + "\n")
    with pytest.raises(ReadError, match=words):
        read_recording(tmp_path / "log.csv")


def test_a_log_read_in_pieces_that_becomes_shorter_is_a_sentence(tmp_path):
    path = tmp_path / "log.npy"
    for array in (np.arange(60_000.0).reshape(-1, 6), np.asfortranarray(np.arange(60_000.0).reshape(-1, 6))):
        np.save(path, array)
        log = open_chunks(path, "ax,ay,az,gx,gy,gz")
        np.testing.assert_array_equal(log.rows(10, 5000), array[10:5000])
        with path.open("r+b") as stream:
            stream.truncate(10_000)
        with pytest.raises(ReadError, match="became shorter"):
            log.rows(5000, 9000)
        path.unlink()
        with pytest.raises(ReadError, match="no such file"):
            log.rows(0, 10)


@pytest.mark.parametrize(
    ("text", "words"),
    [
        ('[session]\nkind = "hand"\nn_poses = 999999999', "a session has at most"),
        ("unit = [1]", r"s\.toml: a value is of another kind"),
        ("table_tilt_deg = [{}, 1]", r"s\.toml: a value is of another kind"),
        ("unit = inf", r"s\.toml: a value is of another kind"),
        ("a = " + "[" * 5000 + "]" * 5000, "nested too deeply"),
        (".".join("a" * 5000) + " = 1", "nested too deeply"),
        ("a = " + "{b=" * 3000 + "1" + "}" * 3000, "nested too deeply"),
    ],
)
def test_a_scenario_too_long_too_deep_or_with_a_value_of_another_kind_is_refused(tmp_path, text, words):
    (tmp_path / "s.toml").write_text(text + "\n")
    with pytest.raises(ValueError, match=words):
        read_scenario(tmp_path / "s.toml")


def deviations(_=None):
    x = np.random.default_rng(1).standard_normal((100_000, 3))
    return _core.allan_variance(x, [1, 2, 64], _core.AllanKind.Overlapping)[0]


def test_a_forked_child_computes_what_its_parent_computes():
    expected = deviations()
    with multiprocessing.get_context("fork").Pool(2) as pool:
        for got in pool.map_async(deviations, range(3)).get(30):
            np.testing.assert_array_equal(got, expected)


# Thousands of cases: benches/fuzz.py.
@pytest.mark.parametrize(
    ("attack", "count"), [("inputs.Inputs", 100), ("formats.Formats", 30), ("commands.Commands", 8)]
)
def test_mutated_files_and_command_lines_end_in_an_answer_or_a_sentence(attack, count):
    for library in ("h5py", "rosbags") if attack == "formats.Formats" else ():
        pytest.importorskip(library)  # its logs are made with these
    module, name = attack.split(".")
    # In a process of its own: one that has read a table before, as tests do, cannot fork and read.
    code = (
        f"from attacks.{module} import {name} as Attack\na = Attack(11)\n"
        f"print([(n, a.describe(n), out) for n, out in a.run_forked(range({count})) if out.startswith('FAILED')])"
    )
    path = os.pathsep.join([str(Path(__file__).parent), *(p for p in sys.path if p)])
    done = subprocess.run(
        [sys.executable, "-c", code], capture_output=True, text=True, env={**os.environ, "PYTHONPATH": path}
    )
    assert done.returncode == 0, done.stderr
    assert done.stdout.strip().splitlines()[-1] == "[]"
