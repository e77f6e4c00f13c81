"""The improved scenario of every real multi-pose set: an ideal sensor, made to fit stage by stage.

    python benches/improved_scenarios.py ../shared/data [set ...]

For each set an ideal scenario is held against the recording (``diagnose --against``), improved, and held against it
again. Poses and moves: rms of what the model leaves, stage by stage; then that of the improved simulation, moved as the
recording was and diagnosed by itself, over the recording's. Noise: simulation over recording by octaves, all axes of
a sensor (lowest and highest of the octaves' geometric means).
"""

import sys
import tempfile
from pathlib import Path

import numpy as np

import trihedron
from trihedron.pipeline import driven, improve
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
    "kim 2": ({"path": "kim/kim_imu_good2.txt"}, 9.79871),
    "kim 3": ({"path": "kim/kim_imu_good3.txt"}, 9.79871),
    "openaxes bmi160": ({"path": "openaxes/bmi160.csv"}, 9.8127),
}


def logs(folder, chosen):
    for name, (where, gravity) in SETS.items():
        if chosen and name.split()[0] not in chosen:
            continue
        paths = {key: folder / value if isinstance(value, str) else value for key, value in where.items()}
        yield name, paths, gravity


DOMAINS = ("static-accel", "moves")


def rms(diagnosis, domain):
    return next((d.rms for d in diagnosis.remaining if d.domain == domain), float("nan"))


def octaves(diagnosis, sensor):
    by = {}
    for n in diagnosis.noise_compared:
        if n.term == "octave" and n.sensor == sensor and n.ratio:
            by.setdefault(n.band_hz, []).append(np.log(n.ratio))
    means = [float(np.exp(np.mean(v))) for v in by.values()]
    return f"{min(means):.2f} to {max(means):.2f}" if means else "–"


def one(name, paths, gravity, work):
    recording = trihedron.read(**paths)
    given, better = work / "ideal.toml", work / "better.toml"
    given.write_text(IDEAL)
    found = trihedron.diagnose(recording, against=given, gravity_m_s2=gravity)
    better.write_text(improve(given, found).text)
    again = trihedron.diagnose(recording, against=better, gravity_m_s2=gravity)
    own = trihedron.calibrate(recording, gravity_m_s2=gravity)
    moved = driven(read_scenario(better), recording, own.segments, own.calibration)
    simulated = trihedron.diagnose(moved, gravity_m_s2=gravity)
    stages = "; ".join(f"{stage.stage}: " + ", ".join(shown(stage)) for stage in found.stages)
    ratios = ", ".join(f"{rms(simulated, d) / rms(again, d):.2f}" for d in DOMAINS)
    cells = (
        name,
        f"{found.verdict}: {named(found)}",
        stages,
        f"{again.verdict}: {named(again)}",
        ratios,
        octaves(again, "accelerometer"),
        octaves(again, "gyroscope"),
    )
    print(f"| {' | '.join(cells)} |", flush=True)


def named(diagnosis):
    return ", ".join(effect.id for effect in diagnosis.effects) or "no effect"


def shown(stage):
    return [f"{d.domain} {d.rms:.3g} {d.unit}" for d in stage.domains if d.domain in DOMAINS]


def main():
    folder, chosen = Path(sys.argv[1]), sys.argv[2:]
    head = ("set", "ideal", "stages, held out", "improved", "poses, moves", "accelerometer's octaves", "gyro's")
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
