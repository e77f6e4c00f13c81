"""What a stranger's system does to a command: closed streams, odd locales, two writers, a log that still grows."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace

import pytest

import trihedron
from small_session import G, copied, leftovers, run, started
from trihedron.documents import DocumentError, parse_json
from trihedron.read import read_recording
from written_session import usual

# C without UTF-8; an unknown locale, no home and a dumb terminal.
ENVIRONMENTS = (
    {"LC_ALL": "C", "LANG": "C", "PYTHONUTF8": "0", "PYTHONCOERCECLOCALE": "0"},
    {"LC_ALL": "xx_YY.foo", "HOME": "", "TERM": "dumb", "COLUMNS": "0"},
)


def test_the_answer_does_not_depend_on_locale_home_or_terminal(tmp_path):
    folder = copied(tmp_path)
    said = [run("segment", "log.csv", "--json", "-", cwd=folder, env=env) for env in ({}, *ENVIRONMENTS)]
    plain, *odd = (re.sub(r'"(made_at|created)": "[^"]*"', "", out) for _, out, _ in said)
    assert [status for status, _, _ in said] == [0, 0, 0]
    assert json.loads(plain)
    assert odd == [plain, plain]


@pytest.mark.skipif(os.name != "posix", reason="a shell closes the streams")
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


@pytest.mark.parametrize("options", [[], ["--force"]])
def test_of_writers_of_one_output_each_says_whether_it_wrote(tmp_path, options):
    folder = copied(tmp_path)
    line = ["convert", "log.csv", "-o", "one.csv", *options]
    writers = [started(*line, cwd=folder) for _ in range(2)]
    said = [writer.communicate(timeout=120)[1].decode() for writer in writers]
    written = [writer.returncode == 0 for writer in writers]
    assert sum(written) == (2 if options else 1)
    assert all("left alone" in text for text, wrote in zip(said, written, strict=True) if not wrote)
    assert read_recording(folder / "one.csv").n_samples == read_recording(folder / "log.csv").n_samples
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


@pytest.mark.parametrize(
    "text", ["a = " + "[" * 5000 + "]" * 5000, ".".join("a" * 5000) + " = 1", "a = " + "{b=" * 3000 + "1" + "}" * 3000]
)
def test_toml_nested_beyond_reason_is_refused(tmp_path, text):
    from trihedron.simulate.scenario_file import read_scenario

    (tmp_path / "s.toml").write_text(text + "\n")
    with pytest.raises(ValueError, match="nested too deeply"):
        read_scenario(tmp_path / "s.toml")


@pytest.mark.skipif(sys.platform != "linux", reason="names of any bytes")
def test_names_of_files_break_no_line_of_a_repr_and_those_that_are_no_text_are_spelled_out(tmp_path):
    folder = copied(tmp_path)
    log = folder / "a\nb\x1b[2J\t.csv"
    (folder / "log.csv").rename(log)
    recording = trihedron.read(log)
    calibrated, judged = trihedron.calibrate(recording, gravity_m_s2=float(G)), trihedron.check(recording)
    diagnosed = replace(usual()[2], recording=recording)
    for result in (recording, calibrated, calibrated.calibration, judged, trihedron.allan(recording), diagnosed):
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
