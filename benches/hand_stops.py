"""Which stops of a log are poses: a hand that pauses inside a move, short poses, poses on something that shakes.

    python benches/hand_stops.py --sessions 40 --seed 5                  # true poses lost, pauses taken for poses
    python benches/hand_stops.py --sessions 10 --seed 5 --kind pauses

Poses rest on a support; between them a hand carries the sensor along bowed paths. ``pauses``: it stops on the way for
0.4 to 1 s, nearly still, in the air. ``waits``: for 1 to 2.5 s. ``short``: poses of 1.0 to 1.3 s among longer ones.
``shaken``: a line of 3 mm/s² to 3 m/s² through some poses or all, with sidebands, not quite steady; in half of the
sessions it turns the sensor too. ``plain``: none of these. ``all``: together.
"""

from __future__ import annotations

import argparse
from dataclasses import dataclass

import numpy as np
from scipy.signal import butter, sosfiltfilt
from scipy.spatial.transform import Rotation

from motion import minimum_jerk
from trihedron.records import Recording
from trihedron.segment import segment_recording

KINDS = ("plain", "pauses", "waits", "short", "shaken", "all")
DEGREE = np.pi / 180.0
G = 9.81
RATES_HZ = (25.0, 50.0, 50.0, 100.0, 100.0, 208.0, 400.0)
FOUND = 0.5
"""Share of a pose, of a pause or of a found hold that has to overlap for the two to be one."""


@dataclass(frozen=True)
class Stops:
    """A recording and what it is made of: (first, last) rows of true poses and of the hand's pauses."""

    recording: Recording
    poses: list[tuple[int, int]]
    pauses: list[tuple[int, int]]
    still: np.ndarray
    """(N, 6) what noiseless sensors would read if the body stood still where it is."""


def _tremor(rng, n, rate, low, high):
    """(n, 3) noise of the hand of unit rms between these frequencies (Hz)."""
    high = min(high, 0.45 * rate)
    out = sosfiltfilt(butter(2, [low, high], "band", fs=rate, output="sos"), rng.normal(size=(n, 3)), axis=0)
    return out / out.std(axis=0)


def _timetable(rng, n_poses, kind):
    """Parts (name, seconds) in turn: pose, then strokes with or without pauses between, then a pose."""
    usual = rng.uniform(1.6, 5.0)
    parts = [("pose", usual + rng.uniform(1.0, 3.0))]
    for _ in range(n_poses - 1):
        strokes = 1
        if kind in ("pauses", "waits", "all") and rng.random() < 0.4:
            strokes += int(rng.integers(1, 3))
        for k in range(strokes):
            parts.append(("stroke", rng.uniform(0.7, 2.0)))
            if k < strokes - 1:
                parts.append(("pause", rng.uniform(1.0, 2.5) if kind == "waits" else rng.uniform(0.4, 1.0)))
        is_short = kind in ("short", "all") and rng.random() < 0.4
        parts.append(("pose", rng.uniform(1.0, 1.3) if is_short else usual * rng.uniform(0.8, 1.3)))
    return parts


def _shaking(rng, t, rate, poses):
    """(n, 3) m/s² and rad/s of what the support does, gone within a tenth of a second in the moves before and after; in
    half of the sessions it turns the sensor a little as well.
    """
    out, turning = np.zeros((len(t), 3)), np.zeros((len(t), 3))
    radius = rng.uniform(0.02, 0.3) if rng.random() < 0.5 else np.inf
    hz, size = rng.uniform(0.08, 0.47) * rate, 10.0 ** rng.uniform(-2.5, 0.5)
    share = rng.choice([0.3, 0.5, 1.0])
    for first, last in poses:
        if rng.random() > share:
            continue
        here = slice(first, last)
        drift = 2 * np.pi * np.cumsum(rng.normal(size=last - first)) * 0.02 / np.sqrt(rate)
        beat = 1.0 + 0.2 * np.sin(2 * np.pi * rng.uniform(0.3, 1.5) * t[here] + rng.uniform(0, 6))
        wave = np.sin(2 * np.pi * hz * rng.uniform(0.99, 1.01) * t[here] + drift)
        edge = minimum_jerk((t[here] - t[first]) / 0.1) * minimum_jerk((t[last - 1] - t[here]) / 0.1)
        out[here] = size * rng.uniform(0.5, 1.5) * (edge * beat * wave)[:, None] * rng.normal(size=3) / np.sqrt(3.0)
        about = np.linalg.norm(rng.normal(size=3)) * rng.normal(size=3)
        turning[here] = size / radius / (2 * np.pi * hz) * (edge * beat * np.roll(wave, 1))[:, None] * about / 3.0
    return out, turning


def _path(rng, parts, edges, rate):
    """Attitude body to room and (N, 3) place in m."""
    n = int(edges[-1])
    spans = list(zip(parts, edges[:-1], edges[1:], strict=True))
    turn, place, held = np.zeros((n, 4)), np.zeros((n, 3)), np.zeros(n)
    attitude, at = Rotation.random(random_state=int(rng.integers(2**31))), np.zeros(3)
    tremor_deg, drift_deg_s = 10.0 ** rng.uniform(-2.0, -0.8), 10.0 ** rng.uniform(-1.3, 0.3)
    for (name, seconds), first, last in spans:
        x = np.arange(last - first) / max(last - first - 1, 1)
        turned, place[first:last] = attitude, at
        if name == "stroke":
            way = Rotation.random(random_state=int(rng.integers(2**31))).as_rotvec() * rng.uniform(0.3, 1.0)
            bow = rng.normal(size=3) * 0.3
            path = Rotation.from_rotvec(np.outer(np.sin(np.pi * minimum_jerk(x)) ** 2, bow))
            turned = attitude * path * Rotation.from_rotvec(np.outer(minimum_jerk(x), way))
            step = rng.normal(size=3) * 0.15
            place[first:last] += np.outer(minimum_jerk(x), step)
            at = at + step
        elif name == "pause":
            # The hand sags while it waits.
            sag = rng.normal(size=3) * drift_deg_s * DEGREE / np.sqrt(3.0)
            turned = attitude * Rotation.from_rotvec(np.outer(x * seconds, sag))
        turn[first:last], held[first:last] = turned.as_quat(), name != "pose"
        attitude = turned if turned is attitude else turned[-1]
    # The hand's tremor fades within the move's first and last tenth of a second: what is set down is still.
    width, is_move = max(int(0.1 * rate), 1), held > 0.0
    held = np.convolve(np.pad(held, width, mode="edge"), np.hanning(2 * width + 1) / width, mode="valid") * is_move
    shake = _tremor(rng, n, rate, 4.0, 11.0) * (held * tremor_deg * DEGREE)[:, None]
    place = place + _tremor(rng, n, rate, 3.0, 9.0) * (held * tremor_deg * DEGREE * 0.1)[:, None]
    return Rotation.from_quat(turn) * Rotation.from_rotvec(shake), place


def session(seed, kind):
    """One session of this kind: (N, 3) m/s² and rad/s of a part with data-sheet noise and errors of a few per cent."""
    rng = np.random.default_rng(seed)
    rate = float(rng.choice(RATES_HZ))
    parts = _timetable(rng, int(rng.integers(10, 22)), kind)
    edges = np.round(np.cumsum([0.0, *(s for _, s in parts)]) * rate).astype(int)
    n = int(edges[-1])
    t = np.arange(n) / rate
    rotation, place = _path(rng, parts, edges, rate)
    lever = rng.normal(size=3) * 0.02
    rates = np.zeros((n, 3))
    rates[1:-1] = (rotation[:-2].inv() * rotation[2:]).as_rotvec() * rate / 2.0
    force = np.gradient(np.gradient(place + rotation.apply(lever), axis=0), axis=0) * rate**2 + [0.0, 0.0, G]
    spans = list(zip((name for name, _ in parts), *np.stack([edges[:-1], edges[1:]]).tolist(), strict=True))
    poses, pauses = ([(a, b) for name, a, b in spans if name == wanted] for wanted in ("pose", "pause"))
    accel = rotation.inv().apply(force)
    still = np.hstack([rotation.inv().apply([0.0, 0.0, G]), np.zeros((n, 3))])
    if kind in ("shaken", "all"):
        force, turning = _shaking(rng, t, rate, poses)
        accel, rates = accel + force, rates + turning
    noise_a, noise_w = rng.uniform(80, 300) * 1e-6 * G * np.sqrt(rate / 2), rng.uniform(0.004, 0.02) * DEGREE
    M, zero = np.zeros((6, 6)), np.concatenate([0.3 * rng.normal(size=3), DEGREE * rng.normal(size=3)])
    M[:3, :3], M[3:, 3:] = np.eye(3) + 0.01 * rng.normal(size=(2, 3, 3))
    accel, gyro = accel @ M[:3, :3] + zero[:3], rates @ M[3:, 3:] + zero[3:]
    accel += noise_a * rng.normal(size=(n, 3))
    gyro += noise_w * np.sqrt(rate / 2) * rng.normal(size=(n, 3))
    return Stops(
        Recording(time_s=t, accelerometer=accel, gyroscope=gyro, rate_hz=rate), poses, pauses, still @ M + zero
    )


def _overlap(a, b):
    return max(0, min(a[1], b[1]) - max(a[0], b[0]))


def score(made, segments):
    """Poses lost, holds that are pauses or nothing (with whether they are called unsteady), poses in two."""
    poses = [(h.start, h.stop) for h in segments.poses]
    lost = [p for p in made.poses if not any(_overlap(p, h) > FOUND * min(h[1] - h[0], p[1] - p[0]) for h in poses)]
    false = [h for h in poses if not any(_overlap(p, h) > FOUND * (h[1] - h[0]) for p in made.poses)]
    in_two = [p for p in made.poses if sum(_overlap(p, h) > 0 for h in poses) > 1]
    return lost, false, in_two


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--sessions", type=int, default=20, help="of every kind")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--kind", choices=KINDS, action="append")
    asked = parser.parse_args()
    print("| kind | poses | lost | in two | pauses | taken for poses | sessions with a fault |\n" + "|---" * 7 + "|")
    for kind in asked.kind or KINDS:
        total, bad = np.zeros(5, dtype=int), 0
        for k in range(asked.sessions):
            made = session(asked.seed * 1000 + k, kind)
            lost, false, in_two = score(made, segment_recording(made.recording))
            total += [len(made.poses), len(lost), len(in_two), len(made.pauses), len(false)]
            bad += bool(lost or false or in_two)
        print(f"| {kind} | {' | '.join(str(v) for v in total)} | {bad} of {asked.sessions} |", flush=True)


if __name__ == "__main__":
    main()
