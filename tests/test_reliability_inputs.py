"""Whatever lies behind the name of an input, a command ends in a sentence; a forked child computes or says why not."""

import gzip
import io
import multiprocessing
import os
import zipfile

import numpy as np
import pytest

from attacks.cases import Commands, Inputs
from trihedron import _core
from trihedron.documents import DocumentError, parse_json, read_text
from trihedron.files.calibration import CalibrationFileError, read_calibration
from trihedron.files.diagnosis import DiagnosisFileError, read_diagnosis
from trihedron.files.noise import NoiseFileError, read_noise
from trihedron.printable import printable, printable_json
from trihedron.read import ReadError, read_recording
from trihedron.simulate.scenario_file import read_scenario

READERS = [
    (read_calibration, CalibrationFileError),
    (read_noise, NoiseFileError),
    (read_diagnosis, DiagnosisFileError),
    (read_scenario, ValueError),
]


@pytest.mark.parametrize(("reader", "error"), READERS)
def test_what_is_no_plain_file_of_sane_size_is_refused_at_once(tmp_path, reader, error):
    pipe, large = tmp_path / "pipe", tmp_path / "large"
    os.mkfifo(pipe)
    with large.open("wb") as stream:
        stream.truncate(10**9)
    for path, words in ((pipe, "plain file"), ("/dev/zero", "plain file"), (large, "1000 MB"), (tmp_path, "directory")):
        with pytest.raises(error, match=words):
            reader(path)


@pytest.mark.parametrize("text", ["[" * 100_000, "9" * 400, "1e999", "NaN", "[" * 70 + "]" * 70, "{", '"'])
@pytest.mark.parametrize(("reader", "error"), READERS)
def test_depth_and_numbers_beyond_any_document_are_refused(tmp_path, reader, error, text):
    path = tmp_path / "x.json"
    path.write_text(text)
    with pytest.raises(error):
        reader(path)


def test_numbers_and_depth_of_ours_are_taken():
    assert parse_json('{"a": [1, -2.5e-300, true, null, "x"]}') == {"a": [1, -2.5e-300, True, None, "x"]}
    with pytest.raises(DocumentError, match="400 digits"):
        parse_json("9" * 400)


def test_a_name_that_cannot_be_opened_is_a_sentence(tmp_path):
    for name in ("n" * 300, "a\0b", tmp_path / "none"):
        with pytest.raises(DocumentError):
            read_text(name, "calibration file")


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
    with gzip.open(bomb, "wb", compresslevel=9) as stream:
        stream.write(b"t,ax,ay,az\n")
        for _ in range(12):
            stream.write(b"1,2,3,4\n" * (1 << 20))
    with pytest.raises(ReadError, match="which no log does"):
        read_recording(bomb)
    archive = tmp_path / "bomb.npz"
    buffer = io.BytesIO()
    np.save(buffer, np.zeros((2_000_000, 8)))
    with zipfile.ZipFile(archive, "w", zipfile.ZIP_DEFLATED) as made:
        made.writestr("data.npy", buffer.getvalue())
    with pytest.raises(ReadError, match="which no log does"):
        read_recording(archive)


def test_escapes_of_a_terminal_are_spelled_out():
    assert printable("a\x1b[2J\x9b\u202eb\n\t") == "a\\x1b[2J\\x9b\\u202eb\n\t"
    assert printable_json('"\x9b"') == '"\\u009b"'


# Fork


def _allan(_=None):
    x = np.random.default_rng(1).standard_normal((100_000, 3))
    return _core.allan_variance(x, [1, 2, 64], _core.AllanKind.Overlapping)[0]


def test_a_forked_child_computes_what_its_parent_computes():
    expected = _allan()
    with multiprocessing.get_context("fork").Pool(2) as pool:
        for got in pool.map_async(_allan, range(3)).get(30):
            np.testing.assert_array_equal(got, expected)


# The attack, a short part of it


def test_mutated_inputs_are_taken_or_refused_in_a_sentence():
    attack = Inputs(11)
    failed = [(n, attack.describe(n), out) for n, out in attack.run_forked(range(300)) if out.startswith("FAILED")]
    assert failed == []


def test_command_lines_end_with_a_status_and_a_sentence():
    attack = Commands(11)
    failed = [(n, attack.describe(n), out) for n, out in attack.run_forked(range(40)) if out.startswith("FAILED")]
    assert failed == []


@pytest.mark.parametrize("words", [["calibrate", "LOG", "--faces", "inf"], ["plan", "--gyro-noise", "1e-300"]])
def test_what_the_attack_found_stays_mended(words, capsys):
    from small_session import made_once
    from trihedron.cli import main

    assert main([str(made_once() / "log.csv") if w == "LOG" else w for w in words]) == 1
    assert "internal error" not in capsys.readouterr().err
