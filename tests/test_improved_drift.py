"""A zero that moves in a straight line: in the improved scenario it goes on as it did, and nothing is missing of it."""

import numpy as np
import pytest
import tomllib

import trihedron
from trihedron.api import driving
from trihedron.api.improving import improve
from trihedron.simulate import Scenario, diagnosed_sizes, hand_session, simulate, with_effect
from trihedron.simulate.profiles import profile_by_name

G = 9.80665
CHANGE = (0.05, -0.08, 0.06)


@pytest.mark.slow
def test_a_straight_drift_is_carried_into_the_improved_scenario(tmp_path, monkeypatch):
    profile = profile_by_name("mpu")
    accel, gyro = profile.unit(4)
    base = Scenario(hand_session(26, pose_s=3.0, layout=5), "unit", accel, gyro, profile.clock)
    length_s = float(simulate(base, 3)[0].duration_s)
    flawed = with_effect(base, "accel-bias-drift", change=CHANGE, length_s=length_s)
    recording = simulate(flawed, 3)[0]
    given, better = tmp_path / "ideal.toml", tmp_path / "better.toml"
    given.write_text('name = "ideal"\nprofile = "ideal"\n\n[session]\nkind = "hand"\n')
    monkeypatch.setattr(driving, "N_SEEDS", 2)
    found = trihedron.diagnose(recording, against=given, gravity_m_s2=G)
    drift = next(e for e in found.effects if e.id == "accel-bias-drift")
    improvement = improve(given, found)
    assert "accel-bias-drift" not in improvement.left_out
    better.write_text(improvement.text)
    table = next(e for e in tomllib.loads(better.read_text())["effect"] if e["id"] == "accel-bias-drift")
    assert drift.model["variant"] == "line"
    assert table["length_s"] == pytest.approx(length_s, rel=0.01)
    sigma = [p.std for p in drift.parameters if p.name.startswith("drift_")]
    assert np.abs((np.array(table["change"]) - CHANGE) / sigma).max() < 4.0
    again = trihedron.diagnose(recording, against=better, gravity_m_s2=G)
    assert not {e.id for e in again.effects} & {"accel-bias-drift", "accel-bias-repeatability"}


def test_a_straight_drift_of_a_session_whose_length_nobody_says_is_left_out():
    values = [{"name": f"drift_{axis}", "value": v} for axis, v in zip("xyz", CHANGE, strict=True)]
    effect = {"id": "accel-bias-drift", "parameters": values, "model": {"variant": "line"}}
    sizes, left_out = diagnosed_sizes([effect])
    assert not sizes
    assert "needs the length of its session" in left_out["accel-bias-drift"]
    sizes, left_out = diagnosed_sizes([effect], 200.0)
    assert sizes == [("accel-bias-drift", {"change": CHANGE, "length_s": 200.0})]
    assert not left_out
