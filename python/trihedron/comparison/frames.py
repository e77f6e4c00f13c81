"""Frame of a simulated log's readings (rates in the world frame, gravity upside down), and its errors in motion."""

from __future__ import annotations

import math
from collections.abc import Sequence
from dataclasses import replace
from typing import TYPE_CHECKING, Literal

import numpy as np
from scipy.spatial.transform import Rotation

from trihedron.arrays import FloatArray, rms_of
from trihedron.comparison.rows import Sensor, difference
from trihedron.estimate.attitude import integrate_rate
from trihedron.probability import fdtrc, stdtrit
from trihedron.records import Calibration, Recording, Segments
from trihedron.records.diagnosis import Diagnosis, NoiseDifference
from trihedron.records.words import words
from trihedron.sensor_model import correct
from trihedron.simulate import Scenario
from trihedron.transforms import directions_of
from trihedron.units import rate_to_si

if TYPE_CHECKING:
    from trihedron.comparison.driving import MovedAlike

AIMED_AT = (0.9, 1.1)
"""Ratio of the gravity errors in poses and moves, simulation over recording, within which the two are alike."""
FIRST_SEED = 60
"""Not among the seeds that the scatter is matched with: a scenario is not tested on the draws it was fitted to."""
FEW, MANY = 8, 24
"""Simulations at first, and in total where these do not decide: the error of their spread is then a seventh."""
OPEN_P = 0.1
"""p-value from few simulations above which no further ones are drawn."""

What = Literal["poses", "moves"]


def judged_by_motion(found: Diagnosis, scenario: Scenario, beside: MovedAlike, alpha: float) -> Diagnosis:
    """A ``consistent`` diagnosis of a scenario, tested against simulations with the recording's motion.

    Noise inside poses does not show bias changes between them. A ratio that chance does not explain makes the verdict
    ``parameters-differ``; other verdicts remain, and need no simulations.
    """
    if found.verdict != "consistent":
        return found
    rows = missed_alike(scenario, beside, alpha)
    if not rows:
        return found
    verdict = "parameters-differ" if any(row.significant for row in rows) else found.verdict
    return replace(found, verdict=verdict, noise_compared=(*found.noise_compared, *rows))


def missed_alike(scenario: Scenario, beside: MovedAlike, alpha: float) -> tuple[NoiseDifference, ...]:
    """Ratios of the errors of poses and moves, scenario over recording, each with its interval.

    If both are alike the recording is one more draw: the logarithm of its root mean square then differs from the mean
    of K simulations by s √(1 + 1/K) times Student's t of K − 1 degrees of freedom, s their standard deviation.
    ``p_value``: one-sided, against the nearer end of ``AIMED_AT``; ``interval``: of 1 − 2 ``alpha``, so that a ratio is
    significant exactly where its interval lies outside.
    """
    made: list[tuple[float | None, float | None]] = []
    rows: tuple[NoiseDifference, ...] = ()
    for enough in (FEW, MANY):
        made += [beside.missed_by(scenario, FIRST_SEED + k) for k in range(len(made), enough)]
        poses, moves = zip(*made, strict=True)
        both = _row("poses", poses, beside.poses, alpha), _row("moves", moves, beside.moves, alpha)
        rows = tuple(row for row in both if row is not None)
        if not any(row.p_value is not None and row.p_value < OPEN_P for row in rows):
            break
    return rows


def _row(what: What, squares: Sequence[float | None], seen: float | None, alpha: float) -> NoiseDifference | None:
    known = [one for one in squares if one is not None and one > 0.0]
    # Where half of the simulations have no value, the model differs from the recording in another way.
    if seen is None or seen <= 0.0 or 2 * len(known) <= len(squares):
        return None
    logs = 0.5 * np.log(known)
    k = len(known)
    deviation = float(np.std(logs, ddof=1)) * math.sqrt(1.0 + 1.0 / k)
    apart = float(np.mean(logs)) - 0.5 * math.log(seen)
    half = float(stdtrit(k - 1, 1.0 - alpha)) * deviation
    beyond = max(math.log(AIMED_AT[0]) - apart, apart - math.log(AIMED_AT[1]))
    # t² is an F variate of one and K − 1 degrees of freedom.
    tail = 0.5 * fdtrc(1.0, k - 1.0, (beyond / max(deviation, 1e-12)) ** 2)
    p = tail if beyond > 0.0 else 1.0 - tail
    differs = beyond > half
    interval = (math.exp(apart - half), math.exp(apart + half))
    model, recording = math.exp(float(np.mean(logs))), math.sqrt(seen)
    said = {"ratio": math.exp(apart), "low": interval[0], "high": interval[1], "level": 100.0 * (1.0 - 2.0 * alpha)}
    case = "poses-miss" if what == "poses" else "moves-miss"
    remark = words(case, **said, simulations=k, is_above=apart > 0.0) if differs else ""
    sensor, unit = _OF[what]
    ratio = model / recording
    return NoiseDifference(sensor, "", what, model, recording, ratio, interval, unit, p, differs, remark)


_OF: dict[What, tuple[Sensor, str]] = {"poses": ("accelerometer", "m/s^2"), "moves": ("gyroscope", "rad")}


OPPOSITE = -0.9
"""Mean cosine between gravity in the poses of both logs, below which they are one protocol with opposite signs."""


def rates_of_world(recording: Recording, segments: Segments) -> NoiseDifference | None:
    """The finding that a simulated log's rates are in the world frame, or ``None``."""
    body_rad, world_rad = carried_gravity(recording, segments) or (0.0, 0.0)
    if body_rad <= MISSED_RAD or world_rad >= BETTER * body_rad:
        return None
    remark = words("rates-of-world", body_rad=body_rad, world_rad=world_rad)
    return difference("gyroscope", "frame", (None, None), "1", remark)


def sign_of_gravity(
    simulated: tuple[Segments, Calibration], recording: tuple[Segments, Calibration]
) -> NoiseDifference | None:
    """The finding that gravity has opposite signs in two logs of one protocol, pose by pose, or ``None``."""
    ours, theirs = _gravity(*recording), _gravity(*simulated)
    if ours is None or theirs is None or len(ours) != len(theirs):
        return None
    if float(np.mean(np.sum(ours * theirs, axis=1))) > OPPOSITE:
        return None
    return difference("accelerometer", "frame", (-1.0, 1.0), "1", words("gravity-upside-down"), ratio=-1.0)


def _gravity(segments: Segments, calibration: Calibration) -> FloatArray | None:
    """(n, 3) direction of specific force in the poses."""
    mean = segments.accelerometer_mean
    if mean is None:
        return None
    return directions_of(correct(mean, calibration.accelerometer.S, calibration.accelerometer.b))


# Rates in the world frame in place of the body frame: detected by gravity before and after the moves.

FEWEST_MOVES = 4
"""Three unknown angles of the first attitude, and one move more."""
MISSED_RAD = 0.3
"""Largest tilt error after any move by body rates, scale errors and biases of cheap parts included."""
BETTER = 0.3
"""Error by world rates over that by body rates, below which the rates are the world's."""


def carried_gravity(recording: Recording, segments: Segments) -> tuple[float, float] | None:
    """Rms tilt error after the moves [rad], with rates taken in the body frame and in the world frame.

    Body: ``u₊ = ΔRᵀ u``. World: ``R₊ = ΔR R``, so ``u_n = R₀ᵀ (ΔR_n … ΔR_1)ᵀ e_z``, with R₀ from all poses (Wahba's
    problem). Rates are scaled by their unit, biases are those of the poses before and after each move; ``None``
    without a unit or with fewer than four moves in a row.
    """
    scale = rate_to_si(recording.gyroscope_unit)
    if scale is None or recording.gyroscope is None or segments.accelerometer_mean is None:
        return None
    mean, still = segments.accelerometer_mean, segments.gyroscope_mean
    if still is None or len(segments.moves) < FEWEST_MOVES or len(segments.moves) != segments.n_poses - 1:
        return None
    up = directions_of(mean)
    to_body = np.eye(3)
    carried, misses = [to_body[:, 2]], []
    for move in segments.moves:
        bias = 0.5 * (still[move.pose_before] + still[move.pose_after])
        part = slice(move.start, move.stop)
        rate = (recording.gyroscope[part] - bias) * scale
        if not np.isfinite(rate).all():
            return None
        # Turns in the order of the world's axes are the inverse of opposite turns in that of the body's.
        body, world_back = (integrate_rate(recording.time_s[part], w, last_only=True) for w in (rate, -rate))
        misses.append(np.arccos(np.clip(up[move.pose_after] @ body.T @ up[move.pose_before], -1.0, 1.0)))
        to_body = to_body @ world_back
        carried.append(to_body[:, 2])
    _, missed = Rotation.align_vectors(up, np.array(carried))
    return rms_of(misses), float(missed) / float(np.sqrt(len(up)))
