"""Range limit reached: the reading stays on a plateau while the motion continues."""

from __future__ import annotations

from collections import Counter
from dataclasses import replace
from typing import ClassVar

import numpy as np
from scipy.special import chdtrc

from trihedron.arrays import AXES, FloatArray
from trihedron.channel_facts.possible_limits import BAND_SIGMA, MIN_PLATEAUS
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.direct import DirectEffect, Evidence, without_moves
from trihedron.diagnose.effects.plateaus import Plateau, plateaus_of
from trihedron.diagnose.session.observations import Observations
from trihedron.diagnose.session.state import DYNAMICS, MOVES
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Where

NEAR_LIMIT = 0.97
"""Share of a limit above which a move is excluded, on any axis: the limit belongs to the sensor, not to one axis."""
CLEARLY = 5.0
"""Factor by which the misfit of moves at a limit must exceed that of the other moves."""
MEDIAN_CHI2 = 0.455
"""Median of a chi-square with one degree of freedom."""
CONTRADICTION = 4.0
"""Chi-square per row of the moves at a limit above which their readings are false."""
FEWEST_OTHERS = 10
"""Rows of other moves from which their median is used: its relative error is then 75 %, against ``CLEARLY`` of 5."""
ABOVE_REST = 1.2
"""Poses and gentle moves alike come close to a range limit below 1.2 g."""


class _Saturation(DirectEffect):
    sensor: ClassVar[str]
    is_proof = True

    def find(self, context: Context) -> Evidence | None:
        obs = context.obs
        is_gyro = self.sensor == "gyro"
        raw = obs.raw_rate if is_gyro else obs.raw_force
        density = obs.rate_density if is_gyro else obs.force_density
        if raw is None or density is None or not obs.move_ranges:
            return None
        sigma = density * np.sqrt(obs.recording.rate_hz)
        runs = plateaus_of(obs, is_gyro=is_gyro)
        if not runs:
            return None
        touched = sorted({m for m, (a, b) in enumerate(obs.move_ranges) for r in runs if a <= r.start < b})
        # Rotations at a constant rate give plateaus too. A false reading contradicts gravity or velocity after the
        # move, and more than in moves within the range. For a gyro only gravity counts: velocity also contradicts where
        # the accelerometer is away from the axis of a table.
        system = context.fitted.system
        domains = (MOVES,) if is_gyro else (MOVES, DYNAMICS)
        move_rows = np.isin(system.domain, domains) & (system.walk == 0)
        at_limit = np.isin(system.segment, touched)
        squared = system.residual**2
        misfit = float(np.mean(squared[move_rows & at_limit]))
        others = squared[move_rows & ~at_limit]
        usual = float(np.median(others) / MEDIAN_CHI2) if len(others) >= FEWEST_OTHERS else 0.0
        # Repeated plateaus on one level need no comparison: where most moves are clipped, all disagree.
        sides = Counter((run.axis, run.sign) for run in runs)
        repeats = max(sides.values()) >= MIN_PLATEAUS
        contradicts = misfit > CONTRADICTION and (repeats or misfit > CLEARLY * usual)
        if not contradicts and not any(run.is_rail for run in runs):
            return None
        touched = self._near_limit(context, runs, touched)
        n = sum(run.stop - run.start for run in runs)
        parameters = self._limits(context, runs, sigma)
        t = obs.time_s
        times = tuple((float(t[r.start]), float(t[r.stop - 1])) for r in runs[:8])
        bad = set(touched)

        def reweigh(old: Observations) -> Observations:
            ranges, poses = without_moves(old.move_ranges, old.move_poses, bad)
            return replace(old, move_ranges=ranges, move_poses=poses)

        prefix = "g" if is_gyro else "a"
        channels = tuple(sorted({prefix + AXES[r.axis] for r in runs}))
        statement = self.told("plateaus", plateaus=len(runs), samples=n, touched=len(touched), moves=obs.n_moves)
        # Chance that smooth peaks of different moves end within one noise band of each other, times the chance that
        # undisturbed moves disagree so much more than the others.
        p = (2 * BAND_SIGMA * float(np.min(sigma / np.ptp(raw, axis=0)))) ** (len(runs) - 1)
        n_rows = int((move_rows & at_limit).sum())
        p *= float(chdtrc(n_rows, misfit * n_rows / max(usual, 1.0)))
        p = float(np.clip(p, 1e-300, 1.0))
        if any(run.is_rail for run in runs):
            p = min(p, 1e-30)
        return Evidence(
            p, -2.0 * np.log(p), parameters, statement, "moves" if is_gyro else "dynamics",
            Where(channels, obs.move_names(touched[:8]), times), reweigh=reweigh,
            restate=lambda later: self._limits(later, runs, sigma),  # false moves had biased the scale factors
        )  # fmt: skip

    def _scale_and_bias(self, context: Context) -> tuple[FloatArray, FloatArray]:
        """SI per raw unit along each axis, and the SI value of a centred raw reading of zero."""
        if self.sensor == "gyro":
            return context.si_per_raw("gyroscope"), np.zeros(3)
        return context.si_per_raw("accelerometer"), context.fitted.state.accel_b

    def _near_limit(self, context: Context, runs: list[Plateau], touched: list[int]) -> list[int]:
        """Moves with a plateau and those that come close to the same limit on any axis and side."""
        state, obs = context.fitted.state, context.obs
        is_gyro = self.sensor == "gyro"
        raw = obs.raw_rate if is_gyro else obs.raw_force
        assert raw is not None
        scale, bias = self._scale_and_bias(context)
        origin = obs.rate_origin if is_gyro else obs.force_origin
        limit = min(abs((run.limit.value - origin[run.axis]) * scale[run.axis] + bias[run.axis]) for run in runs)
        close = {m for m, (a, b) in enumerate(obs.move_ranges)
                 if (np.abs(raw[a:b] * scale + bias).max(axis=0) > NEAR_LIMIT * limit).any()}  # fmt: skip
        # An accelerometer with a range of little more than 1 g comes close in every pose: then only plateaus count.
        return sorted(close | set(touched)) if is_gyro or limit > ABOVE_REST * state.gravity else touched

    def _limits(self, context: Context, runs: list[Plateau], sigma: FloatArray) -> tuple[EffectParameter, ...]:
        """Limits in SI along every channel, with the exact code where the limit is one code."""
        scale, bias = self._scale_and_bias(context)
        obs = context.obs
        is_gyro = self.sensor == "gyro"
        origin = obs.rate_origin if is_gyro else obs.force_origin
        out = []
        limits = {(run.axis, -run.sign): run.limit for run in runs}
        for (axis, _), limit in sorted(limits.items()):
            name = f"limit_{AXES[axis]}{'+' if limit.is_high else '-'}"
            value = float((limit.value - origin[axis]) * scale[axis] + bias[axis])
            out.append(EffectParameter(name, value, float(sigma[axis] * scale[axis]), "rad/s" if is_gyro else "m/s^2"))
            if limit.sigma == 0.0:  # every sample is the same number: it is exact, whatever the scale factor
                out.append(EffectParameter(f"raw_{name}", round(limit.value, 9), 0.0, "raw"))
        out.append(EffectParameter("samples", float(sum(run.stop - run.start for run in runs)), 0.0, "1"))
        return tuple(out)


class GyroSaturation(_Saturation):
    """Rates beyond the gyro's range."""

    id = "gyro-saturation"
    sensor = "gyro"


class AccelSaturation(_Saturation):
    """Specific force beyond the accelerometer's range."""

    id = "accel-saturation"
    sensor = "accelerometer"
