"""Limits of a range found and invented, over logs drawn here: `python benches/limits.py [LOGS]`.

Each line: logs in which readings were stopped, and those in which any limit is told on the sensor's three channels.
"""

import sys
from itertools import pairwise

import numpy as np

from trihedron.channel_facts import facts_of

RATE, G = 100.0, 9.81
STEP, NOISE = 1.0 / 16.4, 0.08
"""Of a gyro of 2000 deg/s and 16 bits, deg/s."""


def turns(rng, peak, n_moves=20):
    """(n, 3) rates of hand turns [deg/s], bells about one axis mostly, with a second of rest between them."""
    parts = []
    for k in range(n_moves):
        n = int(RATE * rng.uniform(0.6, 1.5))
        bell = np.sin(np.pi * np.arange(n) / n) ** 2
        axis = 0.2 * rng.standard_normal(3)
        axis[k % 3] = 1.0
        parts += [np.zeros((int(RATE * rng.uniform(1.0, 2.0)), 3)), peak * rng.uniform(0.6, 1.0) * np.outer(bell, axis)]
    return np.vstack(parts)


def read(rate, rng, limit=np.inf, noise=NOISE, step=STEP):
    """Codes of a rate (n, 3), in its unit."""
    return np.round(np.clip(rate + noise * rng.standard_normal(rate.shape), -limit, limit) / step) * step


def stopped(rng, n_stopped):
    """Hand turns of which so many readings, in all, are beyond the range."""
    rate = turns(rng, 500.0)
    return read(rate, rng, np.sort(np.abs(rate).ravel())[-n_stopped - 1])


def table(rng):
    """Steady turns of a rate table reached in half a second, a converter of 0.01 to 4 deg/s a step."""
    ramp, parts = np.linspace(0.0, 1.0, 50), []
    for k, v in enumerate((40.0, -40.0, 80.0, -80.0, 160.0, -160.0)):
        course = np.concatenate([np.zeros(200), ramp, np.ones(400), ramp[::-1]])
        parts.append(np.outer(v * course, np.eye(3)[k % 3]))
    return read(np.vstack(parts), rng, step=10.0 ** rng.uniform(-2.0, 0.6))


def swings(rng):
    """A sensor on its cord, every swing as high as the last."""
    t = np.arange(int(60 * RATE)) / RATE
    return read(np.outer(np.sin(2 * np.pi * rng.uniform(0.4, 1.2) * t), 200.0 * rng.standard_normal(3)), rng)


def rest(rng, drift=0.0):
    """Rest, with noise of 0.3 to 5 steps and a zero that drifts by so many standard deviations."""
    n = int(60 * RATE)
    return read(np.outer(np.linspace(0.0, drift * NOISE, n), np.ones(3)), rng, step=NOISE / rng.uniform(0.3, 5.0))


def poses(rng):
    """(n, 3) accelerometer of 20 poses, two in three of them faces, a few m/s² of a hand in moves, 2.4 mm/s² a step."""
    faces = [np.roll([(-1.0) ** k, 0.0, 0.0], k // 2) + 0.02 * rng.standard_normal(3) for k in range(20)]
    up = [rng.standard_normal(3) if k % 3 == 2 else face for k, face in enumerate(faces)]
    up = [G * one / np.linalg.norm(one) for one in up]
    bell = np.sin(np.pi * np.arange(80) / 80)[:, None] ** 2
    parts = [np.tile(up[0], (300, 1))]
    for a, b in pairwise(up):
        way = a + (b - a) * np.linspace(0.0, 1.0, 80)[:, None]
        parts += [way + 2.0 * rng.standard_normal(3) * bell, np.tile(b, (300, 1))]
    return read(np.vstack(parts), rng, 1.02 * G, 0.02, 0.0024)


RANGE_G = np.round(1.02 * G / 0.0024) * 0.0024
CASES = {
    "6 readings of hand turns stopped": (0.0, lambda rng: stopped(rng, 6)),
    "12 readings": (0.0, lambda rng: stopped(rng, 12)),
    "200 readings": (0.0, lambda rng: stopped(rng, 200)),
    "accelerometer, range of 1.02 g": (RANGE_G, poses),
    "hand turns inside the range": (np.inf, lambda rng: read(turns(rng, 500.0), rng)),
    "steady rates of a table": (np.inf, table),
    "swings of one height": (np.inf, swings),
    "rest": (np.inf, rest),
    "rest with drift": (np.inf, lambda rng: rest(rng, 10.0)),
}
"""What makes a log and the range that it stops at, 0 where every log's turns end at one of their own."""


def main() -> None:
    logs = int(sys.argv[1]) if len(sys.argv) > 1 else 20
    print(f"| {logs} logs each | readings stopped | limit told |\n|---|---|---|")
    for name, (limit, make) in CASES.items():
        told = stopped = 0
        for seed in range(logs):
            readings = make(np.random.default_rng([seed, 77]))
            facts = facts_of(None, readings, RATE).gyroscope
            told += facts is not None and bool(facts.limits)
            # Two samples: a single one that reaches the range is a reading.
            stopped += np.count_nonzero(np.abs(readings) > limit - 1e-9) > 1
        print(f"| {name} | {stopped} | {told} |", flush=True)


if __name__ == "__main__":
    main()
