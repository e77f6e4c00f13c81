"""``trihedron diagnose``: a log in; verdict, report, JSON and pictures out; extended calibrations applied."""

import json
import os
import re
import subprocess
import sys
from dataclasses import replace
from pathlib import Path
from types import MappingProxyType

import numpy as np
import pytest

import trihedron
from diagnosed_session import unit_of
from trihedron.cli import main
from trihedron.diagnose import compensate
from trihedron.diagnose.effects import catalogue
from trihedron.errors import InputError
from trihedron.files.calibration import schema_of, violation
from trihedron.files.log import write_recording
from trihedron.records import Recording
from trihedron.simulate import diagnosed_sizes, hand_session, profile_by_name, simulate, with_effect
from trihedron.simulate.accelerometer import Accelerometer
from trihedron.simulate.gyroscope import Gyroscope
from trihedron.simulate.scenario import Scenario

K2 = (3e-4, -2e-4, 2e-4)
GRAVITY = ("--gravity", "9.80665")
# What is simulated, and the values of its model.
TAKEN_OFF = {
    "accel-quadratic": ("k2", K2),
    "accel-scale-asymmetry": ("asymmetry", (1e-3, -1.5e-3, 1e-3)),
    "gyro-g-sensitivity": ("matrix", ((1e-4, 2e-5, 0), (0, -1e-4, 5e-5), (5e-5, 0, 1e-4))),
    "accel-thermal-bias": ("per_k", (0.004, -0.006, 0.01)),
    "gyro-thermal-bias": ("per_k", (2e-4, -3e-4, 2e-4)),
    "accel-size-effect": ("places_m", ((0, 0, 0), (0.004, 0.001, -0.002), (0.003, -0.004, 0.001))),
}


def scenario(layout=1, n_poses=18):
    return unit_of(hand_session(n_poses, layout=layout))


@pytest.fixture(scope="module")
def folder(tmp_path_factory):
    where = tmp_path_factory.mktemp("diagnose")
    bent = with_effect(scenario(), "accel-quadratic", k2=K2)
    again = with_effect(scenario(layout=2), "accel-quadratic", k2=K2)
    for name, what, seed in (("healthy", scenario(), 1), ("bent", bent, 1), ("again", again, 2)):
        write_recording(simulate(what, seed)[0], where / f"{name}.csv")
    return where


def test_the_json_follows_the_published_schema_and_has_the_fields_of_the_contract(folder):
    main(["diagnose", str(folder / "bent.csv"), *GRAVITY, "--json", str(folder / "bent.json")])
    document = json.loads((folder / "bent.json").read_text())
    assert violation(document, "diagnosis") == ""
    contract = {"verdict", "domains", "effects", "remaining", "candidates", "calibration", "noise", "schema_version"}
    assert contract <= set(document)
    assert contract <= set(schema_of("diagnosis")["required"])
    assert set(document) <= set(schema_of("diagnosis")["properties"])
    assert set(document["figures"]) == {"gravity_error_in_static_poses", "tilt_error_after_rotations"}
    other = document["figures"]["gravity_error_in_static_poses"] | {"unit": "mg"}
    bent = document["figures"] | {"gravity_error_in_static_poses": other}
    said = violation(document | {"figures": bent}, "diagnosis")
    assert said.startswith("figures.gravity_error_in_static_poses.unit")
    effect = document["effects"][0]
    assert {"id", "statement", "parameters", "p_adjusted", "delta_bic", "heldout", "confounded_with"} <= set(effect)
    assert effect["heldout"]["chi2_per_dof_after"] < 1.3 < effect["heldout"]["chi2_per_dof_before"]


def test_an_extended_calibration_holds_on_another_session_where_the_linear_one_does_not(folder, capsys):
    linear, extended = folder / "linear.json", folder / "extended.json"
    # Poses that bend make a linear calibration one that is not to be trusted; nothing is left to say of the extended.
    assert main(["calibrate", str(folder / "bent.csv"), *GRAVITY, "-o", str(linear)]) == 2
    assert main(["calibrate", str(folder / "bent.csv"), *GRAVITY, "--extended", "-o", str(extended)]) == 0
    known = trihedron.read_calibration(extended)
    assert [effect["id"] for effect in known.extensions["effects"]] == ["accel-quadratic"]
    again = trihedron.read(folder / "again.csv")
    rms = [trihedron.verify(path, again).verification.norm_rms for path in (linear, extended)]
    # The quadratic misses gravity by 6 mm/s² rms in other poses; noise of the means leaves 2.
    assert rms[1] < 0.6 * rms[0]
    found = trihedron.diagnose(again, calibration=extended)
    assert found.verdict == "consistent"
    capsys.readouterr()
    assert main(["export", str(extended), "--to", "c"]) == 0
    assert "no fields for these effects: accel-quadratic" in capsys.readouterr().err


def test_what_cannot_be_taken_off_is_said(folder):
    known = trihedron.calibrate(trihedron.read(folder / "healthy.csv"), gravity_m_s2=9.80665).calibration
    effects = [
        {"id": "accel-thermal-bias", "model": {"variant": "linear", "values": [0.01, 0.0, 0.0]}},
        {"id": "earth-rate", "model": {"variant": "", "values": [0.0, 0.0, 0.0]}},
        {"id": "of-the-future", "model": {"variant": "", "values": []}},
    ]
    extensions = MappingProxyType({"effects": effects, "references": {"temperature_degc": 25.0}})
    done = trihedron.apply(replace(known, extensions=extensions), trihedron.read(folder / "healthy.csv"))
    said = [f.seen for f in done.findings if f.code == "effect-not-applied"]
    named = ("accelerometer thermal bias", "earth rate", "of the future")
    assert [name for text, name in zip(said, named, strict=True) if name in text] == list(named)
    assert "no temperature" in said[0]


@pytest.mark.parametrize("effect_id", TAKEN_OFF)
def test_an_effect_taken_off_sample_by_sample_leaves_the_motion(effect_id):
    clean = Scenario(hand_session(6), "clean", Accelerometer(), Gyroscope(), profile_by_name("mpu").clock)
    key, size = TAKEN_OFF[effect_id]
    recording, truth = simulate(with_effect(clean, effect_id, **{key: size}), seed=1)
    # Places are found from the first of them.
    values = np.ravel(size[1:] if key == "places_m" else size)
    effect = {"id": effect_id, "model": {"variant": "linear" if key == "per_k" else "", "values": list(values)}}
    identity = (np.eye(3), np.zeros(3))
    done = compensate(recording, [effect], {"temperature_degc": 25.0}, identity, identity)
    assert not done.left_out
    is_gyros = "gyro" in effect_id
    true = truth.angular_rate_rad_s if is_gyros else truth.specific_force_m_s2
    before, after = (np.max(np.abs((r.gyroscope if is_gyros else r.accelerometer) - true)) for r in (recording, done))
    # Two passes of the fixed point and temperature logged in steps of 0.01 K leave per mille of the effect.
    assert after < 0.02 * before


@pytest.mark.parametrize(("shape", "is_known"), [({"thermometer_lag": 10.0}, True), ({}, False)])
def test_a_thermal_bias_is_taken_off_at_the_temperature_of_a_die_that_the_thermometer_follows(shape, is_known):
    t = np.arange(6000) / 50.0
    force = np.random.default_rng(1).normal([0.0, 0.0, 9.8], 0.01, (6000, 3))
    log = Recording.from_arrays(t, force, temperature_degc=25.0 + 0.1 * t)
    effect = {"id": "accel-thermal-bias", "model": {"variant": "linear, lag", "shape": shape, "values": [0.01, 0, 0]}}
    how = log, [effect], {"temperature_degc": 25.0}, (np.eye(3), np.zeros(3)), None
    if not is_known:
        with pytest.raises(InputError, match="with its shape"):
            compensate(*how)
        return
    # The die is a kelvin ahead on a ramp of 0.1 K/s.
    left = compensate(*how).accelerometer[:, 0] - force[:, 0]
    assert left == pytest.approx(-0.01 * (0.1 * t + 1.0), abs=1e-6)


def test_every_accepted_effect_is_simulated_or_left_out_with_a_reason():
    numbers = {"K2_x": 1e-4, "offset_x": 0.01, "half_width": 2.0, "warm_up_x": 0.1, "time_constant": 50.0}
    numbers |= {"bias_per_kelvin_x": 1e-3, "jitter": 1e-4, "accelerometer_delay": 1e-3, "accelerometer_lag": 1e-3}
    numbers |= {"lost_at_90.00s": 12.0, "frequency": 17.0, "amplitude_ax": 0.05, "latitude": 55.0, "r_x": 0.1}
    numbers |= {"limit_x+": 4.0, "accel_bias_per_power_x": 1e-3, "G_xx": 1e-4, "sigma": 0.003, "sigma_x": 1e-3}
    parameters = [{"name": k, "value": v, "std": 0.0, "unit": ""} for k, v in numbers.items()]
    for effect in catalogue():
        entry = {"id": effect.id, "parameters": parameters, "model": {"variant": "warm-up"}}
        if effect.id == "accel-hysteresis":
            entry["model"] = {"variant": "play"}
        sizes, left_out = diagnosed_sizes([entry])
        for one, size in sizes:
            with_effect(scenario(), one, **size)
        assert {one for one, _ in sizes} == {effect.id} or left_out[effect.id]


@pytest.mark.slow
def test_the_worked_example_of_adding_an_effect_runs_as_it_stands(tmp_path):
    text = (Path(__file__).parents[1] / "docs" / "adding-an-effect.md").read_text()
    effect_file, script = re.findall(r"```python\n(.*?)```", text, re.S)
    (tmp_path / "gyro_g2_sensitivity.py").write_text(effect_file)
    (tmp_path / "try_it.py").write_text(script)
    # A process of its own: the effect must not stay in the catalogue of the other tests.
    package = str(Path(trihedron.__file__).parents[1])
    environment = {**os.environ, "PYTHONPATH": package}
    done = subprocess.run(
        [sys.executable, "try_it.py"], cwd=tmp_path, env=environment, capture_output=True, text=True, timeout=120
    )
    assert done.returncode == 0, done.stderr
    rows = [line.split() for line in done.stdout.splitlines() if line.startswith("gyro-g2-sensitivity D_")]
    assert len(rows) == 3
    # Three standard normal numbers, one fixed seed: 4 sigma is passed by chance once in 5000.
    assert max(abs(float(value) - float(true)) / float(std) for _, _, value, std, true in rows) < 4.0
