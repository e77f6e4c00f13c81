"""The calibration file: round trip, rejection, what it says of itself; records, documents and schemas agree."""

import json
import math
from dataclasses import fields, replace
from functools import reduce
from importlib.resources import files
from operator import getitem

import numpy as np
import pytest

from small_session import usual
from trihedron import calibrate
from trihedron.files.calibration import (
    CalibrationFileError,
    calibration_document,
    read_calibration,
    schema_of,
    write_calibration,
)
from trihedron.records import FitQuality, diagnosis
from trihedron.records.calibration import Observability
from trihedron.records.domains import DomainResiduals, DomainTest, HeldOut, Where
from trihedron.records.finding import Finding, FindingCode
from trihedron.records.plain import as_plain, from_plain
from trihedron.records.reference import Estimate, FitToReference

OF_DIAGNOSIS = {
    "where": Where, "domain": DomainTest, "heldout": HeldOut, "parameter": diagnosis.EffectParameter,
    "effect": diagnosis.AcceptedEffect, "candidate": diagnosis.Candidate, "linear": diagnosis.LinearModel,
    "residuals": DomainResiduals, "finding": Finding, "parameter_difference": diagnosis.ParameterDifference,
    "noise_difference": diagnosis.NoiseDifference, "relation": diagnosis.Relation, "stage": diagnosis.Stage,
    "estimate": Estimate, "against_reference_sensor": FitToReference,
}  # fmt: skip
OF_CALIBRATION = {"residuals": FitQuality, "observability": Observability}
EVERY = [("diagnosis", *item) for item in OF_DIAGNOSIS.items()]
EVERY += [("calibration", *item) for item in OF_CALIBRATION.items()]


def same(a, b):
    if isinstance(a, np.ndarray):
        return np.array_equal(a, b, equal_nan=True)
    if isinstance(a, float) and np.isnan(a):
        return np.isnan(b)
    return a == b


def test_a_round_trip_gives_back_every_number_exactly(tmp_path):
    calibration = usual()[1].calibration
    write_calibration(calibration, tmp_path / "c.json")
    back = read_calibration(tmp_path / "c.json")
    assert np.array_equal(back.covariance, calibration.covariance)
    for name in ("accelerometer", "gyroscope"):
        was, now = getattr(calibration, name), getattr(back, name)
        assert all(same(getattr(was, key), getattr(now, key)) for key in ("S", "b", "covariance", "raw_unit", "method"))
        for part in ("quality", "observability"):
            before, after = vars(getattr(was, part)), vars(getattr(now, part))
            assert before.keys() == after.keys()
            assert all(same(before[key], after[key]) for key in before), part
    rest = ("frame", "gravity_m_s2", "gravity_source", "recording_source", "recording_sha256", "findings")
    assert all(getattr(back, key) == getattr(calibration, key) for key in rest)
    alone = calibrate(replace(usual()[0], gyroscope=None), gravity_m_s2=9.80665).calibration
    write_calibration(alone, tmp_path / "alone.json")
    assert read_calibration(tmp_path / "alone.json").gyroscope is None
    assert np.array_equal(read_calibration(tmp_path / "alone.json").covariance, alone.covariance)


def test_the_file_follows_its_own_schema_and_states_equation_direction_and_units():
    import jsonschema

    document = json.loads(json.dumps(calibration_document(usual()[1].calibration)))
    jsonschema.Draft202012Validator.check_schema(schema_of("calibration"))
    jsonschema.validate(document, schema_of("calibration"), cls=jsonschema.Draft202012Validator)
    assert document["format_version"] == 1
    assert document["equation"] == "truth = S * raw + b"
    assert "raw to true" in document["direction"]
    assert document["accelerometer"]["raw_unit"] == "counts"
    assert document["parameter_order"][:2] == ["accelerometer.S_xx", "accelerometer.S_xy"]
    assert np.shape(document["covariance"]) == (24, 24)
    assert len(document["recording"]["sha256"]) == 64


@pytest.mark.parametrize(
    ("path", "value", "said"),
    [
        (("format",), "something else", "not a calibration"),
        (("format_version",), 99, "update trihedron"),
        (("equation",), "truth = S * (raw - b)", "states the equation"),
        (("accelerometer", "S"), [[1.0, 0.0], [0.0, 1.0]], "accelerometer.S"),
        (("accelerometer", "b"), None, "'b' is a required property"),
        (("accelerometer", "raw_unit"), "furlongs", "accelerometer.raw_unit"),
        (("covariance",), [[1.0]], "covariance must be 24 x 24"),
        (("gravity_m_s2",), -9.8, "gravity_m_s2"),
        (("parameter_order",), ["b_x"], "parameter_order"),
        (("frame",), "sideways", "frame"),
    ],
)
def test_a_changed_file_is_refused_with_the_place_named(tmp_path, path, value, said):
    document = json.loads(json.dumps(calibration_document(usual()[1].calibration)))
    at = reduce(getitem, path[:-1], document)
    at[path[-1]] = value
    if value is None:
        del at[path[-1]]
    file = tmp_path / "c.json"
    file.write_text(json.dumps(document))
    with pytest.raises(CalibrationFileError, match=r"c\.json") as caught:
        read_calibration(file)
    assert said in str(caught.value)


@pytest.mark.parametrize(("which", "name", "record"), EVERY, ids=lambda v: getattr(v, "__name__", v))
def test_a_schema_names_what_its_record_writes(which, name, record):
    text = files("trihedron.files").joinpath("schema", f"{which}.schema.json").read_text(encoding="utf-8")
    stated = json.loads(text)["$defs"][name]["properties"]
    layout = getattr(record, "LAYOUT", None)
    assert set(stated) == set(layout.order if layout else (field.name for field in fields(record)))


def quality(**more):
    return FitQuality("m/s^2", np.array([0.1, -0.2]), np.array([0.1, 0.1]), 5.0, 1, 0.16, 0.2, 0.1, **more)


def test_null_is_no_finite_number_and_what_may_be_absent_stays_so():
    back = from_plain(as_plain(quality()) | {"chi2": None, "residual": [None, 1.0]}, FitQuality)
    assert math.isnan(back.chi2)
    assert math.isnan(back.residual[0])
    assert back.held_out is back.held_out_rms is None
    finding = Finding(next(iter(FindingCode)), "note", "seen", numbers={"x": math.nan})  # type: ignore[arg-type]
    assert math.isnan(from_plain(finding.to_dict() | {"numbers": {"x": None}}, Finding).numbers["x"])


@pytest.mark.parametrize("harm", [{"surprise": 1}, {"dof": None}, {"chi2": "much"}, {"residual": "x"}])
def test_an_entry_that_is_no_such_record_is_refused(harm):
    with pytest.raises((ValueError, TypeError)):
        from_plain(as_plain(quality()) | harm, FitQuality)
    with pytest.raises(KeyError):
        from_plain({"unit": "m/s^2"}, FitQuality)
