"""The next step of a report is a command that can be copied, and figures in sample do not lead."""

import re
import shlex
from dataclasses import replace
from pathlib import Path
from types import SimpleNamespace

import pytest

from small_session import made_once
from trihedron.cli import main
from trihedron.cli.options import GravitySource, LogSource
from trihedron.cli.run import (
    again,
    begin,
    note_excluded,
    note_file,
    note_log,
    note_place,
    note_reference,
    with_arguments,
)
from trihedron.estimate.accelerometer.verdict import residual_findings
from trihedron.files.calibration import read_calibration
from trihedron.records import Finding, FindingCode, Severity
from trihedron.report import Document, to_text
from trihedron.report.calibration import calibration_report
from trihedron.report.diagnosis_words import next_step_in_words
from trihedron.report.document import FindingList, Section


@pytest.fixture(autouse=True)
def run():
    """A run on a log whose name has a space, at a stated rate and latitude."""
    begin(("calibrate", "my log.csv", "--rate", "50", "--report", "page.html", "--full", "--latitude", "59.9"))
    note_log(LogSource(log=Path("my log.csv"), rate=50.0))
    note_place(GravitySource(latitude=59.9))
    yield
    begin(())


def filled(step):
    return with_arguments(Document("A title", "", "OK.", True, next_step=step)).next_step


def test_a_command_of_the_next_step_names_the_log_its_rate_and_the_calibration():
    note_file(Path("cal.json"))
    said = filled("Test it: `trihedron verify FILE OTHER_LOG`; use it: `trihedron apply FILE LOG`.")
    assert said == (
        "Test it: `trihedron verify cal.json OTHER_LOG`; use it: `trihedron apply cal.json 'my log.csv' --rate 50`."
    )


def test_the_place_goes_to_commands_that_take_it():
    said = filled("`trihedron diagnose LOG`, `trihedron segment LOG`")
    assert (
        said
        == "`trihedron diagnose 'my log.csv' --rate 50 --latitude 59.9`, `trihedron segment 'my log.csv' --rate 50`"
    )


def test_a_reference_goes_to_commands_that_take_it():
    note_reference(Path("motion.csv"))
    said = filled("`trihedron calibrate LOG`, `trihedron segment LOG`")
    assert "calibrate 'my log.csv' --rate 50 --reference motion.csv --latitude 59.9`" in said
    assert "segment 'my log.csv' --rate 50`" in said


def test_a_calibration_that_was_not_written_is_stored_first():
    said = filled("Use it: `trihedron apply FILE LOG`.")
    assert said.startswith(
        "Store it (`trihedron calibrate 'my log.csv' --rate 50 --latitude 59.9 -o calibration.json`)."
    )
    assert "`trihedron apply calibration.json 'my log.csv' --rate 50`" in said


def test_what_is_stored_with_effects_is_not_replaced_by_the_calibration_without_them():
    found = Finding(FindingCode.GYRO_G_SENSITIVITY, Severity.WARNING, "Seen.", "", "Calibrate with --extended.")
    sections = (Section("Findings", (FindingList((found,)),)),)
    used = "Use it: `trihedron apply FILE LOG`."
    said = with_arguments(Document("A title", "", "Usable.", True, sections, next_step=used)).next_step
    assert said.count("-o calibration.json") == 1
    assert "--extended -o calibration.json`" in said


def test_the_command_that_a_simulation_of_turns_suggests_gives_a_calibration_without_problems(tmp_path, capsys):
    log, report = tmp_path / "log.csv", tmp_path / "report.txt"
    assert main(["simulate", "table-turns", "-o", str(log), "--report", str(report)]) == 0
    command = re.search(r"`(trihedron calibrate [^`]*)`", " ".join(report.read_text().split()))[1]
    capsys.readouterr()
    assert main([*shlex.split(command)[1:-1], str(tmp_path / "calibration.json")]) == 0
    assert "OK: no problems found." in capsys.readouterr().out


def test_words_outside_commands_stay_and_a_second_filling_changes_nothing():
    step = "Record a LOG again ..."
    assert filled(step) == step
    once = filled("`... --to kalibr`")
    assert once == "`trihedron calibrate 'my log.csv' --rate 50 --latitude 59.9 --to kalibr`"
    assert filled(once) == once


def test_outputs_are_not_repeated():
    assert again(("noise", "a.csv", "--json=r.json", "--report", "r.html", "--force", "--rate=9")) == (
        "trihedron noise a.csv --rate=9"
    )


def test_a_command_is_not_broken_where_it_fits_a_line():
    step = "Words before it that fill most of the first line of this terminal: `trihedron apply cal.json log.csv`."
    lines = to_text(Document("A title", "", "OK.", True, next_step=step), width=80).splitlines()
    assert any("`trihedron apply cal.json log.csv`." in line for line in lines)


def test_an_error_in_sample_stands_below_what_is_uncertain():
    calibrated = read_calibration(made_once() / "c.json")

    def order(calibration):
        return [one.what for one in calibration_report(calibration).headlines]

    accelerometer = calibrated.accelerometer
    unseen = replace(accelerometer.quality, held_out=None, held_out_sigma=None, held_out_rms=None)
    assert order(calibrated)[0] == "gravity error in static poses"
    bare = replace(calibrated, accelerometer=replace(accelerometer, quality=unseen))
    assert order(bare)[-1] == "gravity error in static poses"
    assert "in sample only" in calibration_report(bare).headlines[-1].beside


def test_cross_validated_errors_are_in_a_verdict_with_warnings_with_the_value_of_its_headline():
    calibrated = read_calibration(made_once() / "c.json")
    quality = calibrated.accelerometer.quality
    worse = replace(quality, held_out_rms=8.7 * quality.floor)
    (finding,) = residual_findings(100.0 * quality.dof, worse)
    bad = replace(calibrated, accelerometer=replace(calibrated.accelerometer, quality=worse), findings=(finding,))
    document = calibration_report(bad)
    for said in (document.verdict, finding.seen):
        assert "8.7 times the noise" in said
    assert f"{document.headlines[0].value} mm/s² rms cross-validated" in finding.seen
    assert "times the noise" in calibration_report(calibrated).verdict
    assert "times the noise" not in calibration_report(replace(calibrated, findings=())).verdict


@pytest.mark.parametrize(
    ("code", "severity", "said"),
    [
        (FindingCode.COLUMNS_ASSUMED, Severity.SERIOUS, "Add poses."),
        (FindingCode.COLUMNS_ASSUMED, Severity.WARNING, "Add poses. Then: store it."),
        (
            FindingCode.WEAKLY_OBSERVABLE,
            Severity.WARNING,
            "Add poses. Record a new log with them, then: `... NEW_LOG`.",
        ),
        (FindingCode.SPECTRUM_LOW_PASS, Severity.WARNING, "Store it."),
        (FindingCode.WEAKLY_OBSERVABLE, Severity.NOTE, "Store it."),
    ],
)
def test_a_warning_about_the_whole_result_is_acted_on_before_the_result_is_used(code, severity, said):
    sections = (Section("Findings", (FindingList((Finding(code, severity, "Seen.", "", "add poses."),)),)),)
    document = Document("A title", "", "Usable.", severity is not Severity.SERIOUS, sections, next_step="Store it.")
    assert document.what_next == said
    assert document.level == {"serious": "bad", "warning": "usable", "note": "good"}[severity.value]


def test_motion_that_is_missing_is_recorded_in_a_new_log_for_the_same_command_which_replaces_its_file():
    begin(("calibrate", "my log.csv", "--rate", "50", "--json", "r.json", "-o", "cal.json"))
    note_log(LogSource(log=Path("my log.csv"), rate=50.0))
    assert filled("`... NEW_LOG`") == "`trihedron calibrate NEW_LOG --rate 50 -o cal.json --force`"
    begin(("calibrate", "a.csv", "b.csv", "--rate", "50"))
    for name in ("a.csv", "b.csv"):
        note_log(LogSource(log=Path(name), rate=50.0))
    assert filled("`... NEW_LOG`") == "`trihedron calibrate NEW_LOG_1 NEW_LOG_2 --rate 50`"


def test_several_logs_are_all_named_in_a_command_of_another_verb():
    begin(("diagnose", "one.csv", "two.csv", "--alpha", "0.02", "--gravity", "9.8", "--json", "out.json"))
    said = filled("Calibrate: `trihedron calibrate ... -o calibration.json`.")
    assert said == "Calibrate: `trihedron calibrate one.csv two.csv --gravity 9.8 -o calibration.json`."


def test_a_model_that_agrees_is_kept_and_a_log_by_itself_is_calibrated():
    found = SimpleNamespace(verdict="consistent", parameters=(1,))
    assert "Keep using model.json" in next_step_in_words(found, "model.json")
    found.parameters = ()
    assert "trihedron calibrate LOG" in next_step_in_words(found)


def test_poses_to_add_come_before_effects_and_effects_of_one_session_are_not_stored():
    weak = Finding(FindingCode.NOT_OBSERVABLE, Severity.SERIOUS, "Seen.", "", "Add poses.")
    effect = SimpleNamespace(id="disturbed-pose", confounded_with=(), model={"applies_to_other_recordings": False})
    found = SimpleNamespace(verdict="missing-physics", parameters=(), effects=(effect,), domains=(), remaining=())
    assert "--extended" not in next_step_in_words(found)
    effect.model = {"applies_to_other_recordings": True}
    assert "--extended" in next_step_in_words(found)
    found.calibration = SimpleNamespace(findings=(weak,))
    assert next_step_in_words(found).startswith("Add poses.")


def test_what_the_effects_explain_of_the_linear_fit_is_not_the_next_step():
    lost = Finding(FindingCode.LOSSES_POSSIBLE, Severity.SERIOUS, "Seen.", "", "Record again.")
    effect = SimpleNamespace(id="gyro-g-sensitivity", confounded_with=(), model={"applies_to_other_recordings": True})
    moves = SimpleNamespace(domain="moves", disagrees=False)
    found = SimpleNamespace(
        verdict="missing-physics", parameters=(), effects=(effect,), remaining=(moves,),
        domains=(SimpleNamespace(domain="moves", disagrees=True),), calibration=SimpleNamespace(findings=(lost,)),
    )  # fmt: skip
    assert "--extended" in next_step_in_words(found)
    assert "without effects are not to be trusted" in next_step_in_words(found)
    moves.disagrees = True
    assert next_step_in_words(found) == "Record again."


def test_what_differs_from_a_ready_made_scenario_is_set_in_a_scenario_of_ones_own():
    found = SimpleNamespace(verdict="parameters-differ", parameters=(SimpleNamespace(significant=True),), effects=())
    named, own = next_step_in_words(found, "hand-session"), next_step_in_words(found, "mine.toml")
    assert named.index("--template sensor.toml") < named.index("--against sensor.toml --improved")
    assert "--template" not in own


def test_a_diagnosis_says_whether_s_and_b_may_be_used_without_its_effects():
    calibrated = read_calibration(made_once() / "c.json")
    effect = SimpleNamespace(id="quantisation", confounded_with=(), model={"applies_to_other_recordings": True})
    found = SimpleNamespace(
        verdict="missing-physics", parameters=(), effects=(effect,), calibration=calibrated, remaining=()
    )
    found.domains = (SimpleNamespace(domain="static-accel", disagrees=False),)
    assert "S and b may be used without effects" in next_step_in_words(found)
    found.domains[0].disagrees = True
    (line,) = (one for one in calibration_report(calibrated).headlines if one.what == "gravity error in static poses")
    assert f"gravity error in static poses {line.value} mm/s²" in next_step_in_words(found)


def test_a_calibration_file_that_is_printed_again_is_not_stored_again(capsys):
    path = made_once() / "c.json"
    assert main(["report", str(path)]) in (0, 2)
    said = capsys.readouterr().out
    assert f"trihedron verify {path}" in " ".join(said.split())
    assert "Store it" not in said


def test_a_log_that_was_excluded_is_not_in_the_next_command():
    begin(("calibrate", "bad.csv", "good.csv", "fine.csv", "--latitude", "59.9"))
    logs = [LogSource(log=Path(name)) for name in ("bad.csv", "good.csv", "fine.csv")]
    note_log(logs[0])
    note_excluded(["bad.csv"], logs)
    said = filled("Store it: `... -o calibration.json`; use it: `trihedron apply FILE LOG`.")
    assert "trihedron calibrate good.csv fine.csv --latitude 59.9" in said
    assert "calibration.json good.csv`" in said
