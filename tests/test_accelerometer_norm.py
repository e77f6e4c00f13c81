"""Method 2: truth comes back inside its error bars, and what the poses do not tell is not claimed."""

import numpy as np
import pytest

from trihedron.estimate.accelerometer import calibrate_norm, calibrate_norm_samples
from trihedron.records import FindingCode, Severity
from trihedron.sensor_model import distort

G = 9.81744
S_TRUE = np.array([[2.41e-3, 0.0, 0.0], [-8.6e-6, 2.43e-3, 0.0], [-2.2e-5, -5.2e-5, 2.41e-3]])
B_TRUE = np.array([-79.9, -80.5, -75.6])
SIGMA = np.array([0.35, 0.30, 0.42])  # counts: about 0.8 mm/s²


def cube_poses() -> np.ndarray:
    """(18, 3) unit vectors: six faces and twelve edges of a cube."""
    grid = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)], dtype=float)
    kept = grid[np.isin(np.abs(grid).sum(axis=1), (1, 2))]
    return kept / np.linalg.norm(kept, axis=1, keepdims=True)


def readings(up: np.ndarray, seed: int, S: np.ndarray = S_TRUE, b: np.ndarray = B_TRUE) -> np.ndarray:
    rng = np.random.default_rng(seed)
    return distort(G * up, S, b) + SIGMA * rng.standard_normal((len(up), 3))


def codes(findings):
    return {finding.code for finding in findings}


def test_exact_readings_give_the_exact_model():
    means = distort(G * cube_poses(), S_TRUE, B_TRUE)
    sensor, findings = calibrate_norm(means, SIGMA, G)
    # Sixteen digits less five for 32768 counts of zero against 4000 of signal, less the conditioning of the poses. The
    # inflation by noise is predicted but absent in exact readings: |σ|²/2g = 1e-7 m/s².
    np.testing.assert_allclose(sensor.S, S_TRUE, atol=1e-10)
    np.testing.assert_allclose(sensor.b, B_TRUE, atol=2e-6)
    assert not findings


def test_every_raw_sample_and_the_means_give_the_same_answer():
    rng = np.random.default_rng(5)
    up = np.repeat(cube_poses(), 200, axis=0)
    samples = distort(G * up, S_TRUE, B_TRUE) + SIGMA * np.sqrt(200) * rng.standard_normal(up.shape)
    pose = np.repeat(np.arange(18), 200)
    means = samples.reshape(18, 200, 3).mean(axis=1)
    from_means, _ = calibrate_norm(means, SIGMA, G)
    from_samples, _ = calibrate_norm_samples(samples, pose, SIGMA, G)
    # The norm of a mean and the mean of norms differ by the inflation alone, which both subtract.
    assert np.all(np.abs(from_samples.S - from_means.S) < 0.02 * np.maximum(from_means.sigma_S, 1e-12))
    np.testing.assert_allclose(from_samples.sigma_b, from_means.sigma_b, rtol=1e-2)


def test_six_faces_are_refused_and_the_missing_poses_named():
    up = np.vstack([np.eye(3), -np.eye(3)])
    sensor, findings = calibrate_norm(readings(up, 1), SIGMA, G)
    refusal = next(f for f in findings if f.code is FindingCode.NOT_OBSERVABLE)
    assert refusal.severity is Severity.SERIOUS
    assert "6 of the 9" in refusal.seen
    assert refusal.action.count("tilted") >= 3
    assert sensor.observability.rank == 6
    # Scales and zeros are seen, the three angles are as unknown as before: 100 % of the scale.
    assert np.all(sensor.sigma_S[np.tril_indices(3, -1)] > 0.5 * 2.4e-3)


@pytest.mark.parametrize("frame", ["lower", "symmetric"])
def test_frames_agree_on_every_norm(frame):
    means = readings(cube_poses(), 3)
    lower, _ = calibrate_norm(means, SIGMA, G)
    other, _ = calibrate_norm(means, SIGMA, G, frame=frame)
    np.testing.assert_allclose(other.S.T @ other.S, lower.S.T @ lower.S, rtol=1e-8, atol=1e-14)
