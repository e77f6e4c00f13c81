"""Laws of invented mechanisms, among nuisances and without any law: right, silent, wrong.

    python benches/laws.py [--each 4] [--none 60] [--first-seed 1] [--only NAME]

Every session is simulated, the mechanism added to the readings sample by sample, the session fitted with the linear
model, and the laws of its misfit asked for: no other effect competes. Right: the first law is of the right sensor and
names the right variables; wrong: it names others.
"""

from __future__ import annotations

import argparse
import dataclasses
import time
from collections.abc import Callable
from dataclasses import dataclass

import numpy as np

from blind_trial.draw import grade_profile
from trihedron.diagnose.context import Context
from trihedron.diagnose.laws.find import find_laws
from trihedron.diagnose.session.observations import observe
from trihedron.diagnose.session.solve import tune_noise
from trihedron.diagnose.session.starting_point import start_twin
from trihedron.diagnose.session.twin import NO_DISTORTION
from trihedron.pipeline import calibrate, segment
from trihedron.records import Recording
from trihedron.records.truth import Truth
from trihedron.simulate import Scenario, hand_session, simulate

DEG = np.pi / 180.0
Signal = Callable[["Motion", np.random.Generator], np.ndarray]


@dataclass(frozen=True, eq=False)
class Motion:
    """What a mechanism may see: time (n,), rate, force [g], room vectors in the body (n, 3, 3), pose number (n,)."""

    t: np.ndarray
    w: np.ndarray
    f: np.ndarray
    room: np.ndarray
    pose: np.ndarray
    holds: list[tuple[int, int]]


@dataclass(frozen=True)
class Mechanism:
    """``signal`` → (n, 3) of rms about 1 where it matters, ``size`` in SI, ``words`` that a right law contains."""

    sensor: str
    domains: tuple[str, ...]
    size: float
    words: tuple[str, ...]
    signal: Signal


def one_axis(value: np.ndarray, rng: np.random.Generator) -> np.ndarray:
    out = np.zeros((len(value), 3))
    out[:, rng.integers(3)] = value * rng.choice((-1.0, 1.0))
    return out


def previous(m: Motion) -> np.ndarray:
    up = np.array([m.f[a:b].mean(axis=0) for a, b in m.holds])
    before = np.vstack([up[:1], up[:-1]])
    return before[m.pose]


def turned(m: Motion) -> np.ndarray:
    angle = np.zeros((len(m.holds), 3))
    for k in range(1, len(m.holds)):
        part = slice(m.holds[k - 1][1], m.holds[k][0])
        angle[k] = np.trapezoid(m.w[part], m.t[part], axis=0)
    return angle[m.pose]


def field(m: Motion, rng: np.random.Generator) -> np.ndarray:
    dip, heading = rng.uniform(0.2, 1.3), rng.uniform(0, 6.28)
    vector = np.array([np.sin(dip) * np.cos(heading), np.sin(dip) * np.sin(heading), np.cos(dip)])
    return (m.room @ vector) @ rng.normal(0, 1, (3, 3)).T


MECHANISMS: dict[str, Mechanism] = {
    "gyro: magnetic field": Mechanism("gyroscope", ("static-gyro",), 0.03 * DEG, ("room",), field),
    "gyro: f_x f_y": Mechanism(
        "gyroscope", ("static-gyro",), 0.2 * DEG, ("u_x u_y",), lambda m, r: one_axis(m.f[:, 0] * m.f[:, 1], r)
    ),
    "gyro: f_z squared": Mechanism(
        "gyroscope",
        ("static-gyro",),
        0.12 * DEG,
        ("u_z^2", "u_x^2", "u_y^2"),
        lambda m, r: one_axis(m.f[:, 2] ** 2, r),
    ),
    "gyro: sign of last turn": Mechanism(
        "gyroscope", ("static-gyro",), 0.05 * DEG, ("last turn",), lambda m, r: one_axis(np.sign(turned(m)[:, 1]), r)
    ),
    "gyro: last turn": Mechanism(
        "gyroscope", ("static-gyro",), 0.04 * DEG, ("last turn",), lambda m, r: one_axis(turned(m)[:, 2], r)
    ),
    "gyro: previous pose": Mechanism(
        "gyroscope", ("static-gyro",), 0.08 * DEG, ("previous",), lambda m, r: one_axis(previous(m)[:, 0], r)
    ),
    "accel: f_y f_z": Mechanism(
        "accelerometer",
        ("static-accel",),
        0.04,
        ("u_y u_z", "u_x u_y", "u_x u_z"),
        lambda m, r: one_axis(m.f[:, 1] * m.f[:, 2], r),
    ),
    "accel: previous pose": Mechanism(
        "accelerometer", ("static-accel",), 0.03, ("previous",), lambda m, r: one_axis(previous(m)[:, 1], r)
    ),
    "accel: last turn": Mechanism(
        "accelerometer", ("static-accel",), 0.02, ("last turn",), lambda m, r: one_axis(turned(m)[:, 0], r)
    ),
    "gyro: w_x f_y": Mechanism(
        "gyroscope", ("moves", "dynamics"), 0.02, ("w_",), lambda m, r: one_axis(m.w[:, 0] * m.f[:, 1], r)
    ),
    "gyro: w_x w_y": Mechanism(
        "gyroscope", ("moves", "dynamics"), 0.03, ("w_",), lambda m, r: one_axis(m.w[:, 0] * m.w[:, 1], r)
    ),
    "accel: |w|": Mechanism(
        "accelerometer", ("dynamics",), 0.1, ("|w|", "w_"), lambda m, r: one_axis(np.linalg.norm(m.w, axis=1), r)
    ),
    # Forms that the dictionary holds only approximately.
    "gyro: |f_x| above 0.5": Mechanism(
        "gyroscope", ("static-gyro",), 0.12 * DEG, ("u_x", "u_"), lambda m, r: one_axis(np.abs(m.f[:, 0]) > 0.5, r)
    ),
    "gyro: cubic of f": Mechanism(
        "gyroscope", ("static-gyro",), 0.25 * DEG, ("u_",), lambda m, r: one_axis(m.f[:, 0] ** 2 * m.f[:, 1], r)
    ),
    "gyro: dead band of last turn": Mechanism(
        "gyroscope",
        ("static-gyro",),
        0.08 * DEG,
        ("last turn",),
        lambda m, r: one_axis(np.clip(turned(m)[:, 1], -0.6, 0.6), r),
    ),
}


def session(seed: int, *, nuisances: bool) -> tuple[Recording, Truth, Motion]:
    rng = np.random.default_rng([seed, 77])
    profile = grade_profile(("mpu", "adis")[seed % 2])
    accelerometer, gyroscope = profile.unit(seed)
    plan = hand_session(
        int(rng.integers(26, 36)), hold_s=float(rng.uniform(3.5, 6.0)), layout=int(rng.integers(1, 9999)),
        move_s=float(rng.uniform(1.6, 2.6)),
    )  # fmt: skip
    log, truth = simulate(Scenario(plan, "laws", accelerometer, gyroscope, profile.clock), seed)
    holds = [(p.start, p.stop) for p in truth.segments if p.kind != "move"]
    pose = np.zeros(log.n_samples, dtype=int)
    for k, (a, _) in enumerate(holds):
        pose[a - (a - holds[k - 1][1]) // 2 if k else 0 :] = k
    w, x, y, z = truth.attitude.T
    rows = np.stack(
        [1 - 2 * (y * y + z * z), 2 * (x * y - w * z), 2 * (x * z + w * y),
         2 * (x * y + w * z), 1 - 2 * (x * x + z * z), 2 * (y * z - w * x),
         2 * (x * z - w * y), 2 * (y * z + w * x), 1 - 2 * (x * x + y * y)], axis=1,
    ).reshape(-1, 3, 3)  # fmt: skip
    motion = Motion(
        log.time_s, truth.angular_rate_rad_s, truth.specific_force_m_s2 / truth.gravity_m_s2,
        rows.transpose(0, 2, 1), pose, holds,
    )  # fmt: skip
    if nuisances:
        jump = rng.normal(size=(len(holds), 3))
        log = added(log, truth, "gyroscope", rng.uniform(0.003, 0.01) * DEG * jump[pose])
        jump = rng.normal(size=(len(holds), 3))
        log = added(log, truth, "accelerometer", rng.uniform(0.0005, 0.002) * jump[pose])
        warm = np.exp(-log.time_s / rng.uniform(30, 90))[:, None] * rng.normal(size=3)
        log = added(log, truth, "gyroscope", 0.01 * DEG * warm)
    return log, truth, motion


def structured(log: Recording, truth: Truth, m: Motion, rng: np.random.Generator) -> Recording:
    """Misfits without a law: telegraphs, blocks of poses, strong scatter, walks."""
    h, kind = len(m.holds), int(rng.integers(5))
    if kind == 0:
        values = rng.normal(size=(h, 3))
    elif kind == 1:
        values = np.cumsum(rng.normal(size=(h, 3)), axis=0) / 3.0
    elif kind == 2:
        values = np.repeat(rng.normal(size=(h // 4 + 1, 3)), 4, axis=0)[:h]
    elif kind == 3:
        values = np.where(rng.random((h, 3)) < 0.5, -1.0, 1.0)
    else:
        values = np.sin(np.linspace(0, rng.uniform(4, 20), h))[:, None] * rng.normal(size=3)
    log = added(log, truth, "gyroscope", 0.05 * DEG * values[m.pose])
    return added(log, truth, "accelerometer", 0.01 * np.roll(values, 1, axis=1)[m.pose])


def added(log: Recording, truth: Truth, sensor: str, extra: np.ndarray) -> Recording:
    S = truth.gyroscope_S if sensor == "gyroscope" else truth.accelerometer_S
    return dataclasses.replace(log, **{sensor: getattr(log, sensor) + extra @ np.linalg.inv(S).T})


def laws_of(log: Recording, gravity: float, domains: tuple[str, ...]) -> tuple:
    segments = segment(log)
    calibration = calibrate(log, segments=segments, gravity_m_s2=gravity).calibration
    obs = observe(log, segments)
    fitted = tune_noise(obs, start_twin(obs, calibration), NO_DISTORTION, None)
    return find_laws(Context(obs, fitted), domains)


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--each", type=int, default=4)
    parser.add_argument("--none", type=int, default=60)
    parser.add_argument("--first-seed", type=int, default=1)
    parser.add_argument("--only", default="")
    arguments = parser.parse_args()
    total = np.zeros(3, dtype=int)
    begun, count = time.perf_counter(), 0
    for name, mechanism in MECHANISMS.items():
        if arguments.only not in name:
            continue
        score, said = np.zeros(3, dtype=int), []
        for seed in range(arguments.first_seed, arguments.first_seed + arguments.each):
            log, truth, motion = session(seed, nuisances=True)
            signal = mechanism.signal(motion, np.random.default_rng([seed, 5]))
            log = added(log, truth, mechanism.sensor, mechanism.size * signal)
            laws = laws_of(log, truth.gravity_m_s2, mechanism.domains)
            count += 1
            if not laws:
                score[1] += 1
            elif laws[0].sensor == mechanism.sensor and any(
                word in " ".join(laws[0].depends_on) for word in mechanism.words
            ):
                score[0] += 1
            else:
                score[2] += 1
            said += ["; ".join(f"{law.sensor[:5]} {', '.join(law.depends_on)} {law.share:.2f}" for law in laws)]
        total += score
        print(f"{name:<30} right {score[0]} silent {score[1]} wrong {score[2]}   {' | '.join(said)}", flush=True)
    print(f"all: right {total[0]} silent {total[1]} wrong {total[2]} of {total.sum()}")
    false, asked = 0, 0
    for seed in range(arguments.first_seed, arguments.first_seed + (0 if arguments.only else arguments.none)):
        log, truth, motion = session(seed, nuisances=seed % 2 == 0)
        if seed % 4:
            log = structured(log, truth, motion, np.random.default_rng([seed, 6]))
        laws = laws_of(log, truth.gravity_m_s2, ("static-gyro", "static-accel", "moves", "dynamics"))
        asked, count = asked + 1, count + 1
        if laws:
            false += 1
            print(f"false at {seed}:", "; ".join(law.statement for law in laws), flush=True)
    print(f"without a law: {false} false of {asked};  {(time.perf_counter() - begun) / max(count, 1):.1f} s a session")


if __name__ == "__main__":
    main()
