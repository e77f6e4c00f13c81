"""Pairs written with NumPy alone and asked on the command line: each mistake of a simulation, one after another.

    python benches/plain_pairs.py                   # every case once
    python benches/plain_pairs.py --case surplus --seed 5 --repeat 3
    python benches/plain_pairs.py --list

Nothing of the package makes the logs: attitudes by Rodrigues' formula, noise by NumPy, CSV by hand. The answer of each
case is sealed in ``sealed.json`` before ``trihedron diagnose`` runs on the two logs in a process of its own; it is
opened afterwards. A case is right when the verdict is, what must be said is said (a significant number or figure of
noise, an effect, words in the text) and nothing else is.
"""

from __future__ import annotations

import argparse
import json
import subprocess
import sys
import tempfile
from collections.abc import Callable
from dataclasses import dataclass, field, replace
from pathlib import Path
from typing import Any

import numpy as np

G = 9.81
RATE_HZ = 100.0
FINE = 4
"""Instants per sample at which the motion is evaluated."""


# --- motion ---------------------------------------------------------------------------------------------------------


def rodrigues(vectors: np.ndarray) -> np.ndarray:
    """(n, 3, 3) matrices of (n, 3) rotation vectors."""
    angle = np.linalg.norm(vectors, axis=1)
    axis = vectors / np.where(angle > 0.0, angle, 1.0)[:, None]
    x, y, z = axis.T
    zero = np.zeros_like(x)
    cross = np.array([[zero, -z, y], [z, zero, -x], [-y, x, zero]]).transpose(2, 0, 1)
    sine, versine = np.sin(angle)[:, None, None], (1.0 - np.cos(angle))[:, None, None]
    return np.eye(3) + sine * cross + versine * (cross @ cross)


def vector_of(R: np.ndarray) -> np.ndarray:
    angle = np.arccos(np.clip((np.trace(R) - 1.0) / 2.0, -1.0, 1.0))
    axis = np.array([R[2, 1] - R[1, 2], R[0, 2] - R[2, 0], R[1, 0] - R[0, 1]])
    length = np.linalg.norm(axis)
    return angle * axis / length if length > 1e-12 else np.zeros(3)


def hand(
    rng: np.random.Generator, poses: int, hold_s: float, move_s: float, protocol: np.random.Generator
) -> tuple[np.ndarray, ...]:
    """Time (n,), specific force (n, 3) and rate (n, 3) in the body, rate in the world (n, 3), at RATE_HZ.

    Each move turns about one axis of the world by a septic law while the hand lifts and sets down; ``protocol`` draws
    the poses, ``rng`` how the hand gets there and when.
    """
    dt = 1.0 / (RATE_HZ * FINE)
    R = np.eye(3)
    blocks: list[tuple[np.ndarray, np.ndarray, np.ndarray]] = []
    for k in range(poses):
        n = int((hold_s * rng.uniform(0.85, 1.25) + (2.0 if k == 0 else 0.0)) / dt)
        still = np.zeros((n, 3))
        blocks.append((np.broadcast_to(R, (n, 3, 3)), still, still))
        if k == poses - 1:
            break
        m = int(move_s * rng.uniform(0.8, 1.3) / dt)
        u = (np.arange(m) + 1.0) / m
        law = u**4 * (35.0 - 84.0 * u + 70.0 * u**2 - 20.0 * u**3)
        speed = 140.0 * u**3 * (1.0 - u) ** 3 / (m * dt)
        random = np.linalg.qr(protocol.standard_normal((3, 3)))[0]
        random = random * np.linalg.det(random)
        turn = vector_of(random @ R.T)
        path = rodrigues(law[:, None] * turn) @ R
        T = m * dt
        lift = rng.normal(size=3) * 0.06
        # Position lift·64u³(1-u)³: velocity and acceleration vanish at both ends.
        second = 64.0 * (6.0 * u - 36.0 * u**2 + 60.0 * u**3 - 30.0 * u**4) / T**2
        blocks.append((path, speed[:, None] * turn, second[:, None] * lift))
        R = path[-1]
    attitude = np.concatenate([b[0] for b in blocks])
    world_rate = np.concatenate([b[1] for b in blocks])
    acceleration = np.concatenate([b[2] for b in blocks])
    force = np.einsum("nji,nj->ni", attitude, acceleration + np.array([0.0, 0.0, G]))
    rate = np.einsum("nji,nj->ni", attitude, world_rate)
    # What a converter gives is the mean of its own interval.
    n = len(force) // FINE * FINE
    force, rate, world_rate = (
        v[:n].reshape(-1, FINE, 3).mean(axis=1) for v in (force, rate, world_rate)
    )  # fmt: skip
    return np.arange(len(force)) / RATE_HZ, force, rate, world_rate


# --- instrument -----------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Sensor:
    """Reading = round((scale · axes · truth + zero + noise) / lsb) · lsb; lsb 0 rounds nothing."""

    scale: np.ndarray = field(default_factory=lambda: np.ones(3))
    axes: np.ndarray = field(default_factory=lambda: np.eye(3))
    zero: np.ndarray = field(default_factory=lambda: np.zeros(3))
    density: np.ndarray = field(default_factory=lambda: np.zeros(3))
    walk: float = 0.0
    lsb: float = 0.0
    law: str = "normal"
    quadratic: np.ndarray = field(default_factory=lambda: np.zeros(3))


@dataclass(frozen=True)
class Side:
    """One log: two sensors, how its clock runs, and what else its author did."""

    accel: Sensor
    gyro: Sensor
    jitter_s: float = 0.0
    g_sensitivity: np.ndarray = field(default_factory=lambda: np.zeros((3, 3)))
    poses: int = 24
    world_rates: bool = False
    gravity_sign: float = 1.0
    accel_factor: float = 1.0
    gyro_factor: float = 1.0
    accel_unit: str = "m/s^2"
    gyro_unit: str = "rad/s"
    walk_step: str = "right"
    protocol: int | None = None


def tilted(rng: np.random.Generator, size: float) -> np.ndarray:
    """(3, 3) unit rows off the orthogonal by about ``size``."""
    rows = np.eye(3) + size * rng.standard_normal((3, 3)) * (1.0 - np.eye(3))
    return rows / np.linalg.norm(rows, axis=1, keepdims=True)


def unit(rng: np.random.Generator) -> Side:
    """A consumer part as it leaves the factory."""
    accel = Sensor(
        1.0 + 0.01 * rng.standard_normal(3), tilted(rng, 0.005), 0.15 * rng.standard_normal(3),
        np.array([1.5e-3, 1.7e-3, 2.1e-3]), 0.0, 9.81 / 8192,
    )  # fmt: skip
    gyro = Sensor(
        1.0 + 0.01 * rng.standard_normal(3), tilted(rng, 0.005), 0.02 * rng.standard_normal(3),
        np.array([1.0e-4, 1.15e-4, 1.3e-4]), 0.0, float(np.radians(1 / 32.8)),
    )  # fmt: skip
    return Side(accel, gyro)


def noise_of(rng: np.random.Generator, sensor: Sensor, n: int, walk_step: str) -> np.ndarray:
    if sensor.law == "uniform":
        white = rng.uniform(-1.0, 1.0, (n, 3)) * np.sqrt(3.0)
    else:
        white = rng.standard_normal((n, 3))
    step = {"right": np.sqrt(1.0 / RATE_HZ), "dt": 1.0 / RATE_HZ, "none": 1.0}[walk_step]
    walk = np.cumsum(rng.standard_normal((n, 3)), axis=0) * sensor.walk * step
    return white * sensor.density * np.sqrt(RATE_HZ) + walk


def readings(rng: np.random.Generator, sensor: Sensor, truth: np.ndarray, walk_step: str) -> np.ndarray:
    along = truth @ sensor.axes.T
    out = sensor.scale * along + sensor.quadratic * along**2 + sensor.zero
    out = out + noise_of(rng, sensor, len(out), walk_step)
    return np.round(out / sensor.lsb) * sensor.lsb if sensor.lsb else out


def log(side: Side, seed: int, path: Path) -> None:
    rng = np.random.default_rng(seed)
    protocol = np.random.default_rng(seed if side.protocol is None else side.protocol)
    t, force, rate, world = hand(rng, side.poses, 4.5, 1.8, protocol)
    force = side.gravity_sign * force
    felt = (world if side.world_rates else rate) + force @ side.g_sensitivity.T
    a = readings(rng, side.accel, force, side.walk_step) * side.accel_factor
    w = readings(rng, side.gyro, felt, side.walk_step) * side.gyro_factor
    t = t + side.jitter_s * rng.standard_normal(len(t))
    head = "t [s]," + ",".join(f"a{x} [{side.accel_unit}]" for x in "xyz") + ","
    head += ",".join(f"g{x} [{side.gyro_unit}]" for x in "xyz")
    np.savetxt(path, np.column_stack([t, a, w]), delimiter=",", fmt="%.9g", header=head, comments="")


# --- cases ----------------------------------------------------------------------------------------------------------


@dataclass(frozen=True)
class Case:
    """Simulation and recording, and what is right to say."""

    simulated: Side
    recorded: Side
    verdict: str
    must: tuple[str, ...] = ()
    may: tuple[str, ...] = ()
    words: tuple[str, ...] = ()
    by_file: bool = False


NUMBERS = (
    "accel-zero", "accel-scale", "accel-misalignment", "gyro-zero", "gyro-scale", "gyro-misalignment",
    "triad-alignment", "gravity",
)  # fmt: skip
ROOT = float(np.sqrt(RATE_HZ))


def ideal(of: Side) -> Side:
    """A student's simulation of a part: no zeros, no scale errors; the part's noise and converter."""
    plain = {"scale": np.ones(3), "axes": np.eye(3), "zero": np.zeros(3)}
    return replace(of, accel=replace(of.accel, **plain), gyro=replace(of.gyro, **plain))


def gyro(side: Side, **changes: Any) -> Side:
    return replace(side, gyro=replace(side.gyro, **changes))


def accel(side: Side, **changes: Any) -> Side:
    return replace(side, accel=replace(side.accel, **changes))


def signs(rng: np.random.Generator) -> np.ndarray:
    return rng.choice((-1.0, 1.0), 3)


def noisy(side: Side, factor: float) -> Side:
    return gyro(side, density=side.gyro.density * factor)


def triad_turned(side: Side, rng: np.random.Generator) -> Side:
    return gyro(side, axes=side.gyro.axes @ rodrigues(0.008 * signs(rng)[None])[0].T)


def cases() -> dict[str, Callable[[np.random.Generator], Case]]:
    """Each by name; the eleven pairs of everyday first, then mistakes that simulators have made."""

    def made(
        change: Callable[[Side, np.random.Generator], tuple[Side, Side]], verdict: str, *must: str,
        may: tuple[str, ...] = (), words: tuple[str, ...] = (), by_file: bool = False,
    ) -> Callable[[np.random.Generator], Case]:  # fmt: skip
        def make(rng: np.random.Generator) -> Case:
            simulated, recorded = change(unit(rng), rng)
            return Case(simulated, recorded, verdict, must, may, words, by_file)

        return make

    differ, physics = "parameters-differ", "missing-physics"
    return {
        "same unit": made(lambda u, _: (u, u), "consistent"),
        "same unit, by file": made(lambda u, _: (u, u), "consistent", by_file=True),
        "nominal": made(lambda u, _: (ideal(u), u), differ, "accel-zero", "gyro-zero", may=NUMBERS),
        "another unit": made(lambda u, r: (unit(r), u), differ, "accel-zero", "gyro-zero", may=NUMBERS),
        "gyro zero moved": made(
            lambda u, r: (u, gyro(u, zero=u.gyro.zero + 0.005 * signs(r))), differ, "gyro-zero", by_file=True
        ),
        "accel zero moved": made(
            lambda u, r: (u, accel(u, zero=u.accel.zero + 0.05 * signs(r))), differ, "accel-zero", by_file=True
        ),
        "triad turned": made(lambda u, r: (triad_turned(u, r), u), differ, "triad-alignment"),
        "noise twice": made(
            lambda u, _: (noisy(u, 2.0), u), differ, "gyroscope N", may=("gyroscope octave",), words=("times",)
        ),
        "converter four times coarser": made(
            lambda u, _: (accel(u, lsb=16 * u.accel.lsb), accel(u, lsb=4 * u.accel.lsb)), differ,
            "accelerometer resolution", may=("accelerometer N", "accelerometer octave", "accelerometer bandwidth"),
        ),
        "surplus": made(
            lambda u, r: (replace(u, g_sensitivity=3e-4 * r.choice((-1.0, 1.0), (3, 3))), u), physics,
            "model:gyro-g-sensitivity", may=("gyro-zero",),
        ),
        "missing": made(
            lambda u, r: (u, accel(u, quadratic=4e-4 * signs(r))), physics, "recording:accel-quadratic",
            may=("accel-zero",),
        ),
        # Mistakes of simulators.
        "density multiplied by the root of the rate": made(
            lambda u, _: (gyro(u, density=u.gyro.density * ROOT), u), differ, "gyroscope N",
            may=("gyroscope octave",), words=("√",),
        ),
        "density divided by the root of the rate": made(
            lambda u, _: (gyro(u, density=u.gyro.density / ROOT, lsb=0.0), gyro(u, lsb=0.0)), differ, "gyroscope N",
            may=("gyroscope octave",), words=("√",),
        ),
        "uniform noise": made(
            lambda u, _: (gyro(u, law="uniform", lsb=0.0), gyro(u, lsb=0.0)), differ, "gyroscope distribution",
            words=("uniform",),
        ),
        "bias never added": made(lambda u, _: (gyro(u, zero=np.zeros(3)), u), differ, "gyro-zero"),
        "same noise on all axes": made(
            lambda u, _: (gyro(u, density=np.full(3, u.gyro.density.mean())), u), differ, "gyroscope N",
            may=("gyroscope octave",), words=("same on all axes",),
        ),
        "degrees taken for radians": made(
            lambda u, _: (replace(u, gyro_factor=float(np.degrees(1.0))), u), differ, "gyroscope unit",
            words=("writes degrees where it says radians",),
        ),
        "radians taken for degrees": made(
            lambda u, _: (replace(u, gyro_factor=float(np.radians(1.0))), u), differ, "gyroscope unit",
            words=("writes radians where it says degrees",),
        ),
        "sign of gravity": made(
            lambda u, _: (replace(u, gravity_sign=-1.0, protocol=7), replace(u, protocol=7)), differ,
            "accelerometer frame", may=("accel-zero",), words=("opposite sign",),
        ),
        "g for m/s²": made(
            lambda u, _: (replace(u, accel_factor=1.0 / 9.80665), u), differ, "accelerometer unit", may=("gravity",),
            words=("writes g where it says m/s²",),
        ),
        "walk not scaled with the step": made(
            lambda u, _: (replace(gyro(u, walk=2e-5), walk_step="none"), gyro(u, walk=2e-5)), differ,
            "gyroscope K", may=("gyroscope octave", "gyroscope N", "gyroscope B", "gyro-zero"), words=("walk",),
        ),
        "no quantisation": made(
            lambda u, _: (accel(u, lsb=0.0), accel(u, lsb=16 * u.accel.lsb)), differ,
            "accelerometer resolution", may=("accelerometer N", "accelerometer octave"),
            words=("converter",),
        ),
        "perfect clock": made(
            lambda u, _: (u, replace(u, jitter_s=1.5e-3)), differ, "both jitter", words=("stamps",),
        ),
        "rates of the world frame": made(
            lambda u, _: (replace(u, world_rates=True), u), differ, "gyroscope frame",
            words=("axes of the world",),
        ),
    }  # fmt: skip


# --- asked and scored -----------------------------------------------------------------------------------------------


def said_by(document: dict[str, Any]) -> set[str]:
    said = {p["id"] for p in document["parameters"] if p["significant"]}
    said |= {f"{n['sensor']} {n['term']}" for n in document["noise"] if n["significant"]}
    return said | {f"{e['in']}:{e['id']}" for e in document["effects"]}


def ask(case: Case, seed: int, folder: Path) -> dict[str, Any]:
    """Seal, ask the command, open the seal."""
    log(case.simulated, seed, folder / "simulation.csv")
    log(case.recorded, seed + 1, folder / "recording.csv")
    sealed = {"verdict": case.verdict, "must": case.must, "may": case.may, "words": case.words}
    (folder / "sealed.json").write_text(json.dumps(sealed))
    tool = [sys.executable, "-m", "trihedron"]
    given = ["--against", str(folder / "simulation.csv"), "--gravity", str(G)]
    if case.by_file:
        made = [*tool, "calibrate", str(folder / "simulation.csv"), "--gravity", str(G), "-o", str(folder / "old.json")]
        subprocess.run(made, capture_output=True, check=False)
        given = ["--calibration", str(folder / "old.json")]
    found = folder / "found.json"
    done = subprocess.run(
        [*tool, "diagnose", str(folder / "recording.csv"), *given, "--json", str(found)],
        capture_output=True, text=True, check=False,
    )  # fmt: skip
    if not found.exists():
        return {"verdict": f"no answer: {done.stderr.strip()[-300:]}", "right": False}
    answer = json.loads((folder / "sealed.json").read_text())
    document = json.loads(found.read_text())
    said = said_by(document)
    missed = [m for m in answer["must"] if m not in said]
    false = sorted(said - {*answer["must"], *answer["may"]})
    unsaid = [w for w in answer["words"] if w not in " ".join(done.stdout.split())]
    right = document["verdict"] == answer["verdict"] and not missed and not false and not unsaid
    return {
        "verdict": document["verdict"], "right": right, "missed": missed, "false": false, "unsaid": unsaid,
        "text": done.stdout,
    }  # fmt: skip


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--case", action="append", choices=tuple(cases()))
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--repeat", type=int, default=1)
    parser.add_argument("--list", action="store_true")
    parser.add_argument("--show", action="store_true", help="the report of every case that is wrong")
    options = parser.parse_args()
    if options.list:
        print("\n".join(cases()))
        return
    right = total = 0
    for repeat in range(options.repeat):
        for number, (name, make) in enumerate(cases().items()):
            if options.case and name not in options.case:
                continue
            seed = 1000 * (options.seed + repeat) + 10 * number
            with tempfile.TemporaryDirectory() as folder:
                result = ask(make(np.random.default_rng(seed)), seed + 2, Path(folder))
            total += 1
            right += result["right"]
            mark = "right" if result["right"] else "WRONG"
            rest = {k: v for k, v in result.items() if k not in ("right", "text") and v}
            print(f"{mark}  {name}: {rest}", flush=True)
            if options.show and not result["right"]:
                print(result.get("text", ""))
    print(f"\n{right} of {total} right")


if __name__ == "__main__":
    main()
