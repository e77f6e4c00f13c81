"""Are the error bars honest end to end? ``python benches/coverage.py [SESSIONS]``: 200 simulated sessions by default.

Each session is segmented, calibrated and compared with its truth; nothing but the comparison knows it.
"""

import sys
from dataclasses import replace

import numpy as np

from trihedron import calibrate
from trihedron.pipeline.demonstrating import compare_with_truth, truth_of_the_day
from trihedron.simulate import hand_session, scenario_by_name, simulate


def main() -> None:
    """Simulate, calibrate, count."""
    n_sessions = int(sys.argv[1]) if len(sys.argv) > 1 else 200
    scenario = replace(scenario_by_name("hand-session"), motion=hand_session(n_poses=24))
    z, chi2, names = [], [], ()
    for seed in range(1000, 1000 + n_sessions):
        recording, _ = simulate(scenario, seed)
        truth = truth_of_the_day(scenario, seed)
        result = calibrate(recording, gravity_m_s2=truth.gravity_m_s2)
        comparison = compare_with_truth(result.calibration, truth)
        z.append(comparison.z)
        chi2.append(comparison.chi2)
        names = comparison.names
    scores = np.abs(np.array(z))
    n = scores.size
    print(f"{n_sessions} sessions of {len(names)} parameters")
    for limit, wanted in ((1.0, 0.6827), (1.96, 0.95), (2.576, 0.99)):
        sigma = np.sqrt(wanted * (1.0 - wanted) / n)
        share = 100 * np.mean(scores < limit)
        print(f"within {limit:5.3f} σ: {share:6.2f} %  (normal {100 * wanted:.2f} ± {100 * sigma:.2f} %)")
    spread = np.sqrt(2 * len(names) / n_sessions)
    print(f"mean χ² of a session: {np.mean(chi2):.2f} for {len(names)} parameters (± {spread:.2f})")
    rms = np.sqrt(np.mean(np.array(z) ** 2, axis=0))
    for name, value in zip(names, rms, strict=True):
        print(f"  {name:20s} rms z {value:.2f}")


if __name__ == "__main__":
    main()
