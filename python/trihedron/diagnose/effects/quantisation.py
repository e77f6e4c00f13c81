"""Resolution too coarse for the noise: pose means follow the staircase of the ADC."""

from __future__ import annotations

from dataclasses import dataclass, replace

import numpy as np
from scipy.special import logsumexp, ndtr, softmax

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import ACCELEROMETER, SENSORS
from trihedron.diagnose.effects.direct import DirectEffect, Evidence
from trihedron.diagnose.residuals.goodness_of_fit import CHANNELS
from trihedron.diagnose.session.observations import Observations
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.domains import Where

COARSE = 0.45
"""Noise, in LSB, below which readings take two or three codes and their mean follows a staircase."""
SIGMA_GRID = np.geomspace(0.03, 2.0, 36)
"""Noise tried, in LSB: below it one code is read, above it the scatter is the noise; 13 % apart."""
OFFSETS = np.linspace(-0.75, 0.75, 61)
"""Mean before the ADC about that of the codes, in LSB: rounding moves it by half of one."""
LEAST_SHARE = 1e-15
"""Least share of a code: rounding errors of the normal distribution."""
LEAST_LEFT = 0.01
"""Least share of a mean's variance that remains once its codes are resolved."""


@dataclass(frozen=True, eq=False)
class Lattice:
    """The LSB of one channel: ``step`` in raw units, noise before the ADC, and corrections of the pose means.

    ``sigma`` that noise and ``scatter`` the scatter of the readings, raw units; ``mean_shift`` (poses,) posterior mean
    minus plain mean and ``mean_sigma`` (poses,) its uncertainty, raw units.
    """

    channel: int
    step: float
    sigma: float
    scatter: float
    mean_shift: FloatArray
    mean_sigma: FloatArray


def before_adc(poses: list[FloatArray], step: float) -> tuple[float, FloatArray, FloatArray]:
    """Noise before the ADC and mean of every pose, by the likelihood of the codes (interval-censored normal readings).

    A pose whose mean is at the centre of a code has no scatter, at its edge half an LSB, whatever the noise: below half
    an LSB the scatter does not determine the noise, but the shares of the codes do.

    Returns sigma in LSB, and per pose the posterior mean minus the plain mean and the posterior sigma, in LSB.
    """
    logs, sigma = [], SIGMA_GRID[:, None, None]
    for values in poses:
        codes, counts = np.unique(np.round((values - values.min()) / step), return_counts=True)
        mean = np.average(codes, weights=counts) + OFFSETS[:, None]
        share = ndtr((codes + 0.5 - mean) / sigma) - ndtr((codes - 0.5 - mean) / sigma)
        logs.append(np.log(np.maximum(share, LEAST_SHARE)) @ counts)
    likelihood = np.array(logs)  # (poses, sigmas, offsets)
    best = int(logsumexp(likelihood, axis=2).sum(axis=0).argmax())
    weight = softmax(likelihood[:, best], axis=1)
    shift = weight @ OFFSETS
    return float(SIGMA_GRID[best]), shift, np.sqrt(np.maximum(weight @ OFFSETS**2 - shift**2, 0.0))


class Quantisation(DirectEffect):
    """An LSB so large against the noise that averaging does not resolve it."""

    id = "quantisation"
    is_proof = True

    def find(self, context: Context) -> Evidence | None:
        obs = context.obs
        found = [one for c in range(3 if obs.raw_rate is None else 6) if (one := self._channel(obs, c)) is not None]
        if not found:
            return None

        def reweigh(old: Observations) -> Observations:
            for one in found:
                old = _resolved(old, one)
            return old

        worst = max(found, key=lambda one: one.step / one.sigma)
        strength = float(sum((one.step / one.sigma) ** 2 for one in found) * obs.n_poses)
        grid = worst.step**2 / 12.0  # variance of the staircase; that of the noise before the ADC is added below
        names = tuple(CHANNELS[one.channel] for one in found)
        told = self.told("steps", channels=names, step=worst.step, times=worst.step / worst.sigma)
        return Evidence(
            0.0, strength, _parameters(context, found), told, "within-static", Where(names),
            reweigh=reweigh, share=grid / (grid + worst.sigma**2),
            restate=lambda later: _parameters(later, found),  # the staircase had biased the scale factors
        )  # fmt: skip

    def _channel(self, obs: Observations, c: int) -> Lattice | None:
        raw = obs.raw_force if c < 3 else obs.raw_rate
        assert raw is not None
        x = np.round(raw[:, c % 3], 9)
        poses = [x[pose.samples()] for pose in obs.segments.poses]
        poses = [values[np.isfinite(values)] for values in poses]
        if not all(map(len, poses)):
            return None
        scatter = float(np.sqrt(np.median([np.var(values) for values in poses])))
        step = float(obs.recording.facts.steps[c])
        if scatter >= step:  # averaging resolves the LSB
            return None
        sigma, shift, spread = before_adc(poses, step)
        return Lattice(c, step, sigma * step, scatter, shift * step, spread * step) if sigma <= COARSE else None


def _parameters(context: Context, found: list[Lattice]) -> tuple[EffectParameter, ...]:
    """LSB of every channel in SI: exact in raw units, it has the relative uncertainty of the scale factor."""
    state, variance, out = context.fitted.state, np.diag(context.fitted.covariance()), []
    for one in found:
        sensor, k = divmod(one.channel, 3)
        # S is lower triangular for the accelerometer.
        place, S = ((0, 2, 5)[k], state.accel_S) if sensor == ACCELEROMETER else (9 + 4 * k, state.gyro_S)
        lsb = one.step * float(context.si_per_raw(sensor)[k])
        sigma = lsb * float(np.sqrt(max(variance[place], 0.0)) / abs(S[k, k]))
        out.append(EffectParameter(f"lsb_{CHANNELS[one.channel]}", lsb, sigma, SENSORS[sensor].unit))
    return tuple(out)


def _resolved(obs: Observations, one: Lattice) -> Observations:
    """Observations with one channel's pose means and noise as estimated from the codes."""
    is_accel = one.channel < 3
    k = one.channel % 3
    kind = "force" if is_accel else "rate"
    mean, sigma, density = (getattr(obs, n).copy() for n in (f"pose_{kind}", f"pose_{kind}_sigma", f"{kind}_density"))
    mean[:, k] += one.mean_shift
    sigma[:, k] = np.hypot(sigma[:, k] * min(one.sigma / max(one.scatter, one.sigma), 1.0), one.mean_sigma)
    # In motion the readings cross many codes: the rounding error is white, of variance LSB²/12 per reading.
    density[k] = np.sqrt((one.sigma**2 + one.step**2 / 12.0) / obs.recording.rate_hz)
    if is_accel and obs.force_up is not None:
        # Change of the variance along the vertical.
        up, error = obs.force_up
        changed = up[:, k] ** 2 * (sigma[:, k] ** 2 - obs.pose_force_sigma[:, k] ** 2)
        obs = replace(obs, force_up=(up, np.sqrt(np.maximum(error**2 + changed, LEAST_LEFT * error**2))))
    known = {f"pose_{kind}": mean, f"pose_{kind}_sigma": sigma, f"{kind}_density": density}
    return replace(obs, **known)
