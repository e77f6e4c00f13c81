"""Instruments with one flaw and the small faults that every recording has; answers are kept apart."""

from __future__ import annotations

import numpy as np
from scipy.signal import lfilter

from nuisance_trial.hand import body_signals, rotations, session

G = 9.81
DEG = np.pi / 180.0
FLAWS = (
    "accel-quadratic", "accel-cubic", "accel-scale-asymmetry", "accel-thermal-bias", "gyro-thermal-bias",
    "accel-bias-drift", "gyro-bias-drift", "gyro-g-sensitivity", "gyro-scale-nonlinearity", "gyro-saturation",
    "accel-saturation", "lever-arm", "accel-gyro-time-offset", "sensor-lag", "dropped-samples",
    "vibration-rectification", "periodic-interference", "quantisation", "accel-hysteresis", "none",
)  # fmt: skip
NUISANCES = ("scatter", "timestamps", "line", "soft", "bumps", "jolt", "warm", "coarse")
ALLOWED_BESIDE = {
    "scatter": {"gyro-bias-repeatability", "accel-bias-repeatability"}, "timestamps": {"timing-jitter"},
    "line": {"periodic-interference"}, "soft": {"disturbed-pose"}, "bumps": {"disturbed-pose"},
    "jolt": {"disturbed-pose"}, "warm": {"accel-bias-drift", "gyro-bias-drift"}, "coarse": {"quantisation"},
}  # fmt: skip
"""What may be said besides the flaw, because it is there too."""
ALSO_RIGHT = {"accel-gyro-time-offset": {"sensor-lag"}, "sensor-lag": {"accel-gyro-time-offset"},
              "accel-cubic": {"accel-scale-asymmetry"}}  # fmt: skip
"""Named together with the truth it counts as an answer shared, not as a wrong one."""
STRESSES = {
    "walk": {"accel-bias-drift", "gyro-bias-drift", "accel-bias-repeatability", "gyro-bias-repeatability"},
    "flicker": {"accel-bias-repeatability", "gyro-bias-repeatability"},
    "soft": {"disturbed-pose"},
    "temperature": set(),
    "step": set(),
}
"""What strains a healthy instrument, with the effects that may be named: a strong bias random walk, 1/f noise of
consumer parts (0.3 mg, 20 °/h), soft supports under every pose, a logged temperature that no sensor follows; and the
drift of a bias as one step."""


def _signed(rng, low, high, size=3):
    return rng.uniform(low, high, size) * rng.choice([-1.0, 1.0], size)


def draw(flaw, seed, size=1.0, nuisances=True, stress=None):
    """``(columns of the log, answer)`` of one trial."""
    rng = np.random.default_rng(seed)
    rate_hz = float(rng.choice([20.0, 50.0, 62.5, 100.0, 100.0, 200.0, 250.0, 500.0, 1000.0]))
    n_poses = int(rng.integers(12, 50))
    slowest = 20.0 / rate_hz if rate_hz < 60 else 0.5
    move_s = float(np.exp(rng.uniform(np.log(max(0.6, 2.0 * slowest)), np.log(4.0))))
    pose_s = float(np.exp(rng.uniform(np.log(1.5), np.log(12.0))))
    most = 90_000 / rate_hz
    pose_s = float(np.clip(most / n_poses - move_s, 1.2, pose_s))
    n_poses = max(10, min(n_poses, int(most / (pose_s + move_s))))
    here = {name: nuisances and bool(rng.random() < 0.65) for name in NUISANCES}
    here |= {"soft": True} if stress == "soft" else {}
    how = {
        "soft": rng.uniform(0.0005, 0.003) if here["soft"] else 0.0,
        "jolt": rng.uniform(0.3, 3.0) if here["jolt"] else 0.0,
        "bumps": int(rng.integers(1, 3)) if here["bumps"] else 0, "bump": rng.uniform(0.005, 0.03),
        "reach": rng.uniform(0.02, 0.12),
    }  # fmt: skip
    over = max(4, round(800.0 / rate_hz))
    fine_hz = rate_hz * over
    motion, bumps = session(rng, fine_hz, n_poses, pose_s, move_s, how)
    force, rate = body_signals(motion, fine_hz, G)
    t = motion.t
    n_fine = len(t)
    duration = t[-1]
    truth = {"rate_hz": rate_hz, "n_poses": n_poses, "pose_s": pose_s, "move_s": move_s, "duration_s": float(duration),
             "nuisances": sorted(k for k, v in here.items() if v), "bumps_s": bumps}  # fmt: skip
    values = {}
    columns = {}
    # -- the flaw, at the level of the mechanism ----------------------------------------------------------------------
    at_pose = np.zeros(n_fine, dtype=int)  # the pose last begun
    for k, (a, _) in enumerate(motion.poses):
        at_pose[int(a * fine_hz) :] = k
    if flaw == "vibration-rectification":
        own_poses = rng.choice(n_poses, max(3, n_poses // 4), replace=False)
        level = rng.uniform(0.5, 1.5)
        f, phase = rng.uniform(0.11, 0.4) * rate_hz, rng.uniform(0, 6.28)
        shape, direction = np.zeros(n_fine), rng.normal(size=3)
        for k in own_poses:
            a, b = motion.poses[k]
            inside = (t >= a) & (t < b)
            shape[inside] = np.clip(np.minimum(t[inside] - a, b - t[inside]) / 0.1, 0.0, 1.0)
        shake = level * shape[:, None] * np.sin(2 * np.pi * f * t + phase)[:, None] * direction
        gain = _signed(rng, 0.02, 0.06) * size
        values = {"bias_per_power": gain}
        force = force + shake + gain * shake**2 * 2.0  # the part squares what it feels; its filter keeps the mean
    if flaw == "lever-arm":
        r = _signed(rng, 0.015, 0.05) * size
        alpha = np.gradient(rate, 1.0 / fine_hz, axis=0)
        force = force + np.cross(alpha, r) + np.cross(rate, np.cross(rate, r))
        values = {"r": r}
    if flaw == "accel-quadratic":
        k2 = _signed(rng, 3e-4, 9e-4) * size
        force, values = force + k2 * force**2, {"K2": k2}
    if flaw == "accel-cubic":
        k3 = _signed(rng, 4e-5, 1.2e-4) * size
        force, values = force + k3 * force**3, {"K3": k3}
    if flaw == "accel-scale-asymmetry":
        a = _signed(rng, 0.003, 0.01) * size
        force, values = force + 0.5 * a * np.abs(force), {"asymmetry": a}
    if flaw == "gyro-g-sensitivity":
        M = rng.normal(size=(3, 3)) * rng.uniform(0.03, 0.12) * size * DEG / G
        rate, values = rate + force @ M.T, {"M": M.ravel()}
    if flaw == "gyro-scale-nonlinearity":
        top = np.abs(rate).max()
        c = _signed(rng, 0.01, 0.03) * size / top**2
        rate, values = rate + c * rate**3, {"cubic": c}
    if flaw in ("accel-hysteresis",):
        tau, a = rng.uniform(2.0, 10.0), _signed(rng, 0.004, 0.012) * size
        memory = lfilter([1.0 / (tau * fine_hz)], [1.0, -(1.0 - 1.0 / (tau * fine_hz))], force, axis=0)
        force, values = force + a * memory, {"memory": a}
    temperature = None
    if flaw.endswith("thermal-bias") or stress == "temperature":
        span = rng.uniform(6.0, 18.0)
        kind = rng.integers(3)
        u = t / duration
        temperature = 25 + span * (u, 1 - np.exp(-3 * u), 0.5 - 0.5 * np.cos(2 * np.pi * u))[kind]
    if flaw.endswith("thermal-bias"):
        if flaw[0] == "a":
            c = _signed(rng, 0.002, 0.008) * size
            force = force + (temperature - 25)[:, None] * c
        else:
            c = _signed(rng, 0.01, 0.04) * size * DEG
            rate = rate + (temperature - 25)[:, None] * c
        values = {"per_k": c}
    if flaw.endswith("bias-drift"):
        u = t / duration
        curve = (np.exp(-u / rng.uniform(0.05, 0.4)), np.sin(2 * np.pi * u * rng.uniform(0.6, 1.4) + rng.uniform(0, 6)),
                 1 / (1 + np.exp((rng.uniform(0.3, 0.7) - u) / 0.08)))[rng.integers(3)]  # fmt: skip
        if stress == "step":
            curve = (u > rng.uniform(0.25, 0.75)).astype(float)
        if flaw[0] == "a":
            force = force + curve[:, None] * _signed(rng, 0.05, 0.2) * size
        else:
            rate = rate + curve[:, None] * _signed(rng, 0.3, 1.0) * size * DEG
    if flaw == "sensor-lag":
        tau = rng.uniform(0.015, 0.04) * size
        c = np.exp(-1.0 / (tau * fine_hz))
        if rng.random() < 0.5:
            force = lfilter([1 - c], [1, -c], force - force[0], axis=0) + force[0]
        else:
            rate = lfilter([1 - c], [1, -c], rate, axis=0)
        values = {"tau_s": np.array([tau])}
    if flaw == "accel-gyro-time-offset":
        delay = rng.uniform(0.008, 0.03) * size * rng.choice([-1, 1])
        force = np.stack([np.interp(t - delay, t, force[:, k]) for k in range(3)], axis=1)
        values = {"delay_s": np.array([delay])}
    # -- the small faults ---------------------------------------------------------------------------------------------
    bias_force, bias_rate = np.zeros((n_poses, 3)), np.zeros((n_poses, 3))
    if here["scatter"]:
        bias_force = rng.normal(size=(n_poses, 3)) * np.exp(rng.uniform(np.log(0.001), np.log(0.01)))
        bias_rate = rng.normal(size=(n_poses, 3)) * np.exp(rng.uniform(np.log(0.01), np.log(0.1))) * DEG
        truth["scatter"] = [float(bias_force.std()), float(bias_rate.std() / DEG)]
    force, rate = force + bias_force[at_pose], rate + bias_rate[at_pose]
    if here["warm"]:
        curve = np.exp(-t / duration / rng.uniform(0.1, 0.4))[:, None]
        force = force + curve * rng.normal(size=3) * 0.004
        rate = rate + curve * rng.normal(size=3) * 0.02 * DEG
    line = rng.uniform(0.01, 0.03) * DEG if here["line"] else 0.0
    if flaw == "periodic-interference":
        line = rng.uniform(0.15, 0.6) * size * DEG
        values = {"amplitude": np.array([line])}
    if line:
        f = rng.uniform(0.06, 0.45) * rate_hz
        values |= {"frequency": np.array([f])} if flaw == "periodic-interference" else {}
        rate = rate + line * np.sin(2 * np.pi * f * t)[:, None] * rng.normal(size=3)
    # -- the part: axes, filter, noise, ADC ---------------------------------------------------------------------
    force, rate = (np.apply_along_axis(np.convolve, 0, x, np.ones(over) / over, "same") for x in (force, rate))
    force[:over], force[-over:], rate[:over], rate[-over:] = force[over], force[-over - 1], rate[over], rate[-over - 1]
    when = np.arange(over, n_fine - over, over)
    true_t = t[when]
    force, rate = force[when], rate[when]
    n = len(when)
    scale = 1.0 + rng.normal(size=(2, 3)) * 0.01
    A = np.diag(scale[0]) @ (np.eye(3) + np.tril(rng.normal(size=(3, 3)) * 0.008, -1))  # SI reading of true force
    turned = rotations(rng.normal(size=(1, 3)) * 0.01)[0]
    W = np.diag(scale[1]) @ (np.eye(3) + rng.normal(size=(3, 3)) * 0.006) @ turned
    zero_a, zero_g = rng.normal(size=3) * 0.15, rng.normal(size=3) * 0.5 * DEG
    accel_sigma = np.exp(rng.uniform(np.log(0.006), np.log(0.05)))
    gyro_sigma = np.exp(rng.uniform(np.log(0.02), np.log(0.2))) * DEG
    accel = force @ A.T + zero_a + rng.normal(size=(n, 3)) * accel_sigma
    gyro = rate @ W.T + zero_g + rng.normal(size=(n, 3)) * gyro_sigma
    if stress == "walk":
        # Over the session, one σ: 5 to 20 mm/s² and 0.1 to 0.5 °/s.
        steps = rng.normal(size=(2, n, 3)) / np.sqrt(n)
        accel += np.cumsum(steps[0], axis=0) * np.exp(rng.uniform(np.log(0.005), np.log(0.02)))
        gyro += np.cumsum(steps[1], axis=0) * np.exp(rng.uniform(np.log(0.1), np.log(0.5))) * DEG
    if stress == "flicker":
        accel_sigma, gyro_sigma = (
            rng.uniform(0.8e-3, 2e-3) * rate_hz**0.5,
            rng.uniform(0.004, 0.01) * DEG * rate_hz**0.5,
        )
        accel = force @ A.T + zero_a + rng.normal(size=(n, 3)) * accel_sigma
        gyro = rate @ W.T + zero_g + rng.normal(size=(n, 3)) * gyro_sigma
        accel += _flicker(rng, n, 0.0003 * G)
        gyro += _flicker(rng, n, 20.0 * DEG / 3600.0)
    lsb_a, lsb_g = (accel_sigma * rng.uniform(0.5, 1.6), gyro_sigma * rng.uniform(0.5, 1.6)) if here["coarse"] else (
        0.05 * accel_sigma, 0.05 * gyro_sigma)  # fmt: skip
    if flaw == "quantisation":
        if rng.random() < 0.5:
            lsb_a = accel_sigma * rng.uniform(4.0, 8.0)
        else:
            lsb_g = gyro_sigma * rng.uniform(4.0, 8.0)
        values = {"lsb": np.array([lsb_a, lsb_g])}
    if flaw.endswith("saturation"):
        x = gyro if flaw[0] == "g" else accel
        floor = 0.0 if flaw[0] == "g" else 10.6
        limit = max(np.quantile(np.abs(x).max(axis=0), 0.5) * rng.uniform(0.55, 0.85), floor)
        np.clip(x, -limit, limit, out=x)
        values = {"limit": np.array([limit])}
        truth["visible"] = int((np.abs(x) >= limit).sum())
    accel, gyro = np.round(accel / lsb_a) * lsb_a, np.round(gyro / lsb_g) * lsb_g
    timestamps = true_t.copy()
    if flaw == "dropped-samples":
        moving = np.flatnonzero(np.linalg.norm(rate, axis=1) > 0.5)
        n_events = int(rng.integers(3, 9))
        gap = max(1, int(rng.uniform(0.02, 0.10) * size * rate_hz))
        keep = np.ones(n, dtype=bool)
        for k in rng.choice(moving, n_events, replace=False):
            keep[k : k + gap] = False
        accel, gyro = accel[keep], gyro[keep]
        timestamps = true_t[: keep.sum()]
        values = {"lost": np.array([float((~keep).sum())])}
    if here["timestamps"]:
        timestamps = np.maximum.accumulate(timestamps + rng.exponential(rng.uniform(0.001, 0.004), len(timestamps)))
        timestamps = np.round(timestamps, 6)
    columns["time [s]"] = timestamps
    for k, axis in enumerate("xyz"):
        columns[f"acc_{axis} [m/s^2]"] = accel[:, k]
    for k, axis in enumerate("xyz"):
        columns[f"gyro_{axis} [rad/s]"] = gyro[:, k]
    if temperature is not None:
        columns["temperature [degC]"] = np.round(temperature[when], 2)[: len(timestamps)]
    if flaw == "accel-hysteresis":
        # S and b are those of a pose that has lasted: the memory has then followed and is part of the scale.
        A = A @ (np.eye(3) + np.diag(values["memory"]))
    said = {k: np.asarray(v).tolist() for k, v in values.items()}
    truth |= {"flaw": flaw, "stress": stress, "seed": seed, "values": said, "A": A.tolist(),
              "W": W.tolist(), "zero_a": zero_a.tolist(), "zero_g": zero_g.tolist()}  # fmt: skip
    return columns, truth


def _flicker(rng, n, B):
    """1/f noise whose Allan deviation levels off at 0.664 B: shaped in the frequency domain."""
    f = np.fft.rfftfreq(n)
    shape = np.zeros(len(f))
    shape[1:] = 1.0 / np.sqrt(f[1:])
    out = np.stack([np.fft.irfft(np.fft.rfft(rng.normal(size=n)) * shape, n) for _ in range(3)], axis=1)
    # One-sided density of such a series: 2 / f_s · 1/f per Hz in units of the sample; B²/(2πf) is wanted.
    return out * B / np.sqrt(4.0 * np.pi)
