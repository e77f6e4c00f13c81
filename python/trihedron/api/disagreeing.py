"""The demonstration's second act: a simulation and a log that disagree, and the diagnosis."""

from __future__ import annotations

import json
from collections.abc import Callable
from dataclasses import replace
from pathlib import Path
from typing import Any

import numpy as np

from trihedron.api.diagnosing import diagnose
from trihedron.api.improving import improve
from trihedron.api.reading import read
from trihedron.files.calibration import plain
from trihedron.files.log import write_recording
from trihedron.files.output import write_whole
from trihedron.files.scenario import write_scenario
from trihedron.gravity import normal_gravity
from trihedron.records.results import DiagnosisResult
from trihedron.report.demonstration import disagreement_report, with_files
from trihedron.report.diagnosis import diagnosis_report
from trihedron.report.document import Document
from trihedron.report.page import to_html
from trihedron.simulate import Environment, Scenario, hand_session, profile_by_name, simulate, with_effect

Draw = Callable[[np.random.Generator], dict[str, Any]]
LATITUDE_DEG = 59.94
SIMULATION = """# The simulation of an ordinary sensor: the data sheet's scales, no biases, no faults.
name = "simulation"
profile = "mpu"        # noise and resolution of the data sheet

[environment]
gravity_m_s2 = {gravity:.6f}   # at the desk

[session]
kind = "hand"

[accelerometer]
# 16384 counts per g
b = [0.0, 0.0, 0.0]    # no bias known

[gyroscope]
S = [[{scale:.8g}, 0, 0], [0, {scale:.8g}, 0], [0, 0, {scale:.8g}]]   # 65.5 counts per deg/s
b = [0.0, 0.0, 0.0]
"""


def _signed(rng: np.random.Generator, size: float) -> tuple[float, float, float]:
    x, y, z = (rng.choice((-1.0, 1.0), 3) * rng.uniform(0.6, 1.4, 3) * size).tolist()
    return (x, y, z)


# Sizes of the data sheets of consumer parts; ids as `trihedron diagnose` names them.
EFFECTS: dict[str, Draw] = {
    "accel-quadratic": lambda rng: {"k2": _signed(rng, 2.5e-4)},
    "accel-cubic": lambda rng: {"k3": tuple(abs(v) for v in _signed(rng, 4e-5))},
    "accel-scale-asymmetry": lambda rng: {"asymmetry": _signed(rng, 1.5e-3)},
    "accel-size-effect": lambda rng: {"places_m": ((0.0, 0.0, 0.0), _signed(rng, 6e-3), _signed(rng, 6e-3))},
    "gyro-g-sensitivity": lambda rng: {"matrix": tuple(_signed(rng, 1.8e-4) for _ in range(3))},
    "accel-gyro-time-offset": lambda rng: {"offset_s": float(rng.choice((-1, 1)) * rng.uniform(3e-3, 6e-3))},
    "gyro-bias-drift": lambda rng: {"amplitude": _signed(rng, 3e-3), "tau_s": float(rng.uniform(40.0, 90.0))},
}


def disagree(
    folder: Path, seed: int, *, overwrite: bool = False, say: Callable[[str], None] = lambda _: None
) -> tuple[DiagnosisResult, Document]:
    """Draw a unit with one effect, seal the answer, diagnose its log against a plain simulation, then open the seal.

    The log is written and read back like any log; the file with the answer is opened after both verdicts.
    """
    folder.mkdir(parents=True, exist_ok=True)
    say("drawing a unit with one effect, and sealing which")
    gravity = normal_gravity(LATITUDE_DEG)
    scenario, sealed = _drawn(seed, gravity)
    write_whole(folder / "sealed.json", json.dumps(plain(sealed), indent=2) + "\n", overwrite=overwrite)
    recording, _ = simulate(scenario, seed)
    log, given, better = folder / "unit.csv", folder / "simulation.toml", folder / "improved.toml"
    write_recording(recording, log, overwrite=overwrite)
    scale = float(np.radians(1.0 / 65.5))
    write_whole(given, SIMULATION.format(gravity=gravity, scale=scale), overwrite=overwrite)
    taken = read(log)
    say("comparing the simulation with the log")
    found = diagnose(taken, gravity_m_s2=gravity, against=given)
    write_scenario(improve(given, found).text, better, overwrite=overwrite)
    say("comparing the improved simulation with the log")
    improved = diagnose(taken, gravity_m_s2=gravity, against=better)
    page = with_files(diagnosis_report(found, str(given), str(better)), LOG=log)
    write_whole(folder / "disagreement.html", to_html(page), overwrite=overwrite)
    say("opening the seal")
    opened = json.loads((folder / "sealed.json").read_text(encoding="utf-8"))
    return found, disagreement_report(found, improved, opened, folder)


def _drawn(seed: int, gravity: float) -> tuple[Scenario, dict[str, Any]]:
    rng = np.random.default_rng(seed)
    profile = profile_by_name("mpu")
    number = int(rng.integers(1, 100_000))
    accelerometer, gyroscope = profile.unit(number)
    # Twice the range, so that hand motion does not clip.
    rows = tuple(tuple(2.0 * v for v in row) for row in gyroscope.S)
    gyroscope = replace(gyroscope, S=rows)  # type: ignore[arg-type]
    motion = hand_session(24, layout=int(rng.integers(1, 10_000)))
    scenario = Scenario(motion, "unit", accelerometer, gyroscope, profile.clock, Environment(gravity_m_s2=gravity))
    effect = str(rng.choice(sorted(EFFECTS)))
    size = EFFECTS[effect](rng)
    return with_effect(scenario, effect, **size), {"unit": number, "effect": effect, "size": size, "seed": seed}
