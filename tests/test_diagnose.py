"""Diagnosis on simulated recordings: healthy ones pass, each mechanism is named, the fit improves held out."""

import numpy as np
import pytest

import diagnosed_session


def diagnosed(*what, **how):
    """Of fourteen poses: nothing that is stated here needs more."""
    return diagnosed_session.diagnosed(*what, n_poses=14, **how)


CASES = {
    "accel-hysteresis": {"offset_m_s2": (0.01, 0.015, 0.01), "width_m_s2": 2.0},
    "timing-jitter": {"jitter_s": 1e-3},
}


@pytest.mark.parametrize("effect_id", CASES)
def test_the_mechanism_is_named_first(effect_id):
    diagnosis = diagnosed(effect_id, **CASES[effect_id])
    assert diagnosis.verdict == "missing-physics"
    assert diagnosis.effects[0].id == effect_id


def test_missing_codes_are_counted_and_lost_ones_by_chance_are_not():
    # Every fourth code of 20 to 60 visited per axis is missing; healthy adis has codes that chance left empty.
    diagnosis = diagnosed("quantisation", seed=5, grade="adis", sensor="accelerometer", missing_every=4)
    assert diagnosis.effects[0].id == "quantisation"
    missing = [p.value for p in diagnosis.effects[0].parameters if p.name.startswith("missing_codes")]
    assert len(missing) == 3
    assert min(missing) >= 5
    assert all(e.id != "quantisation" for e in diagnosed(seed=5, grade="adis").effects)


def test_a_dead_band_is_measured():
    # Gyro readings within 60 counts of zero do not move; half-width to one count of 60.
    diagnosis = diagnosed("quantisation", seed=6, sensor="gyroscope", dead_band=60.0)
    assert diagnosis.effects[0].id == "quantisation"
    scale = np.abs(np.diag(np.array(diagnosis.extended.gyroscope["S"])))
    for axis, name in enumerate("xyz"):
        found = [p.value for p in diagnosis.effects[0].parameters if p.name == f"dead_band_g{name}"]
        assert found
        assert abs(found[0] / scale[axis] - 60.0) < 2.0
