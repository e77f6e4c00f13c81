"""Reports fit the terminal that shows them."""

import pytest

from trihedron.cli import main
from trihedron.report import Document, to_text
from trihedron.report.document import Facts, Paragraph, Section, Table

HEAD = ("what", "domain", "residual", "χ²/dof", "p", "model", "with the effects")
ROW = ("gravity after a move", "static-accel", "5.49 mm/s²", "7.92", "9.0e−19", "disagrees", "1.02 agrees")


def document():
    table = Table(HEAD, (ROW, ROW), "What every domain says, " + "at length, " * 12)
    facts = Facts((("a label that is far longer than half of a narrow terminal has columns", "text " * 40),))
    section = Section("Where", (table, facts, Paragraph("word " * 80)))
    return Document("A title", "a subtitle " * 12, "VERDICT: " + "words " * 40, True, (section,))


@pytest.mark.parametrize("width", [60, 80, 100, 120, 200])
def test_no_line_is_wider_than_the_terminal_and_no_cell_is_lost(width):
    text = to_text(document(), width=width)
    assert max(len(line) for line in text.splitlines()) <= width
    for cell in (*HEAD, *ROW):
        assert cell in text


def test_a_table_that_is_cut_begins_every_part_with_its_first_column():
    lines = to_text(document(), width=60).splitlines()
    # 20 columns of the first, then 12, 10 and 6; 7, 9; 16: three parts of two rows each.
    assert sum(line.startswith("what ") for line in lines) == 3
    assert sum(line.startswith("gravity after a move") for line in lines) == 6


def test_the_version_is_said_without_a_command(capsys):
    assert main(["--version"]) == 0
    assert capsys.readouterr().out.startswith("trihedron 0.")
