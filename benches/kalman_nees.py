"""Are the error bars right? `PYTHONPATH=python python benches/kalman_nees.py [seeds]` (200 seeds: about 1 min).

Mean of the normalised estimation error squared over seeds after 60, 100, 200 and 324 poses (expected 4, with its 99 %
interval), share of final errors within 1, 2 and 3 sigma, mean of the normalised innovation squared (expected 1), and in
how many seeds the NIS test and the whiteness test raise an alarm at 1 %. Noise is simulated sample by sample, apart
from the filter's model (`kalman_session.py`).
"""

import sys

import numpy as np
from scipy import stats

from kalman_session import CONSTANTS, MIXES, REFERENCES, SESSION_S, SIGMA, STEP, readings
from trihedron import _core
from trihedron.estimate.kalman import ShapingOptions, check_innovations
from trihedron.estimate.kalman.shaping import shaping_model
from trihedron.records import AxisNoise

SEEDS = int(sys.argv[1]) if len(sys.argv) > 1 else 200
AT = (60, 100, 200, 324)


def nees(model, z, references, start, hold, at):
    z4, wide = np.zeros(4), np.full(4, 1e8 * SIGMA)
    n = at
    constants, sigma, covariance, y, s, *_ = _core.kalman_track(
        model,
        _core.KalmanStart(z4, wide, z4),
        _core.KalmanPoses(z[:n], references[:n], start[:n], hold[:n], np.zeros(n)),
    )
    e = (constants[-1] - CONSTANTS) / sigma[-1]
    correlation = covariance / np.outer(sigma[-1], sigma[-1])
    return e @ np.linalg.solve(correlation, e), e, y, np.sqrt(s)


def main():
    low, high = stats.chi2.ppf([0.005, 0.995], 4 * SEEDS) / SEEDS
    print(f"{SEEDS} seeds; mean NEES of 4 constants, 99 % interval {low:.2f} to {high:.2f}")
    print(
        f"{'':50}" + "".join(f"{n:>7}" for n in AT) + "   within 1, 2, 3 sigma     NIS  alarms (NIS, whiteness at 1 %)"
    )
    for mix in MIXES:
        for article in (False, True):
            if article and not mix.flicker:
                continue
            options = ShapingOptions.of_the_article(SESSION_S, 5.0) if article else ShapingOptions()
            noise = AxisNoise(**mix.coefficients(), resolution=STEP if mix.converter else 0.0,
                              sample_sigma=mix.white * np.sqrt(20.0))  # fmt: skip
            model = shaping_model(noise, options, session_s=SESSION_S, hold_s=5.0)
            values, errors, nis, alarms = [], [], [], np.zeros(2, dtype=int)
            for seed in range(SEEDS):
                z, start, hold = readings(mix, 10_000 + seed)
                runs = [nees(model, z, REFERENCES, start, hold, n) for n in AT]
                values.append([r[0] for r in runs])
                errors.append(runs[-1][1])
                seen = check_innovations(runs[-1][2], runs[-1][3])
                nis.append(seen.nis_mean)
                alarms += [not seen.nis_low <= seen.nis_mean <= seen.nis_high, seen.whiteness_p < 0.01]
            shares = [np.mean(np.abs(errors) < k) for k in (1, 2, 3)]
            name = mix.name + (" [article filter]" if article else "")
            cells = "".join(f"{v:7.2f}" for v in np.mean(values, axis=0))
            within = " ".join(f"{s:.3f}" for s in shares)
            print(f"{name:50}{cells}    {within}    {np.mean(nis):6.3f}   {alarms[0]:3d} {alarms[1]:3d}")


if __name__ == "__main__":
    main()
