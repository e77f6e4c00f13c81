"""Coverage of the gyro's error bars over many seeds: method 1, method 2, joint fit. Prints one line per method.

python benches/coverage_gyroscope.py [n_seeds]
"""

from __future__ import annotations

import sys
from collections import Counter
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from trihedron.estimate.accelerometer import calibrate_norm
from trihedron.estimate.gyroscope import MoveOptions, calibrate_moves, calibrate_turns, turns_from_segments
from trihedron.estimate.joint import calibrate_joint
from trihedron.simulate import (
    Accelerometer,
    Gyroscope,
    NoiseTerms,
    Scenario,
    hand_session,
    simulate,
    table_turns,
)
from true_segments import segments_from_truth

S_F = ((1.01, 0.0, 0.0), (0.01, 0.99, 0.0), (-0.004, 0.006, 1.02))
S_W = ((1.02, 0.01, -0.015), (0.005, 0.98, 0.02), (-0.01, 0.008, 1.01))
HAND = Scenario(
    motion=hand_session(18, hold_s=3.0, first_hold_s=5.0),
    accelerometer=Accelerometer(S=S_F, b=(0.1, -0.1, 0.05), noise=NoiseTerms(N=(3e-3,) * 3)),
    gyroscope=Gyroscope(S=S_W, b=(0.01, -0.02, 0.005), noise=NoiseTerms(N=(2e-4,) * 3)),
)
TABLE = Scenario(motion=table_turns(), gyroscope=HAND.gyroscope)


def main(n_seeds: int) -> None:
    """Run all methods over the seeds and print coverage, z-scores and findings raised on sound recordings."""
    scores: dict[str, list[np.ndarray]] = {}
    distances: dict[str, list[float]] = {}
    findings: dict[str, Counter[str]] = {}

    def note(name, error, covariance, found):
        free = np.diag(covariance) > 0.0
        error, covariance = error[free], covariance[np.ix_(free, free)]
        scores.setdefault(name, []).append(error / np.sqrt(np.diag(covariance)))
        distances.setdefault(name, []).append(float(error @ np.linalg.solve(covariance, error)) / len(error))
        findings.setdefault(name, Counter()).update(f.code.value for f in found)

    for seed in range(n_seeds):
        recording, truth = simulate(TABLE, seed)
        turns, zeros = turns_from_segments(segments_from_truth(recording, truth))
        for route in ("least-squares", "zero-turn-first"):
            gyro, found = calibrate_turns(recording, turns, zeros, route=route)
            note(f"method 1, {route}", _error(gyro, truth.gyroscope_S, truth.gyroscope_b), gyro.covariance, found)
        recording, truth = simulate(HAND, seed)
        segments = segments_from_truth(recording, truth)
        g = truth.gravity_m_s2
        accelerometer, _ = calibrate_norm(
            segments.accelerometer_mean,
            segments.accelerometer_sigma_mean,
            g,
            raw_unit=recording.accelerometer_unit,
        )
        gyro, found = calibrate_moves(recording, segments, accelerometer, g)
        note("method 2", _error(gyro, truth.gyroscope_S, truth.gyroscope_b), gyro.covariance, found)
        both = calibrate_joint(recording, segments, accelerometer, g, "given", MoveOptions(n_folds=0))
        error = np.concatenate(
            [
                _error(both.accelerometer, truth.accelerometer_S, truth.accelerometer_b),
                _error(both.gyroscope, truth.gyroscope_S, truth.gyroscope_b),
            ]
        )
        note("joint, 21 parameters", error, both.covariance, both.findings)

    print(f"{n_seeds} seeds      within 1 sigma (68.3 %)   within 1.96 (95 %)   sd of z    chi2/n   false findings")
    for name, rows in scores.items():
        z = np.array(rows)
        print(
            f"{name:26s} {100 * np.mean(np.abs(z) < 1):8.1f} %  {100 * np.mean(np.abs(z) < 1.96):18.1f} %"
            f"  {z.std():14.3f}  {np.mean(distances[name]):8.3f}   {dict(findings[name])}"
        )
        print("    sd of z per parameter:", " ".join(f"{s:.2f}" for s in z.std(axis=0)))


def _error(found, S, b):
    return np.concatenate([(found.S - S).ravel(), found.b - b])


if __name__ == "__main__":
    main(int(sys.argv[1]) if len(sys.argv) > 1 else 200)
