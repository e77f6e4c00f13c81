"""Range limit reached: the reading stays on a plateau while the motion goes on."""

from __future__ import annotations

from collections import Counter
from dataclasses import dataclass, replace
from typing import ClassVar

import numpy as np
from scipy.special import chdtrc

from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import AXES
from trihedron.diagnose.effects.direct import DirectEffect, Evidence, without_moves
from trihedron.diagnose.session.observations import FloatArray, Observations
from trihedron.diagnose.session.twin import DYNAMICS, MOVES
from trihedron.records.diagnosis import EffectParameter, Where

BAND_SIGMA = 4.0
"""A plateau is a run of samples within four standard deviations of the limit."""
REACH = 4
"""Samples before and behind a plateau from which the slope of arrival and departure is taken."""
MIN_RUN = 4
MIN_PLATEAUS = 3
"""Smooth peaks differ in height from move to move; three that end on one level within noise do not happen by chance."""
LONG_RUN, HIGH = 8, 15.0
"""One plateau is enough if it is this long and the parabola cut off by it would reach this many sigma higher."""
NEAR_LIMIT = 0.97
"""Moves that come this close to a known limit on any axis are left out: the limit is the sensor's, not one axis's."""
CLEARLY = 5.0
"""How much worse than the other moves those at a limit must contradict gravity and rest."""
MEDIAN_CHI2 = 0.455
"""Median of a chi-square of one degree of freedom."""
CONTRADICTION = 4.0
"""Chi-square per row of the moves concerned above which their readings are false."""
STEEP = 6.0
"""Height in sigma that a parabola with the slopes at both ends of a plateau would reach: it would not look flat."""


@dataclass(frozen=True)
class Plateau:
    """One run at the limit: samples ``[start, stop)`` of channel ``axis``, on the side ``sign``.

    ``is_rail``: every sample is the same number, the largest of the recording. One such run is proof enough.
    """

    axis: int
    sign: int
    start: int
    stop: int
    level: float
    is_rail: bool = False


def plateaus(signal: FloatArray, sigma: FloatArray, ranges: tuple[tuple[int, int], ...]) -> list[Plateau]:
    """Runs of a raw (n, 3) signal on a common limit inside moves."""
    found: list[Plateau] = []
    for axis in range(signal.shape[1]):
        for sign in (1, -1):
            x = sign * signal[:, axis]
            pieces = [x[a:b] for a, b in ranges]
            if not pieces:
                continue
            top = np.array([p.max() for p in pieces])
            codes = np.unique(np.concatenate(pieces))
            step_size = float(np.diff(codes).min()) if len(codes) > 1 else 0.0
            rails = _rails(x, step_size, float(sigma[axis]), axis, sign, ranges)
            if rails:
                found += rails
                continue
            noise = max(float(sigma[axis]), 0.5 * step_size, 1e-300)
            best: list[Plateau] = []
            # The limit is a level that moves end on and that nothing exceeds but noise.
            ends = np.round((top[top > top.max() - 2.0 * BAND_SIGMA * noise] - 2.0 * noise) / noise) * noise
            for level in np.unique(ends):
                runs = _on_level(x, float(level), noise, axis, sign, ranges)
                if len(runs) > len(best):
                    best = runs
            # Nothing is read beyond a limit but noise.
            if best and float(top.max()) <= best[0].level * sign + BAND_SIGMA * noise:
                found += best
    return found


def _on_level(
    x: FloatArray, level: float, noise: float, axis: int, sign: int, ranges: tuple[tuple[int, int], ...]
) -> list[Plateau]:
    """Runs that arrive steeply at a level, stay flat on it within noise, leave it steeply, and agree about it."""
    width = BAND_SIGMA * noise
    runs, means, errors, clear = [], [], [], []
    for a, b in ranges:
        near = np.abs(x[a:b] - level) <= width
        edges = np.flatnonzero(np.diff(np.r_[0, near.astype(np.int8), 0]))
        for first, last in edges.reshape(-1, 2):
            n = last - first
            if n < MIN_RUN or first < REACH or last > b - a - REACH:
                continue
            run = x[a + first : a + last]
            arrival = (run[0] - x[a + first - REACH]) / REACH
            departure = (run[-1] - x[a + last - 1 + REACH]) / REACH
            # A parabola with these slopes at its edges would rise this high above them.
            if min(arrival, departure) * n / 4.0 < STEEP * noise or not _is_flat(_middle(run) / noise):
                continue
            height = min(arrival, departure) * n / 4.0 / noise
            runs.append(Plateau(axis, sign, a + int(first), a + int(last), 0.0))
            clear.append(n >= LONG_RUN and height > HIGH)
            means.append(float(_middle(run).mean()))
            errors.append(noise / np.sqrt(len(_middle(run))))
    if len(runs) < MIN_PLATEAUS and not any(clear):
        return []
    # Peaks that merely end in one band differ by more than the error of their means.
    common = float(np.average(means, weights=1.0 / np.square(errors)))
    agree = [abs(m - common) < 4.0 * e + 0.5 * noise for m, e in zip(means, errors, strict=True)]
    kept = [replace(r, level=sign * common) for r, good in zip(runs, agree, strict=True) if good]
    return kept if len(kept) >= MIN_PLATEAUS or any(c and g for c, g in zip(clear, agree, strict=True)) else []


def _middle(run: FloatArray) -> FloatArray:
    """A run without the ends that still arrive and already leave."""
    cut = max(len(run) // 6, 1)
    return run[cut:-cut]


def _is_flat(run: FloatArray) -> bool:
    """Whether a slope and a curvature explain no more of a run (in units of its noise) than chance does."""
    n = len(run)
    if n < 4:
        return float(np.ptp(run)) < 5.0
    k = np.linspace(-1.0, 1.0, n)
    basis, _ = np.linalg.qr(np.stack([np.ones(n), k, k * k], axis=1))
    return bool(float(((basis[:, 1:].T @ run) ** 2).sum()) < 18.0)  # chi-square of 2: one run in ten thousand


def _rails(
    x: FloatArray, step_size: float, sigma: float, axis: int, sign: int, ranges: tuple[tuple[int, int], ...]
) -> list[Plateau]:
    """Runs of one number, the largest of the recording, where noise should have told neighbours apart."""
    # On a coarse grid equal readings are the rule, at the top of a peak too.
    if not 0.0 < step_size < sigma:
        return []
    shortest = 4 if step_size < 0.3 * sigma else 6
    top = np.nanmax(x)
    found = []
    for a, b in ranges:
        edges = np.flatnonzero(np.diff(np.r_[0, (x[a:b] == top).astype(np.int8), 0]))
        for first, last in edges.reshape(-1, 2):
            if last - first >= shortest:
                found.append(Plateau(axis, sign, a + int(first), a + int(last), sign * float(top), True))
    return found


class _Saturation(DirectEffect):
    sensor: ClassVar[str]
    is_proof = True
    precedence = -1
    experiment = "repeat the moves more slowly, or choose a wider range"

    def find(self, context: Context) -> Evidence | None:
        obs = context.obs
        is_gyro = self.sensor == "gyro"
        raw = obs.raw_rate if is_gyro else obs.raw_force
        density = obs.rate_density if is_gyro else obs.force_density
        if raw is None or density is None or not obs.move_ranges:
            return None
        sigma = density * np.sqrt(obs.recording.rate_hz)
        runs = plateaus(raw, sigma, obs.move_ranges)
        if not runs:
            return None
        touched = sorted({m for m, (a, b) in enumerate(obs.move_ranges) for r in runs if a <= r.start < b})
        # Turns at one steady speed share a level too. A false reading contradicts gravity or rest after the move, and
        # does so more than moves that stay within the range.
        system = context.fitted.system
        move_rows = np.isin(system.domain, (MOVES, DYNAMICS)) & (system.walk == 0)
        at_limit = np.isin(system.segment, touched)
        # In the noise of the parts, not in one that was widened for what nothing had explained.
        widened = np.where(system.domain == MOVES, obs.moves_inflation, obs.dynamics_inflation)
        squared = (system.residual * widened) ** 2
        misfit = float(np.mean(squared[move_rows & at_limit]))
        others = squared[move_rows & ~at_limit]
        usual = float(np.median(others) / MEDIAN_CHI2) if len(others) >= 10 else 0.0
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
            ranges, holds = without_moves(old.move_ranges, old.move_holds, bad)
            return replace(old, move_ranges=ranges, move_holds=holds)

        prefix = "g" if is_gyro else "a"
        channels = tuple(sorted({prefix + AXES[r.axis] for r in runs}))
        statement = (
            f"The {self.sensor} reaches the end of its range: {len(runs)} plateaus, {n} samples, in "
            f"{len(touched)} of {obs.n_moves} moves; what those moves read is false and is left out of the fit."
        )
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
            Where(channels, tuple(f"move {m}" for m in touched[:8]), times), reweigh=reweigh,
            restate=lambda later: self._limits(later, runs, sigma),  # false moves had bent the scale factors
        )  # fmt: skip

    def _scale_and_zero(self, context: Context) -> tuple[FloatArray, FloatArray]:
        """SI per raw unit along each axis, and what a centred raw reading of zero means in SI."""
        if self.sensor == "gyro":
            return context.si_per_raw("gyroscope"), np.zeros(3)
        return context.si_per_raw("accelerometer"), context.fitted.twin.accel_b

    def _near_limit(self, context: Context, runs: list[Plateau], touched: list[int]) -> list[int]:
        """Moves with a plateau and those that come close to the same limit on any axis and side."""
        twin, obs = context.fitted.twin, context.obs
        is_gyro = self.sensor == "gyro"
        raw = obs.raw_rate if is_gyro else obs.raw_force
        assert raw is not None
        scale, zero = self._scale_and_zero(context)
        limit = min(abs(run.level * scale[run.axis] + zero[run.axis]) for run in runs)
        close = {m for m, (a, b) in enumerate(obs.move_ranges)
                 if (np.abs(raw[a:b] * scale + zero).max(axis=0) > NEAR_LIMIT * limit).any()}  # fmt: skip
        # An accelerometer that ends at little more than 1 g comes close in every pose: then only plateaus count.
        return sorted(close | set(touched)) if is_gyro or limit > 1.2 * twin.gravity else touched

    def _limits(self, context: Context, runs: list[Plateau], sigma: FloatArray) -> tuple[EffectParameter, ...]:
        scale, zero = self._scale_and_zero(context)
        obs = context.obs
        unit = "rad/s" if self.sensor == "gyro" else "m/s^2"
        out = []
        for axis in range(3):
            for sign in (1, -1):
                levels = [r.level for r in runs if r.axis == axis and r.sign == sign]
                origin = obs.rate_origin if self.sensor == "gyro" else obs.force_origin
                if levels:
                    name = f"limit_{AXES[axis]}{'+' if sign > 0 else '-'}"
                    value = float(levels[0] * scale[axis] + zero[axis])
                    out.append(EffectParameter(name, value, float(sigma[axis] * scale[axis]), unit))
                    raw = float(levels[0] + origin[axis])
                    is_rail = any(r.is_rail for r in runs if r.axis == axis and r.sign == sign)
                    if is_rail:  # every sample is the same number: it is exact, whatever the scale factor
                        out.append(EffectParameter(f"raw_{name}", round(raw, 9), 0.0, "raw"))
        out.append(EffectParameter("samples", float(sum(run.stop - run.start for run in runs)), 0.0, "1"))
        return tuple(out)


class GyroSaturation(_Saturation):
    """Rates beyond the gyro's range."""

    id = "gyro-saturation"
    sensor = "gyro"
    mechanism = "the gyro reaches the end of its range"


class AccelSaturation(_Saturation):
    """Specific force beyond the accelerometer's range."""

    id = "accel-saturation"
    sensor = "accelerometer"
    mechanism = "the accelerometer reaches the end of its range"
