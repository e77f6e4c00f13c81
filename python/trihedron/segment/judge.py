"""What is weak about the holds that were found, said as findings."""

from __future__ import annotations

from types import MappingProxyType

import numpy as np
from scipy import special

from trihedron.records import Finding, FindingCode, Hold, Recording, Severity
from trihedron.segment.channels import BoolArray, Channels
from trihedron.segment.noise import MeanNoise
from trihedron.segment.runs import MIN_HOLD_S, Run, ranges_of

CREEP_CHANCE = 1e-3
"""Chance that some steady hold of a log is called creeping though none is."""
POSES_FOR_NINE = 9
"""A norm fit of nine parameters needs nine poses in different directions, and more to check itself."""


def judge_runs(
    recording: Recording,
    channels: Channels,
    runs: list[Run],
    holds: tuple[Hold, ...],
    noise: MeanNoise,
) -> list[Finding]:
    """Creep, bumps and unsteadiness of single holds, each named by its number and time."""
    found: list[Finding] = []
    creeping: list[tuple[float, int]] = []
    for k, run in enumerate(runs):
        if run.is_unsteady:
            continue
        size = _creep_size(channels, run, noise, CREEP_CHANCE / max(len(runs), 1))
        if size > 0.0:
            creeping.append((size, k))
    if creeping:
        worst, k = max(creeping)
        found.append(
            Finding(
                FindingCode.HOLD_CREEPS,
                Severity.WARNING,
                f"{_holds(len(creeping))} drift{'s' if len(creeping) == 1 else ''} while still: in hold {k + 1} at "
                f"{_when(recording, holds[k])} the second half reads {worst:.1f} standard errors from the first "
                f"({_list([c for _, c in creeping])}).",
                "The support gives way, the case settles after being let go, or the sensor warms up.",
                "Wait until the case has settled, hold for less time, or put it on a firmer support.",
                MappingProxyType({"holds": float(len(creeping)), "worst_sigmas": worst}),
            )
        )
    bumped = [k for k, hold in enumerate(holds) if hold.disturbed]
    if bumped:
        n = sum(len(holds[k].disturbed) for k in bumped)
        lost = sum((b - a) for k in bumped for a, b in holds[k].disturbed) / recording.rate_hz
        first = holds[bumped[0]]
        found.append(
            Finding(
                FindingCode.HOLD_BUMPED,
                Severity.NOTE,
                f"{n} disturbance{'s' if n > 1 else ''} inside {_holds(len(bumped))} ({_list(bumped)}), {lost:.1f} s "
                f"in all, the first at {recording.time_s[first.disturbed[0][0]]:.1f} s, left out of the means.",
                "The table or the cable was touched, or samples are missing there.",
                "Nothing needs to be done; keep hands off the table during a hold.",
                MappingProxyType({"disturbances": float(n), "left_out_s": lost}),
            )
        )
    unsteady = [k for k, hold in enumerate(holds) if hold.is_unsteady]
    if unsteady:
        found.append(
            Finding(
                FindingCode.HOLD_UNSTEADY,
                Severity.WARNING,
                f"{_holds(len(unsteady))} never come{'s' if len(unsteady) == 1 else ''} down to the sensor's own noise "
                f"({_list(unsteady)}; first at {_when(recording, holds[unsteady[0]])}).",
                "The sensor was held in the hand or stood on a support that shakes.",
                "Their means weigh less, by their own scatter; rest the case on something firm for a better result.",
                MappingProxyType({"holds": float(len(unsteady))}),
            )
        )
    return found


def _creep_size(channels: Channels, run: Run, noise: MeanNoise, chance: float) -> float:
    """Distance of the two halves in standard errors where it is more than chance allows, else 0."""
    blocks = np.vstack([channels.mean[a:b] for a, b in run.quiet_ranges()])
    half = len(blocks) // 2
    if half < 2:
        return 0.0
    difference = blocks[-half:].mean(axis=0) - blocks[:half].mean(axis=0)
    variance = 2.0 * noise.variance(half * channels.step_s) + channels.quantisation_variance / channels.length
    live = variance > 0.0
    statistic = float(np.sum(difference[live] ** 2 / variance[live]))
    freedom = int(live.sum())
    return float(np.sqrt(statistic)) if freedom and statistic > float(special.chdtri(freedom, chance)) else 0.0


def judge_log(
    recording: Recording,
    channels: Channels,
    runs: list[Run],
    holds: tuple[Hold, ...],
    turning: BoolArray,
) -> list[Finding]:
    """Whether the log as a whole rests where it should."""
    found: list[Finding] = []
    duration = recording.duration_s
    if not runs:
        found.append(
            Finding(
                FindingCode.NOT_STATIC,
                Severity.SERIOUS,
                f"No still pose of a second or more in {duration:.1f} s of log.",
                "The sensor was moving, or held in the hand, all the time; or the log is too short.",
                "Log again: put the case down for several seconds in each pose.",
                MappingProxyType({"holds": 0.0, "duration_s": duration}),
            )
        )
        return found
    # Shorter stretches are the ends of moves, not turns of their own.
    turns = [(a, b) for a, b in ranges_of(turning) if b - a >= channels.blocks(MIN_HOLD_S)]
    if turns:
        total = sum(b - a for a, b in turns) * channels.step_s
        found.append(
            Finding(
                FindingCode.SLOW_TURN,
                Severity.NOTE,
                f"{total:.1f} s look still to the accelerometer but turn: the gyro reads away from its zero, first at "
                f"{recording.time_s[turns[0][0] * channels.length]:.1f} s; taken as moving.",
                "A slow steady turn about the vertical.",
                "Nothing needs to be done.",
                MappingProxyType({"turning_s": total}),
            )
        )
    if holds[0].start / recording.rate_hz > 1.0 and recording.n_samples:
        found.append(
            Finding(
                FindingCode.NO_INITIAL_REST,
                Severity.NOTE,
                f"The log does not begin at rest: the first still pose starts at {_when(recording, holds[0])}.",
                "Logging was started with the case in hand.",
                "Nothing needs to be done: the noise was measured in the still poses themselves.",
                MappingProxyType({"first_hold_s": float(recording.time_s[holds[0].start])}),
            )
        )
    if len(holds) < POSES_FOR_NINE:
        found.append(
            Finding(
                FindingCode.FEW_POSES,
                Severity.WARNING,
                f"{len(holds)} still pose{'s' if len(holds) > 1 else ''} found in {duration:.1f} s; a calibration of "
                f"nine parameters needs at least {POSES_FOR_NINE}, in different directions.",
                "The log has few poses, or they were held for less than a second.",
                "Log the six faces and twelve edges of a cube (18 poses), a few seconds each.",
                MappingProxyType({"holds": float(len(holds)), "needed": float(POSES_FOR_NINE)}),
            )
        )
    return found


def _holds(n: int) -> str:
    return f"{n} hold{'s' if n != 1 else ''}"


def _when(recording: Recording, hold: Hold) -> str:
    return f"{recording.time_s[hold.start]:.1f} s"


def _list(indices: list[int]) -> str:
    names = [str(k + 1) for k in sorted(indices)]
    return "hold " + ", ".join(names[:8]) + (" and others" if len(names) > 8 else "")
