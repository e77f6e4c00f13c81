"""``trihedron kalman``: a log and a pose table in, report, JSON and calibration file out."""

import json
from dataclasses import replace

import numpy as np
import pytest

import trihedron
from trihedron.cli import main
from trihedron.estimate.kalman.identified import noise_from_identified
from trihedron.read import ReadError, read_axis_noise
from trihedron.simulate import (
    Accelerometer,
    Clock,
    NoiseTerms,
    Scenario,
    dividing_head,
    long_static,
    scenario_by_name,
    simulate,
)
from twins_kalman import B_TRUE, DIVIDING_HEAD_ANGLES_DEG, S_TRUE


@pytest.fixture(scope="module")
def session(tmp_path_factory):
    folder = tmp_path_factory.mktemp("head")
    accelerometer = Accelerometer(S=S_TRUE, b=B_TRUE, noise=NoiseTerms(N=(0.01,) * 3, K=(0.001,) * 3))
    scenario = Scenario(motion=dividing_head(), accelerometer=accelerometer, clock=Clock(rate_hz=25.0))
    recording = simulate(scenario, seed=1)[0]
    rows = np.column_stack([recording.time_s, recording.accelerometer])
    np.savetxt(folder / "log.csv", rows, delimiter=",", header="t,ax,ay,az", comments="", fmt="%.7g")
    np.savetxt(
        folder / "angles.csv", DIVIDING_HEAD_ANGLES_DEG, delimiter=",", header="pitch,roll", comments="", fmt="%g"
    )
    (folder / "noise.json").write_text('{"white": 0.01, "walk": [0.001, 0.001, 0.001]}')
    return folder


def run(session, *words):
    return main(["kalman", str(session / "log.csv"), "--gravity", "9.80665", *map(str, words)])


def test_the_report_shows_every_method_and_the_calibration_file_holds_the_truth(session, tmp_path, capsys):
    out = tmp_path / "calibration.json"
    status = run(session, "--reference", session / "angles.csv", "--noise", session / "noise.json", "-o", out)
    text = capsys.readouterr().out
    assert status == 0
    for words in ("Kalman filter", "Least squares", "Generalised least squares", "Recursive least squares", "mean NIS"):
        assert words in text
    sensor = trihedron.read_calibration(out).accelerometer
    # Twelve standard normal numbers: 5 σ is beyond all of them but once in 10⁵ runs.
    assert np.max(np.abs(sensor.S - S_TRUE) / sensor.sigma_S) < 5.0
    assert np.max(np.abs(sensor.b - B_TRUE) / sensor.sigma_b) < 5.0


def test_the_noise_may_be_a_log_of_rest_or_the_json_of_allan(session, tmp_path, capsys):
    path = rest_log(tmp_path / "static.csv", 1200.0, N=(0.01,) * 3, K=(0.001,) * 3)
    assert main(["allan", str(path), "--json", str(tmp_path / "allan.json")]) == 0
    said = []
    for noise in (path, tmp_path / "allan.json"):
        capsys.readouterr()
        assert run(session, "--reference", session / "angles.csv", "--noise", noise, "--json") == 0
        said.append([axis["noise"] for axis in json.loads(capsys.readouterr().out)["axes"]])
    for axis in said[0]:
        # 30 000 samples show N to 0.4 %; the walk, seen over 20 minutes, to about 15 %.
        assert axis["white"] == pytest.approx(0.01, rel=0.03)
        assert axis["walk"] == pytest.approx(0.001, rel=0.6)
    # JSON keeps every digit.
    assert said[1] == said[0]


def test_noise_of_a_log_with_both_sensors_in_counts_is_that_of_the_accelerometer():
    motion = long_static(120.0)
    static = simulate(replace(scenario_by_name("static-hour"), motion=motion), seed=3)[0]
    noise = trihedron.allan(static)
    assert {axis.unit for axis in noise.axes} == {"counts"}
    of_accelerometer = [axis.fitted("N") for axis in noise.axes if axis.name.startswith("accel")]
    assert [axis.white for axis in noise_from_identified(noise.axes, "counts")] == of_accelerometer


def rest_log(path, seconds, **noise):
    accelerometer = Accelerometer(noise=NoiseTerms(**noise))
    scenario = Scenario(motion=long_static(seconds), accelerometer=accelerometer, clock=Clock(rate_hz=25.0))
    rest = simulate(scenario, seed=2)[0]
    rows = np.column_stack([rest.time_s, rest.accelerometer])
    np.savetxt(path, rows, delimiter=",", header="t,ax,ay,az", comments="", fmt="%.9g")
    return path


def test_a_log_of_rest_in_counts_of_another_range_is_refused(session, tmp_path, capsys):
    # Half the counts at twice the range: half the noise, which a quieter place has too, and half of gravity.
    rest = rest_log(tmp_path / "static.csv", 600.0, N=(0.01,) * 3)
    half = np.loadtxt(rest, delimiter=",", skiprows=1) * [1.0, 0.5, 0.5, 0.5]
    np.savetxt(rest, half, delimiter=",", header="t,ax [m/s^2],ay [m/s^2],az [m/s^2]", comments="", fmt="%.9g")
    assert run(session, "--reference", session / "angles.csv", "--noise", rest) == 1
    assert "another ADC, range or unit" in capsys.readouterr().err


@pytest.mark.parametrize(
    ("text", "message"),
    [
        ("white: 1", "not JSON"),
        ("[1, 2]", "as one object"),
        ('{"pink": 1}', "no noise term 'pink'"),
        ('{"white": [1, 2]}', "one number, or three"),
        ('{"white": "much"}', "one number, or three"),
        ('{"white": -1}', "white must be zero or positive"),
    ],
)
def test_a_noise_file_that_cannot_be_used_is_refused_in_plain_words(tmp_path, text, message):
    path = tmp_path / "noise.json"
    path.write_text(text)
    with pytest.raises(ReadError, match=message):
        read_axis_noise(path)
