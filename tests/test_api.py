"""The package as people call it from Python: names, arguments, results in notebooks and in other processes."""

import ast
import doctest
import inspect
import pickle
import re
import subprocess
import sys
from dataclasses import replace

import numpy as np
import pytest
from matplotlib.figure import Figure

import trihedron
from small_session import usual
from test_export import given
from trihedron.records import Finding, Severity

# A device, several recordings or minutes: the tutorials run these.
SHOWN_ONLY = {"calibrate_references", "capture", "demo", "diagnose_sessions", "filter_noise", "fleet", "guide"}


def with_sensor(result, **changes):
    return replace(result.calibration, accelerometer=replace(result.calibration.accelerometer, **changes))


def test_apply_and_export_refuse_what_cannot_be_a_calibration():
    recording, result, _ = usual()
    S = result.calibration.accelerometer.S
    singular = with_sensor(result, S=np.stack([S[0], S[1], S[0] + S[1]]))
    negative = result.calibration.accelerometer.covariance.copy()
    contradictory = negative.copy()
    negative[0, 0] = -negative[0, 0]
    contradictory[9, 10] = contradictory[10, 9] = 3.0 * np.sqrt(contradictory[9, 9] * contradictory[10, 10])
    for wrong, words in (
        (singular, "singular"),
        (with_sensor(result, covariance=negative), "negative variance"),
        (with_sensor(result, covariance=contradictory), "contradict"),
    ):
        with pytest.raises(ValueError, match=words):
            trihedron.apply(wrong, recording)
        with pytest.raises(ValueError, match=words):
            trihedron.export(wrong, "c")


def test_a_gyro_that_maps_degrees_as_radians_is_refused():
    with pytest.raises(ValueError, match="unit of the readings"):
        trihedron.export(given((np.eye(3), np.zeros(3)), (np.eye(3) * np.pi / 180.0, np.zeros(3))), "c")


def test_a_bias_that_drifted_in_its_own_recording_is_allowed_that_change_in_another_and_said():
    recording, result, _ = usual()
    change = 0.06
    counts = np.linalg.solve(result.accelerometer.S, [change, -change, 0.5 * change])
    shifted = replace(recording, accelerometer=recording.accelerometer + counts, sha256="")
    found = trihedron.verify(result, shifted).findings
    foremost = next(one for one in found if one.severity is Severity.SERIOUS)
    assert "Biases have changed since, scales and axes have not" in foremost.cause
    drift = Finding.of(
        "bias-drift", is_gyro=0.0, change=(change, "m/s^2"), is_warm=True,
        change_x=change, change_y=change, change_z=change,
    )  # fmt: skip
    drifted = replace(result.calibration, findings=(drift,))
    verified = trihedron.verify(drifted, shifted)
    assert verified.is_passed
    assert "bias-drift" in [one.code for one in verified.findings]


def test_results_cross_processes_and_reports_need_no_matplotlib_as_plot_says_that_it_does(tmp_path):
    (tmp_path / "kept").write_bytes(pickle.dumps(usual()[1]))
    code = (
        "import sys, pickle; sys.modules['matplotlib'] = None\n"
        "import trihedron; r = pickle.load(open('kept', 'rb'))\n"
        "print(r); trihedron.report(r, 'r.html'); r._repr_html_()\n"
        "try: r.plot()\nexcept ValueError as error: print(error)"
    )
    done = subprocess.run([sys.executable, "-c", code], capture_output=True, text=True, cwd=tmp_path)
    assert done.returncode == 0, done.stderr
    assert done.stdout.rstrip().endswith("pip install matplotlib.")
    # A page draws its figures itself.
    assert "<svg" in (tmp_path / "r.html").read_text()


def test_a_figure_is_drawn_where_it_is_asked_for():
    result = usual()[1]
    figure = Figure()
    above, below = figure.subplots(2)
    assert result.plot("residuals", ax=above) is figure
    assert above.has_data()
    assert not below.has_data()
    with pytest.raises(ValueError, match="needs 1 axes, one a panel; ax has 3"):
        result.plot("residuals", ax=[above, below, above])


def test_verbs_and_classes_say_what_they_return_and_raise_and_their_examples_run(tmp_path, monkeypatch):
    """Examples name a recording and its calibration as a reader has them."""
    monkeypatch.chdir(tmp_path)
    recording = trihedron.simulate("hand-session", 3)[0]
    result = trihedron.calibrate(recording, latitude_deg=60.0)
    run = doctest.DocTestRunner()
    for name in trihedron.__all__:
        verb = getattr(trihedron, name)
        said = (inspect.getdoc(verb) or "") if callable(verb) else ""
        if inspect.isfunction(verb):
            assert re.search(r"^Returns\n-+\n(.*\n)*?Raises\n-+\n(.*\n)*?Examples\n-+$", said, re.MULTILINE), name
            for parameter in inspect.signature(verb).parameters:
                assert re.search(rf"^(\w+(,| or) )*{parameter}\b", said, re.MULTILINE), f"{name}: {parameter}"
        if callable(verb):
            examples = re.findall("^>>> .*", said, re.MULTILINE)
            assert examples, name
            assert name in SHOWN_ONLY or not any("+SKIP" in line for line in examples), name
            names = {"trihedron": trihedron, "np": np, "recording": recording, "result": result}
            names |= getattr(inspect.unwrap(verb), "__globals__", {}) | names
            run.run(doctest.DocTestParser().get_doctest(said, names, name, None, 0))
    assert run.tries > 30
    assert run.failures == 0


@pytest.mark.parametrize(
    ("wrong", "meant"), [("gravity", "gravity_m_s2"), ("latitude", "latitude_deg"), ("gravity_ms2", "gravity_m_s2")]
)
def test_a_keyword_that_is_nearly_right_is_offered_its_name_and_several_logs_their_verb(wrong, meant):
    with pytest.raises(TypeError, match=f"is {meant} meant"):
        trihedron.calibrate("log.csv", **{wrong: 9.8})
    with pytest.raises(ValueError, match=r"trihedron\.calibrate_sessions"):
        trihedron.calibrate(["log.csv", "log.csv"], gravity_m_s2=9.81)


def test_a_sensor_shows_its_numbers_and_its_bias_is_what_the_reading_is_too_much():
    S, bias = np.array([[0.99, 0.0, 0.0], [0.01, 1.02, 0.0], [-0.02, 0.005, 1.01]]), np.array([0.1, -0.2, 0.3])
    sensitivity = np.linalg.norm(np.linalg.inv(S), axis=1)
    one = trihedron.SensorCalibration(S, -S @ (bias * sensitivity), np.zeros((12, 12)), "m/s^2", "m/s^2", "test")
    np.testing.assert_allclose(one.bias, bias, atol=1e-14)
    assert "0.99, 1.02, 1.01" in repr(one)


def test_editors_see_the_public_names_where_they_are_imported_on_use():
    tree = ast.parse(inspect.getsource(trihedron))
    seen = {alias.asname: node.module for node in ast.walk(tree) if isinstance(node, ast.ImportFrom)
            for alias in node.names if alias.asname == alias.name}  # fmt: skip
    assert seen == trihedron._HOME
