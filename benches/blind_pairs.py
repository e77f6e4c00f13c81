"""Blind pairs: a simulation held against a recording, what differs sealed until the verdict stands.

    python benches/blind_pairs.py --pairs 60 --seed 1             # every kind in turn
    python benches/blind_pairs.py --kind surplus --pairs 20

Kinds: the same unit in another session; a nominal simulation of the part; another unit; one parameter changed (bias,
scale, misalignment, the gyro triad turned, gravity); an effect that only the recording has, or only the simulation, or
both; noise twice as large; a coarser ADC. Each pair is diagnosed with ``--against`` or, for one kind in three, with
``--calibration`` made from the simulated log. An effect that was not drawn is false; a group of parameters whose true
difference exceeds five of its standard errors must be found.

Each pair goes through a folder: the generator writes ``simulation.csv``, ``recording.csv`` and ``sealed.json``; the
diagnosis sees the two logs alone, and the seal is opened afterwards.
"""

from __future__ import annotations

import tempfile
from collections import Counter
from dataclasses import dataclass, replace
from pathlib import Path
from typing import Any

import numpy as np
from scipy.linalg import polar
from scipy.spatial.transform import Rotation

import trihedron
from blind_trial.draw import grade_profile, rows
from blind_trial.sizes import SIZES
from trials import command_line, sealed, tried, within
from trihedron.diagnose.effects import catalogue
from trihedron.files.log import write_recording
from trihedron.records import Recording
from trihedron.simulate import Scenario, hand_session, simulate
from trihedron.simulate.effects import with_effect

KINDS = (
    "same", "nominal", "other-unit", "accel-bias", "gyro-bias", "accel-scale", "gyro-scale", "accel-misalignment",
    "gyro-misalignment", "triad-alignment", "gravity", "missing", "surplus", "both", "noise", "resolution",
)  # fmt: skip
IS_TOO = {"accel-size-effect": ("lever-arm",)}
"""Three accelerometers drawn at three places lie, in their mean, away from the centre of rotation."""
GROUPS = (
    "accel-bias", "accel-scale", "accel-misalignment", "gyro-bias", "gyro-scale", "gyro-misalignment",
    "triad-alignment", "gravity",
)  # fmt: skip


@dataclass(frozen=True)
class Pair:
    kind: str
    seed: int
    by_file: bool = False


def channels(S: Any, b: Any) -> tuple[np.ndarray, np.ndarray, np.ndarray]:
    """Gains (3,), directions (3, 3) and offsets (3,) of an instrument: raw = gain (direction · truth) + offset."""
    M = np.linalg.inv(np.array(S))
    k = np.linalg.norm(M, axis=1)
    return k, M / k[:, None], -M @ np.array(b)


def moved(kind: str, accel: Any, gyro: Any, rng: np.random.Generator) -> tuple[Any, Any]:
    """One parameter changed, in the distort direction: raw = S⁻¹(truth - b)."""
    sign = rng.choice((-1.0, 1.0), 3) * rng.uniform(0.5, 1.5, 3)
    if kind == "accel-bias":
        accel = replace(accel, b=rows(np.array(accel.b) + 0.03 * sign))
    elif kind == "gyro-bias":
        gyro = replace(gyro, b=rows(np.array(gyro.b) + np.radians(0.3) * sign))
    elif kind in ("accel-scale", "gyro-scale", "accel-misalignment", "gyro-misalignment", "triad-alignment"):
        sensor = accel if kind.startswith("accel") else gyro
        k, n, offset = channels(sensor.S, sensor.b)
        if kind.endswith("scale"):
            k, offset = k * (1 + 0.004 * sign), offset * (1 + 0.004 * sign)
        elif kind == "triad-alignment":
            n = n @ Rotation.from_rotvec(0.006 * sign).as_matrix().T
        else:
            # Two axes opened against each other, their mean direction kept, so that the triad does not turn.
            i, j = rng.choice(3, 2, replace=False)
            other = n[j] - (n[j] @ n[i]) * n[i]
            other /= np.linalg.norm(other)
            angle = float(np.arccos(n[i] @ n[j])) + 0.004 * float(sign[0])
            centre = (n[i] + n[j]) / np.linalg.norm(n[i] + n[j])
            side = (n[j] - n[i]) / np.linalg.norm(n[j] - n[i])
            n = n.copy()
            n[i] = np.cos(angle / 2) * centre - np.sin(angle / 2) * side
            n[j] = np.cos(angle / 2) * centre + np.sin(angle / 2) * side
        S = np.linalg.inv(k[:, None] * n)
        sensor = replace(sensor, S=rows(S), b=rows(-S @ offset))
        accel, gyro = (sensor, gyro) if kind.startswith("accel") else (accel, sensor)
    return accel, gyro


def session(rng: np.random.Generator) -> Any:
    return hand_session(
        int(rng.integers(20, 33)), pose_s=float(rng.uniform(3.5, 7.0)), layout=int(rng.integers(1, 10000)),
        move_s=float(rng.uniform(1.4, 2.6)),
    )  # fmt: skip


def make(pair: Pair) -> tuple[Recording, Recording, float, dict[str, Any]]:
    """Simulated log, recording, gravity, sealed answer."""
    rng = np.random.default_rng([pair.seed, 77])
    profile = grade_profile("mpu")
    number = int(rng.integers(1, 10000))
    accel, gyro = profile.unit(number)
    sim_a, sim_g = accel, gyro
    if pair.kind == "nominal":
        sim_a, sim_g = profile.accelerometer, profile.gyroscope
    elif pair.kind == "other-unit":
        sim_a, sim_g = profile.unit(number + 1)
    elif pair.kind == "noise":
        factor = float(rng.uniform(1.6, 2.5))
        sim_g = replace(gyro, noise=replace(gyro.noise, N=rows(factor * np.array(gyro.noise.N) * np.ones(3))))
    elif pair.kind == "resolution":
        sim_a = replace(accel, adc=replace(accel.adc, lsb=accel.adc.lsb * float(rng.choice((16.0, 64.0)))))
    else:
        sim_a, sim_g = moved(pair.kind, accel, gyro, rng)
    motion_r, motion_s = session(rng), session(rng)
    real = Scenario(motion_r, "recording", accel, gyro, profile.clock)
    sim = Scenario(motion_s, "simulation", sim_a, sim_g, profile.clock)
    effect = ""
    if pair.kind in ("missing", "surplus", "both"):
        effect = str(rng.choice(list(SIZES)))
        size = SIZES[effect](rng, profile)
        if pair.kind != "surplus":
            real = with_effect(real, effect, **size)
        if pair.kind != "missing":
            sim = with_effect(sim, effect, **size)
    recording, truth = simulate(real, pair.seed)
    simulated, truth_s = simulate(sim, pair.seed + 1)
    gravity = truth.gravity_m_s2
    if pair.kind == "gravity":
        sim = replace(sim, environment=replace(sim.environment, gravity_m_s2=gravity * (1.0 + 3e-3)))
        simulated, truth_s = simulate(sim, pair.seed + 1)
    answer = {"kind": pair.kind, "effect": effect, "numbers": true_differences(truth_s, truth, pair.kind)}
    return simulated, recording, gravity, answer


def true_differences(sim: Any, real: Any, kind: str) -> dict[str, list[float]]:
    """Recording minus simulation, group by group, from the two truths and nothing of the tool's own formulas."""
    out: dict[str, list[float]] = {}
    axes = {}
    for name, sensor in (("accel", "accelerometer"), ("gyro", "gyroscope")):
        sides = [channels(getattr(truth, f"{sensor}_S"), getattr(truth, f"{sensor}_b")) for truth in (sim, real)]
        axes[name] = [polar(n)[0] for _, n, _ in sides]
        of_group = {
            "bias": [offset / k for k, _, offset in sides],
            "scale": [np.log(k) for k, _, _ in sides],
            "misalignment": [np.arccos((n @ n.T)[[0, 0, 1], [1, 2, 2]]) for _, n, _ in sides],
        }
        out |= {f"{name}-{group}": (recorded - made).tolist() for group, (made, recorded) in of_group.items()}
    R = [gyro @ accel.T for gyro, accel in zip(axes["gyro"], axes["accel"], strict=True)]
    out["triad-alignment"] = Rotation.from_matrix(R[1] @ R[0].T).as_rotvec().tolist()
    if kind == "gravity":
        out["accel-scale"] = [0.0] * 3
        out["gravity"] = [-float(np.log(1.003))]
    return out


def ask(folder: Path, gravity: float, by_file: bool) -> dict[str, Any]:
    """The diagnosis of the two logs."""
    recording, simulated = (trihedron.read(folder / f"{name}.csv") for name in ("recording", "simulation"))
    if by_file:
        known = trihedron.calibrate(simulated, gravity_m_s2=gravity)
        return trihedron.diagnose(recording, calibration=known).to_dict()
    return trihedron.diagnose(recording, against=simulated, gravity_m_s2=gravity).to_dict()


def trial(pair: Pair) -> dict[str, Any]:
    with tempfile.TemporaryDirectory() as scratch:
        folder = Path(scratch)
        simulated, recording, gravity, truth = make(pair)
        write_recording(simulated, folder / "simulation.csv")
        write_recording(recording, folder / "recording.csv")
        said, crash, _, truth = sealed(folder, truth, lambda: ask(folder, gravity, pair.by_file))
    result: dict[str, Any] = {"kind": pair.kind, "seed": pair.seed, "by_file": pair.by_file, "crash": crash}
    failed = {"right": False, "false": [], "z": {}}
    return result | (failed if said is None else scored(pair, said, truth))


def left_open(effects: list[tuple[str, str, list[str]]]) -> set[str]:
    """Groups whose level is a convention once one of these effects stands (the temperature to which a bias belongs)."""
    by_id = {effect.id: effect.confounded_with for effect in catalogue()}
    return {group for _, name, _ in effects for group in by_id.get(name, ())}


def scored(pair: Pair, document: dict[str, Any], answer: dict[str, Any]) -> dict[str, Any]:
    """The opened seal beside what was said."""
    said_groups = sorted({p["id"] for p in document["parameters"] if p["significant"]})
    z: dict[str, list[float]] = {}
    must, may = set(), set()
    effects = [(e["in"], e["id"], e["confounded_with"]) for e in document["effects"]]
    # Also of an effect that both logs have, which is no difference.
    is_open = left_open([*effects, ("", answer["effect"], [])])
    # A linear calibration of a log with an effect absorbs it: its parameters fit that log and belong to no unit.
    is_bent = pair.by_file and answer["kind"] in ("surplus", "both")
    for group, values in answer["numbers"].items():
        said = [p for p in document["parameters"] if p["id"] == group]
        if any(abs(v) > 1e-9 for v in values):
            may.add(group)
        if len(said) == len(values):
            errors = [(p["difference"] - v) / p["std"] for p, v in zip(said, values, strict=True)]
            z |= {} if group in is_open or is_bent else {group: errors}
            if any(abs(v) > 5 * p["std"] for p, v in zip(said, values, strict=True)):
                must.add(group)
        elif group == "gravity":
            must.add(group)
    side = {"missing": "recording", "surplus": "model"}.get(answer["kind"], "")
    if pair.by_file:
        # A linear calibration has no effects: it absorbs those of its own log in its parameters.
        side = "recording" if answer["kind"] in ("missing", "both") else ""
        may |= set(GROUPS) if answer["kind"] == "surplus" else set()
    false = [g for g in said_groups if g in GROUPS and g not in may and not (g == "accel-scale" and "gravity" in may)]
    rightly = {answer["effect"], *IS_TOO.get(answer["effect"], ())}
    false += [
        f"{where}:{e}" for where, e, c in effects
        if not (where == side and (e in rightly or answer["effect"] in c))
    ]  # fmt: skip
    noise = sorted({f"{n['sensor']} {n['term']}" for n in document["noise"] if n["significant"]})
    if answer["kind"] == "noise":
        false += [n for n in noise if n not in ("gyroscope N", "gyroscope octave", "gyroscope distribution")]
    elif answer["kind"] == "resolution":
        false += [n for n in noise if not n.startswith("accelerometer")]
    else:
        false += noise
    expected = "consistent"
    if must or (answer["kind"] in ("noise", "resolution") and not pair.by_file):
        expected = "parameters-differ"
    if pair.by_file and answer["kind"] == "surplus" and said_groups:
        expected = "parameters-differ"
    if side:
        expected = "missing-physics"
    first = (
        bool(effects)
        and effects[0][0] == side
        and (effects[0][1] == answer["effect"] or answer["effect"] in effects[0][2])
    )
    return {
        "verdict": document["verdict"], "expected": expected, "right": document["verdict"] == expected,
        "effect": answer["effect"], "first": first if side else None, "said": said_groups,
        "missed": sorted(must - set(said_groups)),
        "effects": [f"{w}:{e}" for w, e, _ in effects], "noise": noise, "false": false, "z": z,
        "off": [d["domain"] for d in document["remaining"] if d["disagrees"]],
    }  # fmt: skip


def line(result: dict[str, Any]) -> str:
    """A pair in which something went wrong."""
    is_odd = not result["right"] or result["false"] or result.get("missed") or result.get("first") is False
    return str({k: v for k, v in result.items() if k != "z"}) if is_odd else ""


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--pairs", type=int, default=32)
    parser.add_argument("--kind", action="append", choices=KINDS)
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    kinds = options.kind or list(KINDS)
    pairs = [
        Pair(kinds[k % len(kinds)], int(rng.integers(1 << 30)), (k // len(kinds)) % 3 == 2)
        for k in range(options.pairs)
    ]
    results = tried(trial, [pair for pair in pairs if options.only_seed in (None, pair.seed)], options, line)
    print(f"\n{len(results)} pairs: verdict right {sum(r['right'] for r in results)}, with a false name "
          f"{sum(bool(r['false']) for r in results)}, a group missed {sum(bool(r.get('missed')) for r in results)}, "
          f"crashes {sum(bool(r['crash']) for r in results)}")  # fmt: skip
    firsts = [r["first"] for r in results if r.get("first") is not None]
    print(f"effect first: {sum(firsts)} of {len(firsts)}")
    by_group = {g: [v for r in results for v in r["z"].get(g, ())] for g in GROUPS}
    for group, z in {"all groups": [v for own in by_group.values() for v in own], **by_group}.items():
        if z:
            print(f"{group}: {len(z)} differences, {within(z)}")
    print(Counter((r["kind"], r.get("verdict")) for r in results))


if __name__ == "__main__":
    main()
