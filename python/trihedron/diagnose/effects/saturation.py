"""Range limit reached: the reading stays on a plateau while the motion continues."""

from dataclasses import dataclass
from functools import lru_cache
from typing import ClassVar

import numpy as np

from trihedron.arrays import AXES, BoolArray, FloatArray
from trihedron.channel_facts.possible_limits import REACH
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import ACCELEROMETER, GYRO, SENSORS, DirectEffect, Evidence
from trihedron.diagnose.session.observations import Observations
from trihedron.probability import CLEAR, LEAST_P
from trihedron.records.channel_facts import Limit
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Where
from trihedron.session.model import NOTHING
from trihedron.session.noise import ANYTHING

HALF_WINDOW = 6
"""Samples on either side of an interval that determine the local motion."""
NEAR_LIMIT = 0.97
"""Share of a limit above which a move is excluded, on any axis: the limit belongs to the sensor, not to one axis."""
BEYOND = 0.1
"""Least share of the parabola on a plateau by which the motion clearly exceeds the limit: one of constant rate does
not."""


@dataclass(frozen=True)
class Plateau:
    """One run at a limit inside a move: samples ``[start, stop)``.

    ``is_rail``: every sample is the limit's code, which alone proves clipping; otherwise the run is level within noise.
    """

    limit: Limit
    start: int
    stop: int
    is_rail: bool

    @property
    def axis(self) -> int:
        return self.limit.axis

    @property
    def sign(self) -> int:
        """+1 at the upper limit, -1 at the lower."""
        return 1 if self.limit.is_high else -1


@lru_cache(maxsize=16)
def plateaus_of(obs: Observations, sensor: int) -> list[Plateau]:
    """Runs at the limits of one sensor inside the moves of ``obs``."""
    name = SENSORS[sensor].name
    if (obs.raw_force, obs.raw_rate)[sensor] is None or not obs.move_ranges:
        return []
    exact, noisy = obs.recording.facts.of(name).limits, obs.recording.possible_limits[name]
    starts, stops = np.array(obs.move_ranges, dtype=np.int64).T
    found = []
    for limit in (*exact, *noisy):
        for first, last in limit.runs.tolist():
            for move in np.flatnonzero((starts < last) & (stops > first)).tolist():
                ends = max(first, int(starts[move])), min(last, int(stops[move]))
                found.append(Plateau(limit, *ends, limit in exact))
    return found


@lru_cache(maxsize=8)
def clipped_samples(obs: Observations) -> BoolArray:
    """(n,) samples within ``HALF_WINDOW`` of a plateau at a range limit: their steps give no time error."""
    mask = np.zeros(len(obs.time_s), dtype=bool)
    for sensor in (ACCELEROMETER, GYRO):
        for run in plateaus_of(obs, sensor):
            mask[max(run.start - HALF_WINDOW, 0) : run.stop + HALF_WINDOW] = True
    return mask


class _Saturation(DirectEffect):
    sensor: ClassVar[int]

    def find(self, context: Context) -> Evidence | None:
        obs, is_gyro = context.obs, self.sensor == GYRO
        raw, density = (obs.raw_rate, obs.rate_density) if is_gyro else (obs.raw_force, obs.force_density)
        runs = plateaus_of(obs, self.sensor)
        if raw is None or density is None or not runs:
            return None
        sigma = density * np.sqrt(obs.recording.rate_hz)
        gain = self._gain(context, [run for run in runs if not run.is_rail], raw)
        runs = [run for run in runs if run.is_rail or gain > 0.0]
        if not runs:
            return None
        touched = sorted({m for m, (a, b) in enumerate(obs.move_ranges) for r in runs if a <= r.start < b})
        touched = self._near_limit(context, runs, touched, raw)
        begins = set(obs.move_poses[touched, 0].tolist())
        channels = tuple(sorted({"ag"[self.sensor] + AXES[r.axis] for r in runs}))
        statement = self.reported(
            "plateaus", plateaus=len(runs), samples=_n_samples(runs), touched=len(touched), moves=obs.n_moves
        )
        # A part without a limit does not repeat one code at the end of its range.
        p = LEAST_P if any(run.is_rail for run in runs) else max(float(np.exp(-gain)), LEAST_P)
        return Evidence(
            p, -2.0 * np.log(p), self._limits(context, runs, sigma), statement, "moves" if is_gyro else "dynamics",
            Where(channels, obs.move_names(touched[:8]), obs.times((r.start, r.stop) for r in runs[:8])),
            reweigh=lambda old: old.without_moves_from(begins),
            restate=lambda later: self._limits(later, runs, sigma),  # false moves had biased the scale factors
        )  # fmt: skip

    def _gain(self, context: Context, runs: list[Plateau], raw: FloatArray) -> float:
        """Gain in log-evidence by a motion that goes on beyond the limit, the readings cut off; 0 where it does not.

        Rotations at a constant rate give plateaus too. Slopes at both ends of a plateau state a parabola above it; what
        gravity and velocity after the moves say of its size tells a limit from a constant rate.
        """
        if not runs:
            return 0.0
        cut = np.zeros((len(raw), 3))
        for run in runs:
            x, n = raw[:, run.axis] * run.sign, run.stop - run.start
            arrival, departure = x[run.start] - x[run.start - REACH], x[run.stop - 1] - x[run.stop - 1 + REACH]
            u = (np.arange(n) + 0.5) / n
            cut[run.start : run.stop, run.axis] -= run.sign * min(arrival, departure) / REACH * n * u * (1.0 - u)
        columns = context.on_axes(self.sensor, context.at_points(cut) * context.si_per_raw(self.sensor))
        column = np.ascontiguousarray(columns.sum(axis=2, keepdims=True))
        sides = (None, column) if self.sensor == GYRO else (column, None)
        core = context.fitted.core
        (plain, *_), (beyond, _, size, variance) = core.evidence([NOTHING, (*sides, [1.0])], [core.strengths], ANYTHING)
        return float(beyond - plain) if size[0] - CLEAR * np.sqrt(variance[0, 0]) > BEYOND else 0.0

    def _si(self, context: Context) -> tuple[FloatArray, FloatArray, FloatArray]:
        """SI per raw unit along each axis, the SI value of a centred raw reading of zero, and the origin."""
        if self.sensor == GYRO:
            return context.si_per_raw(GYRO), np.zeros(3), context.obs.rate_origin
        return context.si_per_raw(ACCELEROMETER), context.fitted.state.accel_b, context.obs.force_origin

    def _near_limit(self, context: Context, runs: list[Plateau], touched: list[int], raw: FloatArray) -> list[int]:
        """Moves with a plateau and those that come close to the same limit on any axis and side."""
        scale, bias, origin = self._si(context)
        limit = min(abs((run.limit.value - origin[run.axis]) * scale[run.axis] + bias[run.axis]) for run in runs)
        close = {m for m, (a, b) in enumerate(context.obs.move_ranges)
                 if (np.abs(raw[a:b] * scale + bias).max(axis=0) > NEAR_LIMIT * limit).any()}  # fmt: skip
        # An accelerometer with a range of little more than 1 g comes close at rest: then only plateaus count.
        is_near_rest = self.sensor == ACCELEROMETER and limit * NEAR_LIMIT <= context.fitted.state.gravity
        return touched if is_near_rest else sorted(close | set(touched))

    def _limits(self, context: Context, runs: list[Plateau], sigma: FloatArray) -> tuple[EffectParameter, ...]:
        """Limits in SI along every channel, with the exact code where the limit is one code."""
        scale, bias, origin = self._si(context)
        out = []
        limits = {(run.axis, -run.sign): run.limit for run in runs}
        for (axis, _), limit in sorted(limits.items()):
            name = f"limit_{AXES[axis]}{'+' if limit.is_high else '-'}"
            value = float((limit.value - origin[axis]) * scale[axis] + bias[axis])
            out.append(EffectParameter(name, value, float(sigma[axis] * scale[axis]), SENSORS[self.sensor].unit))
            if limit.sigma == 0.0:  # every sample is the same number: it is exact, whatever the scale factor
                out.append(EffectParameter(f"raw_{name}", round(limit.value, 9), 0.0, "raw"))
        return (*out, EffectParameter("samples", float(_n_samples(runs)), 0.0, "1"))


def _n_samples(runs: list[Plateau]) -> int:
    return sum(run.stop - run.start for run in runs)


class GyroSaturation(_Saturation):
    id, sensor = "gyro-saturation", GYRO


class AccelSaturation(_Saturation):
    id, sensor = "accel-saturation", ACCELEROMETER
