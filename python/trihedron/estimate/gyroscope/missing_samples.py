"""Lost samples that the timestamps do not show, detected by the motion on either side of each step."""

import numpy as np

from trihedron import _core
from trihedron.arrays import BoolArray, FloatArray, IntArray
from trihedron.probability import bdtrc
from trihedron.ranges import rows_beside
from trihedron.records import Finding, FindingCode, Recording, Segments, Severity

HALF_WINDOW = 4
"""Samples on either side of a step for the curve fit: 80 ms of a 100 Hz log, less than a tremor's period."""
COEFFICIENTS = 6
"""Coefficients of the curve, a quintic: two degrees of freedom per channel remain for its misfit."""
SHARP = 40.0
"""Misfit χ² that one lost sample would cause, in units of the median misfit nearby, above which a step is tested."""
PART = (0.5, 2.0)
"""Range of the reduction of χ² by an inserted sample, relative to that expected of a loss: a jolt is outside."""
WHOLE = (0.6, 1.5)
"""Range of the time error, in steps, of a step that is too short by one sample; such steps are due to jolts."""
STILL_ORDINARY = 3.0
"""Largest χ² left with the sample inserted, in units of the median misfit nearby."""
MIRRORED = 0.2
"""For a step that is too short: largest χ² left, as a fraction of that before."""
NEARBY = 65
"""Steps over which the median misfit is taken: losses of 3 % affect a quarter of all windows of eight samples."""
FEWEST = 4
CHANCE = 1e-3
"""A finding needs this many long steps, and at most this probability of so many more long than short steps. 14 real
sessions have 0 to 7 long steps, 0 to 4 short ones; healthy sessions of two generators 0 to 2 of up to 50 000: none has
a finding."""
FALSE_SHARE = 5e-4
"""Share of long steps that impacts during brisk motion cause (18 in 38 000 of filtered noise with impacts)."""
SERIOUS_SHARE = 0.002
"""Share of lost samples above which the scale factor, too small by that share, exceeds its usual uncertainty."""


def missing_samples(recording: Recording, segments: Segments, sigma_scale: float = SERIOUS_SHARE) -> list[Finding]:
    """Finding where far more steps of the moves are one sample too long for the motion around them than too short.

    A quintic is fitted to four samples on either side of a step, in all channels, as logged and with one sample
    inserted (docs/diagnosis-method.md, 8.16 with one count): a step is long if the insertion removes the misfit, by the
    amount that the motion's slope predicts. Steps that are too short are jolts, and an equal number of the long ones
    is; the others are losses, each of which removes the angle of one step from its rotation. A share of losses above
    ``sigma_scale``, the relative standard uncertainty of the gyro's scale, is serious.
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
    # A step that is long by the timestamps is a gap, reported elsewhere; no curve is fitted across it.
    is_gap = ~(np.abs(np.diff(time_s) - step_s) < 0.4 * step_s)
    is_missing: BoolArray = ~np.all(np.isfinite(readings), axis=1)
    is_gap |= is_missing[1:] | is_missing[:-1]
    is_cut = np.convolve(is_gap, np.ones(2 * HALF_WINDOW + 1), mode="same") > 0.5
    is_sharp, is_long, is_short = _steps(readings, np.concatenate(noise), inner)
    step = np.concatenate([np.arange(first, last) for first, last in inner])
    is_known = ~is_cut[step]
    n = int(np.count_nonzero(is_sharp & is_known))
    n_short = int(np.count_nonzero(is_short & is_known))
    at = step[is_long & is_known]
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
    """Findings of a fit, without its possible losses where losses were detected in the motion."""
    return tuple(one for one in of_fit if not (seen and one.code is FindingCode.LOSSES_POSSIBLE))


def _positive(sigma: FloatArray) -> FloatArray:
    """Noise (3,) without zeros: a channel without visible noise (coarse LSB) gets that of the noisiest channel."""
    sigma = np.asarray(sigma, dtype=np.float64)
    return np.where(sigma > 0.0, sigma, max(float(sigma.max()), 1e-300))


def _contrasts(missing: int) -> FloatArray:
    """(2, 8) contrasts that vanish for quintics through four samples on either side, ``missing`` more steps apart."""
    offsets = np.r_[np.arange(-HALF_WINDOW, 0) + 0.5, np.arange(HALF_WINDOW) + 0.5 + missing] / HALF_WINDOW
    q, _ = np.linalg.qr(np.vander(offsets - offsets.mean(), COEFFICIENTS), mode="complete")
    return q[:, COEFFICIENTS:].T


CONTRASTS = np.array([_contrasts(missing) for missing in (0, 1, -1)])
"""Contrasts (3, 2, 8): as logged, with one sample inserted, with one removed."""


def _steps(readings: FloatArray, noise: FloatArray, moves: IntArray) -> tuple[BoolArray, BoolArray, BoolArray]:
    """Flags (k,) of the step after each sample of ``moves`` (m, 2): a loss would be detectable, one sample too long,
    one sample too short; ``noise`` (c,) of the channels.

    A step whose change is smaller than the slope beside it, the mirror image of a long one, also counts as short:
    curvature causes both equally often.
    """
    return _core.motion_joints(
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
