"""`trihedron noise` on simulated drones, cars and walks: are predicted errors right, and shares within their intervals?

    python benches/filter_noise.py --runs 200 --seconds 160 --seed 1

Each run draws N, K, vibration that follows a throttle, a scale matrix off by up to a per cent, and a truth with white
and slow (Matérn-3/2) error; the noise at rest is told with 5 % of error. NEES is that of the held-out half: 3 is right.
`--euroc FOLDER` takes the recorded flights instead, with the data sheet's values as static ones.
"""

import argparse
import sys
from pathlib import Path

import numpy as np
from scipy.spatial.transform import Rotation

from trihedron import read
from trihedron.api.referring import motion_of
from trihedron.estimate.filter_noise import Asked, beside_reference
from trihedron.estimate.filter_noise.shares import parts_of
from trihedron.records import Recording
from trihedron.records.filter_noise import CAUSES, Bounded, StaticNoise
from trihedron.records.reference import ReferenceMotion

HZ, TRACK_HZ, G = 100, 50, 9.81
HORIZONS = (1.0, 10.0, 60.0)
ADIS16448 = StaticNoise(Bounded(1.7e-4, 1.55e-4, 1.87e-4), Bounded(1.94e-5, 1.94e-5, 1.94e-5))
ADIS16448_FORCE = StaticNoise(Bounded(2e-3, 1.8e-3, 2.2e-3), Bounded(3e-3, 3e-3, 3e-3))


def smooth(rng, n, low, high):
    """(n, 3) of unit rms between two frequencies [Hz]."""
    spectrum = np.fft.rfft(rng.normal(size=(n, 3)), axis=0)
    f = np.fft.rfftfreq(n, 1 / HZ)
    x = np.fft.irfft(spectrum * ((f > low) & (f < high))[:, None], n, axis=0)
    return x / x.std()


def rates(rng, kind, t):
    """(n, 3) rad/s of a motion."""
    n = len(t)
    if kind == "drone":
        return 0.5 * smooth(rng, n, 0.05, 1.0)
    if kind == "car":
        return smooth(rng, n, 0.02, 0.2) * [0.02, 0.02, 0.25] + 0.05 * smooth(rng, n, 0.5, 2.0) * [1.0, 1.0, 0.2]
    step = np.sin(2 * np.pi * 1.8 * t[:, None] + rng.uniform(0, 6, 3)) * rng.uniform(0.3, 0.8, 3)
    return step + 0.4 * smooth(rng, n, 0.03, 0.3)


def slow_error(rng, time, sigma, tau):
    """(k, 3) a Matérn-3/2 process by its exact steps."""
    h, lam = time[1] - time[0], np.sqrt(3) / tau
    decay = np.exp(-lam * h)
    F = decay * np.array([[1 + lam * h, h], [-(lam**2) * h, 1 - lam * h]])
    P = sigma**2 * np.diag([1.0, lam**2])
    root, out = np.linalg.cholesky(P - F @ P @ F.T + 1e-14 * P), []
    x = np.linalg.cholesky(P) @ rng.normal(size=(2, 3))
    for _ in time:
        out.append(x[0])
        x = F @ x + root @ rng.normal(size=(2, 3))
    return np.array(out)


def drawn(seed, kind, seconds):
    """Log, reference, static values, and the truth: strengths (8,), the error of an uncalibrated gyro by horizon."""
    rng = np.random.default_rng(seed)
    t = np.arange(0, seconds, 1 / HZ)
    w = rates(rng, kind, t)
    C = Rotation.identity()
    steps, q = Rotation.from_rotvec(w / HZ), np.empty((len(t) + 1, 4))
    q[0] = C.as_quat()
    for k in range(len(t)):
        C = C * steps[k]
        q[k + 1] = C.as_quat()
    C = Rotation.from_quat(q)
    low, high = np.log([1e-4, 3e-6, 3e-4, 5e-4]), np.log([4e-4, 1e-4, 2e-3, 5e-3])
    N, K, V, sigma = np.exp(rng.uniform(low, high))
    V = V if kind == "drone" else 0.3 * V
    tau, white = rng.uniform(3, 15), 3e-4
    throttle = np.maximum(1 + 0.7 * smooth(rng, len(t), 0.0, 0.05)[:, 0], 0.1)
    throttle = throttle**2 / np.mean(throttle**2)
    shaking = {"drone": 0.1, "car": 0.02, "walk": 0.05}[kind] * smooth(rng, len(t), 30, 48) * np.sqrt(throttle)[:, None]
    noise = np.sqrt(N**2 + V**2 * throttle)[:, None] * np.sqrt(HZ) * rng.normal(size=w.shape)
    bias = 0.02 * rng.normal(size=3) + K / np.sqrt(HZ) * np.cumsum(rng.normal(size=w.shape), axis=0)
    M = np.eye(3) + rng.uniform(-0.01, 0.01, (3, 3))
    raw = (w + shaking) @ M.T + bias + noise
    middle = C[:-1] * Rotation.from_rotvec(0.5 * w / HZ)
    force = middle.inv().apply([0, 0, G]) + 0.3 * smooth(rng, len(t), 0.1, 3) + 0.02 * rng.normal(size=w.shape)
    log = Recording.from_arrays(t, force, raw, accelerometer_unit="m/s^2", gyroscope_unit="rad/s")
    k = np.arange(0, len(t), HZ // TRACK_HZ)
    timestamps = t[k] - 0.5 / HZ
    off = slow_error(rng, timestamps, sigma, tau) + white * rng.normal(size=(len(k), 3))
    seen = (Rotation.from_rotvec(off) * C[k]).as_matrix()
    motion = ReferenceMotion(timestamps - timestamps[0], attitude=seen, source="truth")
    told = N * np.exp(0.05 * rng.normal())
    static = StaticNoise(Bounded(told, told * np.exp(-0.1), told * np.exp(0.1)), Bounded(K, 0.5 * K, 2 * K))
    truth = np.array([N, V, K, white / np.sqrt(TRACK_HZ), sigma, 0.0, tau])
    return log, motion, static, truth, left_over(M, w, C)


def left_over(M, w, C):
    """Mean square error over each horizon of one scale and square axes, the mean bias taken off."""
    S = np.linalg.inv(M)
    u, _, vt = np.linalg.svd(S)
    raw = w @ M.T
    wrong = (raw - raw.mean(axis=0)) @ (S - u @ vt).T
    carried = np.cumsum(C[:-1].apply(wrong), axis=0) / HZ
    return {h: np.mean(np.sum((carried[int(h * HZ) :] - carried[: -int(h * HZ)]) ** 2, axis=1)) for h in HORIZONS}


def one(seed, kind, seconds):
    """NEES by horizon, static NEES, whether each true share, N and K lie in their intervals, and which are limits."""
    log, motion, static, truth, left = drawn(seed, kind, seconds)
    (found,) = beside_reference(log, motion, Asked(HORIZONS, 25.0, G, static))
    inside = {"N": holds(found.N, np.hypot(truth[0], truth[1])), "K": holds(found.K, truth[2])}
    for share in found.shares:
        parts = {name: value[0] for name, value in parts_of(truth[None], share.horizon_s).items()}
        parts["calibration"] = left[share.horizon_s]
        inside[share.cause, share.horizon_s] = holds(share.share, parts[share.cause] / sum(parts.values()))
    return {c.horizon_s: (c.nees, c.static_nees) for c in found.consistency}, inside


def holds(found, truth):
    """Whether an interval holds the truth."""
    return found.lower <= truth <= found.upper


def simulated(given):
    runs = []
    for k in range(given.runs):
        kind = ("drone", "car", "walk")[k % 3]
        runs.append((kind, *one(given.seed + k, kind, given.seconds)))
        if (k + 1) % 10 == 0 or k + 1 == given.runs:
            told(runs)


def told(runs):
    print(f"{len(runs)} runs")
    for kind in ("drone", "car", "walk", "all"):
        some = [r for r in runs if kind in (r[0], "all")]
        for h in HORIZONS:
            nees = np.array([r[1][h] for r in some if h in r[1]], dtype=float)
            if len(nees):
                mean, se, half = nees[:, 0].mean(), nees[:, 0].std() / np.sqrt(len(nees)), np.median(nees, axis=0)
                print(f"  {kind:6} {h:4.0f} s: NEES {mean:.2f} ± {se:.2f} (median {half[0]:.2f}), static {half[1]:.0f}")
    names = ["N", "K", *((cause, h) for h in HORIZONS for cause in CAUSES)]
    share = {name: 100 * np.mean([r[2][name] for r in runs]) for name in names}
    print(f"  in 95 %: N {share['N']:.0f} %, K {share['K']:.0f} %")
    for h in HORIZONS:
        print(f"  shares at {h:.0f} s: " + ", ".join(f"{cause} {share[cause, h]:.0f} %" for cause in CAUSES))
    total = np.mean([r[2][name] for r in runs for name in names[2:]])
    print(f"  all shares {100 * total:.1f} %", flush=True)


def flights(folder):
    for path in sorted(Path(folder).glob("*.log.csv.gz")):
        motion = motion_of(str(path).replace(".log.", ".truth."))
        asked = Asked((1.0, 10.0, 30.0), 25.0, 9.807, ADIS16448, ADIS16448_FORCE)
        for s in beside_reference(read(path), motion, asked):
            N, K = (f"{x.value:.2e} [{x.lower:.1e}, {x.upper:.1e}]" for x in (s.N, s.K))
            nees = ", ".join(f"{c.horizon_s:.0f} s {c.nees:.1f} (static {c.static_nees:.0f})" for c in s.consistency)
            print(f"{path.name.split('.')[0]} {s.sensor}: N {N}, K {K}, {s.bias.kind}; NEES {nees}")
            at = [x for x in s.shares if x.horizon_s == 10.0]
            print("   10 s: " + ", ".join(f"{x.cause} {x.share.lower:.2f}-{x.share.upper:.2f}" for x in at))
            print(f"   slow error of the reference {s.reference.slow}, {s.reference.slow_s:.0f} s", flush=True)


def main():
    parser = argparse.ArgumentParser(description=__doc__.splitlines()[0])
    parser.add_argument("--runs", type=int, default=200)
    parser.add_argument("--seconds", type=float, default=160.0)
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--euroc")
    given = parser.parse_args()
    if given.euroc:
        flights(given.euroc)
    else:
        simulated(given)


if __name__ == "__main__":
    sys.exit(main())
