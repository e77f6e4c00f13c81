"""Blind trial of the diagnosis: draw a flaw, seal it, run the tool, open the seal, score.

    python benches/blind.py --runs 400 --seed 7          # confusion matrix over everything
    python benches/blind.py --healthy 200                # false alarms, three noise grades
    python benches/blind.py --effect accel-cubic --runs 40 --size 0.5

Every recording is made by the instrument-level simulator (mechanisms, not the catalogue's curves): noise grade, unit,
protocol, effect, axis, sign and seed are drawn from one generator. The answer is written to a file that the tool never
opens; it is read after the verdict stands.
"""

from __future__ import annotations

import argparse
import json
import tempfile
import time
from collections import Counter, defaultdict
from concurrent.futures import ProcessPoolExecutor
from pathlib import Path

import numpy as np

from trihedron.diagnose import diagnose_recording
from trihedron.estimate.accelerometer import calibrate_norm
from trihedron.estimate.joint import calibrate_joint
from trihedron.segment import segment_recording
from trihedron.simulate import Scenario, hand_session, simulate, table_turns
from trihedron.simulate.effects import with_effect
from trihedron.simulate.profiles import profile_by_name

GRADES = ("mpu", "adis", "tactical")


def signed(rng, size):
    """Three values of a typical size, each of either sign and within a factor of 1.5."""
    return tuple(float(v) for v in size * rng.uniform(0.7, 1.4, 3) * rng.choice((-1.0, 1.0), 3))


def positive(rng, size):
    return tuple(float(v) for v in size * rng.uniform(0.7, 1.4, 3))


# Typical sizes, from data sheets of consumer parts: 0.5 % nonlinearity of ±2 g (0.1 m/s² at 2 g, so K2 = 2.6e-4 and
# K3 = 1.3e-5 .. 4e-5 per (m/s²)^n), 0.1 % asymmetry, 1 mg hysteresis, 1 mg/K, 0.03 %/K, 0.03 °/s/K, 0.1 °/s/g,
# 0.1 % gyro nonlinearity at full scale, 1 mm between accelerometers of a package (4 mm of a board), 3 ms skew.
def draw_size(effect, rng, scale):
    s = scale
    g = 9.8
    table = {
        "accel-quadratic": lambda: {"k2": signed(rng, 2.5e-4 * s)},
        "accel-cubic": lambda: {"k3": positive(rng, 3e-5 * s)},
        "accel-scale-asymmetry": lambda: {"asymmetry": signed(rng, 1.5e-3 * s)},
        "accel-hysteresis": lambda: {"offset_m_s2": positive(rng, 0.012 * s), "width_m_s2": float(rng.uniform(1, 4))},
        "accel-thermal-bias": lambda: {"per_k": signed(rng, 1e-3 * g * s)},
        "accel-thermal-scale": lambda: {"per_k": signed(rng, 3e-4 * s)},
        "gyro-thermal-bias": lambda: {"per_k": signed(rng, np.radians(0.03) * s)},
        "gyro-thermal-scale": lambda: {"per_k": signed(rng, 4e-4 * s)},
        "accel-hidden-drift": lambda: {"amplitude": signed(rng, 5e-3 * g * s), "tau_s": float(rng.uniform(40, 120))},
        "gyro-hidden-drift": lambda: {
            "amplitude": signed(rng, np.radians(0.15) * s),
            "tau_s": float(rng.uniform(40, 120)),
        },
        "gyro-g-sensitivity": lambda: {
            "matrix": tuple(tuple(float(v) for v in row) for row in rng.normal(0, np.radians(0.1) / g * s, (3, 3)))
        },
        "gyro-scale-nonlinearity": lambda: (
            {"c3": positive(rng, 1e-3 * s)} if rng.random() < 0.5 else {"c2": signed(rng, 1.5e-3 * s)}
        ),
        "gyro-saturation": lambda: {"limit": float(rng.uniform(2.0, 3.0) / s**0.3)},
        "accel-size-effect": lambda: {
            "places_m": tuple(tuple(float(v) for v in row) for row in rng.normal(0, 4e-3 * s, (3, 3)))
        },
        "lever-arm": lambda: {"arm_m": signed(rng, 0.04 * s)},
        "accel-gyro-time-offset": lambda: {"offset_s": float(rng.choice((-1, 1)) * rng.uniform(2e-3, 5e-3) * s)},
        "sensor-lag": lambda: {
            "sensor": str(rng.choice(("accelerometer", "gyroscope"))),
            "lag_s": (float(rng.uniform(2e-3, 5e-3) * s),) * 3,
        },
        "dropped-samples": lambda: {
            "losses": [(float(t), max(1, round(float(rng.integers(4, 20)) * s))) for t in rng.uniform(25, 120, 4)]
        },
        "timing-jitter": lambda: {"jitter_s": float(rng.uniform(0.6e-3, 1.5e-3) * s)},
        "earth-rate": lambda: {"latitude_deg": float(rng.uniform(30, 70)), "heading_deg": float(rng.uniform(0, 360))},
        "vibration-rectification": lambda: {"sensor": "gyroscope", "coefficient": signed(rng, 2e-4 * s)},
        "periodic-interference": lambda: {
            "sensor": str(rng.choice(("accelerometer", "gyroscope"))),
            "frequency_hz": float(rng.uniform(4, 45)),
            "amplitude": 0.0,
        },
        "quantisation": lambda: {"sensor": "accelerometer", "lsb": 0.0},
        "supply-sensitivity": lambda: {"sensor": "accelerometer", "ratiometric": float(rng.uniform(0.5, 1.0) * s)},
        "disturbed-pose": lambda: {"poses": [int(rng.integers(2, 20))], "tilt_deg": float(rng.uniform(0.5, 1.5) * s)},
        "turn-angle-error": lambda: {"errors_deg": [float(v) for v in rng.normal(0, 1.5 * s, 12)]},
        "table-tilt": lambda: {"tilt_deg": tuple(float(v) for v in rng.normal(0, 0.7 * s, 2))},
        "axis-handedness": lambda: {
            "sensor": str(rng.choice(("accelerometer", "gyroscope"))),
            "axis": int(rng.integers(1, 4)),
        },
    }
    return table[effect]()


EFFECTS = (
    "accel-quadratic", "accel-cubic", "accel-scale-asymmetry", "accel-hysteresis", "accel-thermal-bias",
    "accel-thermal-scale", "gyro-thermal-bias", "gyro-thermal-scale", "accel-hidden-drift", "gyro-hidden-drift",
    "gyro-g-sensitivity", "gyro-scale-nonlinearity", "gyro-saturation", "accel-size-effect", "lever-arm",
    "accel-gyro-time-offset", "sensor-lag", "dropped-samples", "timing-jitter", "earth-rate",
    "vibration-rectification", "periodic-interference", "quantisation", "supply-sensitivity", "disturbed-pose",
    "turn-angle-error", "table-tilt", "axis-handedness",
)  # fmt: skip
VISIBLE_TO = {
    "earth-rate": ("mpu", "tactical"),
    "quantisation": ("mpu",),
    "periodic-interference": ("mpu", "tactical"),
}
"""Grades whose noise lets an effect of typical size be seen at all (Earth rate is below ADIS noise)."""


def make(effect, grade, seed, scale):
    """A recording with its sealed answer."""
    rng = np.random.default_rng([seed, 20260])
    profile = profile_by_name(grade)
    accelerometer, gyroscope = profile.unit(int(rng.integers(1, 10000)))
    layout = int(rng.integers(1, 10000))
    if effect in ("turn-angle-error", "table-tilt"):
        motion = table_turns()
    else:
        n, hold = int(rng.integers(20, 33)), float(rng.uniform(3.5, 8.0))
        motion = hand_session(n, hold_s=hold, layout=layout, move_s=float(rng.uniform(1.6, 2.6)))
    scenario = Scenario(motion, "blind", accelerometer, gyroscope, profile.clock)
    size = {}
    if effect != "healthy":
        size = draw_size(effect, rng, scale)
        noise = np.sqrt(profile.clock.rate_hz)
        if effect == "periodic-interference":
            part = profile.accelerometer if size["sensor"] == "accelerometer" else profile.gyroscope
            size["amplitude"] = float(part.noise.N[0] * noise * rng.uniform(0.5, 1.5) * scale)
        if effect == "quantisation":
            N = profile.accelerometer.noise.N[0] * noise
            unit = float(np.abs(np.diag(np.asarray(accelerometer.S))).mean())
            size["lsb"] = float(N / unit * rng.uniform(4, 8) * scale)
        scenario = with_effect(scenario, effect, **size)
    recording, truth = simulate(scenario, seed)
    # A brisk move can run a 250 deg/s gyro into the converter's end: then that is what the recording holds.
    clipped = effect == "healthy" and _runs_at_the_end(recording.gyroscope, scenario.gyroscope.adc)
    answer = "gyro-saturation" if clipped else effect
    return recording, truth.gravity_m_s2, {"effect": answer, "size": size, "grade": grade, "seed": seed}


def _runs_at_the_end(raw, adc):
    at_end = (raw <= adc.low) | (raw >= adc.high)
    return bool((at_end[2:] & at_end[1:-1] & at_end[:-2]).any())


def trial(job):
    effect, grade, seed, scale = job
    recording, gravity, answer = make(effect, grade, seed, scale)
    with tempfile.TemporaryDirectory() as folder:
        seal = Path(folder) / "answer.json"
        seal.write_text(json.dumps(answer))
        start = time.perf_counter()
        try:
            segments = segment_recording(recording)
            accelerometer, _ = calibrate_norm(
                segments.accelerometer_mean, segments.accelerometer_sigma_mean, gravity,
                raw_unit=recording.accelerometer_unit,
            )  # fmt: skip
            calibration = calibrate_joint(recording, segments, accelerometer, gravity, "given")
            d = diagnose_recording(recording, segments, calibration)
        except Exception as error:  # a crash is an answer too: the worst one
            return {**json.loads(seal.read_text()), "verdict": f"crash: {error!r}"[:200], "found": [], "seconds": 0.0}
        seconds = time.perf_counter() - start
        answer = json.loads(seal.read_text())
    first = d.effects[0] if d.effects else None
    held = first.held_out[0].chi2_per_dof_after if first and first.held_out else None
    return {
        **answer, "verdict": d.verdict, "found": [e.id for e in d.effects],
        "confounded": list(first.confounded_with) if first else [], "held_after": held,
        "disagrees": [t.domain for t in d.domains if t.disagrees], "seconds": seconds,
        "parameters": [[p.name, p.value, p.std] for p in first.parameters] if first else [],
    }  # fmt: skip


def scored(result):
    """right | confounded | second | missed | wrong"""
    effect = result["effect"]
    if effect == "healthy":
        return "right" if result["verdict"] == "consistent" else "wrong"
    found = result["found"]
    if not found:
        return "missed"
    if found[0] == effect:
        return "right"
    if effect in result["confounded"]:
        return "confounded"
    return "second" if effect in found else "wrong"


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--runs", type=int, default=200, help="recordings with an effect")
    parser.add_argument("--healthy", type=int, default=0, help="healthy recordings instead")
    parser.add_argument("--effect", action="append", help="only this effect (repeatable)")
    parser.add_argument("--grade", action="append", choices=GRADES, help="only this noise grade (repeatable)")
    parser.add_argument("--size", type=float, default=1.0, help="size as a fraction of the typical one")
    parser.add_argument("--seed", type=int, default=1)
    parser.add_argument("--jobs", type=int, default=2)
    parser.add_argument("--json", type=Path)
    parser.add_argument("--verbose", action="store_true")
    options = parser.parse_args()
    rng = np.random.default_rng(options.seed)
    jobs = []
    if options.healthy:
        grades = options.grade or GRADES
        jobs += [("healthy", grades[k % len(grades)], int(rng.integers(1 << 30)), 1.0) for k in range(options.healthy)]
    else:
        effects = options.effect or EFFECTS
        for k in range(options.runs):
            effect = effects[k % len(effects)]
            grades = options.grade or VISIBLE_TO.get(effect, GRADES)
            jobs.append((effect, str(rng.choice(grades)), int(rng.integers(1 << 30)), options.size))
    with ProcessPoolExecutor(options.jobs) as pool:
        results = []
        for result in pool.map(trial, jobs):
            results.append(result)
            if options.verbose or scored(result) in ("wrong", "missed"):
                print(
                    f"  {result['effect']:26s} {result['grade']:9s} {scored(result):10s} {result['verdict'][:90]:16s} "
                    f"{result['found']} {result.get('disagrees', '')} {result['seconds']:.1f} s seed {result['seed']}",
                    flush=True,
                )
    table = defaultdict(Counter)
    for result in results:
        table[result["effect"]][scored(result)] += 1
    print(f"\n{'effect':28s} {'n':>4s} right confounded second missed wrong   first answers")
    for effect, counts in table.items():
        n = sum(counts.values())
        first = Counter((r["found"] or [r["verdict"][:12]])[0] for r in results if r["effect"] == effect)
        print(
            f"{effect:28s} {n:4d} {counts['right']:5d} {counts['confounded']:10d} {counts['second']:6d} "
            f"{counts['missed']:6d} {counts['wrong']:5d}   " + ", ".join(f"{k} {v}" for k, v in first.most_common(3))
        )
    good = sum(scored(r) in ("right", "confounded") for r in results)
    print(f"\nright or named among the confounded: {good} of {len(results)} ({100 * good / len(results):.1f} %)")
    print(f"median time {np.median([r['seconds'] for r in results]):.1f} s, size {options.size} x typical")
    if options.json:
        options.json.write_text(json.dumps(results, indent=1))


if __name__ == "__main__":
    main()
