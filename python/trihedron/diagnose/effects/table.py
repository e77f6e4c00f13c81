"""Rotations on a table by multiples of 90°: a table that is not level, rotations that miss their angle."""

from dataclasses import dataclass

import numpy as np
from scipy.special import chdtrc, ndtr, stdtrit

from trihedron.arrays import FloatArray
from trihedron.defaults import FALSE_ALARM
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import DirectEffect, Evidence, measured
from trihedron.probability import CLEAR, SURE, bdtrc
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Where
from trihedron.records.words import why_not
from trihedron.session.rounding import UNIFORM, undithered_axes

NEAR_DEG = 12.0
"""Distance from a multiple of 90°, and of the vertical in the body from where it was, within which an intended rotation
ends; moves by hand end anywhere."""
ORDINARY_DEG = 0.05
"""Feet, dust, hands and a stop tilt and turn a case by a few hundredths of a degree on any table."""


@dataclass(frozen=True, eq=False)
class TableTurn:
    """One move about the vertical between two poses of the same face: angle, the nearest number of right angles."""

    move: int
    angle_rad: float
    right_angles: int

    @property
    def error_rad(self) -> float:
        """Distance from the multiple of 90°."""
        return self.angle_rad - 0.5 * np.pi * self.right_angles


def table_turns(context: Context) -> list[TableTurn]:
    """Moves about the vertical: it is the same in the body before and after."""
    up, out = context.fitted.state.up, []
    for m, where in enumerate(context.moves):
        before, after = context.obs.move_poses[m]
        angle = float(np.trapezoid(context.rate[where] @ up[before], context.time_s[where]))
        right_angles = round(angle / (0.5 * np.pi))
        if right_angles and up[before] @ up[after] > np.cos(np.radians(NEAR_DEG)):
            out.append(TableTurn(m, angle, right_angles))
    return out


class TableEffect(DirectEffect):
    """An effect of an experiment on a table."""

    of_session = None

    def unavailable(self, context: Context) -> str | None:
        """Unless more rotations end near a multiple of 90° than moves by hand do by chance."""
        near = [abs(np.degrees(turn.error_rad)) < NEAR_DEG for turn in table_turns(context)]
        by_chance = bdtrc(sum(near) - 1, len(near), NEAR_DEG / 45.0) if any(near) else 1.0
        return None if by_chance < FALSE_ALARM else why_not("no-table-turns")


def _error_of_mean(values: FloatArray, weights: FloatArray, noise: FloatArray) -> float:
    """Standard error of a weighted mean of few values: the larger of that by their scatter and that by their noise, as
    neighbouring rotations share a pose. Two standard errors cover as much as those of a normal distribution."""
    share, n = weights / weights.sum(), len(values)
    by_noise = float(np.sqrt(share**2 @ noise**2))
    if n < 2:
        return by_noise
    variance = float(share @ (values - share @ values) ** 2) * n / (n - 1)
    wider = float(stdtrit(n - 1, ndtr(2.0)) / 2.0)
    return max(by_noise, wider * float(np.sqrt(variance * (share @ share))))


class TableTilt(TableEffect):
    """Rotating on a tilted table turns the vertical about the table's normal; it returns only after a full turn."""

    id = "table-tilt"

    def find(self, context: Context) -> Evidence | None:
        state, obs = context.fitted.state, context.obs
        found = []
        for turn in table_turns(context):
            before, after = obs.move_poses[turn.move]
            # After whole turns the vertical returns, on a tilted table too.
            if turn.right_angles % 4:
                variance = obs.pose_force_sigma[before] ** 2 + obs.pose_force_sigma[after] ** 2
                sigma = float(np.sqrt((state.accel_S**2 @ variance).mean())) / state.gravity
                change = float(np.linalg.norm(state.up[after] - state.up[before]))
                found.append((change, sigma, 2.0 * abs(np.sin(0.5 * turn.angle_rad))))
        if not found:
            return None
        change, sigmas, gain = np.array(found).T
        chi2, weights = float(((change / sigmas) ** 2).sum()), gain**2 / (gain**2).sum()
        p, tilts = float(chdtrc(2 * len(found), chi2)), np.degrees(change / gain)
        tilt = float(weights @ tilts)
        error = _error_of_mean(tilts, gain**2, np.degrees(sigmas / gain))
        if tilt < ORDINARY_DEG or tilt < CLEAR * error:
            return None
        return Evidence(
            p, chi2, (EffectParameter("tilt", tilt, max(error, 1e-4), "deg"),),
            self.reported("tilt", tilt_deg=tilt), "static-accel", Where(("ax", "ay", "az")),
        )  # fmt: skip


class TurnAngleError(TableEffect):
    """Rotations on a table against a stop deviate from their multiple of 90° by more than the gyro's own error."""

    id = "turn-angle-error"

    def find(self, context: Context) -> Evidence | None:
        turns = table_turns(context)
        errors, sigmas = _without_common_scale(context, turns)
        z = errors / sigmas
        chi2 = float((z**2).sum())
        p = float(chdtrc(len(z), chi2))
        bad = np.flatnonzero(np.abs(z) > SURE)
        if len(bad) == 0:
            return None
        obs, wrong = context.obs, [turns[k].move for k in bad]
        names = obs.move_names(wrong)
        off, spread = np.degrees(errors[bad]), np.degrees(sigmas[bad])
        parameters = measured([f"error of {name}" for name in names], off, spread, ["deg"] * len(bad))
        return Evidence(
            p, chi2, parameters,
            self.reported(
                "turns", wrong=len(bad), turns=len(turns), most_rad=max(abs(errors[k]) for k in bad), near_deg=NEAR_DEG
            ),
            "moves", Where(("gx", "gy", "gz"), names, obs.times(obs.move_ranges[m] for m in wrong)),
        )  # fmt: skip


def _without_common_scale(context: Context, turns: list[TableTurn]) -> tuple[FloatArray, FloatArray]:
    """Errors of the rotations without the part that one scale error per body axis explains, and their noise [rad].

    A scale error grows with the angle and is the same for every rotation about an axis. The weighted median of error
    over angle is robust against single wrong rotations.
    """
    noise = context.noise_density[1].mean()
    quantum, scatter = context.obs.recording.facts.of("gyroscope").step, context.obs.segments.gyroscope_sigma
    assert scatter is not None
    steps = np.where(undithered_axes(quantum, scatter), quantum, 0.0) * np.linalg.norm(
        context.fitted.state.gyro_S, axis=0
    )
    up, moves = context.fitted.state.up, [context.moves[turn.move] for turn in turns]
    axes = np.abs([up[context.obs.move_poses[turn.move][0]] for turn in turns]).argmax(axis=1)
    errors, angles = np.array([turn.error_rad for turn in turns]), np.array([turn.angle_rad for turn in turns])
    lasts_s = np.array([context.time_s[where.stop - 1] - context.time_s[where.start] for where in moves])
    # Inside one LSB that noise does not dither, the rate has one error throughout.
    sigmas = np.sqrt(noise**2 * lasts_s + UNIFORM * (float(steps.max()) * lasts_s) ** 2 + np.radians(ORDINARY_DEG) ** 2)
    for axis in range(3):
        rows = axes == axis
        if rows.sum() < 2:
            continue
        ratio, weight = errors[rows] / angles[rows], np.abs(angles[rows])
        order = np.argsort(ratio)
        heavy = np.cumsum(weight[order])
        common = float(ratio[order][np.searchsorted(heavy, 0.5 * heavy[-1])])
        errors[rows] -= common * angles[rows]
    return errors, sigmas
