"""Resolution too coarse for the noise: pose means follow the staircase of the ADC; and codes that never occur."""

from dataclasses import dataclass, replace
from functools import reduce

import numpy as np
from scipy.special import pdtrc

from trihedron.arrays import FloatArray
from trihedron.defaults import FALSE_ALARM
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import DirectEffect, Evidence
from trihedron.diagnose.residuals.goodness_of_fit import CHANNELS
from trihedron.diagnose.session.observations import Observations
from trihedron.probability import RARE_ALARM
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Where
from trihedron.session.rounding import LEAST_WHITE, TWO_CODES, UNIFORM, before_adc

MOST_CODES = 0.2
"""Codes per reading: with an LSB every code is read five times or more; readings without one all differ."""
MOSTLY = 0.5
"""Share of the static readings on one code from which a dead zone around it is tested."""
ZONE_STEPS = 3.5
"""A dead zone is wider, in LSB, than the gap that two missing codes leave."""
FEWEST_READINGS = 4
"""Readings of a pose from which its codes determine a scatter."""
LEAST_SHARE = 0.1
"""Share of the codes from which missing ones are named: exports that rescale counts lack up to 9 %, 16-bit converters 3
to 5 %, which changes no mean."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """The LSB of one channel: ``step`` in raw units, noise before the ADC, and corrections of the pose means.

    ``sigma`` that noise and ``scatter`` the scatter of the readings, raw units; ``mean_shift`` (poses,) posterior mean
    minus plain mean and ``mean_sigma`` (poses,) its uncertainty, raw units; ``missing`` number of codes skipped between
    visited ones, ``shifted`` their share; ``dead`` half-width of the zone around one code without any reading, raw
    units.
    """

    channel: int
    step: float
    sigma: float
    scatter: float
    mean_shift: FloatArray | float
    mean_sigma: FloatArray | float
    missing: int = 0
    shifted: float = 0.0
    dead: float = 0.0

    @property
    def added(self) -> float:
        """Variance that the codes add to a reading."""
        return self.step**2 * (self.shifted if self.missing else UNIFORM)


def missing_codes(poses: list[FloatArray], sigma: float, step: float) -> tuple[int, float, float] | None:
    """Codes skipped between visited ones (8.15a), or ``None`` where the poses show no LSB: their number, their share of
    the codes, and the standard error of a pose mean by readings that come out one code higher or lower, in LSB."""
    values = np.concatenate(poses)
    codes = np.unique(values)
    if step == 0.0 or len(codes) < 2 or len(codes) > MOST_CODES * len(values):
        return None
    # Neighbouring codes are expected of noise by which a third of the readings leave their code.
    if sigma**2 <= TWO_CODES * step**2:
        return 0, 0.0, 0.0
    # Gap by gap: over hundreds of codes a relative error of 0.1 % of the step would add up to a whole code.
    place = np.concatenate([[0], np.cumsum(np.rint(np.diff(codes) / step))]).astype(np.int64)
    expected, squares = np.zeros(place[-1] + 1), np.zeros(place[-1] + 1)
    is_visited = np.zeros(place[-1] + 1, dtype=bool)
    is_visited[place] = True
    independent = [np.var(np.diff(one)) / (2.0 * np.var(one)) for one in poses if np.ptp(one) > 0.0]
    for one in poses:
        own = place[np.searchsorted(codes, one)]
        first = own.min()
        count = np.bincount(own - first)
        # Noise is unimodal: at least the geometric mean of the neighbours' counts is expected.
        between = np.sqrt(count[:-2] * count[2:])
        inside = slice(first + 1, first + 1 + len(between))
        expected[inside] += between
        squares[inside] += (between / len(one)) ** 2
    # As many readings as both neighbours have, a third of them on the code itself: the binomial chance of none.
    chance = (2.0 / 3.0) ** (2.0 * min(float(np.median(independent)), 1.0) * expected)
    is_tested = chance < FALSE_ALARM
    missing = is_tested & ~is_visited
    if not missing.any() or pdtrc(np.count_nonzero(missing) - 1.0, chance[is_tested].sum()) > RARE_ALARM:
        return 0, 0.0, 0.0
    # Between all of them up and all down: uniform.
    error = float(np.sqrt(squares[missing].sum() / len(poses) / 3.0))
    # Beside a missing code none is tested.
    known = is_tested | np.convolve(missing, [True, False, True], "same").astype(bool)
    number = int(np.count_nonzero(missing))
    return number, number / int(np.count_nonzero(known)), error


def dead_zone(values: FloatArray, everything: FloatArray, step: float) -> float:
    """Half-width of a zone around the commonest static code that no reading of the recording enters, or 0."""
    codes, counts = np.unique(values, return_counts=True)
    zero = float(codes[counts.argmax()])
    if counts.max() < MOSTLY * len(values):
        return 0.0
    away = np.abs(everything[everything != zero] - zero)
    if len(np.unique(away)) < 3:
        return 0.0
    nearest = float(away.min())
    # Of readings spread evenly over twice its width each would lie in the outer half by a chance of a half.
    by_chance = 0.5 ** int((away < 2.0 * nearest).sum())
    return nearest if nearest > ZONE_STEPS * step and by_chance < RARE_ALARM else 0.0


class Quantisation(DirectEffect):
    """An LSB so large against the noise that averaging does not resolve it."""

    id = "quantisation"

    def find(self, context: Context) -> Evidence | None:
        obs = context.obs
        found = [one for c in range(3 if obs.raw_rate is None else 6) if (one := self._channel(obs, c)) is not None]
        if not found:
            return None
        worst = max(found, key=lambda one: one.step / one.sigma)
        strength = float(sum((one.step / one.sigma) ** 2 for one in found) * obs.n_poses)
        names = tuple(CHANNELS[one.channel] for one in found)
        if worst.missing:
            statement = self.reported(
                "missing", channels=names, codes=[one.missing for one in found],
                share=max(one.shifted for one in found),
            )  # fmt: skip
        else:
            statement = self.reported(
                "steps", channels=names, is_dead=bool(worst.dead), dead=worst.dead, step=worst.step,
                times=worst.step / worst.sigma,
            )  # fmt: skip
        return Evidence(
            0.0, strength, _parameters(context, found), statement, "within-static", Where(names),
            reweigh=lambda old: reduce(_resolved, found, old), share=worst.added / (worst.added + worst.sigma**2),
            restate=lambda later: _parameters(later, found),  # the staircase had biased the scale factors
        )  # fmt: skip

    def _channel(self, obs: Observations, c: int) -> Lattice | None:
        raw = obs.raw_force if c < 3 else obs.raw_rate
        assert raw is not None
        x = np.round(raw[:, c % 3], 9)
        poses = [x[pose.samples()] for pose in obs.segments.poses]
        poses = [values[np.isfinite(values)] for values in poses]
        if min(len(values) for values in poses) < FEWEST_READINGS:
            return None
        still = np.concatenate(poses)
        scatter = float(np.sqrt(np.median([np.var(values) for values in poses])))
        moving = np.concatenate([x[a:b] for a, b in obs.move_ranges]) if obs.move_ranges else still
        step = float(obs.recording.facts.steps[c])
        missing = missing_codes(poses, scatter, step)
        if missing is None:
            dead = dead_zone(still, moving[np.isfinite(moving)], step)
            if not dead:
                return None
            anywhere_inside = dead / np.sqrt(3.0)
            return Lattice(c, dead, anywhere_inside, dead, 0.0, anywhere_inside, dead=dead)
        number, share, error = missing
        if share > LEAST_SHARE:
            density = obs.force_density if c < 3 else obs.rate_density
            assert density is not None
            variance = density[c % 3] ** 2 * obs.recording.rate_hz
            sigma = float(np.sqrt(max(variance - UNIFORM * step**2, variance / 2.0)))
            return Lattice(c, step, sigma, sigma, 0.0, error * step, number, share)
        # The staircase of a mean is exp(-2π²σ²)/π LSB, for σ of half an LSB 2·10⁻³: averaging resolves the LSB.
        if scatter**2 > (TWO_CODES + UNIFORM) * step**2:
            return None
        found = before_adc(poses, step)
        sigma, shift, spread = found.sigma, found.shift, np.hypot(found.own, found.common)
        if sigma**2 > TWO_CODES:
            return None
        return Lattice(c, step, sigma * step, scatter, shift * step, spread * step)


def _parameters(context: Context, found: list[Lattice]) -> tuple[EffectParameter, ...]:
    """LSB in SI, number of missing codes, half-width of dead zones."""
    parameters = []
    for one in found:
        scale, relative = _scale_of(context, one.channel)
        unit = "m/s^2" if one.channel < 3 else "rad/s"
        name = CHANNELS[one.channel]
        # The LSB is exact in raw units; in SI it has the relative uncertainty of the scale factor.
        sigma = max(relative, 1e-6) * one.step * scale
        parameters.append(EffectParameter(f"lsb_{name}", one.step * scale, sigma, unit))
        if one.missing:
            parameters.append(EffectParameter(f"missing_codes_{name}", float(one.missing), 0.0, "1"))
        if one.dead:
            parameters.append(EffectParameter(f"dead_band_{name}", one.dead * scale, one.step * scale, unit))
    return tuple(parameters)


def _scale_of(context: Context, channel: int) -> tuple[float, float]:
    """SI per raw unit along one channel's axis, and its relative standard uncertainty."""
    is_accel, k = channel < 3, channel % 3
    S = context.fitted.state.accel_S if is_accel else context.fitted.state.gyro_S
    place = (0, 2, 5)[k] if is_accel else 9 + 4 * k  # S is lower triangular for the accelerometer
    sigma = float(np.sqrt(max(context.fitted.covariance()[place, place], 0.0)))
    return float(context.si_per_raw(channel // 3)[k]), sigma / abs(float(S[k, k]))


def _resolved(obs: Observations, one: Lattice) -> Observations:
    """Observations with one channel's pose means and noise as estimated from the codes."""
    is_accel = one.channel < 3
    k = one.channel % 3
    if not is_accel and obs.undithered[k]:
        return obs  # the session knows
    kind = "force" if is_accel else "rate"
    mean, sigma, density = (getattr(obs, n).copy() for n in (f"pose_{kind}", f"pose_{kind}_sigma", f"{kind}_density"))
    mean[:, k] += one.mean_shift
    sigma[:, k] = np.hypot(sigma[:, k] * min(one.sigma / max(one.scatter, one.sigma), 1.0), one.mean_sigma)
    # In motion the readings cross many codes: the rounding error is white, of variance LSB²/12 per reading.
    density[k] = np.sqrt((one.sigma**2 + UNIFORM * one.step**2) / obs.recording.rate_hz)
    if is_accel and obs.force_up is not None:
        # Change of the variance along the vertical.
        up, error = obs.force_up
        changed = up[:, k] ** 2 * (sigma[:, k] ** 2 - obs.pose_force_sigma[:, k] ** 2)
        obs = replace(obs, force_up=(up, np.sqrt(np.maximum(error**2 + changed, LEAST_WHITE * error**2))))
    known = {f"pose_{kind}": mean, f"pose_{kind}_sigma": sigma, f"{kind}_density": density}
    return replace(obs, **known)
