"""Recordings of an instrument with a drawn flaw, and the sealed answer that goes with each."""

from __future__ import annotations

import math
from dataclasses import dataclass, replace
from typing import Any

import numpy as np

from blind_trial.foreign import FOREIGN
from blind_trial.sizes import ON_A_TABLE, SIZES, Session
from trihedron.records import Recording
from trihedron.simulate import Scenario, hand_session, simulate
from trihedron.simulate.effects import with_effect
from trihedron.simulate.motion.steps import Motion, MoveTo, Pose, Turn
from trihedron.simulate.profiles import Profile, profile_by_name

GRADES = ("mpu", "adis", "tactical")


@dataclass(frozen=True)
class Job:
    """One trial: effects of the catalogue (none: healthy) or one foreign mechanism, grade, seed, fraction of size."""

    effects: tuple[str, ...]
    grade: str
    seed: int
    scale: float = 1.0
    foreign: str = ""

    @property
    def label(self) -> str:
        return self.foreign or " + ".join(self.effects) or "healthy"


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


def table_session(layout: int, rng: np.random.Generator) -> Motion:
    """Poses by hand, then four to six turns against a wall on each of two faces."""
    hand = hand_session(20, pose_s=float(rng.uniform(3.5, 6.0)), layout=layout)
    steps = list(hand.steps)
    for face in ((0.0, 0.0, 1.0), (1.0, 0.0, 0.0)):
        steps += [MoveTo(face, 3.0, wobble_deg=3.0), Pose(4.0, name="on the table")]
        for angle in (90.0, 90.0, -180.0, 180.0, -90.0, -90.0)[: int(rng.integers(4, 7))]:
            steps += [Turn(face, angle, max(1.2, abs(angle) / 70.0), name="turn"), Pose(3.5, name="on the table")]
    return replace(hand, steps=tuple(steps))


def moves_of(motion: Motion) -> list[tuple[float, float]]:
    """Start and stop of every move [s]."""
    clock, out = 0.0, []
    for step in motion.steps:
        if isinstance(step, (MoveTo, Turn)):
            out.append((clock, clock + step.duration_s))
        clock += step.duration_s
    return out


def make(job: Job) -> tuple[Recording, float, dict[str, Any]]:
    """A recording, gravity, and the sealed answer."""
    rng = np.random.default_rng([job.seed, 20260])
    profile = grade_profile(job.grade)
    accelerometer, gyroscope = profile.unit(int(rng.integers(1, 10000)))
    layout = int(rng.integers(1, 10000))
    if set(job.effects) & set(ON_A_TABLE):
        motion = table_session(layout, rng)
    else:
        # Mixed products of the axes show only in poses that are neither faces nor edges (the first 18 are).
        least, pose = (30 if job.foreign == "accel-cross-product" else 20), float(rng.uniform(3.5, 8.0))
        n = int(rng.integers(least, least + 13))
        # Only a brisk hand takes an accelerometer beyond 1 g.
        travel = 0.6 if "accel-saturation" in job.effects else 0.1
        motion = hand_session(n, pose_s=pose, layout=layout, move_s=float(rng.uniform(1.6, 2.6)), travel_m=travel)
    scenario, sizes = Scenario(motion, "blind", accelerometer, gyroscope, profile.clock), {}
    session = Session(profile, accelerometer, moves_of(motion))
    for effect in job.effects:
        sizes[effect] = SIZES[effect](rng, job.scale, session)
        scenario = with_effect(scenario, effect, **sizes[effect])
    recording, truth = simulate(scenario, job.seed)
    expected: list[str] = []
    if job.foreign:
        mechanism = FOREIGN[job.foreign]
        recording = mechanism.added_to(recording, truth, scenario, session, rng, job.scale)
        expected = list(mechanism.domains)
    answer = {
        "label": job.label, "effects": list(job.effects), "foreign": job.foreign, "grade": job.grade,
        "seed": job.seed, "scale": job.scale, "sizes": sizes, "expected_domains": expected,
        "also": true_saturations(recording, scenario, job.effects),
    }  # fmt: skip
    return recording, truth.gravity_m_s2, answer


def true_saturations(recording: Recording, scenario: Scenario, drawn: tuple[str, ...]) -> list[str]:
    """Saturations that nobody drew: three readings in a row at the end of an ADC's range."""
    out = []
    for effect, raw, adc in (
        ("accel-saturation", recording.accelerometer, scenario.accelerometer.adc),
        ("gyro-saturation", recording.gyroscope, scenario.gyroscope.adc),
    ):
        if raw is None or effect in drawn:
            continue
        at_end = (raw <= adc.low) | (raw >= adc.high)
        if bool((at_end[2:] & at_end[1:-1] & at_end[:-2]).any()):
            out.append(effect)
    return out
