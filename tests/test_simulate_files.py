"""Scenario files, logs and truth files: what is asked is what is made, and a wrong question gets one sentence."""

import json

import numpy as np
import pytest

from small_session import rejected
from trihedron.api.reading import read
from trihedron.cli import main
from trihedron.files.log import truth_document, write_truth
from trihedron.simulate import Pose, Turn, profile_by_name, read_scenario, scenario_by_name, simulate

EXAMPLE = """
name = "bench"
profile = "adis"
unit = 7
start_up = [0, 0, 1]
table_tilt_deg = [0.1, -0.2]

[clock]
rate_hz = 200
losses = [{ time_s = 1.0, n = 3 }]

[environment]
gravity_m_s2 = 0
latitude_deg = 59.9
earth_rate = true
[environment.temperature]
warm_up_k = 5
logged = true

[accelerometer]
noise = { N = 1e-3, K = [1e-5, 0, 0] }
mass = { moves = true, resonance_hz = 120 }

[[step]]
kind = "pose"
duration_s = 2
[[step]]
kind = "turn"
axis = [0, 0, 1]
angle_deg = 90
duration_s = 1.5

[[effect]]
id = "gyro-g-sensitivity"
matrix = [[1e-3, 0, 0], [0, 1e-3, 0], [0, 0, 1e-3]]
"""


def written(tmp_path, text):
    path = tmp_path / "bench.toml"
    path.write_text(text, encoding="utf-8")
    return path


def test_a_scenario_file_says_the_same_as_python(tmp_path):
    scenario = read_scenario(written(tmp_path, EXAMPLE))
    assert scenario.name == "bench"
    assert scenario.motion.steps == (Pose(2.0), Turn((0.0, 0.0, 1.0), 90.0, 1.5))
    assert scenario.motion.table_tilt_deg == (0.1, -0.2)
    accel, gyro = profile_by_name("adis").unit(7)
    assert scenario.accelerometer.S == accel.S
    assert scenario.accelerometer.noise.N == (1e-3, 1e-3, 1e-3)
    # What the file does not mention stays as in the profile.
    assert scenario.accelerometer.noise.B == accel.noise.B
    assert scenario.accelerometer.mass.resonance_hz == (120.0, 120.0, 120.0)
    assert scenario.gyroscope.b == gyro.b
    assert scenario.clock.losses[0].n == 3
    recording, truth = simulate(scenario, seed=1)
    assert recording.rate_hz == pytest.approx(200.0)
    assert recording.temperature_degc is not None
    assert set(truth.effects) >= {"gyro-g-sensitivity", "earth-rate", "dropped-samples", "table-tilt"}


@pytest.mark.parametrize(
    ("text", "sentence"),
    [
        ("profile = [", "not a TOML file"),
        ('profile = "mpux"', "no profile is called 'mpux'"),
        ('sesion = "hand"', "no key 'sesion'"),
        ("[clock]\nrate = 5", "clock has no key 'rate'"),
        ("[clock]\nrate_hz = 'fast'", "clock.rate_hz must be float"),
        ("[clock]\nrate_hz = -5", "rate_hz must be a positive number"),
        ("[accelerometer]\nb = [1, 2]", "accelerometer.b must hold 3 values"),
        ("[accelerometer]\nunit = 'stone'", "accelerometer.unit is one of"),
        ("[[step]]\nkind = 'jump'", "is of kind 'jump'"),
        ("[[step]]\nkind = 'pose'", "missing 1 required positional argument"),
        ("session = { kind = 'tango' }", "no session is of kind 'tango'"),
        ("session = { kind = 'hand', n = 3 }", "there is no 'n'; there are kind, n_poses"),
        ("[[effect]]\nid = 'gremlin'", "no effect is called 'gremlin'"),
        ("[accelerometer.noise]\nN = -1", "noise term N"),
        ("latitude_deg = 48.0", "belongs in [environment]"),
        ("rate_hz = 48.0", "belongs in [clock]"),
        ('[[effect]]\nkind = "accel-cubic"', "needs its id"),
        ('[[effect]]\nid = "accel-cubic"', "accel-cubic needs k3"),
        ('[[effect]]\nid = "accel-cubic"\nk = [1, 1, 1]', "it takes k3"),
    ],
)
def test_a_wrong_scenario_file_is_refused_with_its_name_and_the_place(tmp_path, text, sentence):
    with pytest.raises(ValueError, match=r"bench\.toml") as caught:
        read_scenario(written(tmp_path, text))
    assert sentence in str(caught.value)
    assert "\n" not in str(caught.value)[:60]


def test_a_part_whose_log_is_in_si_has_the_steps_of_its_own_adc(tmp_path):
    text = 'profile = "mpu"\n[session]\nkind = "hand"\n[accelerometer]\nunit = "m/s^2"\n'
    accel = read_scenario(
        written(tmp_path, text + "S = [[1, 0, 0], [0, 1, 0], [0, 0, 1]]\nb = [0, 0, 0]\n")
    ).accelerometer
    part = profile_by_name("mpu").accelerometer
    assert accel.adc.lsb == pytest.approx(part.S[0][0] * part.adc.lsb)
    assert accel.adc.high == pytest.approx(part.S[0][0] * part.adc.high, rel=0.01)


def test_truth_is_written_whole(tmp_path):
    _, truth = simulate(scenario_by_name("imperfect"), seed=3)
    write_truth(truth, tmp_path / "truth.npz")
    again = np.load(tmp_path / "truth.npz")
    assert json.loads(str(again["header"])) == json.loads(json.dumps(truth_document(truth)))
    for name in ("specific_force_m_s2", "angular_rate_rad_s", "attitude", "temperature_degc"):
        assert np.array_equal(again[name], getattr(truth, name))


def test_the_command_writes_log_and_truth_and_refuses_in_one_sentence(tmp_path, capsys):
    log, truth, singular = tmp_path / "a.csv", tmp_path / "a.npz", tmp_path / "singular.toml"
    singular.write_text("[accelerometer]\nS = [[1, 0, 0], [0, 1, 0], [0, 0, 0]]\n")
    assert main(["simulate", "table-turns", "-o", str(log), "--truth", str(truth), "--seed", "4"]) == 0
    assert "30 poses" in capsys.readouterr().out
    recording, _ = simulate(scenario_by_name("table-turns"), seed=4)
    again = read(log)
    assert np.array_equal(again.gyroscope, recording.gyroscope)
    assert (again.accelerometer_unit, again.gyroscope_unit) == (recording.accelerometer_unit, recording.gyroscope_unit)
    assert json.loads(str(np.load(truth)["header"]))["seed"] == 4
    assert main(["simulate", "--list"]) == 0
    assert "manual-example" in capsys.readouterr().out
    for words, sentence in (
        (["table-turns", "-o", str(log)], "--force"),
        (["table-turns"], "-o LOG"),
        (["tango", "-o", str(tmp_path / "b.csv")], "no scenario is called 'tango'"),
        (["table-turns", "-o", str(tmp_path / "b.doc")], ".csv, .npz, .parquet"),
        ([], "either a SCENARIO"),
        (["--like", str(log), "-o", str(tmp_path / "b.csv")], "--like and --calibration go together"),
        (["none.toml", "-o", str(tmp_path / "b.csv")], "none.toml"),
        ([str(singular), "-o", str(tmp_path / "b.csv")], "accelerometer: S has no inverse"),
    ):
        assert sentence in rejected(capsys, "simulate", *words)
    assert main(["simulate", str(written(tmp_path, EXAMPLE)), "-o", str(tmp_path / "c.parquet")]) == 0
    assert not (tmp_path / "b.csv").exists()
