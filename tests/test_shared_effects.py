"""Several recordings of one unit: their evidence for an effect of one size adds."""

from dataclasses import replace

import numpy as np
import pytest
from scipy import stats

import trihedron
from diagnosed_session import simulated
from trihedron.diagnose.hypothesis import AddedTerms
from trihedron.diagnose.shared import agreement
from trihedron.records import Finding, Severity
from trihedron.report.shared_diagnosis import shared_diagnosis_report

STRENGTHS = ((1.0, 1.0), (1.0,) * 4, (1.0, 1.0), (1.0, 1.0))


def answered(A, y, size):
    """What a linear recording ``y = A p + noise`` answers, its evidence over that of no effect."""
    prior = np.eye(A.shape[1]) * size**2
    covariance = np.linalg.inv(A.T @ A + np.linalg.inv(prior))
    spread = A @ prior @ A.T + np.eye(len(y))
    of = stats.multivariate_normal
    gain = of.logpdf(y, cov=spread) - of.logpdf(y, cov=np.eye(len(y)))
    sizes = np.full(A.shape[1], size)
    return AddedTerms(gain, STRENGTHS, covariance @ A.T @ y, covariance).likelihood(sizes, sizes)


def test_evidence_of_recordings_together_is_that_of_all_their_rows():
    """Against one Gaussian of all rows, dense; also where the common size is expected larger than each was asked at."""
    rng = np.random.default_rng(4)
    As = [rng.normal(size=(12, 3)), rng.normal(size=(7, 3)), rng.normal(size=(2, 3))]
    p = np.array([0.5, -1.0, 0.2])
    ys = [A @ p + rng.normal(size=len(A)) for A in As]
    parts = [answered(A, y, 0.7) for A, y in zip(As, ys, strict=True)]
    A, y = np.vstack(As), np.concatenate(ys)
    for scale in (1.0, 3.0):
        gain, value, covariance = sum(parts[1:], parts[0]).under(np.full(3, scale))
        prior = np.eye(3) * (0.7 * scale) ** 2
        of = stats.multivariate_normal
        dense = of.logpdf(y, cov=A @ prior @ A.T + np.eye(len(y))) - of.logpdf(y, cov=np.eye(len(y)))
        posterior = np.linalg.inv(A.T @ A + np.linalg.inv(prior))
        # Rounding of a few hundred products.
        assert gain == pytest.approx(dense, abs=1e-8)
        np.testing.assert_allclose(0.7 * value, posterior @ A.T @ y, atol=1e-10)
        np.testing.assert_allclose(0.49 * covariance, posterior, atol=1e-10)


def test_values_that_agree_do_so_at_the_rate_of_chance():
    """p below 0.1 in 10 % of 400 trials: 95 % binomial limits 7 to 13 %."""
    rng = np.random.default_rng(5)
    p = []
    for _ in range(400):
        truth = rng.normal(size=2)
        As = [rng.normal(size=(6, 2)) for _ in range(3)]
        p.append(agreement([answered(A, A @ truth + rng.normal(size=6), 5.0) for A in As]))
    assert 0.07 <= np.mean(np.array(p) < 0.1) <= 0.13


def sessions(*strengths, unit=1):
    """Recordings of one unit, or of several (None), whose gyro has these g-sensitivities [(rad/s)/(m/s²)]."""
    made = []
    for k, g in enumerate(strengths):
        size = {"matrix": [[0.0, g, 0.0], [0.0, 0.0, g], [-g, 0.0, 0.0]]} if g else {}
        made.append(simulated("gyro-g-sensitivity" if g else "", 11 + k, 12, unit=unit, **size)[0])
    return trihedron.diagnose_sessions(made, gravity_m_s2=9.81)


def test_an_effect_too_weak_for_one_recording_is_found_in_three():
    found = sessions(6e-5, 6e-5, 6e-5)
    (effect,) = found.effects
    assert effect.id == "gyro-g-sensitivity"
    assert effect.is_of_instrument
    assert effect.score > sum(max(score, 0.0) for score in effect.scores)
    value = {p.name: p for p in effect.parameters}["G_xy"]
    assert abs(value.value - 6e-5) < 4.0 * value.std


def test_healthy_recordings_share_nothing_and_one_not_with_itself_alone():
    found = sessions(0.0, 0.0)
    assert found.effects == found.findings == ()
    assert "share no missing effect" in " ".join(str(found).split())
    several = sessions(0.0, 0.0, unit=None)
    assert {one.code for one in several.findings} == {"several-devices"}
    assert shared_diagnosis_report(several).what_next.startswith("Diagnose the recordings of one unit")
    # One that is red by itself is named, and makes the whole red.
    serious = Finding("not-observable", Severity.SERIOUS, "The poses determine 4 parameters.", "", "Add.")
    first, second = found.calibrations
    red = replace(found, calibrations=(first, replace(second, findings=(serious,))))
    document = shared_diagnosis_report(red)
    assert document.level == "bad"
    assert "seed 12" in document.verdict.split("share")[0]
    with pytest.raises(ValueError, match="two or more"):
        trihedron.diagnose_sessions([simulated("", 11, 14)[0]], gravity_m_s2=9.81)
