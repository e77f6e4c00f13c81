"""One sentence for every question that the command line cannot answer, and nothing written."""

import json
from dataclasses import replace

import numpy as np
import pytest

from trihedron.cli import main
from trihedron.records import Recording
from trihedron.simulate import Motion, MoveTo, Pose
from written_session import G, log_text, recording, rejected, session, simulated

__all__ = ["recording", "session"]


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["calibrat", "x.csv"], "Did you mean 'calibrate'"),
        (["calibrate", "--gravty", "9.8", "x.csv"], "--gravity"),
        (["calibrate"], "no log was named"),
        (["calibrate", "x.csv", "--method", "magic"], "joint, separate, faces"),
        (["calibrate", "x.csv", "--frame", "upper"], "lower, symmetric, case"),
        (["calibrate", "x.csv", "--gravity", "heavy"], "number"),
        (["calibrate", "x.csv", "--faces", "1,two"], "--faces"),
        (["calibrate", "x.csv", "--axis-signs", "++"], "three signs"),
        (["calibrate", "x.csv", "--report", "r.docx"], ".html, .txt or .json"),
        (["export", "x.json"], "--to"),
        (["segment", "a.csv", "b.csv"], "--accel F --gyro F"),
        (["diagnose", "a.csv", "b.csv", "--calibration", "c.json"], "without a model"),
        (["check", "a.csv", "b.csv"], "once for each log"),
    ],
)
def test_a_slip_of_the_pen_is_answered_with_what_there_is(capsys, arguments, said):
    assert said in rejected(capsys, *arguments)


def test_an_output_that_exists_is_refused_before_the_work_and_left_as_it_was(session, tmp_path, capsys):
    kept = tmp_path / "kept.json"
    kept.write_text("precious")
    for option in ("-o", "--json", "--report"):
        assert "left alone" in rejected(capsys, "calibrate", session / "log.csv", option, kept)
        assert kept.read_text() == "precious"
    assert main(["calibrate", str(session / "log.csv"), "--gravity", G, "-o", str(kept), "--force"]) == 0
    assert json.loads(kept.read_text())["format_version"] == 1


def test_units_that_a_calibration_does_not_map_are_refused(session, recording, tmp_path, capsys):
    other = tmp_path / "si.csv"
    in_si = replace(recording, accelerometer=recording.accelerometer * 6e-4, gyroscope=recording.gyroscope * 1.3e-4)
    other.write_text(log_text(in_si))
    for command in ("apply", "verify"):
        assert "maps counts" in rejected(capsys, command, session / "c.json", other)


def test_gravity_said_twice_or_by_height_alone_is_refused(session, capsys):
    log = session / "log.csv"
    assert "given twice" in rejected(capsys, "calibrate", log, "--gravity", G, "--latitude", "50")
    assert "--latitude" in rejected(capsys, "calibrate", log, "--height", "100")
    assert "latitude" in rejected(capsys, "calibrate", log, "--latitude", "95")
    # The log is in counts, in which no gravity is implausible by its readings.
    for another_unit in ("980", "98", "1"):
        assert "m/s²" in rejected(capsys, "calibrate", log, "--gravity", another_unit)


def test_too_few_poses_and_a_log_that_never_rests_are_refused_with_the_remedy(tmp_path, capsys):
    two = tmp_path / "two.csv"
    two.write_text(log_text(simulated(Motion((Pose(5.0), MoveTo((1.0, 0.0, 0.0), 2.0), Pose(5.0))))))
    said = rejected(capsys, "calibrate", two)
    assert "two.csv" in said
    assert "poses" in said
    time_s = np.arange(1500) / 100.0
    swing = 9.8 * np.sin(np.outer(time_s, [2.1, 3.3, 4.7])) + np.random.default_rng(1).normal(size=(1500, 3))
    moving = Recording(time_s, swing, 2.0 * np.cos(np.outer(time_s, [2.1, 3.3, 4.7])), 100.0)
    shaken = tmp_path / "shaken.csv"
    shaken.write_text(log_text(moving))
    assert "still" in rejected(capsys, "calibrate", shaken)
    assert main(["check", str(shaken)]) == 2
    assert "NOT FIT" in capsys.readouterr().out
