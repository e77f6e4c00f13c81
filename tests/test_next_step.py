"""The next step of a report is a command that can be copied, and figures in sample do not lead."""

import re
import shlex
from pathlib import Path
from types import SimpleNamespace

import pytest

from trihedron.cli import main
from trihedron.cli import run as now
from trihedron.cli.options import GravitySource, LogSource
from trihedron.records import Finding, Severity
from trihedron.report.diagnosis_next_step import next_step_in_words
from trihedron.report.document import Document, FindingList, Section

MY_LOG = "'my log.csv' --rate 50"
DISAGREES = SimpleNamespace(domain="moves", disagrees=True)


@pytest.fixture(autouse=True)
def run():
    """A run on a log whose name has a space, at a stated rate and latitude."""
    now.begin(("calibrate", "my log.csv", "--rate", "50", "--report", "page.html", "--full", "--latitude", "59.9"))
    now.note_log(LogSource(log=Path("my log.csv"), rate=50.0))
    now.note_place(GravitySource(latitude=59.9))
    yield
    now.begin(())


def found_with(effect_id, *, is_of_unit, **more):
    """A diagnosis of one effect, which belongs to the unit or to this session alone, and its effect."""
    model = {"applies_to_other_recordings": is_of_unit}
    effect = SimpleNamespace(id=effect_id, confounded_with=(), held_out=(), model=model)
    known = {"verdict": "missing-physics", "parameters": (), "effects": (effect,), "domains": (), "remaining": ()}
    return SimpleNamespace(**known | more), effect


def filled(step):
    return now.with_arguments(Document("A title", "", "OK.", next_step=step)).next_step


@pytest.mark.parametrize(
    ("notes", "step", "said"),
    [
        (
            [(now.note_file, Path("cal.json"))],
            "`trihedron verify FILE OTHER_LOG`; `trihedron apply FILE LOG`.",
            f"`trihedron verify cal.json OTHER_LOG`; `trihedron apply cal.json {MY_LOG}`.",
        ),
        # The place and a reference go to commands that take them.
        (
            [(now.note_reference, "motion.csv")],
            "`trihedron diagnose LOG`, `trihedron segment LOG`",
            f"`trihedron diagnose {MY_LOG} --reference motion.csv --latitude 59.9`, `trihedron segment {MY_LOG}`",
        ),
    ],
)
def test_a_command_of_the_next_step_names_what_was_given_where_it_is_taken(notes, step, said):
    for note, given in notes:
        note(given)
    assert filled(step) == said


def test_a_calibration_that_was_not_written_is_stored_first():
    said = filled("Use it: `trihedron apply FILE LOG`.")
    assert said.startswith("Store it: add `-o calibration.json` to this command.")
    assert f"`trihedron apply calibration.json {MY_LOG}`" in said


def test_the_command_that_a_simulation_of_turns_suggests_gives_a_calibration_that_is_trusted(tmp_path, capsys):
    log, report = tmp_path / "log.csv", tmp_path / "report.txt"
    assert main(["simulate", "table-turns", "-o", str(log), "--report", str(report)]) == 0
    # A command longer than a line is continued as a shell reads it.
    command = re.search(r"`(trihedron calibrate [^`]*)`", report.read_text().replace("\\\n", ""))[1]
    capsys.readouterr()
    assert main([*shlex.split(command)[1:-1], str(tmp_path / "calibration.json")]) == 0
    out = capsys.readouterr().out
    assert "turns by stated angles were fitted" in out
    assert "NOT TO BE TRUSTED" not in out


def test_poses_to_add_come_before_effects_and_effects_of_one_session_are_not_stored():
    weak = Finding("not-observable", Severity.SERIOUS, "Seen.", "", "Add poses.")
    found, effect = found_with("disturbed-pose", is_of_unit=False)
    assert "--extended" not in next_step_in_words(found)
    effect.model = {"applies_to_other_recordings": True}
    assert "--extended" in next_step_in_words(found)
    # What still disagrees with the effects would make their calibration untrusted.
    effect.model = {"applies_to_other_recordings": False}
    effect.id, effect.held_out = "dropped-samples", (SimpleNamespace(domain="moves"),)
    above = Finding("residual-above-noise", Severity.SERIOUS, "Seen.", "", "See `trihedron diagnose LOG`.")
    found.calibration = SimpleNamespace(findings=(above,))
    assert "--extended" in next_step_in_words(found)
    found.remaining = (DISAGREES,)
    assert "--extended" not in next_step_in_words(found)
    found.findings = (Finding("not-fit", Severity.WARNING, "Two orientations.", "", ""),)
    assert "trihedron calibrate" not in next_step_in_words(found)
    found.findings = ()
    found.calibration = SimpleNamespace(findings=(weak,))
    assert next_step_in_words(found).startswith("Add poses.")


def test_what_the_effects_explain_of_the_linear_fit_is_not_the_next_step():
    lost = Finding("losses-possible", Severity.SERIOUS, "Seen.", "", "Record again.")
    moves = SimpleNamespace(domain="moves", disagrees=False)
    own = SimpleNamespace(findings=(lost,))
    found, _ = found_with(
        "gyro-g-sensitivity", is_of_unit=True, domains=(DISAGREES,), remaining=(moves,), calibration=own
    )
    assert "--extended" in next_step_in_words(found)
    assert "without effects are not to be trusted" in next_step_in_words(found)
    moves.disagrees = True
    assert next_step_in_words(found) == "Record again."


@pytest.mark.parametrize(
    ("own_level", "first"), [("usable", "Check the sensor."), (None, "Use a firm support. Then: ")]
)
def test_the_next_step_of_a_verdict_of_its_own_answers_it_and_not_a_warning(own_level, first):
    shaken = Finding("pose-unsteady", Severity.WARNING, "Seen.", "", "Use a firm support.")
    sections = (Section("Findings", (FindingList((shaken,)),)),)
    document = Document("", "", "Other.", sections, stated_level=own_level, next_step="Check the sensor.")
    assert document.what_next.startswith(first)
