"""Recordings of an instrument, healthy or with a foreign mechanism, and the sealed answer that goes with each."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from blind_trial.foreign import FOREIGN
from trihedron.records import Recording
from trihedron.simulate import Scenario, hand_session, simulate
from trihedron.simulate.profiles import Profile, profile_by_name

GRADES = ("mpu", "adis", "tactical")


@dataclass(frozen=True)
class Job:
    """One trial: noise grade, seed, and the name of one foreign mechanism (none: healthy)."""

    grade: str
    seed: int
    foreign: str = ""


def rows(S: np.ndarray) -> Any:
    """Numbers of a vector, or of a matrix row by row, as records of a sensor hold them."""
    return tuple(rows(row) if row.ndim else float(row) for row in np.asarray(S))


def grade_profile(grade: str) -> Profile:
    """The class of instrument; the consumer gyro on its ±500 °/s range, which hand moves do not leave.

    On ±250 °/s one session in six holds a second effect, saturation, that nobody drew.
    """
    profile = profile_by_name(grade)
    if grade != "mpu":
        return profile
    wide = rows(np.diag([math.radians(1.0 / 65.5)] * 3))
    return replace(profile, gyroscope=replace(profile.gyroscope, S=wide))


def make(job: Job) -> tuple[Recording, float, dict[str, Any]]:
    """A recording, gravity, and the sealed answer."""
    rng = np.random.default_rng([job.seed, 20260])
    profile = grade_profile(job.grade)
    accelerometer, gyroscope = profile.unit(int(rng.integers(1, 10000)))
    layout = int(rng.integers(1, 10000))
    # Mixed products of the axes show only in poses that are neither faces nor edges (the first 18 are).
    least, pose = (30 if job.foreign == "accel-cross-product" else 20), float(rng.uniform(3.5, 8.0))
    n = int(rng.integers(least, least + 13))
    motion = hand_session(n, pose_s=pose, layout=layout, move_s=float(rng.uniform(1.6, 2.6)))
    scenario = Scenario(motion, "blind", accelerometer, gyroscope, profile.clock)
    recording, truth = simulate(scenario, job.seed)
    expected: list[str] = []
    if job.foreign:
        mechanism = FOREIGN[job.foreign]
        recording = mechanism.added_to(recording, truth, scenario, profile, rng)
        expected = list(mechanism.domains)
    answer = {
        "label": job.foreign or "healthy", "foreign": job.foreign, "grade": job.grade, "seed": job.seed,
        "expected_domains": expected, "also": true_saturations(recording, scenario),
    }  # fmt: skip
    return recording, truth.gravity_m_s2, answer


def true_saturations(recording: Recording, scenario: Scenario) -> list[str]:
    """Saturations that nobody drew: three readings in a row at the end of an ADC's range."""
    out = []
    for effect, raw, adc in (
        ("accel-saturation", recording.accelerometer, scenario.accelerometer.adc),
        ("gyro-saturation", recording.gyroscope, scenario.gyroscope.adc),
    ):
        at_end = (raw <= adc.low) | (raw >= adc.high)
        if bool((at_end[2:] & at_end[1:-1] & at_end[:-2]).any()):
            out.append(effect)
    return out
