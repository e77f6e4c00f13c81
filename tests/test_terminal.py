"""Reports fit the terminal that shows them."""

import os
import re
import subprocess
import sys

import pytest

from trihedron.cli import COMMANDS, main
from trihedron.report.document import Document, Facts, Paragraph, Section, Table
from trihedron.report.page import to_html
from trihedron.report.text import Style, to_text

HEAD = ("what", "domain", "residual", "χ²/dof", "p", "model", "with the effects")
ROW = ("tilt error after a rotation", "static-accel", "5.49 mm/s²", "7.92", "9.0e−19", "disagrees", "1.02 agrees")


def document():
    table = Table(HEAD, (ROW, ROW), "What every domain says, " + "at length, " * 12)
    facts = Facts((("a label that is far longer than half of a narrow terminal has columns", "text " * 40),))
    section = Section("Where", (table, facts, Paragraph("word " * 80)))
    return Document("A title", "a subtitle " * 12, "VERDICT: " + "words " * 40, True, (section,))


@pytest.mark.parametrize("width", [60, 80, 200])
def test_no_line_is_wider_than_the_terminal_and_no_cell_is_lost(width):
    text = to_text(document(), width=width)
    assert max(len(line) for line in text.splitlines()) <= width
    # Heads, and names of rows, may stand on several lines.
    said = text.split()
    for cell in (*HEAD, *ROW):
        assert all(word in said for word in cell.split())
    for cell in ROW[1:]:
        assert cell in text


def test_names_from_a_log_steer_no_terminal_and_stay_one_line_of_a_page():
    hostile = Document("t", "log\x1b[2J.csv", "v", True, (Section("S", (Paragraph("a\x9bb"),)),))
    assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f]", to_text(hostile, style=Style(80)))
    page = to_html(
        Document("a\nb\x1b.csv", "/logs/a\nNOT TO BE TRUSTED\t.csv", "v", True, (Section("Poses of a\nb", ()),))
    )
    assert r"/logs/a\nNOT TO BE TRUSTED\t.csv" in page
    assert "a\nNOT TO BE" not in page
    assert not re.search("a\nb|[\x00-\x09\x0b-\x1f\x7f-\x9f]", page)


def run(*words, **environment):
    known = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "NO_COLOR", "PYTHONUTF8", "LC_ALL")}
    program = [sys.executable, "-m", "trihedron", *words]
    return subprocess.run(program, env=known | environment, capture_output=True, check=True).stdout


def test_a_pipe_gets_no_colour_columns_are_obeyed_and_without_utf_8_it_is_ascii():
    out = run("plan", COLUMNS="64", PYTHONIOENCODING="cp1252").decode("ascii")
    assert "deg/s/sqrt(Hz)" in out
    assert "?" not in out
    assert "\x1b" not in out
    assert max(map(len, out.splitlines())) <= 64


@pytest.mark.parametrize("command", [None, *(c.__name__ for c in COMMANDS)])
def test_help_fits_the_terminal_and_its_examples_name_real_options(command, capsys, monkeypatch):
    monkeypatch.setenv("COLUMNS", "60")
    assert main([*([] if command is None else [command]), "--help"]) == 0
    out = capsys.readouterr().out
    if command is None:
        # Whole sentences, none cut off.
        assert "..." not in out.split("\n", 1)[1].replace("B C ...", "")
    # Examples are there to be copied and are not wrapped.
    prose = [line for line in out.splitlines() if not line.lstrip().startswith(("$", "trihedron"))]
    assert max(map(len, prose)) <= 60
    for line in [line for line in out.splitlines() if line.lstrip().startswith("$ trihedron")]:
        used = line.split()[2]
        main([used, "--help"])
        known = capsys.readouterr().out
        for option in re.findall(r" (--?[a-z][a-z-]*)", line):
            assert option in known, (line, option)
