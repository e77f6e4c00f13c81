"""Range limit reached: the reading stays on a plateau while the motion goes on."""

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
"""Moves that come this close to a known limit on any axis are left out: the limit is the sensor's, not one axis's."""
CLEARLY = 5.0
"""How much worse than the other moves those at a limit must contradict gravity and rest."""
MEDIAN_CHI2 = 0.455
"""Median of a chi-square of one degree of freedom."""
CONTRADICTION = 4.0
"""Chi-square per row of the moves concerned above which their readings are false."""
FEWEST_OTHERS = 10
"""Rows of other moves whose median says what is usual: it is then known to three quarters, against ``CLEARLY`` of 5."""
ABOVE_REST = 1.2
"""A range that ends below 1.2 g is reached by poses and gentle moves alike."""


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
        # Turns at one steady speed share a level too. A false reading contradicts gravity or rest after the move, and
        # does so more than moves that stay within the range. A false rate contradicts gravity first: rest alone is
        # contradicted by an arm between the sensors and the axis of a table as well.
        system = context.fitted.system
        domains = (MOVES,) if is_gyro else (MOVES, DYNAMICS)
        move_rows = np.isin(system.domain, domains) & (system.walk == 0)
        at_limit = np.isin(system.segment, touched)
        squared = system.residual**2
        misfit = float(np.mean(squared[move_rows & at_limit]))
        others = squared[move_rows & ~at_limit]
        usual = float(np.median(others) / MEDIAN_CHI2) if len(others) >= FEWEST_OTHERS else 0.0
        # Plateaus on one level time and again need no such comparison: where most moves are clipped, all disagree.
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
        # sound moves disagree so much more than the others.
        p = (2 * BAND_SIGMA * float(np.min(sigma / np.ptp(raw, axis=0)))) ** (len(runs) - 1)
        n_rows = int((move_rows & at_limit).sum())
        p *= float(chdtrc(n_rows, misfit * n_rows / max(usual, 1.0)))
        p = float(np.clip(p, 1e-300, 1.0))
        if any(run.is_rail for run in runs):
            p = min(p, 1e-30)
        return Evidence(
            p, -2.0 * np.log(p), parameters, statement, "moves" if is_gyro else "dynamics",
            Where(channels, obs.move_names(touched[:8]), times), reweigh=reweigh,
            restate=lambda later: self._limits(later, runs, sigma),  # false moves had bent the scale factors
        )  # fmt: skip

    def _scale_and_bias(self, context: Context) -> tuple[FloatArray, FloatArray]:
        """SI per raw unit along each axis, and what a centred raw reading of zero means in SI."""
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
        # An accelerometer that ends at little more than 1 g comes close in every pose: then only plateaus count.
        return sorted(close | set(touched)) if is_gyro or limit > ABOVE_REST * state.gravity else touched

    def _limits(self, context: Context, runs: list[Plateau], sigma: FloatArray) -> tuple[EffectParameter, ...]:
        """Limits in SI along every channel, with the exact code where readings end on one."""
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
