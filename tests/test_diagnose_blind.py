"""The blind trial in small: healthy sessions pass, a handful of drawn flaws is named, the bench itself is sound."""

import pytest

from blind_trial.draw import Job
from blind_trial.score import scored, trial


@pytest.mark.parametrize(
    ("effect", "size", "grade", "seed"),
    [
        ("gyro-thermal-bias", "per_k", "tactical", 2),
        pytest.param("lever-arm", "arm_m", "adis", 4, marks=pytest.mark.slow),
    ],
)
def test_a_drawn_flaw_is_named_with_its_size(effect, size, grade, seed):
    result = trial(Job((effect,), grade, seed))
    assert result["score"] == "right"
    found = result["parameters"][result["found"].index(effect)]
    assert len(found) >= 3
    # Three values: 4 sigma is passed by chance once in 5000.
    for parameter, true in zip(found, result["sizes"][effect][size], strict=False):
        assert abs(parameter["value"] - true) < 4.0 * parameter["std"], parameter["name"]


def test_an_answer_behind_a_saturation_that_is_true_is_right_and_behind_another_it_is_not():
    result = {
        "effects": ["accel-cubic"], "foreign": "", "verdict": "missing-physics",
        "found": ["gyro-saturation", "accel-cubic"], "confounded": [[], []], "also": ["gyro-saturation"],
    }  # fmt: skip
    assert scored(result) == "right"
    assert scored(result | {"also": []}) == "second"
    assert scored(result | {"found": ["accel-quadratic"], "confounded": [["accel-cubic"]]}) == "confounded"
    assert scored(result | {"found": ["accel-quadratic"], "confounded": [[]]}) == "wrong"
    assert scored(result | {"found": [], "confounded": []}) == "missed"
