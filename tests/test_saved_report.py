"""A saved result is laid out again: the same report from its JSON, and nothing that a file may smuggle into a page."""

import json

import numpy as np
import pytest

from trihedron.cli import main
from trihedron.errors import InputError
from trihedron.records import Finding, FindingCode, Severity
from trihedron.report import to_text
from trihedron.report.chart import Bars, Chart, Level, Line, Matrix, Note, Panel, Points, Scale, Span, Sphere
from trihedron.report.document import Document, Headline, Paragraph, Picture, Section, Table
from trihedron.report.findings import findings_block
from trihedron.report.machine import json_text
from trihedron.report.page import to_html
from trihedron.report.saved import report_of, with_report


def chart():
    """A mark of every kind, with a gap in a line."""
    x, y = np.array([1.0, 2.0, 3.0]), np.array([0.5, np.nan, -1.25])
    marks = (
        Line(x, y, "a line"), Points(x, y, ["a", "b", "c"], 0.1 * x, "dots", is_across=True), Span(1.0, 2.0, "span"),
        Bars(x, y, 0.5, ["a", "b", "c"], "bars"), Level(y=0.0), Note(1.0, 0.0, "note"),
    )  # fmt: skip
    panel = Panel(Scale("x [s]", "s", limits=(0.0, 4.0)), Scale("y", names=("one", "two")), marks)
    sphere = Sphere("errors", np.eye(3), x, 3.0, ["a", "b", "c"])
    return Chart((panel, sphere, Matrix("r", ("a", "b"), np.eye(2))))


def document():
    finding = Finding(FindingCode.UNIT_DETECTED, Severity.WARNING, "seen", "cause", "action")
    table = Table(("", "value"), (("a", "1 ± 2"),), "a table")
    picture = Picture("signals", "A caption.", chart)
    sections = (
        Section("Result", (Paragraph("words"), table, picture)),
        Section("Findings", (findings_block((finding,)),)),
    )
    return Document("A title", "of a log", "Usable.", True, sections, (Headline("error", "1", "mm/s²"),), picture)


def test_a_report_comes_back_from_json_word_for_word_and_mark_for_mark():
    text = json_text(with_report({"answer": 42}, document()))
    again = report_of(json.loads(text))
    assert to_text(again) == to_text(document())
    assert to_html(again) == to_html(document())


def test_a_finding_that_warns_and_its_action_stand_below_the_verdict():
    head = to_html(document()).partition("<nav")[0]
    told = '<p class="foremost"><b class="warning">warning</b>Seen → Action'
    assert told in head.replace("seen", "Seen").replace("action", "Action")


@pytest.mark.parametrize(
    ("path", "value"),
    [
        (("sections", 0, "blocks", 2, "chart", "panels", 0, "marks", 0, "colour"), 'c1" onload="x'),
        (("sections", 0, "blocks", 2, "chart", "panels", 0, "height_px"), "1px;background:url(x)"),
        (("sections", 0, "blocks", 0, "is"), "Chart"),
        (("sections", 0, "blocks", 2, "chart", "panels", 0, "marks", 0, "x"), "1 2 three"),
        (("title",), {"a": 1}),
        (("sections",), "none"),
        (("stated_level",), "excellent"),
    ],
)
def test_what_is_of_another_kind_than_it_should_be_is_refused(path, value):
    saved = json.loads(json_text(with_report({}, document())))
    place = saved["report"]["document"]
    for key in path[:-1]:
        place = place[key]
    assert path[-1] in place if isinstance(place, dict) else True
    place[path[-1]] = value
    with pytest.raises(InputError, match="malformed"):
        report_of(saved)


@pytest.mark.parametrize("saved", [[], {}, {"report": 3}, {"report": {"version": 99}}])
def test_a_result_without_a_report_says_how_to_have_one(saved):
    with pytest.raises(InputError, match="--json FILE"):
        report_of(saved)


def test_the_command_lays_out_what_another_one_saved(tmp_path, capsys):
    made, page = tmp_path / "plan.json", tmp_path / "plan.html"
    assert main(["plan", "--json", str(made)]) == 0
    first = capsys.readouterr().out
    assert main(["report", str(made), "--report", str(page)]) == 0
    assert first.splitlines()[:3] == capsys.readouterr().out.splitlines()[:3]
    assert "trihedron plan" in page.read_text(encoding="utf-8"), "how it was made is how it was made first"
    assert main(["report", str(page)]) == 1
    assert "not a saved result" in capsys.readouterr().err
