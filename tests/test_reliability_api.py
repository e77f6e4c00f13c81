"""Records made by hand are checked, and every result stays as it was made."""

import collections
import copy
import dataclasses
import enum
import json
import pickle
import re
import traceback
import types
from dataclasses import replace

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
    for name in ("S", "b", "covariance"):
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
    # Poses without their recording have no figure.
    assert name == "segment" or isinstance(one.plot(), Figure)
    assert name != "calibrate" or one.plot()._repr_png_().startswith(b"\x89PNG")
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
