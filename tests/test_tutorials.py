"""Every command and every line of Python that a tutorial shows is run, in order, in an empty folder."""

import re
import shlex
from pathlib import Path

import matplotlib as mpl
import pytest

from trihedron.cli import main

mpl.use("Agg")

FOLDER = Path(__file__).parents[1] / "docs" / "tutorials"
TUTORIALS = sorted(FOLDER.glob("*.md"))

# A block may say what its last command returns: ```sh exit=2. Blocks of a real board or a real log are ```sh not-run.
BLOCK = re.compile(r"^```(sh|python)( [^\n]*)?\n(.*?)^```", re.M | re.S)


def blocks(path):
    for language, words, body in BLOCK.findall(path.read_text(encoding="utf-8")):
        if "not-run" not in words:
            yield language, int(next(iter(re.findall(r"exit=(\d)", words)), 0)), body


def commands(body):
    for line in body.replace("\\\n", " ").splitlines():
        words = shlex.split(line, comments=True)
        if words:
            assert words[0] == "trihedron", f"a tutorial shows a command that is not run here: {line}"
            yield words[1:]


@pytest.mark.parametrize("path", TUTORIALS, ids=[path.stem for path in TUTORIALS])
def test_what_the_tutorial_shows_runs_as_shown(path, tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    names = {}
    n_run = 0
    for language, status, body in blocks(path):
        if language == "python":
            exec(compile(body, path.name, "exec"), names)
            n_run += 1
            continue
        shown = list(commands(body))
        for i, words in enumerate(shown):
            got = main(words)
            said = capsys.readouterr()
            expected = status if i == len(shown) - 1 else 0
            assert got == expected, f"trihedron {shlex.join(words)}\n{said.out}\n{said.err}"
            n_run += 1
    assert n_run >= 3
    # Files that the text names as results exist.
    for name in re.findall(r"<!-- makes (\S+) -->", path.read_text(encoding="utf-8")):
        assert (tmp_path / name).stat().st_size > 0, name


def test_every_kind_of_reader_has_a_tutorial():
    assert {path.stem for path in TUTORIALS} >= {"desk", "vio", "drone", "navigation", "laboratory"}
