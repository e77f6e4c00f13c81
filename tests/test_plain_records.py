"""Records, the documents that hold them and the published schemas name the same things."""

import json
import math
from dataclasses import fields
from importlib.resources import files

import numpy as np
import pytest

from trihedron.records import FitQuality
from trihedron.records.calibration import Observability
from trihedron.records.diagnosis import (
    AcceptedEffect,
    Candidate,
    EffectParameter,
    LinearModel,
    NoiseDifference,
    ParameterDifference,
    Relation,
    Stage,
)
from trihedron.records.domains import DomainResiduals, DomainTest, HeldOut, Where
from trihedron.records.finding import Finding, FindingCode
from trihedron.records.plain import as_plain, from_plain
from trihedron.records.reference import Estimate, FitToReference

OF_DIAGNOSIS = {
    "where": Where, "domain": DomainTest, "heldout": HeldOut, "parameter": EffectParameter, "effect": AcceptedEffect,
    "candidate": Candidate, "linear": LinearModel, "residuals": DomainResiduals, "finding": Finding,
    "parameter_difference": ParameterDifference, "noise_difference": NoiseDifference, "relation": Relation,
    "stage": Stage,
    "estimate": Estimate, "against_reference_sensor": FitToReference,
}  # fmt: skip
OF_CALIBRATION = {"residuals": FitQuality, "observability": Observability}
EVERY = [("diagnosis", *item) for item in OF_DIAGNOSIS.items()]
EVERY += [("calibration", *item) for item in OF_CALIBRATION.items()]


@pytest.mark.parametrize(("which", "name", "record"), EVERY, ids=lambda v: getattr(v, "__name__", v))
def test_a_schema_names_what_its_record_writes(which, name, record):
    text = files("trihedron.files").joinpath("schema", f"{which}.schema.json").read_text(encoding="utf-8")
    stated = json.loads(text)["$defs"][name]["properties"]
    layout = getattr(record, "LAYOUT", None)
    assert set(stated) == set(layout.order if layout else (field.name for field in fields(record)))


def quality(**more):
    return FitQuality("m/s^2", np.array([0.1, -0.2]), np.array([0.1, 0.1]), 5.0, 1, 0.16, 0.2, 0.1, **more)


def test_a_record_comes_back_from_plain_types_with_the_same_bits():
    given = quality(held_out=np.array([[1 / 3, 2 / 3], [0.1, 1e-300]]), stopped_because="gradient")
    back = from_plain(json.loads(json.dumps(as_plain(given))), FitQuality)
    for field in fields(FitQuality):
        a, b = getattr(given, field.name), getattr(back, field.name)
        assert np.array_equal(a, b), field.name
        assert type(a) is type(b), field.name
    assert not back.residual.flags.writeable
    seen = Observability(2, 3, 4.0, np.ones(2), "tilt", ("turn it",), (("a", "b", 0.95),))
    again = from_plain(json.loads(json.dumps(as_plain(seen))), Observability)
    assert (again.correlated, again.advice) == (seen.correlated, seen.advice)
    finding = Finding(next(iter(FindingCode)), "note", "seen", numbers={"x": math.nan})  # type: ignore[arg-type]
    found = from_plain(finding.to_dict() | {"numbers": {"x": None}}, Finding)
    assert found.code is finding.code
    assert math.isnan(found.numbers["x"])


def test_null_is_no_finite_number_and_what_may_be_absent_stays_so():
    back = from_plain(as_plain(quality()) | {"chi2": None, "residual": [None, 1.0]}, FitQuality)
    assert math.isnan(back.chi2)
    assert math.isnan(back.residual[0])
    assert back.held_out is back.held_out_rms is None


@pytest.mark.parametrize("harm", [{"surprise": 1}, {"dof": None}, {"chi2": "much"}, {"residual": "x"}])
def test_an_entry_that_is_no_such_record_is_refused(harm):
    with pytest.raises((ValueError, TypeError)):
        from_plain(as_plain(quality()) | harm, FitQuality)
    with pytest.raises(KeyError):
        from_plain({"unit": "m/s^2"}, FitQuality)
