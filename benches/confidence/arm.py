"""A second witness with laws of its own: a sensor carried by an arm of seven joints and put down, or held, in a hand.

Every joint follows a ramp behind three lags (a muscle pulls, the limb follows), starts when it likes, and the move ends
where the support stops it: with a speed left, a knock, and a soft settling. Attitude and position come from the same
joint angles, so that what the accelerometer feels is what the arm does. Rates are averages of the attitude's change.
Noise is made by sums of first-order processes. Nothing is shared with ``motion.py`` but quaternion products.
"""

from types import SimpleNamespace

import numpy as np
from scipy.interpolate import CubicSpline
from scipy.signal import lfilter

from confidence.motion import G, exponential, matrix, multiply
from confidence.sensor import Truth

DEG = np.pi / 180.0
# Axes of the joints in the body that they turn, from the trunk out: shoulder (3), elbow, forearm, wrist (2).
AXES = np.array([[0, 0, 1], [0, 1, 0], [1, 0, 0], [0, 1, 0], [1, 0, 0], [0, 1, 0], [0, 0, 1]], dtype=float)
# Upper arm and forearm [m]; the hand holds the sensor a little beyond the wrist.
LINKS = {2: 0.31, 4: 0.26, 6: 0.09}
FULL_TURN = 2.0 * np.pi


def lagged_ramp(u, lag):
    """Progress on [0, 1] of a ramp over 80 % of the time seen behind three equal lags, one at the end, still moving."""
    t = np.linspace(0.0, 1.0, 400)
    x = np.clip(t / 0.8, 0.0, 1.0)
    decay = np.exp(-(t[1] - t[0]) / lag)
    for _ in range(3):
        y = np.empty_like(x)
        y[0] = 0.0
        for k in range(1, len(x)):
            y[k] = decay * y[k - 1] + (1.0 - decay) * x[k]
        x = y
    # Cubic through the table, so that the rate has no corners of its own.
    return CubicSpline(t, x / x[-1])(np.clip(u, 0.0, 1.0))


def smooth(x, width):
    """Moving average of ``width`` twice over, ends held."""
    for _ in range(2):
        padded = np.concatenate([np.repeat(x[:1], width // 2, 0), x, np.repeat(x[-1:], width - width // 2, 0)])
        total = np.concatenate([np.zeros_like(padded[:1]), np.cumsum(padded, axis=0)])
        x = ((total[width:] - total[:-width]) / width)[: len(x)]
    return x


def poses(n, rng):
    """Joint angles (n, 7) whose verticals tell nine numbers: the best next one of thirty, over and over."""
    tried = rng.uniform(-1.5, 1.5, (400, 7)) * [2.0, 1.0, 2.0, 0.8, 1.6, 1.0, 1.6]
    up = np.array([matrix(attitude(row[None])[0])[2] for row in tried])
    rows = np.concatenate([(up[:, :, None] * up[:, None, :])[(slice(None), *np.tril_indices(3))], up], axis=1)
    chosen = [int(rng.integers(400))]
    information = 1e-3 * np.eye(9) + np.outer(rows[chosen[0]], rows[chosen[0]])
    while len(chosen) < n:
        some = rng.integers(400, size=30)
        gain = np.einsum("ni,ij,nj->n", rows[some], np.linalg.inv(information), rows[some])
        chosen.append(int(some[np.argmax(gain)]))
        information += np.outer(rows[chosen[-1]], rows[chosen[-1]])
    return tried[chosen]


def attitude(joints):
    """Quaternions (n, 4), sensor to room, of joint angles (n, 7)."""
    q = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (len(joints), 4))
    for k, axis in enumerate(AXES):
        q = multiply(q, exponential(joints[:, k, None] * axis))
    return q


def position(joints):
    """Place of the sensor (n, 3) in the room [m]."""
    q, place = np.broadcast_to([1.0, 0.0, 0.0, 0.0], (len(joints), 4)), np.zeros((len(joints), 3))
    for k, axis in enumerate(AXES):
        q = multiply(q, exponential(joints[:, k, None] * axis))
        if k in LINKS:
            place = place + LINKS[k] * matrix(q)[..., 0]
    return place


def tremor(n, dt, rng):
    """Unit tremor (n, 3): a resonance near 9 Hz driven by noise."""
    f, damping = rng.uniform(8.0, 11.0), 0.15
    size = 1 << int(np.ceil(np.log2(n)))
    s = 1j * np.fft.rfftfreq(size, dt) / f
    gain = 1.0 / (s * s + 2.0 * damping * s + 1.0) ** 2
    x = np.fft.irfft(np.fft.rfft(rng.normal(size=(size, 3)), axis=0) * gain[:, None], size, axis=0)[:n]
    return x / x.std()


def slow_noise(n, rate_hz, rng, shortest_s=0.05):
    """(n, 3) of about 1/f with B = 1: first-order processes two to a decade, from ``shortest_s`` to twenty minutes."""
    x = np.zeros((n, 3))
    for tau in np.logspace(np.log10(max(shortest_s, 2.0 / rate_hz)), np.log10(1200.0), 9):
        a = np.exp(-1.0 / (rate_hz * tau))
        drive = rng.normal(size=(n, 3)) * np.sqrt(1.0 - a * a)
        drive[0] = rng.normal(size=3)
        x += lfilter([1.0], [1.0, -a], drive, axis=0)
    # Unit variances, ``spacing`` apart in ln τ, add to a two-sided density of 1/(2 spacing f); B²/(2πf) is asked for.
    spacing = np.log(1200.0 / max(shortest_s, 2.0 / rate_hz)) / 8.0
    return (x - x.mean(axis=0)) * np.sqrt(spacing / np.pi)


def carried(
    seed,
    n_poses=18,
    move_s=2.0,
    hold_s=4.0,
    rate_hz=100.0,
    rest="put down",
    settle_deg=0.3,
    settle_s=0.25,
    tremor_deg=0.06,
    **sensor,
):
    """Counts (n, 3) of accelerometer and gyro, rate, truth and motion (``rests``: times at which nothing moves on).

    ``rest``: "put down" (a support, quiet) or "in hand" (a third of the tremor and a sway go on).
    """
    rng = np.random.default_rng([21, seed])
    sensor.setdefault("gyro_range", (1000.0 if move_s >= 1.0 else 4000.0) * DEG)
    per = int(np.ceil(max(800.0, rate_hz) / rate_hz))
    dt = 1.0 / (rate_hz * per)
    targets = poses(n_poses, rng)
    joints, extra, shake, rests, clock = [], [], [], [], 0
    for k, target in enumerate(targets):
        if k:
            n = round(move_s * rng.uniform(0.7, 1.4) / dt)
            u = (np.arange(n) + 1.0) / n
            late, lag = rng.uniform(0.0, 0.25, 7), rng.uniform(0.05, 0.09)
            part = np.stack([lagged_ramp((u - x) / (1.0 - x), lag) for x in late], axis=1)
            joints.append(targets[k - 1] + (target - targets[k - 1]) * part)
            loose = rng.normal(size=3) * settle_deg * DEG
            extra.append(loose * np.clip((u - 0.4) / 0.6, 0.0, 1.0)[:, None] ** 2)
            shake.append(np.clip(np.minimum(u, 1.0 - u) * 12.0, 0.0, 1.0))
            clock += n
        else:
            loose = np.zeros(3)
        n = round(hold_s * rng.uniform(0.85, 1.3) / dt)
        joints.append(np.broadcast_to(target, (n, 7)))
        extra.append(loose * np.exp(-(np.arange(n) + 1.0) * dt / (settle_s * rng.uniform(0.5, 1.5)))[:, None])
        shake.append(np.zeros(n))
        rests.append((clock * dt, (clock + n) * dt))
        clock += n
    # A support of rubber, and flesh: nothing stops within less than some hundredths of a second.
    width = max(int(0.04 / dt), 2)
    joints, extra, shake = (smooth(np.concatenate(x), width) for x in (joints, extra, shake))
    loud = np.maximum(shake, 0.33) if rest == "in hand" else shake
    extra += loud[:, None] * tremor(clock, dt, rng) * tremor_deg * DEG
    if rest == "in hand":
        extra += smooth(slow_noise(clock, 1.0 / dt, rng, 0.5), max(int(0.1 / dt), 2)) * 0.03 * DEG
    q = multiply(attitude(joints), exponential(extra))
    place = position(joints) + loud[:, None] * tremor(clock, dt, rng) * 1e-4
    a = np.zeros_like(place)
    a[1:-1] = np.diff(place, 2, axis=0) / dt**2
    step = multiply(q[:-1] * [1.0, -1.0, -1.0, -1.0], q[1:])
    step *= np.sign(step[:, :1])
    size = np.linalg.norm(step[:, 1:], axis=1, keepdims=True)
    w = 2.0 * np.arctan2(size, step[:, :1]) * step[:, 1:] / np.maximum(size, 1e-300) / dt
    motion = SimpleNamespace(rests=rests, turns=[])
    at = np.arange(1, clock - 1, per)
    f = np.einsum("nji,nj->ni", matrix(q[at]), a[at] + [0.0, 0.0, G])
    return (*read_by_converter(f, 0.5 * (w[at - 1] + w[at]), rate_hz, rng, **sensor), motion)


def read_by_converter(
    f,
    w,
    rate_hz,
    rng,
    gyro_bits=16,
    accel_bits=16,
    gyro_density=0.006 * DEG,
    accel_density=1.5e-3,
    gyro_slow=3.0 / 3600.0 * DEG,
    accel_slow=3e-4,
    gyro_range=1000.0 * DEG,
    accel_range=4.0 * G,
):
    """Counts of both sensors, rate and truth: axes that are not square, gains that differ, zeros, noise, codes."""
    n = len(f)
    counts, models = [], []
    for x, bits, reach, density, slow, zero in (
        (f, accel_bits, accel_range, accel_density, accel_slow, 0.25),
        (w, gyro_bits, gyro_range, gyro_density, gyro_slow, 1.0 * DEG),
    ):
        code = 2.0 * reach / 2**bits
        gain = np.diag(1.0 + 0.02 * rng.normal(size=3)) + 0.008 * rng.normal(size=(3, 3))
        offset = zero * rng.normal(size=3)
        read = x @ gain.T + offset + density * np.sqrt(rate_hz) * rng.normal(size=(n, 3))
        read += slow * slow_noise(n, rate_hz, rng)
        counts.append(np.clip(np.floor(read / code + 0.5), -(2 ** (bits - 1)), 2 ** (bits - 1) - 1))
        models += [np.linalg.inv(gain) * code, -np.linalg.solve(gain, offset)]
    return counts[0], counts[1], rate_hz, Truth(*models)
