"""The improved scenario of every real multi-pose set: an ideal sensor, made to fit stage by stage.

    python benches/improved_scenarios.py ../shared/data [set ...]

For each set an ideal scenario is held against the recording (``diagnose --against``), improved with the recording's
numbers, then noise, then effects and scatter, and every one of them is moved as the recording was. A line a stage:
simulation over recording, mean in the logarithm of up to twelve simulations (with its 98 % interval), of what poses
miss in the length of gravity and moves in its direction, the worst of either side spared, and of the noise per octave
(geometric mean of all octaves and axes, lowest and highest octave). As given, both are read with the
scenario's numbers; from the stage of the numbers on each is read
with its own calibration. The last column is the verdict of ``diagnose --against`` the improved scenario.
"""

import sys
import tempfile
from dataclasses import replace
from pathlib import Path

import numpy as np

import trihedron
from trihedron.diagnose.against.fitted import model_of_calibration
from trihedron.pipeline import driven, improve
from trihedron.pipeline.carried_misses import carried_misses
from trihedron.pipeline.comparing_noise import sampled
from trihedron.probability import stdtrit
from trihedron.segment import resegment
from trihedron.sensor_model import correct
from trihedron.simulate import read_scenario

IDEAL = 'name = "ideal"\nprofile = "ideal"\n\n[session]\nkind = "hand"\n'
SETS = {
    "xsens_mti": (
        {"accelerometer_path": "xsens_mti/xsens_acc.txt", "gyroscope_path": "xsens_mti/xsens_gyro.txt"},
        9.81744,
    ),
    **{
        f"getovermassif {k}": (
            {
                "accelerometer_path": f"getovermassif/session{k}_acc.txt",
                "gyroscope_path": f"getovermassif/session{k}_gyro.txt",
            },
            9.803,
        )
        for k in (2, 3, 4)
    },
    **{f"mpu9150 {k}": ({"path": f"mpu9150/imu{k}.log", "rate_hz": 100.0}, 9.81) for k in (0, 1, 2)},
    "kim 1": ({"path": "kim/kim_imu_good1.txt"}, 9.79871),
    "kim 2": ({"path": "kim/kim_imu_good2.txt"}, 9.79871),
    "kim 3": ({"path": "kim/kim_imu_good3.txt"}, 9.79871),
    **{f"mimu4444 {k}": ({"path": f"mimu4444/exp_{k}.npz", "device": 1}, 9.8184) for k in (3, 5)},
    **{f"openaxes {part}": ({"path": f"openaxes/{part}.csv"}, 9.8127) for part in ("bmi160", "adxl355")},
}


def logs(folder, chosen):
    for name, (where, gravity) in SETS.items():
        if chosen and name not in chosen and name.split()[0] not in chosen:
            continue
        paths = {key: folder / value if isinstance(value, str) else value for key, value in where.items()}
        yield name, paths, gravity


SEEDS = {"as-given": (300,), "numbers": (300,), "noise": (300, 301), "effects": tuple(range(300, 312))}
"""Of the simulations of each stage, none of those that the improvement itself makes."""


def of_poses(log, segments, calibration):
    """Mean square of what the length of gravity misses in the poses [(m/s²)²], the worst spared.

    With the log's own calibration in the poses that it was fitted to (pieces of one pose are one), per degree of
    freedom; with the numbers of a scenario in all holds.
    """
    a = calibration.accelerometer
    if a.quality is not None:
        return spared(a.quality.residual) * len(a.quality.residual) / max(a.quality.dof, 1)
    length = [np.linalg.norm(correct(log.accelerometer[h.samples()].mean(axis=0), a.S, a.b)) for h in segments.holds]
    return spared(np.array(length) - calibration.gravity_m_s2)


def of_moves(log, segments, calibration):
    """Mean square of the angle by which carried gravity misses the next pose [rad²], the worst spared."""
    return spared(carried_misses(calibration, log, segments).angle_rad)


def spared(misses):
    return float(np.mean(np.sort(misses**2)[:-1]))


def octaves(simulated, recording):
    """Logarithms of the ratio of densities of noise, {(sensor, low_hz): [axes]}."""
    out = {}
    for sensor, axes in recording.noise.items():
        for m, r in zip(simulated.noise.get(sensor, ()), axes, strict=False):
            made = {o.low_hz: o.density.value for o in m.octaves}
            for o in r.octaves:
                if made.get(o.low_hz, 0.0) > 0.0:
                    out.setdefault((sensor, o.low_hz), []).append(0.5 * np.log(made[o.low_hz] / o.density.value))
    return out


def one(name, paths, gravity, work):
    recording = trihedron.read(**paths)
    given = work / "ideal.toml"
    given.write_text(IDEAL)
    found = trihedron.diagnose(recording, against=given, gravity_m_s2=gravity)
    own = trihedron.calibrate(recording, gravity_m_s2=gravity)
    poses = resegment(recording, own.segments)
    seen = sampled(recording, own.segments.holds, model_of_calibration(own.calibration))
    files = {"as-given": given}
    for stage in ("numbers", "noise", "effects"):
        files[stage] = work / f"{stage}.toml"
        files[stage].write_text(improve(given, found, stage=stage).text)
    again = trihedron.diagnose(recording, against=files["effects"], gravity_m_s2=gravity)
    said = {"as-given": f"{found.verdict}: {named(found)}", "effects": f"{again.verdict}: {named(again)}"}
    for stage, path in files.items():
        scenario = read_scenario(path)
        made, ratios = [], {}
        for seed in SEEDS[stage]:
            log = driven(scenario, recording, own.segments, own.calibration, seed)
            its = trihedron.calibrate(log, gravity_m_s2=gravity)
            reads = with_numbers(its.calibration, scenario) if stage == "as-given" else its.calibration
            cut = resegment(log, its.segments)
            made.append((of_poses(log, cut, reads), of_moves(log, cut, reads)))
            for key, values in octaves(
                sampled(log, its.segments.holds, model_of_calibration(its.calibration)), seen
            ).items():
                ratios.setdefault(key, []).extend(values)
        reads = with_numbers(own.calibration, scenario) if stage == "as-given" else own.calibration
        own_misses = of_poses(recording, poses, reads), of_moves(recording, poses, reads)
        cells = [name if stage == "as-given" else "", stage, *map(with_interval, zip(*made, strict=True), own_misses)]
        cells += [in_short(ratios, sensor) for sensor in ("accelerometer", "gyroscope")]
        print(f"| {' | '.join([*cells, said.get(stage, '')])} |", flush=True)


def with_numbers(calibration, scenario):
    """The calibration with S and b of a scenario."""
    a, g = scenario.accelerometer, scenario.gyroscope
    return replace(
        calibration,
        accelerometer=replace(calibration.accelerometer, S=np.array(a.S), b=np.array(a.b), quality=None),
        gyroscope=replace(calibration.gyroscope, S=np.array(g.S), b=np.array(g.b)),
    )


def with_interval(squares, of_recording):
    """Ratio of root mean squares, mean in the logarithm; with its 98 % interval where three or more simulations tell.

    The recording is one more draw: s √(1 + 1/K) times Student's t.
    """
    logs = 0.5 * np.log(np.maximum(squares, 1e-300) / of_recording)
    ratio, n = float(np.exp(logs.mean())), len(logs)
    if n < 3:
        return f"{ratio:.2f}"
    half = stdtrit(n - 1, 0.99) * logs.std(ddof=1) * np.sqrt(1.0 + 1.0 / n)
    return f"{ratio:.2f} ({ratio * np.exp(-half):.2f} to {ratio * np.exp(half):.2f})"


def in_short(ratios, sensor):
    means = [float(np.mean(values)) for (of, _), values in ratios.items() if of == sensor]
    if not means:
        return "–"
    return f"{np.exp(np.mean(means)):.2f} ({np.exp(min(means)):.2f} to {np.exp(max(means)):.2f})"


def named(diagnosis):
    return (
        ", ".join(f"{effect.id}{' of the model' if effect.side == 'model' else ''}" for effect in diagnosis.effects)
        or "no effect"
    )


def main():
    folder, chosen = Path(sys.argv[1]), sys.argv[2:]
    head = ("set", "stage", "poses", "moves", "accelerometer's octaves", "gyro's", "verdict against it")
    print(f"| {' | '.join(head)} |")
    print("|" + "---|" * len(head))
    for name, paths, gravity in logs(folder, chosen):
        with tempfile.TemporaryDirectory() as work:
            try:
                one(name, paths, gravity, Path(work))
            except ValueError as error:
                print(f"| {name} | {error} | | | | | |", flush=True)


if __name__ == "__main__":
    main()
