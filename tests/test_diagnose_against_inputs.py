"""What cannot be held against a recording is rejected in one sentence: which file, which place, what to do."""

from dataclasses import replace

import numpy as np

import trihedron
from small_session import G, made_once
from trihedron.api.diagnosing_with_simulation import gravity_of_scenario
from trihedron.cli import main
from trihedron.report import diagnosis_report
from trihedron.report.document import Picture
from trihedron.simulate import hand_session, scenario_by_name, simulate


def rejected(given, capsys):
    """The one sentence on stderr."""
    log = made_once() / "log.csv"
    assert main(["diagnose", str(log), "--gravity", G, "--against", str(given)]) == 1
    said = capsys.readouterr().err.strip()
    assert "Traceback" not in said
    return " ".join(said.split())


def test_a_simulated_log_that_is_none_or_holds_no_poses_is_refused(tmp_path, capsys):
    assert "no such file" in rejected(tmp_path / "absent.csv", capsys)
    belongs = "this is a trihedron calibration, no log; name it with --calibration"
    assert belongs in rejected(made_once() / "c.json", capsys)
    empty = tmp_path / "words.csv"
    empty.write_text("nothing,here\n")
    assert "words.csv" in rejected(empty, capsys)
    rng = np.random.default_rng(3)
    rows = np.column_stack([np.arange(2000) / 100.0, rng.normal([0, 0, 9.8, 0, 0, 0], 0.01, (2000, 6))])
    still = tmp_path / "still.csv"
    head = "t [s],ax [m/s^2],ay [m/s^2],az [m/s^2],gx [rad/s],gy [rad/s],gz [rad/s]\n"
    still.write_text(head + "\n".join(",".join(f"{v:.6g}" for v in row) for row in rows) + "\n")
    said = rejected(still, capsys)
    assert "the simulated recording cannot be calibrated" in said
    assert "pose" in said


def test_a_gyro_that_one_side_lacks_is_said_in_the_verdict_and_found(tmp_path, capsys):
    log, bare = made_once() / "log.csv", tmp_path / "bare.csv"
    bare.write_text("\n".join(",".join(line.split(",")[:4]) for line in log.read_text().splitlines()) + "\n")
    for recording, model, lacks in ((log, bare, "the simulated log has none"), (bare, log, "the recording has none")):
        assert main(["diagnose", str(recording), "--gravity", G, "--against", str(model), "--full"]) == 0
        said = " ".join(capsys.readouterr().out.split())
        assert "the gyro was not compared." in said
        assert lacks in said


def test_gravity_is_that_of_the_scenario_unless_given():
    """A simulation at the pole, and a log of it: with standard gravity on one side scales would differ by 0.3 %."""
    at_the_pole = replace(scenario_by_name("hand-session"), motion=hand_session(n_poses=12, pose_s=2.0, move_s=1.0))
    at_the_pole = replace(at_the_pole, environment=replace(at_the_pole.environment, gravity_m_s2=9.832))
    found = trihedron.diagnose(simulate(at_the_pole, 5)[0], against=at_the_pole)
    assert found.calibration.gravity_m_s2 == 9.832
    assert found.gravity_source == "that of the scenario"
    assert not [p for p in found.parameters if p.significant and p.id in ("accel-scale", "gravity")]
    assert gravity_of_scenario(scenario_by_name("hand-session")) is None
    # Its readings are drawn over those of the log, which a reader looks for first.
    pictures = [b.name for s in diagnosis_report(found).sections for b in s.blocks if isinstance(b, Picture)]
    assert "traces" in pictures
