"""Ends of range in an improved scenario: carried exactly, reached again, and no physics once the scenario has them."""

import math
from dataclasses import replace
from types import SimpleNamespace

import numpy as np
import pytest
import tomllib

import trihedron
from diagnosed_session import simulated, unit_of
from trihedron.api.improving import _mean_drift, improve
from trihedron.records.channel_facts import ChannelFacts, Limit
from trihedron.simulate import Drift, diagnosed_sizes, hand_session, read_scenario, simulate
from trihedron.simulate.profiles import profile_by_name
from trihedron.simulate.twin import unclipped

pytestmark = pytest.mark.usefixtures("without_corners")
IDEAL = """# A perfect sensor.
name = "ideal"  # and a name
profile = "ideal"

[session]
kind = "hand"

[accelerometer]
b = [0, 0, 0]  # none
"""


@pytest.mark.usefixtures("few_simulations")
def test_the_ends_of_a_recordings_range_and_its_noise_are_those_of_the_improved_scenario(tmp_path):
    """Of a recording whose gyro ends at ±150 °/s of its ADC in several moves, with noise of its own."""
    unit = unit_of(hand_session(12, pose_s=2.5, move_s=1.6, layout=8), 5)
    code = round(math.radians(150.0) / unit.gyroscope.S[0][0])
    adc = replace(unit.gyroscope.adc, low=-float(code), high=float(code))
    clipped = simulate(replace(unit, gyroscope=replace(unit.gyroscope, adc=adc)), 11)[0]
    given, better = tmp_path / "ideal.toml", tmp_path / "better.toml"
    given.write_text(IDEAL)
    found = trihedron.diagnose(clipped, against=given, gravity_m_s2=9.80665)
    text = improve(given, found).text
    better.write_text(text)
    assert "gyro-saturation" in {e.id for e in found.effects}
    table = tomllib.loads(text)
    assert (table["gyroscope"]["adc"]["low"], table["gyroscope"]["adc"]["high"]) == (-code, code)
    # The ADC's, not an effect beside it; and none of the accelerometer, whose range nothing came to.
    assert "gyro-saturation" not in {e["id"] for e in table.get("effect", [])}
    assert "low" not in table["accelerometer"].get("adc", {})
    # What the scenario said of its old values is not kept; a stated bias of none is not asked about.
    assert text.startswith("# ideal.toml, with the values of a recording")
    assert "perfect" not in text
    assert "# none" not in text
    assert "# and a name" in text
    assert {p.id for p in found.parameters if p.significant} >= {"accel-bias", "gyro-bias"}
    assert not any(p.remark for p in found.parameters if p.id.endswith("bias"))
    # Three axes of the part's data sheet; 12 poses of 2.5 s know a density to some per cent.
    scenario = read_scenario(better)
    for name, own in zip(("accelerometer", "gyroscope"), profile_by_name("mpu").unit(5), strict=True):
        density = np.array(getattr(scenario, name).noise.N) * np.ones(3)
        assert density == pytest.approx(np.array(own.noise.N) * np.ones(3), rel=0.15), name


def test_a_cut_peak_is_drawn_beyond_the_limit_and_nothing_else_is_touched():
    # A triangle of 41 samples along X, cut at 80.
    x = np.zeros((81, 3))
    x[20:61, 0] = 100.0 * (1.0 - np.abs(np.arange(-20, 21)) / 20.0)
    cut = np.minimum(x, 80.0)
    at = cut[:, 0] == 80.0
    runs = np.flatnonzero(at)[[0, -1]][None] + [0, 1]
    facts = ChannelFacts(np.zeros(3), np.zeros(3), (Limit(0, 80.0, True, runs),))
    out = unclipped(cut, facts)
    assert np.array_equal(out[~at], cut[~at])
    # A cubic reaches a quarter to half as high as the tip of a triangle of its slopes, and never inside the limit.
    assert np.all(out[at, 0] >= 80.0)
    assert 82.0 < out[:, 0].max() < 100.0
    assert unclipped(x, replace(facts, limits=())) is x
    # Neither the sign nor the place of a limit matters.
    limit = facts.limits[0]
    below = replace(facts, limits=(replace(limit, value=-80.0, is_high=False),))
    np.testing.assert_allclose(unclipped(-cut, below), -unclipped(cut, facts), atol=1e-12)
    # A peak that the log begins in has no slope to be drawn with.
    begun = replace(facts, limits=(replace(limit, runs=limit.runs - limit.runs[0, 0]),))
    assert np.array_equal(unclipped(cut[limit.runs[0, 0] :], begun), cut[limit.runs[0, 0] :])


def test_a_straight_drift_of_a_session_whose_length_nobody_says_is_left_out():
    change = (0.05, -0.08, 0.06)
    values = [{"name": f"drift_{axis}", "value": v} for axis, v in zip("xyz", change, strict=True)]
    effect = {"id": "accel-bias-drift", "parameters": values, "model": {"variant": "line"}}
    sizes, left_out = diagnosed_sizes([effect])
    assert not sizes
    assert "needs the length of its session" in left_out["accel-bias-drift"]
    sizes, left_out = diagnosed_sizes([effect], 200.0)
    assert sizes == [("accel-bias-drift", {"change": change, "length_s": 200.0})]
    assert not left_out


def test_b_beside_a_warm_up_is_the_mean_of_the_session_and_a_scenario_adds_it_back():
    size = {"amplitude": (0.08, -0.1, 0.06), "tau_s": 60.0}
    recording, truth = simulated("accel-bias-drift", 5, **size)
    found = trihedron.diagnose(recording, gravity_m_s2=9.80665)
    assert "accel-bias-drift" in [one.id for one in found.effects]
    poses = found.segments
    mean = np.average(Drift(**size).at(poses.time_mid_s), axis=0, weights=poses.duration_s)
    # b of f = S a' + b takes the drift off.
    fitted = found.extended.accelerometer
    sigma = np.array(fitted["sigma_b"])
    assert np.all(np.abs(np.array(fitted["b"]) - (truth.accelerometer_b - mean)) < 4.0 * sigma)
    # The mean of the drift is far more certain than where it ends.
    assert np.all(sigma < 0.1 * np.abs(mean))
    beside = SimpleNamespace(own_effects=found.effects, recording=found.recording, segments=poses)
    assert np.allclose(_mean_drift(beside, "accel-bias-drift"), mean, atol=0.2 * np.abs(mean).min())
