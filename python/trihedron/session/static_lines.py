"""Means of poses with a spectral line, by a joint fit of constant and line (docs/diagnosis-method.md, 8.0)."""

from collections.abc import Sequence
from dataclasses import replace
from functools import lru_cache
from itertools import pairwise

import numpy as np
import numpy.typing as npt
from scipy.ndimage import median_filter
from scipy.special import gammaincc

from trihedron.arrays import TINY, FloatArray
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments

SURE = 1e-8
"""False-alarm probability of a line in noise over all frequencies of a pose. A fainter line of six cycles or more moves
the plain mean by less than a quarter of its standard error, and is not fitted."""
FEWEST_CYCLES = 6
"""A slower line is confounded with drift, which the session model has terms for."""
ABOVE_SLOWER = 10.0
"""Power of a line over that of the bins three to five below: in a bias random walk the ratio is 1/9 to 1."""
FEWEST_SAMPLES = 64
"""A spectrum of fewer samples has too few frequencies to separate a line from the noise around it."""
LONGEST_REMEMBERED = 4096
"""Samples of a pose whose lines are cached: with 512 poses of two sensors 50 MB at most."""
FEWEST_BINS, MOST_BINS = 27, 101
"""Frequencies whose median is the noise level at one: few follow its colour, many determine it well."""
REFINED = 2e-4
"""Error of a line's frequency in bins: its phase then errs by a thousandth at the ends of the pose."""
MOST_LINES = 3
"""A shaker and its first harmonics; the remaining vibration widens the uncertainty."""
STILL_SHAKES = 2.0
"""Scatter beside the lines over that of quiet poses, from which vibration remains."""
N_BESIDE = 4
"""Bins beside frequency zero that give the noise there: below the slowest line searched, with an error of a third."""
BLOCKS = 8
"""Parts of a pose whose means show whether slow motion remains."""


def means_beside_lines(recording: Recording, segments: Segments) -> tuple[Segments, FloatArray]:
    """Segments whose poses with a line have mean and standard error of a fit of constant + lines; swing of the lines.

    A sinusoid of amplitude A that is no whole number of cycles moves the mean of a pose of length T by up to A/(πfT),
    and block means scatter by it. Poses without a significant line stay as they are. Samples are taken as even.

    The swing (h, 2, 3), force and rate, is the variance of a line's integral at the edge of its pose, (raw unit · s)²:
    A²/2(2πf)². A move that begins or ends in it does not begin or end at rest.
    """
    changed: dict[str, FloatArray] = {}
    swing = np.zeros((segments.n_poses, 2, 3))
    both = (("accelerometer", recording.accelerometer), ("gyroscope", recording.gyroscope))
    for s, (sensor, readings) in enumerate(both):
        mean, error = getattr(segments, f"{sensor}_mean"), getattr(segments, f"{sensor}_sigma_mean")
        sigma = getattr(segments, f"{sensor}_sigma")
        if readings is None or mean is None or error is None or sigma is None or not len(mean):
            continue
        white = sigma / np.sqrt(np.maximum(segments.n_averaged, 1))[:, None]
        # Ratio of the errors of means to white noise: a line does not change the slow noise.
        colour = np.maximum(np.median(error / np.maximum(white, TINY), axis=0), 1.0)
        new_mean, new_error = mean.copy(), error.copy()
        for k, pose in enumerate(segments.poses):
            part = readings[pose.start : pose.stop]
            if pose.disturbed or len(part) < FEWEST_SAMPLES or not np.isfinite(part).all():
                continue
            lines, has_line = _known_lines(part)
            if not lines:
                continue
            fitted, own = _constant_beside(part, lines, sigma)
            swing[k, s] = np.where(has_line, _swing(part, lines) / recording.rate_hz**2, 0.0)
            new_mean[k] = np.where(has_line, fitted, mean[k])
            new_error[k] = np.where(has_line, colour * own, error[k])
        if (new_mean != mean).any():
            changed |= {f"{sensor}_mean": new_mean, f"{sensor}_sigma_mean": new_error}
            if s == 0 and segments.accelerometer_sigma_up is not None:
                moved = (new_mean != mean).any(axis=1)
                changed["accelerometer_sigma_up"] = np.where(moved, np.nan, segments.accelerometer_sigma_up)
    return (replace(segments, **changed) if changed else segments), swing  # type: ignore[arg-type]


def _known_lines(part: FloatArray) -> tuple[list[float], npt.NDArray[np.bool_]]:
    """As :func:`find_pose_lines`, cached for poses of usual length: every change of a session needs all lines again."""
    is_long = len(part) > LONGEST_REMEMBERED
    return find_pose_lines(part) if is_long else _lines_of(part.tobytes(), part.shape[1])


@lru_cache(maxsize=512)
def _lines_of(readings: bytes, n_axes: int) -> tuple[list[float], npt.NDArray[np.bool_]]:
    return find_pose_lines(np.frombuffer(readings).reshape(-1, n_axes))


def find_pose_lines(part: FloatArray) -> tuple[list[float], npt.NDArray[np.bool_]]:
    """Significant lines of one pose's readings (n, 3): frequencies in cycles per sample, and the axes that have any."""
    lines: list[float] = []
    has_line = np.zeros(part.shape[1], dtype=bool)
    # Relative to a reading, an axis that never changes is exactly zero, not a rounding error with a spectrum.
    part = part - part[0]
    rest = part - part.mean(axis=0)
    while len(lines) < MOST_LINES:
        found = _strongest(rest)
        if found is None:
            break
        k, axes = found
        lines.append(_refined(part[:, axes], lines, k / len(part)))
        has_line |= axes
        rest = part - _model(part, lines)[0]
    return lines, has_line


def _strongest(rest: FloatArray) -> tuple[int, npt.NDArray[np.bool_]] | None:
    """Bin of the strongest significant line of the axes together, and which of them have it."""
    n = len(rest)
    power = (np.abs(np.fft.rfft(rest * np.hanning(n)[:, None], axis=0)) ** 2)[:-1]
    if len(power) < FEWEST_BINS:
        return None
    width = min(max(FEWEST_BINS, (n // 16) | 1), MOST_BINS)
    # The median of exponentially distributed power is ln 2 of its mean.
    local = np.stack([median_filter(one, size=width, mode="mirror") for one in power.T], axis=1)
    level = np.maximum(local, 0.5 * np.median(power, axis=0)) / np.log(2.0)
    live = (level > 0).all(axis=0)
    if not live.any():
        return None
    ratio = np.where(live, power / np.where(live, level, 1.0), 0.0)
    together = ratio[FEWEST_CYCLES:].sum(axis=1)
    k = FEWEST_CYCLES + int(np.argmax(together))
    # A bias random walk rises towards low frequencies: a line must exceed these too.
    if ratio[k].sum() < ABOVE_SLOWER * ratio[k - 5 : k - 2].sum(axis=1).mean():
        return None
    if gammaincc(int(live.sum()), ratio[k].sum()) * (n / 2) > SURE:
        return None
    axes = ratio[k] > -np.log(SURE) / 2.0
    return (k, axes) if axes.any() else None


def _basis(n: int, lines: Sequence[float]) -> FloatArray:
    phase = 2.0 * np.pi * np.outer(np.arange(n) - 0.5 * (n - 1), lines)
    return np.hstack([np.ones((n, 1)), np.cos(phase), np.sin(phase)])


def _model(part: FloatArray, lines: Sequence[float]) -> tuple[FloatArray, FloatArray]:
    basis = _basis(len(part), lines)
    coefficient = np.asarray(np.linalg.lstsq(basis, part, rcond=None)[0], dtype=np.float64)
    return basis @ coefficient, coefficient


def _swing(part: FloatArray, lines: Sequence[float]) -> FloatArray:
    """(3,) variance of the lines' integral at a random phase, (reading · samples)²."""
    _, coefficient = _model(part, lines)
    m = len(lines)
    squares = coefficient[1 : 1 + m] ** 2 + coefficient[1 + m :] ** 2
    return np.asarray(0.5 * (squares / (2.0 * np.pi * np.array(lines)[:, None]) ** 2).sum(axis=0))


def _refined(part: FloatArray, lines: Sequence[float], near: float) -> float:
    """Least-squares frequency within the main lobe, one bin of ``near``, the known lines fitted jointly."""
    scale = np.maximum(np.std(part, axis=0), TINY)
    reduced = part / scale

    def left(f: float) -> float:
        return float(((reduced - _model(reduced, [*lines, f])[0]) ** 2).sum())

    bin_ = 1.0 / len(part)
    within = (near - bin_, near + bin_)
    from scipy.optimize import minimize_scalar  # imported here: most logs have no line

    return float(minimize_scalar(left, bounds=within, method="bounded", options={"xatol": REFINED * bin_}).x)


def _constant_beside(part: FloatArray, lines: Sequence[float], sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Constant (3,) beside the lines and its standard error (3,); amplitudes, phases and frequencies are unknowns."""
    n, m = len(part), len(lines)
    model, coefficient = _model(part, lines)
    rest = part - model
    basis = _basis(n, lines)
    cosines, sines = basis[:, 1 : 1 + m], basis[:, 1 + m :]
    t = (np.arange(n) - 0.5 * (n - 1))[:, None]
    level = np.maximum(np.sqrt((rest**2).sum(axis=0) / max(n - 1 - 3 * m, 1)), sigma)
    error = np.empty(part.shape[1])
    for axis in range(part.shape[1]):
        a, b = coefficient[1 : 1 + m, axis], coefficient[1 + m :, axis]
        slope = t * (b * cosines - a * sines)
        size = np.maximum(np.linalg.norm(slope, axis=0), TINY)
        columns = np.hstack([basis, slope / size])
        error[axis] = level[axis] * np.sqrt(np.linalg.pinv(columns.T @ columns)[0, 0])
    edges = np.linspace(0, n, BLOCKS + 1).astype(int)
    blocks = np.array([rest[a:b].mean(axis=0) for a, b in pairwise(edges)])
    scatter = blocks.std(axis=0, ddof=1) / np.sqrt(BLOCKS)
    # Eight blocks detect a pose that goes on settling, not a fifth of its noise.
    error = np.where(scatter > 2.0 * error, scatter, error)
    tapered, its_error = _tapered(rest, sigma)
    # A shaker of varying frequency remains in the residuals, away from frequency zero, where the mean is.
    is_better = (level > STILL_SHAKES * sigma) & (its_error < error)
    return coefficient[0] + np.where(is_better, tapered, 0.0), np.where(is_better, its_error, error)


def _tapered(rest: FloatArray, sigma: FloatArray) -> tuple[FloatArray, FloatArray]:
    """Mean (3,) by Hann's window and its standard error (3,) from the spectrum beside frequency zero.

    Of motion k cycles from zero the window passes 1/k³, a plain mean 1/k. The noise of the mean is that of bins 3 to 6
    (the window spreads frequency zero over two), and at least the sensor's white noise.
    """
    n = len(rest)
    window = np.hanning(n)
    whole = window.sum()
    mean = (window @ rest) / whole
    beside = np.fft.rfft(window[:, None] * (rest - mean), axis=0)[3 : 3 + N_BESIDE]
    error = np.sqrt(np.mean(np.abs(beside) ** 2, axis=0)) / whole
    return mean, np.maximum(error, sigma * np.sqrt((window**2).sum()) / whole)
