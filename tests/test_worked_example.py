"""The worked example of the documents runs as it is printed, and ends in a scenario that passes."""

import contextlib
import io
import re
import shlex
from pathlib import Path

import pytest

from documented import DOCS, blocks
from trihedron.cli import main
from trihedron.report.diagnosis import diagnosis_report
from trihedron.report.page import to_html

PAGE = DOCS / "worked-example.md"


def shown(language):
    return [block for block in blocks(PAGE) if block.language == language]


@pytest.mark.slow
def test_the_commands_of_the_worked_example_end_in_a_scenario_that_passes(tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    monkeypatch.setenv("COLUMNS", "100")  # as the page shows it
    for block in shown("toml"):
        Path(block.said).write_text(block.text, encoding="utf-8")
    said = []
    for block in shown("sh"):
        words = shlex.split(block.text)
        assert words[0] == "trihedron"
        out = io.StringIO()
        with contextlib.redirect_stdout(out):
            status = main(words[1:])
        assert not status, block.text
        said.append(out.getvalue())
    assert len(said) == 6  # one that represents the recording, and five
    promised = shown("text")[0].text
    assert "MISSING PHYSICS: gyro g-sensitivity is missing" in said[2]
    assert "gyro bias X −7.86" in said[2]
    assert promised in said[3]
    assert Path("extended.json").is_file()


SHORTER = "n_poses = 12\\npose_s = 4\\n"


@pytest.fixture(scope="module")
def names(tmp_path_factory, without_corners):  # noqa: ARG001
    """What the script leaves, its sessions shorter than they are printed."""
    script = (DOCS / "tutorials" / "simulation_against_recording.py").read_text(encoding="utf-8")
    session = 'kind = "hand"\\n'
    assert script.count(session) == 2
    script = script.replace(session, session + SHORTER)
    left = {}
    with (
        contextlib.chdir(tmp_path_factory.mktemp("tutorial")),
        contextlib.redirect_stdout(io.StringIO()),
        pytest.MonkeyPatch.context() as patch,
    ):
        # Improved scenarios are aimed by two simulations and not by eight.
        patch.setattr("trihedron.api.driving.N_SEEDS", 2)
        exec(compile(script, "simulation_against_recording.py", "exec"), left)
    return left


def test_the_same_in_python_ends_the_same_way(names):
    assert [e.id for e in names["found"].effects] == ["gyro-g-sensitivity"]
    assert names["again"].verdict == "consistent"


def test_an_ideal_sensor_in_si_is_held_against_counts_at_their_own_mean_scale(names):
    found = names["found"]
    as_given = {seen.domain: seen.rms for seen in found.stages[0].domains}
    # Zeros of 0.35 m/s² and scales 1.4 % apart; counts taken for m/s² would be 16000 m/s² wrong.
    assert 0.05 < as_given["static-accel"] < 0.5
    assert as_given["moves"] < 10.0
    page = to_html(diagnosis_report(found))
    low = [float(v) for v in re.findall(r'data-y="(\S+) \S+" data-ux="m/s²" data-uy="°/s"', page)]
    # 0.3 · 10⁻³ (rad/s)/(m/s²) times 10.6 m/s² is 0.18 °/s.
    assert len(low) == 3
    assert 0.1 < -min(low) < 0.3
