"""Guided against random poses: a simulated hand follows the guide, or turns the board to 18 directions drawn at random.

python benches/guided_poses.py [SEEDS] [ACCURACY] [SCENARIO]
"""

from __future__ import annotations

import sys

import numpy as np

from trihedron.pipeline import calibrate
from trihedron.pipeline.guiding import examine
from trihedron.records.guiding import Accuracy
from trihedron.sensor_model import in_frame
from trihedron.simulate import scenario_by_name
from trihedron.simulate.following import FollowingHand

MOST = 40


def z_scores(recording, truth):
    """Errors of the final calibration over its error bars, in the frame that the truth is turned into."""
    made = in_frame(calibrate(recording, gravity_m_s2=truth.gravity_m_s2).calibration, "lower")
    out = []
    for sensor, S, b in (
        (made.accelerometer, truth.accelerometer_S, truth.accelerometer_b),
        (made.gyroscope, truth.gyroscope_S, truth.gyroscope_b),
    ):
        rotation = _to_lower(truth.accelerometer_S)
        error = np.concatenate([(sensor.S - rotation @ S).ravel(), sensor.b - rotation @ b])
        sigma = np.sqrt(np.diag(sensor.covariance))
        keep = sigma > 1e-12 * np.abs(sensor.S).max()
        out.append((error[keep] / sigma[keep])[: int(keep.sum())])
    return np.concatenate([out[0], out[1][:9]])


def _to_lower(S):
    """The rotation R with R S lower triangular and a positive diagonal."""
    flip = np.eye(3)[::-1]
    q, _ = np.linalg.qr(S @ flip)
    # S flip = q r, so qᵀ S = r flip; flip qᵀ S = flip r flip is lower triangular.
    rotation = flip @ q.T
    return np.diag(np.sign(np.diag(rotation @ S))) @ rotation


def guided(scenario, seed, accuracy):
    hand = FollowingHand(scenario, seed)
    while True:
        recording, truth = hand.session()
        state = examine(recording, accuracy, gravity_m_s2=truth.gravity_m_s2, look_ahead=False)
        if state.is_good_enough or hand.n_poses >= MOST:
            return hand.n_poses, recording.duration_s, state.hold_s, state.shortfall, z_scores(recording, truth)
        hand.go(state.next_up, state.hold_s)


def at_random(scenario, seed, accuracy, hold_s):
    hand = FollowingHand(scenario, seed)
    rng = np.random.default_rng(1000 + seed)
    at_18 = needed = None
    while True:
        if hand.n_poses >= 9:
            recording, truth = hand.session()
            state = examine(recording, accuracy, gravity_m_s2=truth.gravity_m_s2, look_ahead=False)
            if hand.n_poses == 18:
                at_18 = (recording.duration_s, state.shortfall)
            if state.is_good_enough and needed is None:
                needed = (hand.n_poses, recording.duration_s)
            if (needed is not None and at_18 is not None) or hand.n_poses >= MOST:
                return at_18, needed
        direction = rng.normal(size=3)
        hand.go(direction / np.linalg.norm(direction), hold_s)


def main(seeds=50, accuracy="accel 0.05 %, gyro 0.1 %", name="hand-session"):
    wanted, scenario = Accuracy.parse(accuracy), scenario_by_name(name)
    print(f"{name}, {wanted.sentence()}, {seeds} seeds")
    print("seed  guided: poses  time    | 18 random: time  shortfall | random until reached: poses  time")
    rows, scores = [], []
    for seed in range(seeds):
        n, time_s, hold_s, shortfall, z = guided(scenario, seed, wanted)
        at_18, needed = at_random(scenario, seed, wanted, hold_s)
        rows.append((n, time_s, shortfall, *at_18, *(needed or (np.nan, np.nan))))
        scores.append(z)
        r = rows[-1]
        print(
            f"{seed:4d}  {n:13d}  {time_s:5.0f} s | {r[3]:15.0f} s  {r[4]:9.2f} | {r[5]:26.0f}  {r[6]:5.0f} s",
            flush=True,
        )
    table, z = np.array(rows), np.array(scores)
    reached = table[:, 2] <= 1.0
    print(
        f"guided: reached {reached.sum()} of {seeds}; poses median {np.median(table[:, 0]):.0f} "
        f"(worst {table[:, 0].max():.0f}), time median {np.median(table[:, 1]):.0f} s (worst {table[:, 1].max():.0f})"
    )
    print(f"18 random: reached {(table[:, 4] <= 1).sum()} of {seeds}; time median {np.median(table[:, 3]):.0f} s")
    print(
        f"random until reached: median {np.nanmedian(table[:, 5]):.0f} poses, {np.nanmedian(table[:, 6]):.0f} s; "
        f"not within {MOST}: {np.isnan(table[:, 5]).sum()}"
    )
    print(
        f"truth: rms z {np.sqrt(np.mean(z**2)):.3f}; within 2 sigma {np.mean(np.abs(z) < 2):.3f} (0.954 expected), "
        f"within 3 sigma {np.mean(np.abs(z) < 3):.3f} (0.997), worst {np.abs(z).max():.1f}"
    )


if __name__ == "__main__":
    given = sys.argv[1:]
    main(int(given[0]) if given else 50, *given[1:])
