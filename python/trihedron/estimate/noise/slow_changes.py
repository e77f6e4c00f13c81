"""Slow changes of a static log that are not noise: a warm-up or a step of a bias, a wave, what temperature explains."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass
from functools import cached_property
from itertools import islice, pairwise

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, FloatArray
from trihedron.estimate.noise import gaps
from trihedron.estimate.noise.screening import Event
from trihedron.estimate.noise.spectrum import gauss_markov_density, unit_densities
from trihedron.session.drift import LEAST_SWING_K
from trihedron.transforms import cosine_transform

MEANS = 256
"""Number of means of equal length in which slow changes are sought."""
MEANS_OF_HEAT = 64
"""Number of means that are compared with the temperature: their noise is hardly white."""
SHORTEST = 4
"""Fewest means between two breaks, or steps."""
HELD = 0.5
"""Least share of them with readings."""
CORRELATION = (2.0, 4.0, 8.0, 16.0, 32.0, 64.0)
"""Correlation times, in means, of the Gauss-Markov processes that are tried beside white noise, flicker and a walk."""
TIMES = np.geomspace(0.005, 0.5, 15)
"""Time constants that are tried, in lengths of the log: a slower warm-up is like a straight line or a walk."""
CYCLES = np.arange(1.0, 16.1, 0.125)
"""Periods in the log that are tried: less than one is drift, more is a line of the spectrum."""
EXPONENTIAL, WAVE, STEP = KINDS = range(3)
TRIED = (TIMES, 1.0 / CYCLES, np.arange(SHORTEST, MEANS - SHORTEST + 1) / MEANS)
"""Time constants, periods and instants that are tried, in lengths of the log."""
SIZES = (1, 2, 1)
"""Number of sizes of a change of each kind."""
PARAMETERS = (2, 3, 4)
"""Size and time of an exponential; amplitude, phase and period of a wave; size of a step and its instant, which fits
chance as three parameters do, because the likelihood has no curvature along it (Ninomiya 2005)."""
MOST = 4
"""Most changes of one log: sums of more exponentials cannot be told apart."""
PLAUSIBLE = float(np.log(MEANS))
"""Least rise of twice the log-likelihood per parameter of a change for which intervals allow: with more it is as likely
as none (Schwarz)."""
EARNED = 10.0
"""Least rise per parameter of a change that is stated and subtracted. Chance reaches it in 1e-5 of logs of white noise,
1e-4 of Gauss-Markov noise, 4e-4 of flicker, 2e-3 of a walk (benches/static_screening.py)."""
NOTHING = 1e-6
"""Share of the largest column that rounding leaves of one which is a sum of others."""
CONVERGED = 0.1
"""Decrease of the deviance below which the times of changes are as likely as can be."""
MOSTLY = 0.5
"""Share of a random walk's power beyond which temperature, not noise, is the larger part of it. Of 6000 axes of white
noise, flicker, walk or ramp beside an independent temperature (walk, cycle or cooling) none reaches 0.41."""


@dataclass(frozen=True)
class SlowChange:
    """A change by ``weights`` of exp(-t/T), of cosine and sine of period T, or of a step at T, ``time_s``."""

    time_s: float
    weights: tuple[float, ...]
    kind: int

    @property
    def size(self) -> float:
        """Amplitude; of a step with its sign."""
        return self.weights[0] if self.kind == STEP else float(np.linalg.norm(self.weights))

    def at(self, t: FloatArray) -> FloatArray:
        """(n,) its value at times (n,) [s] after the first reading."""
        return np.asarray(self.weights @ _shape(t, self.time_s, self.kind))

    def columns(self, t: FloatArray) -> FloatArray:
        """(2 or 4, n) what an error of its weights and of its time adds at times (n,) [s]; not of a step."""
        shape = _shape(t, self.time_s, self.kind)
        return np.vstack([shape, t / self.time_s * shape])


def _shape(t: FloatArray, time: float, kind: int) -> FloatArray:
    """(1, n) exponential or step, or (2, n) cosine and sine, at times (n,)."""
    if kind == STEP:
        return np.asarray(t > time, dtype=np.float64)[np.newaxis]
    phase = t / time
    if kind == WAVE:
        return np.stack([np.cos(2.0 * np.pi * phase), np.sin(2.0 * np.pi * phase)])
    return np.exp(-phase)[np.newaxis]


def slow_changes(x: FloatArray, rate_hz: float, breaks: Sequence[float] = ()) -> list[Sequence[SlowChange]]:
    """Exponentials, waves and steps in readings ``x`` (n,), NaN where missing, that no Gaussian noise explains as well,
    beside a straight line and a level on each side of the ``breaks`` (numbers of readings): those that are stated and,
    where more are as likely as not, all of these.

    They are added one by one, each time the one that raises the likelihood most, with all their times fitted anew.
    """
    means = block_means(x, breaks=breaks)
    if means is None:
        return [()]
    found = [means.beside(())]
    while len(found) <= MOST:
        more = [means.with_one_more(found[-1], kind) for kind in KINDS]
        # Times between those that are tried raise a likelihood that is high at one of these.
        worth = [one for one in more if one.cost(0.5 * PLAUSIBLE) < found[-1].cost(0.5 * PLAUSIBLE)]
        best = min([found[-1], *map(means.refined, worth)], key=lambda one: one.cost(PLAUSIBLE))
        if best is found[-1]:
            break
        found.append(best)
    duration_s = len(x) / rate_hz
    stated = min(found, key=lambda one: one.cost(EARNED))
    # A step is stated or absent: below its price the increments of a walk are as likely.
    plausible = [one for one in found if one.n_steps == stated.n_steps][-1]
    return [one.changes(duration_s) for one in ((stated,) if stated is plausible else (stated, plausible))]


def without(x: FloatArray, changes: Sequence[SlowChange], rate_hz: float) -> FloatArray:
    """(n,) readings ``x`` (n,) less the ``changes``, steps excepted: a level on each side is free."""
    t = np.arange(len(x)) / rate_hz
    return x - sum((one.at(t) for one in changes if one.kind != STEP), np.zeros(len(x))) if changes else x


def steps_of(changes: Sequence[SlowChange], n: int, rate_hz: float) -> list[Event]:
    """Steps among the ``changes`` of ``n`` readings, each known to a mean."""
    out, half = [], 0.5 * n / MEANS
    for one in changes:
        if one.kind == STEP:
            middle = one.time_s * rate_hz
            out.append(Event(int(middle - half), int(middle + half) + 1, one.size))
    return out


Time = tuple[float, int]
"""Time constant, period or instant, in lengths of the log, and its kind."""


def _are_apart(times: Sequence[Time]) -> bool:
    """Whether time constants differ by as much as those tried, waves by a period in the log, its resolution, and steps
    by some means: nearer ones have sizes of any amount, and opposite."""
    constants, periods, instants = (sorted(time for time, of in times if of == kind) for kind in KINDS)
    return (
        all(later >= TIMES[1] / TIMES[0] * time for time, later in pairwise(constants))
        and all(1.0 / shorter >= 1.0 + 1.0 / period for shorter, period in pairwise(periods))
        and all(later >= time + SHORTEST / MEANS for time, later in pairwise(instants))
    )


@dataclass(frozen=True, eq=False)
class Beside:
    """Changes of these ``times`` beside the most likely noise: ``deviance``, ``sizes`` of a line and of the changes,
    standard deviation ``sigma`` (m,) of every coefficient."""

    times: tuple[Time, ...]
    deviance: float
    sizes: FloatArray
    sigma: FloatArray

    def cost(self, price: float) -> float:
        """Deviance with ``price`` for every parameter."""
        return self.deviance + price * sum(PARAMETERS[kind] for _, kind in self.times)

    @property
    def n_steps(self) -> int:
        """Number of steps among the changes."""
        return sum(kind == STEP for _, kind in self.times)

    def changes(self, duration_s: float) -> list[SlowChange]:
        """The changes of a log of ``duration_s``."""
        sizes = iter(self.sizes[1:].tolist())
        return [SlowChange(time * duration_s, tuple(islice(sizes, SIZES[kind])), kind) for time, kind in self.times]


@dataclass(frozen=True, eq=False)
class Means:
    """Means ``y`` (k,) of ``block`` readings, their times ``t`` (k,) in lengths of the log, and the ``runs`` of them
    without a hole or a break, of which the share ``bridged`` is."""

    y: FloatArray
    t: FloatArray
    block: int
    runs: tuple[tuple[int, int], ...]
    bridged: tuple[float, ...]

    def transformed(self, values: FloatArray) -> FloatArray:
        """(..., m) cosine coefficients of ``values`` (..., k) in every run, without its level."""
        return np.concatenate([cosine_transform(values[..., a:b])[..., 1:] for a, b in self.runs], axis=-1)

    @cached_property
    def coefficients(self) -> FloatArray:
        """(m,) those of the means; bridged means contain no white noise."""
        scale = np.repeat([1.0 / np.sqrt(1.0 - share) for share in self.bridged], [b - a - 1 for a, b in self.runs])
        return np.asarray(scale * self.transformed(self.y))

    @cached_property
    def noises(self) -> list[FloatArray]:
        """Expected squares (terms, m) of N, B and K, alone and with each Gauss-Markov process."""
        parts = []
        for a, b in self.runs:
            order, n = np.arange(1, b - a), b - a
            frequency = order / (2.0 * n)
            processes = [gauss_markov_density(frequency, 1.0, time) for time in CORRELATION]
            parts.append(np.vstack([unit_densities(frequency, order, n, 1.0, self.block)[1:], *processes]))
        whole = np.concatenate(parts, axis=1)
        return [whole[:3], *(np.vstack([whole[:3], row]) for row in whole[3:])]

    def likely(self, columns: FloatArray, noise: FloatArray) -> _core.SpectralFit:
        """The most likely strengths of a ``noise`` (terms, m) beside the coefficients ``columns`` (c, m)."""
        c, X = self.coefficients, columns
        likelihood = _core.SpectralBins(np.ones(len(c)), c**2, c * X, X[:, np.newaxis] * X, noise)
        return likelihood.fit(range(len(noise)))

    def beside(self, times: Sequence[Time]) -> Beside:
        """Changes of these ``times`` beside the noise that is most likely then."""
        # Two exponentials of nearly one time are told apart by their difference.
        across, size = np.linalg.qr(self.columns(times).T)
        fits = [(self.likely(across.T, noise), noise) for noise in self.noises]
        fit, noise = min(fits, key=lambda one: one[0].deviance - one[0].log_determinant)
        sizes = np.linalg.lstsq(size, np.asarray(fit.columns), rcond=None)[0]
        deviance, sigma = fit.deviance - fit.log_determinant, np.sqrt(np.asarray(fit.strength) @ noise)
        return Beside(tuple(times), deviance, sizes, sigma)

    def columns(self, times: Sequence[Time]) -> FloatArray:
        """(c, m) coefficients of a line and of changes of these ``times``."""
        return self.transformed(np.vstack([self.t, *(self.shape(*time) for time in times)]))

    def shape(self, time: float, kind: int) -> FloatArray:
        """(1 or 2, k) means of an exponential, a wave or a step at ``time`` lengths."""
        # The mean of a curve over a part is not its middle.
        if kind == STEP:
            return np.clip((self.t - time) * MEANS + 0.5, 0.0, 1.0)[np.newaxis]
        half = 0.5 / (MEANS * time)
        mean = np.sinc(2.0 * half) if kind == WAVE else np.sinh(half) / half
        return np.asarray(mean * _shape(self.t, time, kind))

    @cached_property
    def tried(self) -> list[FloatArray]:
        """(times, sizes, m) coefficients of the changes of each kind that are tried."""
        return [self.transformed(np.stack([self.shape(time, kind) for time in TRIED[kind]])) for kind in KINDS]

    def with_one_more(self, known: Beside, kind: int) -> Beside:
        """The ``known`` changes and one more, the best of those tried beside the noise as it was."""
        across = np.linalg.qr((self.columns(known.times) / known.sigma).T)[0]
        tried = self.tried[kind] / known.sigma
        largest = np.linalg.norm(tried, axis=2).max()
        tried, left = np.linalg.qr(np.swapaxes(tried - tried @ across @ across.T, 1, 2))
        # A step at a break of the log, where either side has its own level, changes nothing.
        is_seen = np.abs(np.diagonal(left, axis1=1, axis2=2)).min(axis=1) > NOTHING * largest
        gain = is_seen * np.sum((self.coefficients / known.sigma @ tried) ** 2, axis=1)
        more = [[*known.times, (float(time), kind)] for time in TRIED[kind]]
        return self.beside(more[int(np.argmax(gain * [_are_apart(times) for times in more]))])

    def refined(self, found: Beside) -> Beside:
        """The changes ``found`` with times and noise fitted in turn while the deviance falls."""
        while True:
            better = self.beside(self._times(found))
            if better.deviance > found.deviance - CONVERGED:
                return min(better, found, key=lambda one: one.deviance)
            found = better

    def _times(self, found: Beside) -> list[Time]:
        """The most likely times near those ``found``, beside its noise."""
        # Imported here: commands that read a log start faster.
        from scipy.optimize import Bounds, minimize

        kinds = [kind for _, kind in found.times]
        beyond = np.where(np.equal(kinds, STEP), 0.0, 0.1)
        least = np.log([min(TRIED[kind]) for kind in kinds]) - beyond
        most = np.log([max(TRIED[kind]) for kind in kinds]) + beyond
        # Steps as those between the times that are tried.
        start = np.log([time for time, _ in found.times]).clip(least, most)
        step = np.where(np.equal(kinds, STEP), 0.5 / MEANS * np.exp(-start), np.array([0.3, 0.01, 0.0])[kinds])
        simplex = np.vstack([start, start + np.diag(np.where(start + step < most, step, -step))])

        def times(logs: FloatArray) -> list[Time]:
            return list(zip(np.exp(logs).tolist(), kinds, strict=True))

        def deviance(logs: FloatArray) -> float:
            if not _are_apart(times(logs)):
                return 0.0
            across = np.linalg.qr((self.columns(times(logs)) / found.sigma).T)[0]
            return -float(np.sum((self.coefficients / found.sigma @ across) ** 2))

        best = minimize(
            deviance,
            start,
            method="Nelder-Mead",
            bounds=Bounds(least, most),
            options={"initial_simplex": simplex, "xatol": 1e-4, "fatol": 1e-2},
        )
        return times(best.x)


def share_of_temperature(x: FloatArray, temperature: FloatArray, breaks: Sequence[float] = ()) -> float:
    """Share of the power of slow changes of readings ``x`` (n,) that ``temperature`` (n,) explains, beside a straight
    line and a level on each side of the ``breaks`` (numbers of readings); 0 where the temperature does not change."""
    there = np.flatnonzero(np.isfinite(x))
    inside = slice(there[0], there[-1] + 1) if len(there) else slice(0)
    means = block_means(x[inside], MEANS_OF_HEAT, [at - inside.start for at in breaks])
    if means is None:
        return 0.0
    n = len(x[inside])
    heat = np.interp(means.t * n, np.arange(n) + 0.5, temperature[inside])
    swing = float(np.ptp(heat))
    if swing < LEAST_SWING_K:
        return 0.0
    u, line = (heat - heat.mean()) / swing, means.t[np.newaxis]
    # In the noise that is most likely without it, whose whitened readings have the walk's increments.
    fit = means.likely(means.transformed(line), means.noises[0])
    sigma = np.sqrt(np.asarray(fit.strength) @ means.noises[0])
    power = []
    for columns in (line, np.vstack([line, u, u**2, u**3])):
        white, y = (means.transformed(columns) / sigma).T, means.coefficients / sigma
        left = y - white @ np.linalg.lstsq(white, y, rcond=None)[0]
        power.append(float(left @ left))
    return 1.0 - power[1] / max(power[0], TINY)


def block_means(x: FloatArray, number: int = MEANS, breaks: Sequence[float] = ()) -> Means | None:
    """Means of ``number`` equal parts of readings ``x`` (n,) between the ``breaks``; ``None`` where half of them have
    too few readings, or none differs."""
    block = len(x) // number
    if block < 1:
        return None
    found = []
    for start, stop in pairwise([0, *(round(at) for at in sorted(breaks)), len(x)]):
        runs = gaps.block_means(x[start:stop], block)
        found += [(start / block + run.first, run) for run in runs if len(run.means) >= SHORTEST]
    ends = np.cumsum([0, *(len(run.means) for _, run in found)]).tolist()
    if ends[-1] < HELD * number:
        return None
    y, bridged = np.concatenate([run.means for _, run in found]), tuple(run.bridged for _, run in found)
    if not np.ptp(y) > 0.0:
        return None
    t = [(first + np.arange(len(run.means)) + 0.5) * block / len(x) for first, run in found]
    return Means(y, np.concatenate(t), block, tuple(pairwise(ends)), bridged)
