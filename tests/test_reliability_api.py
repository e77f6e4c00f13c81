"""The Python front: every wrong argument is one sentence of ours, every result stays as it was made."""

import collections
import copy
import dataclasses
import enum
import inspect
import json
import pickle
import re
import traceback
import types
from dataclasses import replace
from fractions import Fraction

import numpy as np
import polars as pl
import pytest
from matplotlib.figure import Figure

import trihedron
from small_session import made_once
from trihedron.records import SensorCalibration

SHOWN = ("read", "segment", "calibrate", "verify", "check", "diagnose", "kalman", "allan")


@pytest.fixture(scope="module")
def recording():
    return trihedron.read(made_once() / "log.csv")


@pytest.fixture(scope="module")
def result(recording):
    return trihedron.calibrate(recording, gravity_m_s2=9.80665)


@pytest.fixture(scope="module")
def right(recording, result, tmp_path_factory):
    """Arguments that each verb needs, all of them right."""
    folder, place = made_once(), tmp_path_factory.mktemp("api")
    x = np.random.default_rng(0).normal(size=(2000, 3))
    both = {"calibration": result, "recording": recording}
    return {
        "allan_deviation": {"x": x, "rate_hz": 100.0},
        "apply": both,
        "calibrate_references": {"recordings": [recording], "references": [recording]},
        "calibrate_sessions": {"recordings": [recording, recording]},
        "capture": {"port": "none", "output": place / "x.csv"},
        "diagnose_sessions": {"recordings": [recording, recording]},
        "convert": {"log": recording, "output": place / "x.csv"},
        "demo": {"folder": place / "demo"},
        "export": {"calibration": result, "target": "c"},
        "extend": {"result": result},
        "filter_noise": {"recording": folder / "static.csv"},
        "fleet": {"logs": [folder / "log.csv"], "out": place / "fleet"},
        "identify_noise": {"x": x, "rate_hz": 100.0},
        "integrate_rate": {"time_s": np.arange(50) / 100, "rate": np.zeros((50, 3))},
        "allan": {"recording": folder / "static.csv"},
        "plan": {},
        "plot": {"result": result},
        "ports": {},
        "rank": {"calibrations": [result, result], "recording": recording},
        "read": {"path": folder / "log.csv"},
        "read_calibration": {"path": folder / "c.json"},
        "report": {"result": result},
        "simulate": {"scenario": "hand-session"},
        "twin": both,
        "verify": both,
        "write_calibration": {"calibration": result, "path": place / "c.json"},
    } | {verb: {"recording": recording} for verb in ("calibrate", "check", "diagnose", "guide", "kalman", "segment")}


NO_NUMBER = ("1", [1.0], None, 1j, object(), np.zeros(3), True, b"1", np.datetime64("2020-01-01"))
NO_QUANTITY = (float("nan"), float("inf"), 10**400, -(10**400), -1e300)
NO_TEXT = (3, b"x", ["x"], 1.5, {}, object(), np.zeros(3), "a\0b")
NO_LIST = (3, "1,2", b"x", {1, 2}, {"a": 1}, object(), np.array(1.0), (k for k in range(3)), int)
NO_RECORD = (object(), np.zeros((2, 2, 2, 2)), 3, 1.5, b"x", int, {}, [], {"x": object()}, "a\0b", "n" * 300, "", ".")
NO_FILE = (3, b"x", "", "a\0b", object(), ["x"], np.zeros(3))
NO_WORD = (3, b"x", ["lower"], {}, object(), np.array("lower"), "x", "", "a\0b")
NO_ARRAY = (None, "x", object(), [["a"]], [[1, 2], [3]], np.ones((50, 3)) * 1j, np.zeros((2, 2, 2, 2)), {}, 3.0, [])
NO_ARRAY += (np.array([object()]), np.array(["2020-01-01"], "M8[s]"), np.array(1.0), {1, 2}, [10**400])
NO_CALL = (3, "x", object(), [1], int, np.zeros(3))
NO_TABLE = (object(), 3, np.zeros(3), b"x", "a\0b", [1])
BY_KIND = {
    "float": (*NO_NUMBER, *NO_QUANTITY),
    "int": (*NO_NUMBER, 1.5, float("nan"), 10**400, Fraction(1, 3)),
    "str": NO_TEXT,
    "bool": (1, 0.0, "yes", None, [], np.zeros(2), object()),
    "Sequence[float]": (*NO_LIST, ["a"], [None], [[1.0]], np.zeros((2, 2)), [10**400], [float("nan")]),
    "Sequence[int]": (*NO_LIST, ["a"], [None], [[1]], np.zeros((2, 2)), [1.5], [10**400]),
    "Sequence[str]": (*NO_LIST, [1], [None], [["a"]]),
    "Sequence[tuple[float, float]]": (*NO_LIST, [1], ["ab"], [(1, 2, 3)], [("a", "b")], [(float("nan"), 1)]),
    "npt.ArrayLike": NO_ARRAY,
    "Segments": (object(), 3, "x", [1], np.zeros(3), int),
    "object": (3, object(), "x", None, np.zeros(3), []),
    "GivenModel": (*NO_TABLE, "none.toml"),
    "Scenario": (*NO_TABLE, "no-such"),
    "Axes | Sequence[Axes]": (3, "x", object(), [3], {}),
    "Sequence[AnyCalibration]": (*NO_LIST, [], [3], [object(), object()], ["none.json"] * 2),
    "Sequence[AnyRecording | CalibrationResult]": (*NO_LIST, [], [3], [object(), object()], ["none.csv"] * 2),
    "Sequence[str | os.PathLike[str]]": (3, b"x", object(), [], [3], {1}, "", "a\0b", "n" * 300, "none", [""]),
}
"""What is wrong for a parameter of each type; a new type of parameter needs its line here."""
BY_KIND |= dict.fromkeys(("AllanKind", "By", "Form", "Frame", "Loss", "Method", "NormFrame", "RateShape"), NO_WORD)
BY_KIND |= dict.fromkeys(("AccelerationUnit", "RateUnit"), (*NO_WORD, 1.5))
BY_KIND |= dict.fromkeys(("AnyRecording", "AnyCalibration", "CalibrationResult", "Any"), NO_RECORD)
BY_KIND |= dict.fromkeys(("Progress", "Callable[[Block], bool | None]", "OnPose"), NO_CALL)
BY_KIND |= dict.fromkeys(("PoseTable", "AnyReference"), (*NO_TABLE, "", "none.csv"))
BY_KIND |= dict.fromkeys(("Noise", "NoiseSource"), (*NO_TABLE, "none.json"))
LISTS_OF_LOGS = ("Sequence[AnyRecording]", "Sequence[AnyReference]")
BY_KIND |= dict.fromkeys(LISTS_OF_LOGS, (*NO_LIST, [], [3], [object()], ["none.csv"]))
BY_KIND |= {"str | os.PathLike[str]": NO_FILE, "int | str": (1.5, b"x", [1], object())}
FIRST = ["Sequence[str | os.PathLike[str]]", "Scenario", "PoseTable", "Noise", "AccelerationUnit", "RateUnit"]
FIRST += ["str | os.PathLike[str]", "int | str", "Sequence[int]"]
ALSO_NEGATIVE = {"gravity_m_s2", "rate_hz", "gyroscope_nominal", "alpha", "confidence", "limit_mg", "limit_deg", "baud"}
ALSO_NEGATIVE |= {"turn_s", "pose_s", "seconds", "gyroscope_density", "accelerometer_density", "seed", "workers"}
ALSO_NEGATIVE |= {"sigma_angle_deg", "sigma_turn_rad", "wait_s"}
ALSO_ZERO = ALSO_NEGATIVE - {"seed", "workers", "sigma_angle_deg", "sigma_turn_rad", "wait_s"}
OF_A_LIBRARY = re.compile(
    r"unhashable|float\(\) arg|expected str|object is not|not supported between|truth value|broadcast|could not|"
    r"to unpack|inhomogeneous|iterable|subscriptable|interpreted as|no attribute|can't|valid [A-Z]| at 0x|"
    r"argument must be"
)


def rejected(what, ask):
    """That a call ends in one sentence of ours, raised by us."""
    try:
        ask()
    except (ValueError, TypeError) as error:
        said, last = str(error), traceback.extract_tb(error.__traceback__)[-1]
        ours = (last.line or "").startswith("raise") or "_core." in (last.line or "")
        assert "/trihedron/" in last.filename, (what, said, last)
        assert ours, (what, said, last)
        assert 10 < len(said) < 500, (what, said)
        assert said.count("\n") == 0, (what, said)
        assert not OF_A_LIBRARY.search(said), (what, said)
        # In words of Python, not of the command line.
        assert not re.search(r"(?<!\w)--\w", said), (what, said)
        return
    pytest.fail(f"{what} was taken")


VERBS = [name for name in trihedron.__all__ if inspect.isfunction(getattr(trihedron, name))]
WALK = [(verb, name) for verb in VERBS for name in inspect.signature(getattr(trihedron, verb)).parameters]


@pytest.mark.parametrize(("verb", "name"), WALK)
def test_every_wrong_argument_of_every_verb_is_one_sentence_of_ours(right, verb, name, tmp_path, monkeypatch):
    monkeypatch.chdir(tmp_path)
    ask = getattr(trihedron, verb)
    parameter = inspect.signature(ask).parameters[name]
    if parameter.kind is inspect.Parameter.VAR_KEYWORD:
        rejected(f"{verb}(nonsense=1)", lambda: ask("log.csv", "x.csv", nonsense=1))
        rejected(f"{verb}(rate_hz='x')", lambda: ask("log.csv", "x.csv", rate_hz="x"))
        return
    annotation = str(parameter.annotation)
    kinds = annotation.removesuffix(" | None")
    listed = next((kind for kind in (kinds, *FIRST) if kind in BY_KIND and kind in kinds), kinds)
    wrong = [value for value in BY_KIND[listed] if value is not None or kinds == annotation]
    for value in [*wrong, *([-3] if name in ALSO_NEGATIVE else []), *([0] if name in ALSO_ZERO else [])]:
        arguments = {**right[verb], name: value}
        rejected(f"{verb}({name}={value!r:.60})", lambda ask=ask, arguments=arguments: ask(**arguments))
    assert list(tmp_path.iterdir()) == []


def test_an_unknown_or_a_missing_argument_is_a_sentence():
    for verb in VERBS:
        rejected(verb, lambda verb=verb: getattr(trihedron, verb)(nonsense=1))


@pytest.mark.parametrize("kind", ["Calibration", "Diagnosis", "Finding", "Recording", "Segments"])
def test_a_record_made_by_hand_is_checked_where_it_is_made(kind, results):
    made = {
        "Calibration": results["calibrate"].calibration,
        "Diagnosis": results["diagnose"],
        "Finding": results["calibrate"].findings[0],
        "Recording": results["read"],
        "Segments": results["segment"],
    }[kind]
    values = {f.name: getattr(made, f.name) for f in dataclasses.fields(getattr(trihedron, kind))}
    for name in values.keys() - {"rows_in_file", "rows_read"}:
        for value in (object(), 1j, [object()], {"x": [1, [2]]}, np.ones((2, 2, 2, 2)) * 1j):
            if name in ("extensions", "noise", "references", "numbers", "auxiliary") and isinstance(value, dict):
                continue
            arguments = values | {name: value}
            rejected(f"{kind}({name}={value!r:.40})", lambda a=arguments: getattr(trihedron, kind)(**a))


def test_a_recording_of_arrays_and_a_sensor_are_checked():
    t, acc = np.arange(50) / 100, np.zeros((50, 3))
    for change in (
        *({"time_s": value} for value in ("x", [["a"]], t * 1j, np.zeros((2, 2)), -t, t * np.nan)),
        *({"accelerometer": value} for value in ("x", acc.T, acc * 1j, acc[:4], [[1, 2], [3]], object())),
        *({"rate_hz": value} for value in ("x", -1.0, float("nan"), [1])),
        *({"accelerometer_unit": value} for value in ("furlong", 3, [], object())),
        *({"temperature_degc": value} for value in ("x", acc, t[:5], t * 1j)),
    ):
        arguments = {"time_s": t, "accelerometer": acc} | change
        rejected(f"from_arrays({change})", lambda a=arguments: trihedron.Recording.from_arrays(**a))
    good = {"S": np.eye(3), "b": np.zeros(3), "covariance": np.zeros((12, 12)), "raw_unit": "g", "si_unit": "m/s^2"}
    for name in good:
        for value in (object(), 3, [["a"]], np.zeros((5, 5)), np.eye(3) * np.nan, np.eye(3) * 1j, None):
            arguments = good | {"method": "given", name: value}
            rejected(f"SensorCalibration({name}={value!r:.40})", lambda a=arguments: SensorCalibration(**a))


@pytest.fixture(scope="module")
def results(recording, result):
    folder = made_once()
    rest = folder / "static.csv"
    return {
        "read": recording,
        "simulate": trihedron.simulate("six-faces", 4),
        "segment": result.segments,
        "calibrate": result,
        "sessions": trihedron.calibrate_sessions(
            [recording, replace(recording, sha256="another")], gravity_m_s2=9.80665
        ),
        "verify": trihedron.verify(result, recording),
        "check": trihedron.check(rest),
        "diagnose": trihedron.diagnose(recording, gravity_m_s2=9.80665),
        "extend": trihedron.extend(result),
        "kalman": trihedron.kalman(recording, gravity_m_s2=9.80665),
        "allan": trihedron.allan(rest),
        "allan_deviation": trihedron.allan_deviation(np.random.default_rng(0).normal(size=(2000, 2)), 100.0),
        "plan": trihedron.plan(),
        "apply": trihedron.apply(result, recording),
        "twin": trihedron.twin(recording, result),
        "read_calibration": trihedron.read_calibration(folder / "c.json"),
    }


def loose(value, path):
    """Where a value can be written to, and every array that was seen."""
    found, arrays = [], []

    def walk(value, path):
        if isinstance(value, np.ndarray):
            arrays.append(value)
            try:
                value[...] = 0
                found.append(path)
            except ValueError:
                pass
        elif dataclasses.is_dataclass(value):
            name = dataclasses.fields(value)[0].name
            try:
                setattr(value, name, getattr(value, name))
                found.append(f"{path} ({type(value).__name__})")
            except dataclasses.FrozenInstanceError:
                pass
            for field in dataclasses.fields(value):
                walk(getattr(value, field.name), f"{path}.{field.name}")
        elif isinstance(value, tuple):
            for k, one in enumerate(value):
                walk(one, f"{path}[{k}]")
        elif isinstance(value, types.MappingProxyType):
            for key, one in value.items():
                walk(one, f"{path}[{key!r}]")
        elif not isinstance(value, str | bytes | int | float | enum.Enum | None):
            found.append(f"{path} is a {type(value).__name__}")

    walk(value, path)
    return found, arrays


def test_nobody_can_write_into_a_result_or_what_pickle_and_deepcopy_make_of_it_whole(results):
    seen = collections.Counter()
    for name, one in results.items():
        for copied in (one, pickle.loads(pickle.dumps(one)), copy.deepcopy(one)):
            found, arrays = loose(copied, name)
            assert found == []
            assert type(copied) is type(one)
            seen[name] += len(arrays)
    assert sum(seen.values()) > 300


@pytest.mark.parametrize("name", [*SHOWN, "read_calibration"])
def test_a_result_is_plain_types_a_frame_a_figure_and_a_piece_of_html(results, name):
    one, plain = results[name], results[name].to_dict()
    json.dumps(plain, allow_nan=False)
    for twin in (pickle.loads(pickle.dumps(one)), copy.deepcopy(one)):
        assert twin.to_dict() == plain
    assert isinstance(one.to_dataframe(), pl.DataFrame)
    figure = one.plot()
    assert isinstance(figure, Figure)
    assert name != "calibrate" or figure._repr_png_().startswith(b"\x89PNG")
    page = one._repr_html_()
    # A notebook holds many: small, no picture inside, nothing that runs.
    assert len(page) < 8000
    assert "<script" not in page
    assert "<img" not in page
    assert len(repr(one)) < 160
    assert trihedron.report(one)
    is_data = name in ("read", "segment", "read_calibration")
    assert is_data or str(one).count("\n") > 5


def test_the_arrays_that_a_caller_gave_stay_the_callers_to_write_to():
    t, acc = np.arange(50) / 100, np.tile([0.0, 0.0, 9.8], (50, 1)) + np.random.default_rng(1).normal(size=(50, 3))
    made = trihedron.Recording.from_arrays(t, acc)
    before = made.accelerometer.copy()
    acc[:] = 0.0
    t[:] = 0.0
    assert np.array_equal(made.accelerometer, before)
    S = np.eye(3)
    sensor = SensorCalibration(S, np.zeros(3), np.zeros((12, 12)), "g", "m/s^2", "given")
    S[:] = 5.0
    assert np.array_equal(sensor.S, np.eye(3))
