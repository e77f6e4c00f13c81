"""The command line end to end: results, exit status, errors."""

import json
import subprocess
import sys
from dataclasses import replace
from pathlib import Path

import numpy as np
import pytest

from small_session import G, log_text, made_once, rejected, rows_of, simulated, usual
from trihedron import read, segment
from trihedron.cli import main
from trihedron.simulate import hand_session, scenario_by_name


@pytest.fixture
def session():
    """A folder with a good log and its calibration."""
    return made_once()


def test_calibrate_prints_a_report_and_writes_what_was_asked_for(session, tmp_path, capsys):
    page, machine = tmp_path / "r.html", tmp_path / "m.json"
    status = main(
        ["calibrate", str(session / "log.csv"), "--gravity", G, "--report", str(page), "--json", str(machine)]
    )
    out, err = capsys.readouterr()
    assert status == 0
    assert "Accelerometer: f = S a′ + b" in out
    assert "±" in out
    assert "report:" in err
    document = json.loads(machine.read_text())
    assert np.shape(document["accelerometer"]["S"]) == (3, 3)
    assert document["gravity_m_s2"] == 9.80665
    text = page.read_text()
    # Residuals by pose and before calibration, poses, moves, signals.
    # All drawn as they are read: no pictures of pictures.
    assert text.count("<figure id=") == 4
    assert "data:image" not in text
    # Self-contained: nothing is fetched; its one script is inside it.
    assert "http" not in text.replace("http-equiv", "")
    assert "<script src" not in text


@pytest.mark.parametrize("command", ["segment", "check", "calibrate", "verify", "apply"])
def test_json_on_stdout_is_json_and_nothing_else(session, tmp_path, capsys, command):
    log, known = str(session / "log.csv"), str(session / "c.json")
    more = {"calibrate": ["--gravity", G], "apply": ["-o", str(tmp_path / "x.csv")]}.get(command, [])
    first = [known] if command in ("verify", "apply") else []
    # A calibration held against its own recording is no test, and the status says so.
    assert main([command, *first, log, *more, "--json"]) == (2 if command == "verify" else 0)
    json.loads(capsys.readouterr().out)


def test_apply_writes_si_readings_that_the_tool_reads_back_at_the_norm_of_gravity(session, tmp_path):
    for name in ("out.csv", "out.parquet"):
        assert main(["apply", str(session / "c.json"), str(session / "log.csv"), "-o", str(tmp_path / name)]) == 0
        back = read(tmp_path / name)
        assert back.accelerometer_unit.value == "m/s^2"
        assert back.gyroscope_unit.value == "rad/s"
        norm = np.linalg.norm(segment(back).accelerometer_mean, axis=1)
        # Noise of a mean over 2 s at 3.9e-3 m/s²/√Hz is 2.8e-3 m/s²; five times that.
        np.testing.assert_allclose(norm, 9.80665, atol=0.014)


def test_verify_on_another_session_passes_and_a_limit_turns_the_status(session, tmp_path, capsys):
    other = tmp_path / "other.csv"
    other.write_text(log_text(rows_of(simulated(hand_session(n_poses=10, pose_s=3.0, move_s=1.5, layout=4), seed=9))))
    assert main(["verify", str(session / "c.json"), str(other)]) == 0
    assert "tilt error after a rotation" in capsys.readouterr().out
    assert main(["verify", str(session / "c.json"), str(other), "--limit-mg", "0.001"]) == 2
    assert "NOT VERIFIED" in capsys.readouterr().out


@pytest.mark.slow
@pytest.mark.usefixtures("few_simulations")
def test_the_demonstration_writes_its_files_and_never_over_others(tmp_path, monkeypatch, capsys):
    monkeypatch.chdir(tmp_path)
    assert main(["demo", "--seed", "3"]) == 0
    out = capsys.readouterr().out
    assert "Compare with the truth" in out
    assert "The drawn effect" in out
    names = {"session.csv", "second-session.csv", "calibration.json", "report.html", "verification.html", "truth.json"}
    names |= {"unit.csv", "simulation.toml", "improved.toml", "disagreement.html", "sealed.json"}
    assert {p.name for p in Path("trihedron-demo").iterdir()} == names
    assert "left alone" in rejected(capsys, "demo", "trihedron-demo")


def test_neither_the_package_nor_help_nor_calibrating_a_plain_log_loads_what_takes_longer_than_they_do(session):
    script = (
        "import sys, trihedron\nprint('LOADED', sorted({'numpy', 'scipy', 'polars', 'typer'} & set(sys.modules)))\n"
        "from trihedron.cli import main\n"
        "heavy = {'scipy', 'polars', 'matplotlib', 'jinja2', 'jsonschema'}\n"
        "main(['--help'])\n"
        "print('LOADED', sorted(heavy & set(sys.modules)))\n"
        f"main(['calibrate', {str(session / 'log.csv')!r}, '--gravity', '9.81'])\n"
        "print('LOADED', sorted({'scipy', 'polars', 'matplotlib'} & set(sys.modules)))\n"
    )
    done = subprocess.run([sys.executable, "-c", script], capture_output=True, text=True, check=True)
    assert "Calibrate" in done.stdout
    assert [line for line in done.stdout.splitlines() if "LOADED" in line] == ["LOADED []"] * 3


def test_a_reader_that_leaves_early_is_no_error(session):
    command = f"{sys.executable} -m trihedron apply {session / 'c.json'} {session / 'log.csv'} | head -1"
    done = subprocess.run(["bash", "-o", "pipefail", "-c", command], capture_output=True, text=True)
    assert done.stdout.startswith("t [s],ax [m/s^2]")
    assert "Traceback" not in done.stderr
    assert "Exception" not in done.stderr


def test_poses_that_do_not_determine_the_answer_end_with_status_two_and_poses_to_add(tmp_path, capsys):
    log = tmp_path / "log.csv"
    log.write_text(log_text(rows_of(simulated(scenario_by_name("six-faces").motion))))
    assert main(["calibrate", str(log), "--gravity", G]) == 2
    out = capsys.readouterr().out
    assert "NOT TO BE TRUSTED" in out
    assert "add poses" in out.lower()
    assert main(["check", str(log)]) == 2


@pytest.mark.parametrize(
    ("arguments", "said"),
    [
        (["calibrat", "x.csv"], "Did you mean 'calibrate'"),
        (["calibrate", "--gravty", "9.8", "x.csv"], "--gravity"),
        (["calibrate"], "no log was named"),
        (["calibrate", "x.csv", "--frame", "upper"], "lower, symmetric, case"),
        (["calibrate", "x.csv", "--faces", "1,two"], "--faces"),
        (["fleet", "", "--out", "x"], "the name of the logs is empty"),
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


def test_units_that_a_calibration_does_not_map_are_refused(session, tmp_path, capsys):
    other = tmp_path / "si.csv"
    recording = usual()[0]
    in_si = replace(recording, accelerometer=recording.accelerometer * 6e-4, gyroscope=recording.gyroscope * 1.3e-4)
    other.write_text(log_text(rows_of(in_si)))
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
