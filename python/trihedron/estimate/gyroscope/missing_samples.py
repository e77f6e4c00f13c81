"""Samples lost without a trace in the timestamps: the turns they take away, as the motion on either side shows them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.probability import bdtrc
from trihedron.ranges import rows_beside
from trihedron.records import Finding, FindingCode, Recording, Segments, Severity

HALF_WINDOW = 4
"""Samples on either side through which one curve is laid: 80 ms of a 100 Hz log, less than a tremor's period."""
COEFFICIENTS = 6
"""Of that curve, a quintic: two numbers a channel are left to contradict it."""
SHARP = 40.0
"""What one lost sample would add to χ² of the joint, in that of an ordinary joint nearby, from where a step counts."""
PART = (0.5, 2.0)
"""Of that, what is gained by a sample put between: a jolt gains otherwise."""
WHOLE = (0.6, 1.5)
"""Extra time, in steps, of a step that is one sample off; a step that is one too short is the measure of jolts."""
STILL_ORDINARY = 3.0
"""What may be left with the sample put between, in ordinary joints."""
MIRRORED = 0.2
"""And of a step that falls short, as a part of what there was."""
NEARBY = 65
"""Steps over which an ordinary joint is the median: losses of 3 % touch a quarter of all windows of eight."""
FEWEST = 4
CHANCE = 1e-3
"""Long steps, and chance of so many more of them than of short ones, below which nothing is said. 14 real sessions
show 0 to 7 long steps, 0 to 4 short ones; healthy sessions of two generators 0 to 2 of up to 50 000. None is named."""
FALSE_SHARE = 5e-4
"""Share of long steps that knocks upon brisk motion leave (18 in 38 000 of a filtered noise with knocks)."""
SERIOUS_SHARE = 0.002
"""Share of turning steps lost above which a scale factor, short by as much, exceeds an uncertainty of usual size."""


def missing_samples(recording: Recording, segments: Segments, sigma_scale: float = SERIOUS_SHARE) -> list[Finding]:
    """A finding where steps of a move are longer than the motion around them by whole samples, far oftener than
    shorter.

    One quintic is laid through four samples on either side of a step, in all channels at once, as they stand and with
    one sample put between (docs/diagnosis-method.md, 8.16 with one count): a step is long if that joins them, by as
    much as the motion's slope says. Steps that are as much too short are jolts, and so are as many of the long ones;
    the rest was lost: each takes the angle of one step from its turn. ``sigma_scale`` is the relative standard error
    of the gyro's scale: a share beyond it is serious.
    """
    gyroscope = recording.gyroscope
    if gyroscope is None or segments.gyroscope_sigma is None or not segments.moves:
        return []
    triads, noise = [gyroscope], [_positive(segments.gyroscope_sigma)]
    if recording.accelerometer is not None and segments.accelerometer_sigma is not None:
        triads.append(recording.accelerometer)
        noise.append(_positive(segments.accelerometer_sigma))
    ends = recording.n_samples - HALF_WINDOW - 1
    inner = np.array([(max(move.start, HALF_WINDOW), min(move.stop, ends)) for move in segments.moves], dtype=np.int64)
    inner = inner[inner[:, 1] - inner[:, 0] >= 2 * HALF_WINDOW]
    if not len(inner):
        return []
    rows, inner = rows_beside(inner, HALF_WINDOW + 1, recording.n_samples)
    readings, time_s = np.concatenate([triad[rows] for triad in triads], axis=1), recording.time_s[rows]
    step_s = 1.0 / recording.rate_hz
    # A step that the timestamps show to be long is a gap, known and reported; no curve is laid across it.
    is_gap = ~(np.abs(np.diff(time_s) - step_s) < 0.4 * step_s)
    is_missing: BoolArray = ~np.all(np.isfinite(readings), axis=1)
    is_gap |= is_missing[1:] | is_missing[:-1]
    is_cut = np.convolve(is_gap, np.ones(2 * HALF_WINDOW + 1), mode="same") > 0.5
    found = _steps(readings, np.concatenate(noise), inner)
    step = np.concatenate([np.arange(first, last) for first, last in inner])
    is_known = ~is_cut[step]
    n = int(np.count_nonzero(found.is_sharp & is_known))
    n_short = int(np.count_nonzero(found.is_short & is_known))
    at = step[found.is_long & is_known]
    n_long = len(at)
    if n_long < FEWEST or float(bdtrc(n_long - 1, n_long + n_short, 0.5)) > CHANCE:
        return []
    share, error = (n_long - n_short) / n, float(np.sqrt(n_long + n_short)) / n
    if share < FALSE_SHARE:
        return []
    first_s = float(time_s[at[0]])
    return [
        Finding.of(
            FindingCode.SAMPLES_LOST,
            "seen-in-motion",
            severity=Severity.SERIOUS if share > min(SERIOUS_SHARE, sigma_scale) else Severity.WARNING,
            long_steps=n_long,
            short_steps=n_short,
            steps=n,
            lost_share=share,
            sigma_lost_share=error,
            first_s=first_s,
        )
    ]


def unless_seen(of_fit: tuple[Finding, ...], seen: tuple[Finding, ...]) -> tuple[Finding, ...]:
    """Findings of a fit; losses that were seen leave none to be guessed."""
    is_seen = any(finding.code is FindingCode.SAMPLES_LOST for finding in seen)
    return tuple(one for one in of_fit if not (is_seen and one.code is FindingCode.SAMPLES_LOST))


def _positive(sigma: FloatArray) -> FloatArray:
    """Noise (3,) without zeros: a channel whose codes hide its noise weighs as the noisiest other one."""
    sigma = np.asarray(sigma, dtype=np.float64)
    return np.where(sigma > 0.0, sigma, max(float(sigma.max()), 1e-300))


@dataclass(frozen=True, eq=False)
class _Steps:
    """Of the steps of moves: which would show a lost sample, which are one sample too long, which too short."""

    is_sharp: BoolArray
    is_long: BoolArray
    is_short: BoolArray


def _contrasts(missing: int) -> FloatArray:
    """(2, 8) what no quintic through four samples on either side joins, those after it moved by ``missing`` steps."""
    offsets = np.r_[np.arange(-HALF_WINDOW, 0) + 0.5, np.arange(HALF_WINDOW) + 0.5 + missing] / HALF_WINDOW
    q, _ = np.linalg.qr(np.vander(offsets - offsets.mean(), COEFFICIENTS), mode="complete")
    return q[:, COEFFICIENTS:].T


CONTRASTS = np.array([_contrasts(missing) for missing in (0, 1, -1)])
"""As the readings stand, with one sample put between, and with one taken out."""


def _steps(readings: FloatArray, noise: FloatArray, moves: IntArray) -> _Steps:
    """The steps behind the samples of ``moves``, one after the other; ``noise`` (c,) of the channels.

    A short step is also one whose jump falls short of the slope beside it, the mirror image of a long one: a bend is as
    often the one as the other.
    """
    flags = _core.motion_joints(
        readings,
        noise,
        moves,
        CONTRASTS,
        nearby=NEARBY,
        sharp=SHARP,
        part=PART,
        whole=WHOLE,
        left=(STILL_ORDINARY, MIRRORED),
    )
    return _Steps(*flags)
