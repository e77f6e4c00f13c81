"""Diagnosis on simulated recordings: healthy ones pass, each mechanism is named, the fit improves held out."""

import numpy as np
import pytest

import diagnosed_session


def diagnosed(*what, **how):
    """Of fourteen poses: nothing that is stated here needs more."""
    return diagnosed_session.diagnosed(*what, n_poses=14, **how)


def test_a_healthy_recording_is_consistent():
    diagnosis = diagnosed(grade="tactical")
    assert diagnosis.verdict == "consistent"
    assert diagnosis.effects == ()


CASES = {
    "accel-hysteresis": {"offset_m_s2": (0.01, 0.015, 0.01), "width_m_s2": 2.0},
    "gyro-g-sensitivity": {"matrix": ((1e-4, 2e-5, 0), (0, -1e-4, 5e-5), (5e-5, 0, 1e-4))},
    "timing-jitter": {"jitter_s": 1e-3},
}


@pytest.mark.parametrize("effect_id", CASES)
def test_the_mechanism_is_named_first(effect_id):
    diagnosis = diagnosed(effect_id, **CASES[effect_id])
    assert diagnosis.verdict == "missing-physics"
    assert diagnosis.effects[0].id == effect_id


def test_parameters_come_with_honest_errors_and_the_fit_improves_held_out():
    truth = np.array([3e-4, -2e-4, 2e-4])
    effect = diagnosed("accel-quadratic", k2=tuple(truth)).effects[0]
    z = [(p.value - t) / p.std for p, t in zip(effect.parameters, truth, strict=True)]
    # Three standard normal numbers: 4 sigma is passed by chance once in 5000 runs.
    assert np.max(np.abs(z)) < 4.0
    held = effect.held_out[0]
    assert held.chi2_per_dof_after < 1.3 < held.chi2_per_dof_before


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
