"""A saved result is laid out again: the same report from its JSON, as text that fits its terminal, as a page."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from functools import reduce
from operator import getitem

import numpy as np
import pytest

import trihedron
from small_session import G, rejected, simulated, usual
from trihedron.cli import COMMANDS, main
from trihedron.errors import InputError
from trihedron.records import Finding, Severity
from trihedron.records.domains import DOMAINS
from trihedron.report.calibration_charts import uncalibrated_error
from trihedron.report.chart import Bars, Chart, Level, Line, Panel, Points, Scale, Span, ticks
from trihedron.report.diagnosis import diagnosis_report
from trihedron.report.document import Document, Facts, Paragraph, Picture, Section, Table
from trihedron.report.findings import combined, findings_block
from trihedron.report.findings.wording import filled
from trihedron.report.machine import json_text
from trihedron.report.numbers import unit_with_power, with_sigma_and_power
from trihedron.report.page import to_html
from trihedron.report.saved import report_of, with_report
from trihedron.report.text import Style, to_text
from trihedron.simulate import hand_session, scenario_by_name, simulate

HEAD = ("what", "domain", "residual", "χ²/dof", "p", "model", "with the effects")
ROW = ("tilt error after a rotation", "static-accel", "5.49 mm/s²", "7.92", "9.0e−19", "disagrees", "1.02 agrees")


def chart():
    """A mark of every kind, with a gap in a line."""
    x, y = np.array([1.0, 2.0, 3.0]), np.array([0.5, np.nan, -1.25])
    marks = (
        Line(x, y, "a line"), Points(x, y, ["a", "b", "c"], 0.1 * x, "dots", is_across=True), Span(1.0, 2.0, "span"),
        Bars(x, y, 0.5, ["a", "b", "c"], "bars"), Level(y=0.0),
    )  # fmt: skip
    panel = Panel(Scale("x [s]", "s", limits=(0.0, 4.0)), Scale("y", names=("one", "two")), marks)
    return Chart((panel, replace(panel, is_map=True)))


def document():
    finding = Finding("unit-detected", Severity.WARNING, "seen", "cause", "action")
    table = Table(("", "value"), (("a", "1 ± 2"),), "a table")
    picture = Picture("signals", "A caption.", chart)
    sections = (
        Section("Result", (Paragraph("words"), table, picture)),
        Section("Findings", (findings_block((finding,)),)),
    )
    return Document("A title", "of a log", "Usable.", sections, picture)


def test_a_report_comes_back_from_json_word_for_word_and_mark_for_mark():
    text = json_text(with_report({"answer": 42}, document()))
    again = report_of(json.loads(text))
    assert to_text(again) == to_text(document())
    assert to_html(again) == to_html(document())


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
    place = reduce(getitem, path[:-1], saved["report"]["document"])
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
    assert "not a saved result" in rejected(capsys, "report", page)


def test_a_domain_agrees_exactly_up_to_the_limit_of_its_figure_and_is_never_named_by_its_id():
    _, _, found = usual()
    judged = [one for one in found.domains if one.limit is not None]
    assert {one.domain for one in judged} >= {"static-accel", "moves", "dynamics"}
    assert not re.search("|".join(name for name in DOMAINS if "-" in name), to_text(diagnosis_report(found)))
    assert all(one.disagrees == (one.chi2_per_dof > one.limit) for one in judged)


def test_a_bias_has_one_sign_and_one_value_in_every_report():
    recording, result, _ = usual()
    text = trihedron.report(result)
    expected = -np.linalg.solve(result.accelerometer.S, result.accelerometer.b)
    expected /= np.linalg.norm(np.linalg.inv(result.accelerometer.S), axis=1)
    # The error before the calibration stands beside the one after it as the figure has it.
    error = uncalibrated_error(result.calibration, result.segments.accelerometer_mean)
    before = re.search(r"^ *before calibration +(\S+) mm/s²", text, re.MULTILINE)
    assert float(before[1]) == pytest.approx(1e3 * np.sqrt(np.mean(error**2)), rel=5e-3)
    line = re.search(r"^bias +X (\S+) ± (\S+?), Y", text, re.MULTILINE)
    # The figure is printed to two digits of its uncertainty, in mm/s².
    assert abs(float(line[1].replace("−", "-")) - 1000.0 * expected[0]) < float(line[2])
    other = simulated(hand_session(n_poses=14, pose_s=2.0, move_s=1.0), seed=4)
    several = trihedron.calibrate_sessions([recording, other], gravity_m_s2=float(G))
    biases = (one for one in several.model.repeated if one.parameter.id == "accel-bias")
    common = next(one for one in biases if one.parameter.name == "x")
    # Two sessions of one simulated unit: their common bias is that of the first within both uncertainties.
    assert abs(common.value - expected[0]) < 5.0 * common.std
    again = trihedron.diagnose(recording, calibration=result)
    given = next(one for one in again.parameters if (one.id, one.name) == ("accel-bias", "x"))
    assert given.model == pytest.approx(expected[0], abs=1e-9)


@pytest.mark.parametrize("shift_deg_s", [0.0, 0.1])
def test_verify_and_diagnose_judge_the_bias_of_another_session_alike(shift_deg_s):
    # The bias of this unit changes by 6 σ of both calibrations between these sessions: 1/f noise, and no fault.
    motions = (hand_session(n_poses=n, pose_s=3.0, move_s=2.5, first_pose_s=5.0) for n in (24, 18))
    scenarios = (replace(scenario_by_name("hand-session"), motion=motion) for motion in motions)
    first, second = (simulate(scenario, seed)[0] for scenario, seed in zip(scenarios, (3, 9), strict=True))
    own = trihedron.calibrate(first, gravity_m_s2=9.80665).calibration
    known = replace(own, gyroscope=replace(own.gyroscope, b=own.gyroscope.b + np.radians(shift_deg_s)))
    shifts = [one for one in trihedron.verify(known, second).findings if one.code == "calibration-shift"]
    against = trihedron.diagnose(second, calibration=known)
    assert bool(shifts) == any(one.significant for one in against.parameters if one.id == "gyro-bias")
    assert bool(shifts) == (shift_deg_s > 0.0)
    assert all("°/s" in one.seen for one in shifts)


@pytest.mark.parametrize("low", [0.0031, 0.31, 5.1])
@pytest.mark.parametrize("factor", [2.1, 3.0, 30.0])
def test_a_logarithmic_axis_has_two_figures_to_read_a_scale_from(low, factor):
    named = [word for _, word in ticks(low, factor * low, is_log=True) if word]
    assert 2 <= len(named) <= 8


def test_small_numbers_have_one_notation_in_tables_and_sentences():
    assert with_sigma_and_power(8.804e-5, 1.3e-7) == "(8.804 ± 0.013)e−5"
    assert filled("K < {limit:.2g} {unit:unit}/√s.", {"limit": 7.3e-5, "unit": "m/s^2"}, {}) == "K < 7.3e−5 m/s²/√s."
    axes = ("gyro X: 1 in 60 s.", "gyro X: 2 in 540 s.", "gyro Y: 3 in 61 s.", "gyro Y: 4 in 541 s.")
    of_each = "Gyro X and Y: 1 to 3 in 60 to 61 s. Gyro X and Y: 2 to 4 in 540 to 541 s."
    for some, said in ((("K is 7.3e−5 m/s².", "K is 1.2e−4 m/s²."), "K is 7.3e−5 to 1.2e−4 m/s²."), (axes, of_each)):
        assert combined(Finding("unit-detected", Severity.NOTE, one, "", "") for one in some)[0].seen == said
    # A power of ten is a prefix where the unit takes one.
    for exponent, unit, printed in ((-6, "m", "µm"), (-3, "rad/s", "mrad/s"), (-6, "s²/m", "10⁻⁶ s²/m"), (0, "s", "s")):
        assert unit_with_power(exponent, unit) == printed
    assert unit_with_power(-3, "") == "10⁻³"


@pytest.mark.parametrize("width", [60, 80, 200])
def test_no_line_is_wider_than_the_terminal_and_no_cell_is_lost(width):
    table = Table(HEAD, (ROW, ROW), "What every domain says, " + "at length, " * 12)
    facts = Facts((("a label that is far longer than half of a narrow terminal has columns", "text " * 40),))
    section = Section("Where", (table, facts, Paragraph("word " * 80)))
    long = Document("A title", "a subtitle " * 12, "VERDICT: " + "words " * 40, (section,))
    text = to_text(long, width=width)
    assert max(len(line) for line in text.splitlines()) <= width
    # Heads, and names of rows, may stand on several lines.
    said = text.split()
    for cell in (*HEAD, *ROW):
        assert all(word in said for word in cell.split())
    for cell in ROW[1:]:
        assert cell in text


def test_names_from_a_log_steer_no_terminal_and_stay_one_line_of_a_page():
    hostile = Document("t", "log\x1b[2J.csv", "v", (Section("S", (Paragraph("a\x9bb"),)),))
    assert not re.search("[\x00-\x09\x0b-\x1f\x7f-\x9f]", to_text(hostile, style=Style(80)))
    sections = (Section("Poses of a\nb", ()),)
    page = to_html(Document("a\nb\x1b.csv", "/logs/a\nNOT TO BE TRUSTED\t.csv", "v", sections))
    assert r"/logs/a\nNOT TO BE TRUSTED\t.csv" in page
    assert "a\nNOT TO BE" not in page
    assert not re.search("a\nb|[\x00-\x09\x0b-\x1f\x7f-\x9f]", page)


def test_a_pipe_gets_no_colour_columns_are_obeyed_and_it_is_utf_8():
    known = {k: v for k, v in os.environ.items() if k not in ("COLUMNS", "NO_COLOR", "PYTHONUTF8", "LC_ALL")}
    known |= {"COLUMNS": "64", "PYTHONIOENCODING": "cp1252"}
    done = subprocess.run([sys.executable, "-m", "trihedron", "plan"], env=known, capture_output=True, check=True)
    out = done.stdout.decode("utf-8")
    assert "°/s/√Hz" in out
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
