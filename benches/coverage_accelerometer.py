"""Do the error bars of the accelerometer cover the truth? `python benches/coverage_accelerometer.py`: 200 seeds each.

Every seed draws another instrument (zeros to half of |g|, scales to 10 %, axes to 2°), other small leanings of the
poses, and unequal noise per axis and pose. z = (estimate - truth)/sigma of every free parameter should be standard
normal: |z| < 1 in 68.3 % and |z| < 1.96 in 95 % of the cases, mean square 1.
"""

from __future__ import annotations

import argparse

import numpy as np
from scipy import stats

from trihedron.estimate.accelerometer import calibrate_faces, calibrate_norm, calibrate_norm_samples
from trihedron.sensor_model import distort, reframing

G = 9.81


def cube_directions() -> np.ndarray:
    """(18, 3) faces and edges of a cube."""
    grid = np.array([(x, y, z) for x in (-1, 0, 1) for y in (-1, 0, 1) for z in (-1, 0, 1)], dtype=float)
    kept = grid[np.isin(np.abs(grid).sum(axis=1), (1, 2))]
    return kept / np.linalg.norm(kept, axis=1, keepdims=True)


def instrument(rng: np.random.Generator) -> tuple[np.ndarray, np.ndarray]:
    """A full S in m/s² per count and b."""
    S = 2.4e-3 * (np.diag(1 + 0.1 * rng.uniform(-1, 1, 3)) + 0.035 * rng.uniform(-1, 1, (3, 3)))
    return S, -S @ np.full(3, 32768.0) + 0.5 * G * rng.uniform(-1, 1, 3)


def session(rng: np.random.Generator, up: np.ndarray, S: np.ndarray, b: np.ndarray) -> tuple[np.ndarray, np.ndarray]:
    """Mean readings of poses and their true standard errors, unequal per axis and pose."""
    sigma = 0.4 * rng.uniform(0.5, 2.0, 3) * rng.uniform(0.5, 2.0, (len(up), 1))
    return distort(G * up, S, b) + sigma * rng.standard_normal(up.shape), sigma


def z_scores(method: str, seed: int) -> np.ndarray:
    """z of the free parameters of one simulated session."""
    rng = np.random.default_rng([20261121, seed])
    S, b = instrument(rng)
    if method.startswith("faces"):
        up = np.repeat(np.vstack([np.eye(3), -np.eye(3)]), 2, axis=0)
        means, sigma = session(rng, up, S, b)
        name = "closed-form" if method.endswith("closed") else "least-squares"
        sensor, _ = calibrate_faces(means, sigma, G, method=name)
        free = np.ones(12, dtype=bool)
    else:
        up = cube_directions() + 0.1 * rng.standard_normal((18, 3))
        up /= np.linalg.norm(up, axis=1, keepdims=True)
        frame = "symmetric" if "symmetric" in method else "lower"
        change = reframing(S, b, frame)
        S, b = change.rotation @ S, change.rotation @ b
        means, sigma = session(rng, up, S, b)
        if method.endswith("samples"):
            noise = sigma[:, None, :] * np.sqrt(50) * rng.standard_normal((18, 50, 3))
            samples = (distort(G * up, S, b)[:, None, :] + noise).reshape(-1, 3)
            sensor, _ = calibrate_norm_samples(samples, np.repeat(np.arange(18), 50), sigma, G, frame=frame)
        else:
            loss = "huber" if "huber" in method else "linear"
            sensor, _ = calibrate_norm(means, sigma, G, frame=frame, loss=loss)
        free = np.concatenate([np.tri(3, dtype=bool).ravel(), np.ones(3, dtype=bool)])
    error = np.concatenate([(sensor.S - S).ravel(), sensor.b - b])
    return error[free] / np.sqrt(np.diag(sensor.covariance)[free])


METHODS = ("faces, least squares", "faces, closed", "norm, lower", "norm, symmetric", "norm, huber", "norm, samples")


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__)
    parser.add_argument("--seeds", type=int, default=200)
    n = parser.parse_args().seeds
    print(f"{n} seeds; two-sided 99 % binomial limits are for independent seeds, one parameter")
    low68, high68 = stats.binom.interval(0.99, n, 0.6827)
    low95, high95 = stats.binom.interval(0.99, n, 0.95)
    print(f"  68 %: {low68 / n:.3f} to {high68 / n:.3f}   95 %: {low95 / n:.3f} to {high95 / n:.3f}")
    print(
        f"{'method':24} {'|z|<1':>7} {'|z|<1.96':>9} {'mean z²':>8} {'mean z':>7}   range of |z|<1.96 over parameters"
    )
    for method in METHODS:
        z = np.array([z_scores(method, seed) for seed in range(n)])
        in68, in95 = np.mean(np.abs(z) < 1), np.mean(np.abs(z) < 1.96)
        each = np.mean(np.abs(z) < 1.96, axis=0)
        print(
            f"{method:24} {in68:7.3f} {in95:9.3f} {np.mean(z**2):8.3f} {np.mean(z):7.3f}   "
            f"{each.min():.3f} to {each.max():.3f}"
        )


if __name__ == "__main__":
    main()
