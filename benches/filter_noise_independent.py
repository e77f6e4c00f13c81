"""`trihedron noise` against a generator that shares nothing with it: no code, no draws, no formula of a share.

    python benches/filter_noise_independent.py --runs 45 --seed 1
    python benches/filter_noise_independent.py --runs 45 --seed 1 --slow exponential

Written from docs/filter-noise.md alone. Drones, cars and walks of 160 s; the unit has a static log of its own, from
which `trihedron.allan` takes the noise at rest; its truth has a clock and a mounting of its own. True shares are not
formulas: each cause is carried alone through the log's own motion, and its mean square over all starts (over a
hundred drawings where it is random) is what it has. ``--slow`` says what the truth's slow error is: the documented
``matern``, or what it is not: ``exponential``, ``two`` (of two lengths), ``outliers``.
"""

import argparse
from dataclasses import dataclass

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.spatial.transform import Rotation

import trihedron
from trihedron.records.reference import ReferenceMotion

RATE, EVERY, G = 200.0, 4, 9.81
HORIZONS = (1.0, 10.0, 60.0)
SLOW = ("matern", "exponential", "two", "outliers")


@dataclass
class Unit:
    """What a run's gyro and truth are: SI, 1 σ."""

    N: float
    K: float
    V: float
    E: np.ndarray
    G: np.ndarray
    degrees: np.ndarray
    white: float
    slow: float
    slow_s: float
    body: float


def log_uniform(rng, low, high):
    return np.exp(rng.uniform(np.log(low), np.log(high)))


def unit(rng):
    E = 10 ** rng.uniform(-4, -2.3) * rng.standard_normal((3, 3))
    E = (E + E.T) / 2
    return Unit(
        N=log_uniform(rng, 5e-5, 4e-4), K=log_uniform(rng, 3e-6, 1e-4), V=log_uniform(rng, 3e-5, 8e-4),
        E=E - np.eye(3) * np.trace(E) / 3, G=log_uniform(rng, 1e-5, 2e-4) * rng.standard_normal((3, 3)),
        degrees=log_uniform(rng, 3e-5, 4e-4) * rng.standard_normal(3), white=log_uniform(rng, 3e-4, 4e-3),
        slow=log_uniform(rng, 5e-4, 2e-2), slow_s=log_uniform(rng, 2, 25), body=rng.uniform(),
    )  # fmt: skip


def smooth(rng, t, scale_s, columns=1, kernel="matern"):
    """Stationary processes (n, columns) of σ = 1, Matérn-3/2 or exponential, drawn on a coarse grid."""
    step = scale_s / 12 if kernel == "matern" else 0.25
    grid = np.arange(t[0] - step, t[-1] + 2 * step, step)
    lag = np.abs(grid[:, None] - grid) / scale_s
    k = (1 + np.sqrt(3) * lag) * np.exp(-np.sqrt(3) * lag) if kernel == "matern" else np.exp(-lag)
    drawn = np.linalg.cholesky(k + 1e-9 * np.eye(len(grid))) @ rng.standard_normal((len(grid), columns))
    if kernel == "matern":
        return CubicSpline(grid, drawn)(t)
    return np.stack([np.interp(t, grid, column) for column in drawn.T], axis=1)


def travelled(kind, t, rng):
    """Attitude and position (n, 3) [m] at every sample."""
    if kind == "drone":
        angles = smooth(rng, t, 1.2, 3) * [0.0, 0.2, 0.2] + smooth(rng, t, 4.0, 3) * [1.0, 0.1, 0.1]
        position = 2 * smooth(rng, t, 4.0, 3)
    else:
        speed, turn = (9.0, 0.25) if kind == "car" else (1.3, 0.5)
        heading = np.cumsum(turn * smooth(rng, t, 3.0)[:, 0]) / RATE
        shake = 0.01 if kind == "car" else 0.08
        step = 2 * np.pi * 1.9 * t
        sway = np.stack([0.3 * np.sin(step / 2), np.sin(step), np.cos(step / 2)], axis=1) * (kind == "walk")
        angles = shake * (smooth(rng, t, 2.0, 3) + sway) + np.stack([heading, 0 * t, 0 * t], axis=1)
        along = speed * (1 + 0.3 * smooth(rng, t, 5.0)[:, 0])
        flat = np.stack([along * np.cos(heading), along * np.sin(heading), 0 * t], axis=1)
        position = np.cumsum(flat, axis=0) / RATE
        position[:, 2] = 0.03 * np.sin(step) if kind == "walk" else 0.02 * smooth(rng, t, 1.0)[:, 0]
    return Rotation.from_euler("ZYX", angles), position


def band(rng, n, columns):
    """Noise (n, columns) of 30 to 95 Hz, σ = 1."""
    spectrum = np.fft.rfft(rng.standard_normal((n, columns)), axis=0)
    f = np.fft.rfftfreq(n, 1 / RATE)
    spectrum[(f < 30) | (f > 95)] = 0
    drawn = np.fft.irfft(spectrum, n, axis=0)
    return drawn / drawn.std(axis=0)


def noise(rng, n, N, K):
    """White noise and a walking bias (n, 3)."""
    return N * np.sqrt(RATE) * rng.standard_normal((n, 3)) + np.cumsum(
        K / np.sqrt(RATE) * rng.standard_normal((n, 3)), axis=0
    )


def misread(rng, t, one, kind):
    """The truth's attitude error: rotation vectors in the room and in the body (n, 3)."""
    kernel = "exponential" if kind == "exponential" else "matern"
    room, body = (smooth(rng, t, one.slow_s, 3, kernel) for _ in range(2))
    if kind == "two":
        room = (room + smooth(rng, t, one.slow_s / 8, 3)) / np.sqrt(2)
    return one.slow * np.sqrt(1 - one.body) * room, one.slow * np.sqrt(one.body) * body


def carried(rotation, error, h):
    """Mean square [rad²] over all starts of the attitude error that a rate error (n, 3) makes within ``h``; its mean is
    a bias, which a filter finds."""
    path = np.cumsum(rotation.apply(error - error.mean(axis=0)), axis=0) / RATE
    n = round(h * RATE)
    return np.mean(np.sum((path[n:] - path[:-n]) ** 2, axis=1))


def parts(one, moved, power, rng):
    """Mean square attitude error by horizon and cause."""
    rotation, rate, force, warm = moved
    found = {}
    for h in HORIZONS:
        n = round(h * RATE)
        starts = np.arange(0, len(rate) - n, 50)
        path = np.cumsum(rotation.apply(np.tile(one.degrees, (len(rate), 1))) * warm[:, None], axis=0) / RATE
        steady = np.cumsum(rotation.apply(np.tile(one.degrees, (len(rate), 1))), axis=0) / RATE
        since = path[starts + n] - path[starts] - warm[starts, None] * (steady[starts + n] - steady[starts])
        u = np.linspace(0, h, 50) / h
        walk = one.K**2 * h**3 * np.trapezoid((1 - u) ** 2, u) * 3
        late = np.arange(0.0, 160.0, 0.5)
        drawn = [[misread(rng, late, one, "matern") for _ in range(20)] for _ in range(5)]
        at = Rotation.concatenate([rotation[int(x * RATE)] for x in late])
        wrong = [room + at.apply(body) for some in drawn for room, body in some]
        m = round(2 * h)
        slow = np.mean([np.mean(np.sum((w[m:] - w[:-m]) ** 2, axis=1)) for w in wrong])
        found[h] = {
            "rest": 3 * one.N**2 * h, "vibration": 3 * one.V**2 * h * power.mean(), "bias": walk,
            "temperature": np.mean(np.sum(since**2, axis=1)), "calibration": carried(rotation, rate @ one.E.T, h),
            "g-sensitivity": carried(rotation, force @ one.G.T, h),
            "reference": slow + 6 * one.white**2 * EVERY / RATE,
        }  # fmt: skip
    return found


def run(seed, kind, slow):
    """Strengths, shares and NEES that `trihedron noise` finds, beside the truth."""
    rng = np.random.default_rng([seed, 40])
    one, t = unit(rng), np.arange(0.0, 160.0, 1 / RATE)
    rotation, position = travelled(kind, t, rng)
    rate = (rotation[:-1].inv() * rotation[1:]).as_rotvec() * RATE
    acceleration = np.gradient(np.gradient(position, 1 / RATE, axis=0), 1 / RATE, axis=0) + np.array([0, 0, G])
    body = rotation.inv().apply(acceleration)
    force, middle = (body[:-1] + body[1:]) / 2, t[:-1] + 0.5 / RATE
    n = len(rate)
    power = 0.1 + smooth(rng, middle, 6.0)[:, 0] ** 2
    shaken = np.sqrt(power)[:, None]
    degrees = 25 + 8 * (1 - np.exp(-middle / rng.uniform(40, 150)))
    warm = degrees - degrees[0]
    at_rest = [(one.N, one.K), (log_uniform(rng, 5e-4, 4e-3), log_uniform(rng, 2e-5, 4e-4))]
    shaking = [(one.V, 0.03), (log_uniform(rng, 1e-3, 1e-2), 1.0)]
    made = [
        noise(rng, n, *rest) + shaken * (V * np.sqrt(RATE) * rng.standard_normal((n, 3)) + seen * band(rng, n, 3))
        for rest, (V, seen) in zip(at_rest, shaking, strict=True)
    ]
    gyroscope = rate @ (np.eye(3) + one.E).T + force @ one.G.T + np.outer(warm, one.degrees) + made[0] + 0.01
    accelerometer = force + np.outer(warm, 1e-3 * rng.standard_normal(3)) + made[1] + 0.05
    room, own = misread(rng, t[::EVERY], one, slow)
    own = own + one.white * rng.standard_normal(own.shape)
    if slow == "outliers":
        own[rng.random(len(own)) < 0.01] += 30 * one.white * rng.standard_normal(3)
    mounting = Rotation.from_rotvec(0.05 * rng.standard_normal(3))
    truth = Rotation.from_rotvec(room) * rotation[::EVERY] * Rotation.from_rotvec(own) * mounting
    where = position[::EVERY] + 2e-3 * rng.standard_normal((len(truth), 3))
    clock = (t[::EVERY] + rng.uniform(0.01, 0.2)) * (1 + 1e-4 * rng.standard_normal())
    lying = [noise(rng, 120_000, *rest) + offset for rest, offset in zip(at_rest, (0.01, [0.1, 0.2, G]), strict=True)]
    still = trihedron.Recording.from_arrays(np.arange(120_000) / RATE, lying[1], lying[0])
    found = trihedron.filter_noise(
        trihedron.Recording.from_arrays(middle, accelerometer, gyroscope, temperature_degc=degrees),
        static=trihedron.allan(still),
        reference=ReferenceMotion(clock, attitude=truth.as_matrix(), position=where, source="truth"),
        horizons_s=HORIZONS, band_hz=25.0, gravity_m_s2=G,
    )  # fmt: skip
    true = {
        "gyroscope": (np.hypot(one.N, one.V * np.sqrt(power.mean())), one.K),
        "accelerometer": (np.hypot(at_rest[1][0], shaking[1][0] * np.sqrt(power.mean())), at_rest[1][1]),
    }
    return found, true, parts(one, (rotation[:-1], rate, force, warm), power, rng)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=45)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--slow", choices=SLOW, default="matern")
    parser.add_argument("--shown", action="store_true", help="print every share that its interval misses")
    given = parser.parse_args()
    nees, inside = {}, {}
    for k in range(given.runs):
        kind = ("drone", "car", "walk")[k % 3]
        try:
            found, true, parted = run(given.seed + k, kind, given.slow)
        except ValueError as error:
            print(f"  {given.seed + k} {kind} refused: {error}", flush=True)
            continue
        for sensor in found.sensors:
            for c in sensor.consistency:
                nees.setdefault((sensor.sensor, c.horizon_s), []).append((c.nees, c.static_nees))
            asked = [("N", sensor.N, true[sensor.sensor][0]), ("K", sensor.K, true[sensor.sensor][1])]
            if sensor.sensor == "gyroscope":
                asked += [
                    (f"{x.cause} {x.horizon_s:.0f} s", x.share, p[x.cause] / sum(p.values()))
                    for x in sensor.shares for p in [parted[x.horizon_s]]
                ]  # fmt: skip
            for name, x, is_ in asked:
                held = x.lower <= is_ <= x.upper
                inside.setdefault((sensor.sensor, name), []).append(held)
                if given.shown and not held:
                    print(f"  {given.seed + k} {sensor.sensor} {name}: {x.lower:.3g} .. {x.upper:.3g}, is {is_:.3g}")
        if (k + 1) % 15 == 0 or k + 1 == given.runs:
            print(f"{k + 1} runs")
            for key, values in nees.items():
                one, static = np.array(values).T
                error = one.std() / np.sqrt(len(one))
                print(f"  {key[0]} {key[1]:.0f} s: NEES {one.mean():.2f} ± {error:.2f}, static {np.median(static):.0f}")
            for key, held in inside.items():
                print(f"  {key[0]} {key[1]}: {100 * np.mean(held):.0f} %")
            print("", flush=True)


if __name__ == "__main__":
    main()
