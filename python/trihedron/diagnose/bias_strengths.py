"""Bias drift and bias repeatability, from the strengths of the session's noise (eq. 11.20).

Every hypothesis contains both processes with free strengths. A process is named where the session is much less likely
with that strength bounded to what the part's own noise explains.
"""

from collections.abc import Collection, Iterable
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray, rms_of
from trihedron.diagnose.candidates import Tried, price_of_choice
from trihedron.diagnose.effects import catalogue
from trihedron.diagnose.effects.bias_process import BiasProcess
from trihedron.diagnose.hypothesis import Hypothesis, again
from trihedron.diagnose.session.observations import Observations
from trihedron.probability import STRONG_SCORE
from trihedron.quantiles import medians
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.words import Words
from trihedron.session.noise import ANYTHING, NOISE_CORNER_S, Bounds
from trihedron.threads import side_by_side

FLICKER_WITHIN = 2.0
"""Factor by which the pose-to-pose scatter predicted from 1/f noise inside the poses may be too small; and rms of a
drifting bias over the poses, in standard errors of a pose mean, above which the drift is named: 1/f noise drifts too,
up to 1.63 with 0.3 mg (benches/blind_nuisances.py --stress flicker)."""
DRIFT_CORNER_S = 2.0 * NOISE_CORNER_S
"""Corner time of a walk that twenty poses in some minutes do not show: half an error of a pose. A smooth drift of 12
errors is likely as a walk with the corner time of the noisiest parts."""


@dataclass(frozen=True, eq=False)
class BiasStrength:
    """One bias process: ``gain`` in twice the log-evidence over its strength bounded to the part's noise, ``score`` the
    gain less the penalty for further axes, ``size`` and ``std`` (3,) SI by axis, those of the hypothesis ``alone``:
    where the sensor's other process is not needed beside it, with that bounded."""

    effect: BiasProcess
    gain: float
    score: float
    size: FloatArray
    std: FloatArray
    parameters: tuple[EffectParameter, ...]
    statement: Words
    without: Hypothesis
    alone: Hypothesis
    is_large: bool
    """Whether a drift exceeds that of 1/f noise (``FLICKER_WITHIN``)."""
    rivals: tuple[str, ...] = ()
    """The sensor's other process, where that explains as much."""

    @property
    def p_value(self) -> float:
        """An upper bound: at its boundary a strength gains half a chi-square with one degree of freedom."""
        return float(np.exp(-0.5 * max(self.gain, 0.0)))


def bias_strengths(model: Hypothesis, alpha: float) -> tuple[list[BiasStrength], dict[str, BiasStrength]]:
    """The processes that are named, largest gain first; and all that were tested, by id."""
    held = {term.effect.id for term in model.terms}
    # Twice the logarithm of odds of (1 - α)/α: the strength is large or not, no search to correct for.
    limit = 2.0 * float(np.log((1.0 - alpha) / alpha))
    processes = [one for one in catalogue() if isinstance(one, BiasProcess) and one.id not in held]
    applying = [one for one in processes if one.unavailable(model.context) is None]
    bounded = side_by_side(lambda effect: again(model, model.terms, bounds_without(model, effect)), applying)
    asked: dict[str, BiasStrength] = {}
    for effect, without in zip(applying, bounded, strict=True):
        # Drift and scatter can absorb each other: one that is not needed may hide the size of the other.
        beside = (other for one, other in zip(applying, bounded, strict=True) if one.sensor == effect.sensor)
        needless = [other for other in beside if other is not without and model.gain_over(other) < STRONG_SCORE]
        asked[effect.id] = _strength(model, effect, without, *needless)
    named = [one for one in asked.values() if one.score > limit and one.is_large]
    for sensor in range(2):
        both = [one for one in asked.values() if one.effect.sensor == sensor and one.is_large]
        if len(both) == 2 and not any(one in named for one in both):
            # Neither is needed beside the other: bound both; where that is unlikely the likelier one is named.
            bounds = _bounded(model.obs, model.within, {(sensor, True), (sensor, False)})
            without = again(model, model.terms, bounds)
            gain = model.gain_over(without)
            if gain > limit:
                other, likelier = sorted(both, key=lambda one: one.gain)
                named.append(replace(likelier, gain=gain, score=gain, without=without, rivals=(other.effect.id,)))
                asked[other.effect.id] = _strength(model, other.effect, other.without, likelier.without)
    return sorted(named, key=lambda one: -one.gain), asked


def noise_bounds(obs: Observations, but: Collection[BiasProcess] = ()) -> Bounds:
    """Bounds of the noise strengths that the part's own noise explains; the processes ``but`` stay unbounded."""
    free = {(one.sensor, one.walks) for one in but}
    every = {(s, walks) for s in range(2) for walks in (True, False)}
    return _bounded(obs, (*ANYTHING[:2], (1.0, 1.0)), every - free)


def bounds_without(model: Hypothesis, effect: BiasProcess) -> Bounds:
    """Bounds of the hypothesis, with the strength of ``effect`` bounded to what the part's own noise explains, that of
    a walk to what poses do not show."""
    return _bounded(model.obs, model.within, {(effect.sensor, effect.walks)}, DRIFT_CORNER_S)


def _bounded(
    obs: Observations, within: Bounds, which: Collection[tuple[int, bool]], least_s: float = NOISE_CORNER_S
) -> Bounds:
    """Bounds, those of some processes (sensor, whether it walks) replaced by what the part's own noise explains: of a
    walk a corner time of ``least_s``."""
    corner, scatter, excess = within
    # 1/f noise inside the poses explains so much; scatter below the standard error of a pose mean shows in none.
    flicker = FLICKER_WITHIN * np.array([obs.force_scatter, obs.rate_scatter]) / obs.scatter_unit()[:, 0]
    corners = [least_s if (s, True) in which else corner[s] for s in range(2)]
    scatters = [max(float(flicker[s]), 1.0) if (s, False) in which else scatter[s] for s in range(2)]
    return (corners[0], corners[1]), (scatters[0], scatters[1]), excess


def _strength(model: Hypothesis, effect: BiasProcess, without: Hypothesis, *needless: Hypothesis) -> BiasStrength:
    """One process; ``needless`` is the hypothesis without the sensor's other one, where that is as likely."""
    gain, alone = model.gain_over(without), next(iter(needless), model)
    size, std = _size(alone, effect)
    is_large = not effect.walks or _times_error(model, effect.sensor) > FLICKER_WITHIN
    parameters, statement = effect.of_strength(size, std)
    # Noise strengths are in every hypothesis, so no selection penalty applies. Each axis beyond the first is one more
    # fitted strength, with a relative uncertainty of 1/sqrt(2n), and has the penalty of a parameter.
    n_strengths = 3 if effect.sensor == 1 and not effect.walks else 1
    cost = (n_strengths - 1) * float(np.log(2.0 * max(model.obs.n_poses, 1)))
    return BiasStrength(effect, gain, gain - cost, size, std, parameters, statement, without, alone, is_large)


def _times_error(model: Hypothesis, sensor: int) -> float:
    """Rms of the bias about its mean over the poses, in standard errors of a pose mean by noise, largest axis."""
    obs, unit = model.obs, model.obs.scatter_unit()[sensor]
    if sensor and obs.segments.gyroscope_sigma_mean is not None:
        # A support that yields widens the errors of poses, and no 1/f noise.
        unit = rms_of(medians(obs.segments.gyroscope_sigma_mean))
    unit = unit * model.context.si_per_raw(sensor)
    return float(np.max(model.fitted.bias(sensor).std(axis=0) / unit)) if model.obs.n_poses else 0.0


def _size(model: Hypothesis, effect: BiasProcess) -> tuple[FloatArray, FloatArray]:
    """(3,) SI by axis, and its standard uncertainty: one sigma of a scatter, the peak-to-peak range of a drift."""
    sensor, obs = effect.sensor, model.obs
    si_per_raw = model.context.si_per_raw(sensor)
    if not effect.walks:
        # One strength of the accelerometer, of a gyro one by axis.
        scatter = model.strengths[1][1:] if sensor else model.strengths[1][:1]
        unit = obs.scatter_unit()[sensor] * si_per_raw
        size = np.array(scatter) * unit
        # A scatter far below the error of a pose is known to be below it, and no better.
        of_square = (size**2 + unit**2) * np.sqrt(2.0 / max(obs.n_poses - 1, 1))
        return size, np.sqrt(size**2 + of_square) - size
    sigma = (obs.pose_force_sigma, obs.pose_rate_sigma)[sensor]
    assert sigma is not None
    error = np.median(sigma, axis=0) * si_per_raw
    return np.ptp(model.fitted.bias(sensor), axis=0), np.asarray(np.sqrt(2.0) * error)


def explain_as_much(one: BiasStrength, model: Hypothesis, tried: Iterable[Tried]) -> list[Tried]:
    """Effects of the same sensor that explain as much as the process, with its strength bounded to the part's noise:
    odds no worse than 1 to 20, likeliest first.

    The process was selected from the catalogue like an effect, so the same selection penalty applies to it.
    """

    def acts(other: Tried) -> bool:
        columns = other.term.distortion
        return (columns.force, columns.rate)[one.effect.sensor] is not None and other.term.effect.id != one.effect.id

    least = -STRONG_SCORE - price_of_choice(model, catalogue())
    # Bounds can only lower the evidence: only candidates that are near without them are evaluated.
    near = [other for other in tried if acts(other) and other.score > least]
    asked = model.with_added([other.term for other in near], bounds_without(model, one.effect)) if near else []
    found = [
        replace(other, score=2.0 * (bounded.log_evidence - model.log_evidence) - other.term.cost, asked=bounded)
        for other, bounded in zip(near, asked, strict=True)
    ]
    return sorted((other for other in found if other.score > least), key=lambda other: -other.score)
