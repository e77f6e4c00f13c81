"""A g-sensitivity added to recordings with references: in which is it named, alone and jointly?

    python benches/reference_flights.py LOG TRUTH [LOG TRUTH ...] [--inject full|one|none] [--joint] [--gravity 9.807]

Logs in SI. `full`: nine elements of about 0.1 °/s/g (seed 5); `one`: 0.1 °/s/g of gyro X along accelerometer Y alone.
Printed: the scores, from which size the reference would show one, the errors of the estimates in σ, and χ² of S of all
recordings, each fitted alone, about their common mean.
"""

import argparse
from dataclasses import replace

import numpy as np

from trihedron import read
from trihedron.estimate.reference.fit import fit_references
from trihedron.read.reference.motion import read_reference

SIZE = np.radians(0.1) / 9.807


def matrix(kind):
    """(3, 3) [(rad/s)/(m/s²)] what is put in."""
    if kind == "full":
        return SIZE * np.sign(np.random.default_rng(5).normal(size=(3, 3)))
    return SIZE * np.array([[0.0, kind == "one", 0.0], [0.0] * 3, [0.0] * 3])


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("paths", nargs="+")
    parser.add_argument("--inject", choices=("full", "one", "none"), default="full")
    parser.add_argument("--joint", action="store_true")
    parser.add_argument("--gravity", type=float, default=9.807)
    given = parser.parse_args()
    injected = matrix(given.inject)
    pairs = []
    for path, beside in zip(given.paths[::2], given.paths[1::2], strict=True):
        log = read(path)
        pairs.append((replace(log, gyroscope=log.gyroscope + log.accelerometer @ injected.T), read_reference(beside)))
    alone = []
    for group in [pairs] if given.joint else [[pair] for pair in pairs]:
        found = fit_references(group, given.gravity)[0]
        alone.append((found.gyroscope.S.ravel(), np.linalg.inv(found.gyroscope.covariance[:9, :9])))
        print(" + ".join(str(log.source) for log, _ in group))
        for ident, one in found.effects.items():
            print(f"  {ident} score {one.score:.1f}, shown from {one.shown_from:.2f} times a data sheet's")
        one = found.effects["gyro-g-sensitivity"]
        z = (one.value - injected.ravel()) / one.std
        print(
            f"  estimates {np.abs(z).max():.1f} sigma at most from what was put in (rms {np.sqrt(np.mean(z**2)):.2f})"
        )
    if len(alone) > 1:
        mean = np.linalg.solve(sum(W for _, W in alone), sum(W @ S for S, W in alone))
        chi2 = sum((S - mean) @ W @ (S - mean) for S, W in alone)
        print(f"S of {len(alone)} recordings about their mean: chi-square {chi2:.1f} of {9 * (len(alone) - 1)}")


if __name__ == "__main__":
    main()
