"""``python benches/confidence [NAME ...] [--sessions N] [--first SEED ...] [--design [--jobs N]]``: do intervals hold?

One line per setting: sessions answered and trusted (no serious finding), marked, failed; over the trusted ones the
share within 1.96 σ and rms z of S and b of both sensors, and the largest of all in σ. A share is outside where it
misses 93 to 97 % by more than two of its standard errors, from session to session, for a session's elements share its
readings.
"""

import argparse
import itertools
import sys
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1]))

from confidence import design
from confidence.motion import G
from confidence.sensor import lower, recorded
from confidence.sessions import hand
from trihedron import calibrate

STRONG = {"gyro_flicker": np.radians(20.0 / 3600.0), "accel_flicker": 0.3e-3 * G}
NORMAL_95 = 1.96
FAR = 4.5
"""Error in standard errors of which the seed is named; one session in a few thousand by chance."""
QUANTITIES = ("S_f", "b_f", "S_w", "b_w")

# One factor of a session at a time: length of moves, bits, rate, poses, slow noise, losses. 16 bits, 100 Hz, 18 poses
# are those of the moves of 2 s.
SETTINGS = {
    **{f"moves of {s:g} s": {"move_s": s} for s in (0.25, 2.0, 30.0)},
    **{f"gyro of {b} bit": {"gyro_bits": b} for b in (8, 10, 12)},
    **{f"both of {b} bit": {"gyro_bits": b, "accel_bits": b} for b in (8, 10, 12)},
    **{f"{hz:g} Hz": {"rate_hz": hz} for hz in (10.0, 1000.0)},
    **{f"{n} poses": {"n_poses": n} for n in (9, 40)},
    "1/f strong": STRONG,
    **{f"g-sensitivity of {d:g} °/s/g": {"g_sensitivity": np.radians(d) / G} for d in (0.02, 0.1, 0.3)},
    **{f"lost {100 * p:g} %, timestamps true": {"lost": p} for p in (0.001, 0.03)},
    **{f"lost {100 * p:g} %, timestamps remade": {"lost": p, "is_remade": True} for p in (0.001, 0.03)},
    # A radio link that drops 50 to 400 ms at a time.
    **{f"lost {100 * p:g} % in bursts": {"lost": p, "burst": (5, 40)} for p in (0.1, 0.3)},
    # Bias repeatability from pose to pose [°/s, mm/s²].
    "scattered biases": {"n_poses": 24, "scatter": (0.05, 3.0)},
}


def scattered(values, S, time_s, rests, sigma, rng):
    """Readings (n, 3) with a bias of each pose's own, of ``sigma`` in SI, that jumps somewhere in every move."""
    own = sigma * rng.standard_normal((len(rests), 3))
    jumps = [rng.uniform(before[1], after[0]) for before, after in itertools.pairwise(rests)]
    return values + np.linalg.solve(S, own[np.searchsorted(jumps, time_s)].T).T


def answer(make, options, seed):
    """Calibration of one session through the public front, and its truth in the same frame."""
    options = dict(options)
    lost, is_remade = options.pop("lost", 0.0), options.pop("is_remade", False)
    burst, scatter = options.pop("burst", (1, 2)), options.pop("scatter", None)
    f, w, rate, truth, motion = make(seed, **options)
    t = getattr(motion, "time_s", np.arange(len(f)) / rate)
    if scatter:
        rng = np.random.default_rng([15, seed])
        w = scattered(w, truth.S_w, t, motion.rests, np.radians(scatter[0]), rng)
        f = scattered(f, truth.S_f, t, motion.rests, 1e-3 * scatter[1], rng)
    if lost:
        rng, kept = np.random.default_rng([14, seed]), np.ones(len(t), dtype=bool)
        while kept.mean() > 1.0 - lost:
            start = rng.integers(len(t))
            kept[start : start + rng.integers(*burst)] = False
        f, w, t = f[kept], w[kept], t[kept]
        if is_remade:
            t = np.arange(len(f)) / rate
    return calibrate(recorded(f, w, rate, t), gravity_m_s2=G), lower(truth)


def session(make, options, seed):
    """Whether the result is trusted, and every error in standard errors: of S_f, b_f, S_w, b_w."""
    try:
        result, truth = answer(make, options, seed)
    except ValueError:
        return "failed", None
    a, g = result.accelerometer, result.gyroscope
    if g is None:
        return "failed", None
    free = np.tril_indices(3)
    z = {"S_f": ((a.S - truth.S_f) / np.where(a.sigma_S > 0.0, a.sigma_S, np.inf))[free]}
    z |= {"b_f": (a.b - truth.b_f) / a.sigma_b}
    z |= {"S_w": ((g.S - truth.S_w) / g.sigma_S).ravel(), "b_w": (g.b - truth.b_w) / g.sigma_b}
    return ("trusted" if result.is_trustworthy else "marked"), z


def line(name, rows):
    """One row of the table."""
    counts = ", ".join(str(sum(said == kind for said, _ in rows)) for kind in ("trusted", "marked", "failed"))
    trusted = [z for said, z in rows if said == "trusted"]
    cells, outside, worst = [], [], 0.0
    for quantity in QUANTITIES if trusted else ():
        z = np.array([row[quantity] for row in trusted])
        each = 100.0 * np.mean(np.abs(z) < NORMAL_95, axis=1)
        error = max(each.std() / np.sqrt(len(each)), 100.0 * np.sqrt(0.05 * 0.95 / z.size))
        cells.append(f"{each.mean():.1f} %, {np.sqrt(np.mean(z**2)):.2f}")
        worst = max(worst, float(np.abs(z).max()))
        if not 93.0 - 2.0 * error <= each.mean() <= 97.0 + 2.0 * error:
            outside.append(f"{quantity} too {'small' if each.mean() < 95.0 else 'wide'}")
    return f"| {name} | {counts} | {' | '.join(cells or ['–'] * 4)} | {worst:.1f} σ | {' '.join(outside)} |"


def of_design(seed):
    """Levels of one session of the design, and what :func:`session` says of it."""
    levels = design.drawn(seed)

    def make(of):
        made = design.session(of, **levels)
        return made.force, made.rate, made.rate_hz, made.truth, made

    said = session(make, {}, seed)
    for quantity, z in (said[1] or {}).items():
        if said[0] == "trusted" and np.abs(z).max() > FAR:
            print(f"seed {seed}: {quantity} {np.abs(z).max():.1f} σ", file=sys.stderr, flush=True)
    return levels, said


def by_level(seeds, jobs):
    """Rows of every level of every factor of the design, each session in one of every factor."""
    rows = {}
    with ProcessPoolExecutor(jobs) as pool:
        for levels, said in pool.map(of_design, seeds):
            for name in ("all", *(f"{factor} {level}" for factor, level in levels.items())):
                rows.setdefault(name, []).append(said)
    return rows


def main() -> None:
    """Print the table."""
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=20, help="from every first seed")
    parser.add_argument("--first", type=int, nargs="+", default=[0], help="seeds of first sessions")
    parser.add_argument("names", nargs="*")
    parser.add_argument("--jobs", type=int, default=2, help="processes of the design")
    parser.add_argument("--design", action="store_true", help="every factor at once, a row for each of its levels")
    given = parser.parse_args()
    print("| setting | trusted, marked, failed | S_f | b_f | S_ω | b_ω | worst | outside |\n" + "|---" * 8 + "|")
    seeds = [first + k for first in given.first for k in range(given.sessions)]
    if given.design:
        for name, rows in sorted(by_level(seeds, given.jobs).items()):
            print(line(name, rows))
        return
    for name, options in SETTINGS.items():
        if not given.names or any(word in name for word in given.names):
            print(line(name, [session(hand, options, seed) for seed in seeds]), flush=True)


if __name__ == "__main__":
    main()
