"""Inside the poses: spectral lines, poses noisier than the others, and noise of another level for a while
(eq. 8.7g): one level in consecutive poses, against one of each pose."""

from dataclasses import dataclass
from functools import lru_cache

import numpy as np
from scipy.special import chdtrc

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray
from trihedron.diagnose.residuals.goodness_of_fit import CHANNELS, N_DOMAINS_TESTED
from trihedron.diagnose.session.observations import LOUD, Observations
from trihedron.probability import CLEAR, LEAST_P, RARE_ALARM
from trihedron.records.domains import DomainTest, Where
from trihedron.session.noise import FEWEST_POSES, FEWEST_READINGS
from trihedron.session.rounding import TWO_CODES

MIN_LINE_SHARE = 0.03
"""Share of the variance below which a line is ignored: long poses resolve lines far below the noise that change no
result."""
TESTS = ("lines", "noisy poses", "changes of noise")
"""They share the false-alarm rate of their domain."""


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
    quiet: BoolArray = np.asarray((pose_scatter(obs).ratio < 2.0).all(axis=1))
    if quiet.sum() < 3:
        quiet[:] = True
    for i in np.flatnonzero(quiet):
        # Contiguous parts: a line keeps its phase across each.
        for start, stop in obs.segments.poses[i].undisturbed():
            piece = x[start:stop]
            if stop - start >= FEWEST_READINGS and np.isfinite(piece).all():
                out.append((start, piece - piece.mean(axis=0)))
    return out


@lru_cache(maxsize=4)
def find_lines(obs: Observations, p_limit: float = RARE_ALARM) -> list[Line]:
    """Lines above the smooth spectrum of the poses, at most one per channel."""
    pieces = pose_pieces(obs)
    times = [obs.time_s[a : a + len(piece)] for a, piece in pieces]
    found = _core.session_lines(times, [piece for _, piece in pieces], obs.recording.rate_hz, p_limit)
    return [
        Line(channel, *frequency, *amplitude, max(p, LEAST_P), noise, *rms)
        for channel, frequency, amplitude, p, noise, rms in found
    ]


@dataclass(frozen=True, eq=False)
class PoseScatter:
    """Fast scatter of every pose: ``ratio`` of its variance to the common one (poses, channels), ``dof`` (poses,), and
    whether it is ``steady`` (poses,): one already marked as vibrating is weighted by its own scatter, and is no
    disagreement."""

    ratio: FloatArray
    dof: FloatArray
    steady: BoolArray
    p_value: FloatArray


@lru_cache(maxsize=4)
def pose_scatter(obs: Observations) -> PoseScatter:
    """Variance of first differences per pose over the median of all: sensitive to vibration, not to slow drift."""
    x, found = obs.readings, []
    for start, stop in obs.segments.spans:
        steps = np.diff(x[start:stop], axis=0)
        own = np.var(steps, axis=0)
        found.append(np.nanvar(steps, axis=0) if np.isnan(own).any() else own)
    # Neighbouring differences share a sample: two thirds as many are independent.
    variance, freedom = np.array(found), (np.diff(obs.segments.spans, axis=1)[:, 0] - 1) * 2.0 / 3.0
    # Readings that toggle between two neighbouring codes scatter by up to half an LSB squared without any vibration.
    centre = np.maximum(np.median(variance, axis=0), 0.5 * obs.recording.facts.steps[: x.shape[1]] ** 2)
    centre[centre == 0] = 1.0
    relative = variance / centre
    steady = np.array([not pose.is_unsteady for pose in obs.segments.poses])
    p_value = np.asarray(chdtrc(freedom[:, None], freedom[:, None] * relative))
    return PoseScatter(relative, freedom, steady, p_value)


@dataclass(frozen=True, eq=False)
class NoiseChange:
    """Noise of one sensor (0 accelerometer, 1 gyro) in poses ``first`` to ``last`` over that of the others.

    ``axes`` are those tested, ``ratio`` of the standard deviations with ``sigma``; ``score`` is twice the
    log-likelihood gained, less its penalty; ``share`` is that of the excess in the variance of all poses.
    """

    sensor: int
    first: int
    last: int
    axes: list[int]
    ratio: list[float]
    sigma: list[float]
    score: float
    share: float

    @property
    def changed(self) -> list[int]:
        """Places in ``axes`` of those whose noise differs."""
        return [k for k, ratio in enumerate(self.ratio) if abs(ratio - 1.0) > CLEAR * self.sigma[k]]

    @property
    def channels(self) -> list[str]:
        """Channels whose noise differs."""
        return [CHANNELS[3 * self.sensor + self.axes[k]] for k in self.changed]


@lru_cache(maxsize=4)
def noise_changes(obs: Observations) -> tuple[NoiseChange, ...]:
    """The interval of poses of each sensor whose noise differs most clearly from that of all others, if one does."""
    found = (_change(obs, sensor) for sensor in range(obs.readings.shape[1] // 3))
    return tuple(one for one in found if one is not None and one.score > 0.0)


def _change(obs: Observations, sensor: int) -> NoiseChange | None:
    readings = (obs.raw_force, obs.raw_rate)[sensor]
    assert readings is not None
    least = np.sqrt(TWO_CODES) * obs.recording.facts.steps[3 * sensor : 3 * sensor + 3]
    parts = [(i, *span) for i, pose in enumerate(obs.segments.poses) for span in pose.undisturbed()]
    owner, *spans = np.array(parts, dtype=np.int64).reshape(-1, 3).T
    moves = np.array(obs.move_ranges, dtype=np.int64).reshape(-1, 2), obs.move_poses
    poses = np.stack(spans, axis=1), owner, obs.n_poses
    found = _core.noise_change(readings, least.tolist(), poses, moves, FEWEST_POSES)
    return None if found is None else NoiseChange(sensor, *found)


def loud_poses(obs: Observations) -> FloatArray:
    """(poses, channels) p-values of poses that are louder than usual, times the number of looks; 1 for the others."""
    scatter = pose_scatter(obs)
    is_loud = scatter.steady[:, None] & (scatter.ratio > LOUD)
    return np.where(is_loud, np.minimum(scatter.p_value * scatter.p_value.size, 1.0), 1.0)


def within_limit(alpha: float) -> float:
    """Score (twice a log-likelihood) above which one of the tests disagrees."""
    return float(-2.0 * np.log(alpha / (len(TESTS) * N_DOMAINS_TESTED)))


def judge_within_poses(obs: Observations, alpha: float) -> DomainTest:
    """Lines, noisy poses and changes of noise, as one domain; the p-value is the smallest, corrected for the number of
    tests."""
    scatter, loud = pose_scatter(obs), loud_poses(obs)
    p_scatter = float(loud.min(initial=1.0))
    lines = [line for line in find_lines(obs) if line.has_size]
    p_line = min((line.p_value for line in lines), default=1.0)
    changes = {one: float(np.exp(-0.5 * one.score)) for one in noise_changes(obs)}
    p = min(1.0, len(TESTS) * min(p_scatter, p_line, *changes.values()))
    dof = float(scatter.dof.sum() * scatter.ratio.shape[1])
    weight = scatter.dof * scatter.steady if scatter.steady.any() else scatter.dof
    chi2_per_dof = float(np.average(scatter.ratio, axis=0, weights=weight).mean())
    disagrees = p < alpha / N_DOMAINS_TESTED
    where = Where()
    if disagrees:
        clear = [one for one, p_change in changes.items() if p_change < alpha]
        changed = {pose for one in clear for pose in range(one.first, one.last + 1)}
        poses = sorted({*np.flatnonzero(loud.min(axis=1) < alpha).tolist()[:8], *changed})
        strong = [line for line in lines if line.p_value < alpha]
        frequencies = tuple(line.frequency_hz for line in strong)
        loud_channels = [CHANNELS[c] for c in np.flatnonzero(loud.min(axis=0) < alpha)]
        changed_channels = [channel for one in clear for channel in one.channels]
        channels = tuple(dict.fromkeys([*(line.channel for line in strong), *loud_channels, *changed_channels]))
        where = Where(channels, obs.pose_names(poses), obs.times(obs.segments.spans[poses]), frequencies)
    return DomainTest("within-static", chi2_per_dof, dof, p, disagrees, where, 0.0, "")
