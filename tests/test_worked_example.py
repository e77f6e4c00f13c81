"""The worked example of the documents runs as it is printed, and ends in a scenario that passes."""

import contextlib
import io
import re
import runpy
import shlex
from pathlib import Path

from trihedron.cli import main

DOCS = Path(__file__).parents[1] / "docs"


def blocks(kind):
    text = (DOCS / "worked-example.md").read_text(encoding="utf-8")
    return re.findall(rf"^```{kind}(?: (\S+))?\n(.*?)^```$", text, flags=re.M | re.S)


def test_the_commands_of_the_worked_example_end_in_a_scenario_that_passes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")  # as the page shows it
    for name, text in blocks("toml"):
        Path(name).write_text(text, encoding="utf-8")
    said = []
    for _, command in blocks("sh"):
        words = shlex.split(command)
        assert words[0] == "trihedron"
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            status = main(words[1:])
        assert not status, command
        said.append(out.getvalue())
    assert len(said) == 6  # one that stands for the recording, and five
    promised = blocks("text")[0][1]
    assert "MISSING PHYSICS: gyro-g-sensitivity was left out" in said[2]
    assert "gyro x zero −7.86" in said[2]
    assert promised in said[3]
    assert Path("extended.json").is_file()


def test_the_same_in_python_ends_the_same_way(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    with contextlib.redirect_stdout(io.StringIO()):
        names = runpy.run_path(str(DOCS / "tutorials" / "simulation_against_recording.py"))
    assert [e.id for e in names["found"].effects] == ["gyro-g-sensitivity"]
    assert names["again"].verdict == "consistent"
