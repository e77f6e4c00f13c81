"""Inside the poses: spectral lines, and poses noisier than the others."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter
from scipy.special import chdtrc, gammaincc

from trihedron import _core
from trihedron.arrays import FloatArray, IntArray
from trihedron.diagnose.residuals.goodness_of_fit import CHANNELS, N_DOMAINS_TESTED
from trihedron.diagnose.session.observations import Observations
from trihedron.probability import LEAST_P
from trihedron.records.domains import DomainTest, Where

MIN_LINE_SHARE = 0.03
"""Share of the variance below which a line is ignored: long poses resolve lines far below the noise that change no
result."""
GRID = 41
"""Frequencies per refinement, from one resolution below to one above: half a lobe has ten."""
LOUD = 3.0
"""Variance of a pose over that of the others from which it disagrees, and is named: real noise is not exactly Gaussian
or white, and a pose on another support has 50 % more."""
SHORTEST = 32
"""Readings of a piece of a pose: twice as many give 33 frequencies, two windows of the median."""
ENOUGH_STRETCHES = 6
"""Fewest spectra in the average, which has a relative error of 40 % then; with fewer their length is halved."""
PARTS = 8
"""Parts of a pose; the even ones predict the odd ones and vice versa."""
STEADY = 0.3
"""Power of a line in the second halves of poses over that in the first: ringing of a support (2 to 6 Hz, over in half a
second) leaves a tenth or less in poses of 2 s."""
COHERENT = 4.0
"""Standard errors of its amplitude from which a line is coherent through the recording: by noise once in 3000."""


@dataclass(frozen=True)
class Line:
    """A spectral line of one channel (0 to 5); amplitude, ``noise`` around it and held-out rms in raw units."""

    index: int
    frequency_hz: float
    frequency_sigma_hz: float
    resolution_hz: float
    amplitude: float
    amplitude_sigma: float
    p_value: float
    noise: float
    rms_before: float
    rms_after: float

    @property
    def channel(self) -> str:
        """Name of the channel."""
        return CHANNELS[self.index]

    @property
    def share(self) -> float:
        """Variance of the line over that of the static readings."""
        return 0.5 * self.amplitude**2 / self.rms_before**2 if self.rms_before > 0.0 else 0.0

    @property
    def has_size(self) -> bool:
        """Whether its share is large enough to be reported; the domain and the effect use the same limit."""
        return self.share > MIN_LINE_SHARE


def pose_pieces(obs: Observations) -> list[tuple[int, FloatArray]]:
    """``(first sample, (n, 6 or 3) raw readings minus their mean)`` of every contiguous piece of the quiet poses."""
    x = obs.readings
    out = []
    # Lines are searched in quiet poses: vibration has a spectrum of its own.
    quiet: npt.NDArray[np.bool_] = np.asarray((pose_scatter(obs).ratio < 2.0).all(axis=1))
    if quiet.sum() < 3:
        quiet[:] = True
    for i in np.flatnonzero(quiet):
        keep = obs.segments.poses[i].samples()
        if len(keep) < SHORTEST:
            continue
        # Contiguous part only: a line keeps its phase across it.
        breaks = np.flatnonzero(np.diff(keep) > 1)
        for part in np.split(keep, breaks + 1):
            piece = x[part]
            if len(part) >= SHORTEST and np.isfinite(piece).all():
                out.append((int(part[0]), piece - piece.mean(axis=0)))
    return out


def _averaged_spectra(pieces: list[tuple[int, FloatArray]], n: int) -> tuple[FloatArray, FloatArray, IntArray]:
    """Mean periodogram (n//2+1, channels) of non-overlapping parts of n samples; the same of each part relative to its
    own variance, and their number (channels,).

    Readings that their noise does not dither change in some parts and not in others. The mean of all follows the few
    that change, whose peaks chance alone makes.
    """
    parts = [piece[k * n : (k + 1) * n] for _, piece in pieces for k in range(len(piece) // n)]
    centred = np.array(parts) - np.mean(parts, axis=1, keepdims=True)
    power = np.abs(np.fft.rfft(centred * np.hanning(n)[:, None], axis=1)) ** 2
    variance = centred.var(axis=1)
    is_live = variance > 0.0
    count = is_live.sum(axis=0)
    relative = power / np.where(is_live, variance, np.inf)[:, None]
    return power.mean(axis=0), relative.sum(axis=0) / np.maximum(count, 1), count


@lru_cache(maxsize=4)
def find_lines(obs: Observations, p_limit: float = 1e-4) -> list[Line]:
    """Lines above the smooth spectrum of the poses, at most one per channel."""
    pieces = pose_pieces(obs)
    if not pieces:
        return []
    longest = max(len(p) for _, p in pieces)
    n = 1 << int(np.log2(min(longest, 1024)))
    while n > 2 * SHORTEST and sum(len(p) // n for _, p in pieces) < ENOUGH_STRETCHES:
        n //= 2
    if sum(len(p) // n for _, p in pieces) < 3:
        return []
    spectrum, relative, counts = _averaged_spectra(pieces, n)
    rate = obs.recording.rate_hz
    out = []
    width = max(15, (n // 32) | 1)
    for c in range(spectrum.shape[1]):
        power, count = relative[:, c], int(counts[c])
        if not np.all(power[1:] > 0):
            continue
        smooth = median_filter(power, size=width, mode="mirror")
        # The median of an average of `count` exponentials sits a little below its mean.
        ratio = power / smooth * (1.0 - 1.0 / (3.0 * count))
        lowest = max(3, n // 128)
        while lowest < n // 2 - 1:
            k = lowest + int(np.argmax(ratio[lowest : n // 2 - 1]))
            # Adjacent bins of a Hann window share power: the free bins are about two thirds of all.
            p = float(min(1.0, gammaincc(count, count * ratio[k]) * (n / 2) * spectrum.shape[1]))
            if p > p_limit:
                break
            noise = np.median(spectrum[max(k - width // 2, 0) : k + width // 2 + 1, c])
            density = float(noise / (np.hanning(n) ** 2).sum())
            line = _refine(obs, pieces, c, k * rate / n, rate / n, p, density)
            if line is not None and not _dies_away(pieces, c, line.frequency_hz / rate, density):
                out.append(line)
                break
            lowest = 2 * k  # above the ringing, whose frequency differs from pose to pose
    return out


def _dies_away(pieces: list[tuple[int, FloatArray]], c: int, per_sample: float, density: float) -> bool:
    """Whether a line is ringing of the supports: strong at the start of poses and weak in their second half."""
    power = np.zeros(2)
    for _, piece in pieces:
        for k, half in enumerate(np.array_split(piece[:, c], 2)):
            window = np.hanning(len(half))
            turned = window * np.exp(-2j * np.pi * per_sample * np.arange(len(half)))
            power[k] += np.abs(np.sum(turned * (half - half.mean()))) ** 2 / np.sum(window**2) - density
    return bool(power[0] > 0.0 and power[1] < STEADY * power[0])


def _refine(
    obs: Observations,
    pieces: list[tuple[int, FloatArray]],
    c: int,
    f0: float,
    resolution: float,
    p: float,
    density: float,
) -> Line | None:
    """Frequency and amplitude by coherent least squares over all poses; half of each pose predicts the other half."""
    t = np.concatenate([obs.time_s[a : a + len(x)] for a, x in pieces])
    x = np.concatenate([part[:, c] for _, part in pieces])
    early = np.concatenate([np.arange(len(part)) < len(part) // 2 for _, part in pieces])

    span = float(t[-1] - t[0])
    # From the coarse bin to the resolution of the whole recording, in steps no wider than half a lobe.
    best_f, width = f0, resolution
    length = min(max(len(part) for _, part in pieces) / obs.recording.rate_hz, span)
    stretch = length
    while True:
        stretch = min(stretch, span)
        chosen = np.abs(t - t[len(t) // 2]) <= stretch
        if chosen.sum() < 2 * SHORTEST:
            chosen[:] = True
        grid = best_f + np.linspace(-width, width, GRID)
        power = _core.sinusoid_power(
            t[chosen], x[chosen], start_hz=float(grid[0]), step_hz=2.0 * width / (GRID - 1), count=GRID
        )
        best_f = float(grid[power.argmax()])
        width /= 6.0
        if stretch >= span:
            break
        stretch *= 3.0
    amplitude = float(np.hypot(*_sinusoid(t, x, best_f)))
    noise = float(np.sqrt(density))
    sigma = float(noise * np.sqrt(2.0 / len(t)))
    if amplitude < COHERENT * sigma:
        # Not coherent through the recording: the line is real, its amplitude is that of single poses.
        stretches = [(obs.time_s[a : a + len(part)], part[:, c]) for a, part in pieces]
        return _wandering(stretches, c, f0, resolution, p, noise)
    rest = ~early
    left = x[rest] - _basis(t[rest], best_f) @ _sinusoid(t[early], x[early], best_f)
    before, after = float(np.sqrt(np.mean(x[rest] ** 2))), float(np.sqrt(np.mean(left**2)))
    frequency_sigma = float(np.sqrt(6.0) / np.pi / span * sigma / amplitude / np.sqrt(2.0))
    return Line(c, best_f, frequency_sigma, resolution, amplitude, sigma, max(p, LEAST_P), noise, before, after)


def _wandering(
    stretches: list[tuple[FloatArray, FloatArray]], c: int, f0: float, resolution: float, p: float, noise: float
) -> Line:
    """A line whose phase is constant only within a pose: every other part of a pose predicts the parts between.

    Its amplitude is that of single poses less the contribution of noise alone (2σ²·2/n).
    """
    tried = f0 + np.linspace(-resolution, resolution, GRID)
    step = float(tried[1] - tried[0])
    power = np.zeros(GRID)
    for t, x in stretches:
        at = np.ascontiguousarray(t), np.ascontiguousarray(x)
        power += len(x) * _core.sinusoid_power(*at, start_hz=float(tried[0]), step_hz=step, count=GRID)
    f = float(tried[np.argmax(power)])
    lengths = np.array([len(x) for _, x in stretches], dtype=np.float64)
    squares = np.array([np.hypot(*_sinusoid(t, x, f)) ** 2 for t, x in stretches])
    own = np.average(squares - 4.0 * noise**2 / lengths, weights=lengths)
    amplitude = float(np.sqrt(max(own, 0.0)))
    sums, n = np.zeros(2), 0
    for t, x in stretches:
        part = (np.arange(len(x)) * PARTS // len(x)) % 2
        for kept in (0, 1):
            rest = part != kept
            left = x[rest] - _basis(t[rest], f) @ _sinusoid(t[~rest], x[~rest], f)
            sums += [float((x[rest] ** 2).sum()), float((left**2).sum())]
            n += int(rest.sum())
    before, after = np.sqrt(sums / max(n, 1))
    sigma = noise * float(np.sqrt(2.0 / lengths.sum()))
    of_frequency = float(resolution / max(np.sqrt(lengths.sum() / lengths.mean()), 1.0))
    found = (amplitude, sigma, max(p, LEAST_P), noise, float(before), float(after))
    return Line(c, f, of_frequency, resolution, *found)


def _basis(t: FloatArray, f: float) -> FloatArray:
    return np.column_stack([np.cos(2 * np.pi * f * t), np.sin(2 * np.pi * f * t)])


def _sinusoid(t: FloatArray, x: FloatArray, f: float) -> FloatArray:
    """(2,) coefficients of a sinusoid of known frequency."""
    return np.asarray(np.linalg.lstsq(_basis(t, f), x, rcond=None)[0])


@dataclass(frozen=True, eq=False)
class PoseScatter:
    """Fast scatter of every pose: ``ratio`` of its variance to the common one (poses, channels), ``dof`` (poses,)."""

    ratio: FloatArray
    dof: FloatArray
    p_value: FloatArray


@lru_cache(maxsize=4)
def pose_scatter(obs: Observations) -> PoseScatter:
    """Variance of first differences per pose over the median of all: sensitive to vibration, not to slow drift."""
    x = obs.readings
    ratio, dof = [], []
    for pose in obs.segments.poses:
        part = x[pose.start : pose.stop]
        steps = np.diff(part, axis=0)
        own = np.var(steps, axis=0)
        ratio.append(np.nanvar(steps, axis=0) if np.isnan(own).any() else own)
        # Neighbouring differences share a sample: two thirds as many are independent.
        dof.append((len(part) - 1) * 2.0 / 3.0)
    variance, freedom = np.array(ratio), np.array(dof)
    # Readings that toggle between two neighbouring codes scatter by up to half an LSB squared without any vibration.
    centre = np.maximum(np.median(variance, axis=0), 0.5 * obs.recording.facts.steps[: x.shape[1]] ** 2)
    centre[centre == 0] = 1.0
    relative = variance / centre
    return PoseScatter(relative, freedom, np.asarray(chdtrc(freedom[:, None], freedom[:, None] * relative)))


def loud_poses(obs: Observations) -> FloatArray:
    """(poses, channels) p-values of poses that are louder than usual, times the number of looks; 1 for the others.

    A pose already marked as vibrating is weighted by its own scatter: it is no disagreement.
    """
    scatter = pose_scatter(obs)
    steady = np.array([not pose.is_unsteady for pose in obs.segments.poses])
    is_loud = steady[:, None] & (scatter.ratio > LOUD)
    return np.where(is_loud, np.minimum(scatter.p_value * scatter.p_value.size, 1.0), 1.0)


def judge_within_poses(obs: Observations, alpha: float) -> DomainTest:
    """Lines and noisy poses, as one domain; the p-value is the smallest, corrected for the number of tests."""
    scatter, loud = pose_scatter(obs), loud_poses(obs)
    p_scatter = float(loud.min(initial=1.0))
    steady = np.array([not pose.is_unsteady for pose in obs.segments.poses])
    lines = [line for line in find_lines(obs) if line.has_size]
    p_line = min((line.p_value for line in lines), default=1.0)
    p = min(1.0, 2.0 * min(p_scatter, p_line))
    dof = float(scatter.dof.sum() * scatter.ratio.shape[1])
    weight = scatter.dof * steady if steady.any() else scatter.dof
    chi2_per_dof = float(np.average(scatter.ratio, axis=0, weights=weight).mean())
    disagrees = p < alpha / N_DOMAINS_TESTED
    where = Where()
    if disagrees:
        poses = np.flatnonzero(loud.min(axis=1) < alpha)[:8]
        t = obs.time_s
        spans = tuple((float(t[obs.segments.poses[i].start]), float(t[obs.segments.poses[i].stop - 1])) for i in poses)
        strong = [line for line in lines if line.p_value < alpha]
        loud_channels = [CHANNELS[c] for c in np.flatnonzero(loud.min(axis=0) < alpha)]
        channels = tuple(dict.fromkeys([line.channel for line in strong] + loud_channels))
        where = Where(channels, obs.pose_names(poses), spans, tuple(line.frequency_hz for line in strong))
    return DomainTest("within-static", chi2_per_dof, dof, p, disagrees, where, 0.0, "")
