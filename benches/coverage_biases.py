"""Are the uncertainties honest where biases scatter from pose to pose?

    python benches/coverage_biases.py [--sessions N] [--gyro DEG_S] [--accel MM_S2] [--jump uniform|middle|linear|own]

Healthy simulated sessions of 24 poses; every pose gets a bias of its own. What the bias does during a move is one of
four stories (``--jump``): it leaps at an instant drawn anew for every move, at the middle, it runs straight from one
pose to the next, or every move has a third zero that belongs to neither pose. Both `calibrate` and the model without
effects of `diagnose` are compared with the truth; nothing but the comparison knows it.
"""

import argparse
from dataclasses import replace

import numpy as np

from trihedron import calibrate, diagnose
from trihedron.api.demonstrating import truth_of_the_day
from trihedron.segment import segment_recording
from trihedron.simulate import hand_session, scenario_by_name, simulate

NAMES = (
    *(f"S_a{i}{j}" for i in range(1, 4) for j in range(1, i + 1)), *(f"b_a{i}" for i in range(1, 4)),
    *(f"S_w{i}{j}" for i in range(1, 4) for j in range(1, 4)), *(f"b_w{i}" for i in range(1, 4)),
)  # fmt: skip
LOWER = np.tril_indices(3)
WANTED = 0.1
"""Standard errors by which two answers about a healthy session may differ."""


def biases_along(segments, n, sigma, jump, rng):
    """(n, 3) zero of every sample: one of its own in every pose, and a story for the moves between."""
    own = sigma * rng.standard_normal((segments.n_poses, 3))
    out = np.zeros((n, 3))
    for pose, zero in zip(segments.poses, own, strict=True):
        out[pose.start : pose.stop] = zero
    out[: segments.poses[0].start] = own[0]
    out[segments.poses[-1].stop :] = own[-1]
    for i, (before, after) in enumerate(zip(segments.poses[:-1], segments.poses[1:], strict=True)):
        a, b = before.stop, after.start
        x = (np.arange(a, b) - a + 0.5) / max(b - a, 1)
        if jump == "own":
            out[a:b] = sigma * rng.standard_normal(3)
            continue
        if jump == "uniform":
            share = (x[:, None] > rng.uniform(size=3)).astype(float)
        else:
            share = (x > 0.5 if jump == "middle" else x)[:, None] * np.ones(3)
        out[a:b] = own[i] + share * (own[i + 1] - own[i])
    return out


def scores(seed, arguments):
    """z (21,) of `calibrate` and of the model without effects of `diagnose`."""
    scenario = replace(scenario_by_name("hand-session"), motion=hand_session(arguments.poses, layout=seed))
    recording, _ = simulate(scenario, seed)
    truth = truth_of_the_day(scenario, seed)
    rng = np.random.default_rng(seed + 10_000)
    segments = segment_recording(recording)
    n = recording.n_samples
    of_rate = biases_along(segments, n, np.radians(arguments.gyro), arguments.jump, rng)
    of_force = biases_along(segments, n, 1e-3 * arguments.accel, arguments.jump, rng)
    recording = replace(
        recording,
        gyroscope=recording.gyroscope + np.linalg.solve(truth.gyroscope_S, of_rate.T).T,
        accelerometer=recording.accelerometer + np.linalg.solve(truth.accelerometer_S, of_force.T).T,
    )
    S_a, S_w = np.asarray(truth.accelerometer_S), np.asarray(truth.gyroscope_S)
    true = np.concatenate([S_a[LOWER], truth.accelerometer_b, S_w.ravel(), truth.gyroscope_b])
    found = calibrate(recording, gravity_m_s2=truth.gravity_m_s2).calibration
    accelerometer, gyroscope = found.accelerometer, found.gyroscope
    value = np.concatenate([accelerometer.S[LOWER], accelerometer.b, gyroscope.S.ravel(), gyroscope.b])
    sigma = np.concatenate(
        [accelerometer.sigma_S[LOWER], accelerometer.sigma_b, gyroscope.sigma_S.ravel(), gyroscope.sigma_b]
    )
    out = [(value, sigma)]
    n_clipped = int(recording.facts.of("gyroscope").at_limits(recording.n_samples).sum())
    named = []
    if arguments.diagnose:
        diagnosis = diagnose(recording, gravity_m_s2=truth.gravity_m_s2)
        for model in (diagnosis.baseline, diagnosis.extended):
            a, g = model.accelerometer, model.gyroscope
            value = np.concatenate([np.array(a["S"])[LOWER], a["b"], np.ravel(g["S"]), g["b"]])
            sigma = np.concatenate([np.array(a["sigma_S"])[LOWER], a["sigma_b"], np.ravel(g["sigma_S"]), g["sigma_b"]])
            out.append((value, sigma))
        named = [one.id for one in diagnosis.effects]
    return true, out, f"{n_clipped} readings at the gyro's limit, named: {', '.join(named) or 'nothing'}"


def main() -> None:
    """Simulate, calibrate, diagnose, count."""
    parser = argparse.ArgumentParser()
    parser.add_argument("--sessions", type=int, default=80)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--poses", type=int, default=24)
    parser.add_argument("--gyro", type=float, default=0.0)
    parser.add_argument("--accel", type=float, default=0.0)
    parser.add_argument("--jump", default="uniform", choices=["uniform", "middle", "linear", "own"])
    parser.add_argument("--diagnose", action="store_true")
    arguments = parser.parse_args()
    runs = [scores(seed, arguments) for seed in range(arguments.first, arguments.first + arguments.sessions)]
    print(
        f"{arguments.sessions} sessions, scatter {arguments.gyro} °/s, {arguments.accel} mm/s², zero: {arguments.jump}"
    )
    names = ("calibrate", "diagnose, no effects", "diagnose, all effects")
    for k in range(len(runs[0][1])):
        z = np.array([(out[k][0] - true) / out[k][1] for true, out, _ in runs])
        shares = [100 * np.mean(np.abs(z) < limit) for limit in (1.0, 2.0)]
        print(f"{names[k]:<22} within 1 σ {shares[0]:5.1f} %, 2 σ {shares[1]:5.1f} %, mean z² {np.mean(z**2):.2f}")
        rms = np.sqrt(np.mean(z**2, axis=0))
        print("   rms z: " + " ".join(f"{name} {value:.2f}" for name, value in zip(NAMES, rms, strict=True)))
    if arguments.diagnose:
        # What `diagnose` answers is its model with the effects that it names: without them a session that saturated
        # is not described.
        apart = np.array([np.abs(out[0][0] - out[2][0]) / out[0][1] for _, out, _ in runs])
        for seed, (row, run) in enumerate(zip(apart, runs, strict=True), arguments.first):
            if row.max() > WANTED:
                print(f"   session {seed}: {NAMES[row.argmax()]} {row.max():.2f} σ apart; {run[2]}")
        print(
            f"calibrate and the answer of diagnose apart: median {np.median(apart):.3f} σ, largest {apart.max():.3f} σ"
        )
        ratio = np.array([out[2][1] / out[0][1] for _, out, _ in runs])
        print(f"their error bars: ratio {ratio.min():.3f} to {ratio.max():.3f}, median {np.median(ratio):.3f}")


if __name__ == "__main__":
    main()
