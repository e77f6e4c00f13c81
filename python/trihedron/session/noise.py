"""Noise of a session, measured once: `calibrate` and `diagnose` use the same weights (docs/model-session.md)."""

from dataclasses import dataclass

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, FloatArray, rms_of
from trihedron.errors import InputError
from trihedron.quantiles import medians
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments
from trihedron.session.rounding import rounding_of_moves

Pair = tuple[float, float]
Strengths = tuple[Pair, tuple[float, float, float, float], Pair, Pair]
"""Corner times of walks [s], scatter from pose to pose in its units (accelerometer, gyro by axis), departure in moves
in units of the scatter, factors on the noise of moves. Pairs: accelerometer and gyro; of moves gravity and velocity."""
NO_SCATTER = 1e-3
"""Scatter that counts as zero."""
Bounds = tuple[Pair, Pair, Pair]
"""Shortest corner times [s], largest scatter, largest factors on the noise of moves: each for the pairs above."""
ANYTHING: Bounds = ((0.0, 0.0), (np.inf, np.inf), (np.inf, np.inf))
NOISE_CORNER_S = 20.0
"""Shortest corner time that the part's noise explains, where white noise and bias walk have equal Allan deviation: in
consumer parts it is this or later. Every hypothesis allows a walk of any strength; a stronger one is called drift."""


def strengths_of_all(
    corner_s: float, scatter: float = NO_SCATTER, between: float = 1.0, moves: float = 1.0
) -> Strengths:
    """The same strengths of both sensors, all axes, gravity and velocity."""
    return (corner_s, corner_s), (scatter,) * 4, (between, between), (moves, moves)


START_STRENGTHS = strengths_of_all(8.0 * NOISE_CORNER_S)
"""Start of the search for strengths."""
NOISE_DOF = 100.0
"""Degrees of freedom of the predicted noise, which is measured in the recording to about 7 %."""
FEWEST_POSES, FEWEST_READINGS = 6, 32
"""Fewer poses do not separate two processes (drift, scatter, settling) on three axes; fewer readings of a pose neither
slow from white noise nor a line from a drift."""


@dataclass(frozen=True, eq=False, kw_only=True)
class SessionNoise:
    """Noise of one session in raw units.

    Standard errors of pose means ``pose_force_sigma``, ``pose_rate_sigma`` (h, 3), white noise ``force_density``,
    ``rate_density`` (3,) per √Hz. ``force_up`` are the verticals (h, 3) and the standard errors (h,) of the means along
    them, NaN where those of the axes apply; ``None`` where no vertical is known. ``force_scatter``, ``rate_scatter``:
    scatter of the bias from pose to pose that 1/f noise explains, 0 where poses show none.
    """

    pose_force_sigma: FloatArray
    force_density: FloatArray
    pose_rate_sigma: FloatArray | None
    rate_density: FloatArray | None
    force_up: tuple[FloatArray, FloatArray] | None = None
    force_scatter: float = 0.0
    rate_scatter: float = 0.0

    def scatter_unit(self) -> FloatArray:
        """(2, 3) scatter of strength one, raw: the usual standard error of a pose, accelerometer and gyro.

        One size for three axes: an axis with more noise need not scatter more. The accelerometer's is that along the
        vertical where it is known, because static poses show no other scatter.
        """
        out = np.ones((2, 3))
        out[0] = rms_of(medians(self.pose_force_sigma))
        if self.force_up is not None and np.isfinite(self.force_up[1]).any():
            out[0] = np.nanmedian(self.force_up[1])
        if self.pose_rate_sigma is not None:
            out[1] = rms_of(medians(self.pose_rate_sigma))
        return np.maximum(out, TINY)

    def norm_sigma(self, gradient: FloatArray) -> FloatArray:
        """(h,) standard errors of a quantity with gradient (h, 3) by the raw means, the norm of gravity say.

        Across the vertical from the errors of the axes, along it from the vertical's own where it is known.
        """
        plain = (gradient**2 * self.pose_force_sigma**2).sum(axis=1)
        if self.force_up is None:
            return np.asarray(np.sqrt(plain))
        up, error = self.force_up
        share = (gradient * up).sum(axis=1)
        across, known = gradient - share[:, None] * up, np.isfinite(error)
        own = share**2 * np.where(known, error, 0.0) ** 2
        return np.asarray(np.sqrt(np.where(known, (across**2 * self.pose_force_sigma**2).sum(axis=1) + own, plain)))


def measure_noise(
    recording: Recording, segments: Segments, ranges: list[tuple[int, int]]
) -> tuple[SessionNoise, FloatArray]:
    """Noise of poses, and variance (m, 4, 3) of the integrals of every move, (raw unit · s)², in the half-open sample
    ``ranges`` of the moves: of force and rate by motion faster than the samples, then by rounding and slow noise.

    Refused when the segments state no uncertainty of their means.
    """
    if (
        recording.accelerometer is None
        or segments.accelerometer_sigma is None
        or segments.accelerometer_sigma_mean is None
        or segments.accelerometer_mean is None
    ):
        raise InputError("the segments state no uncertainty of their pose means")
    step_s = 1.0 / recording.rate_hz
    # For logs without scatter (a simulation without noise): the square of a smaller share is lost beside one.
    floor = np.sqrt(np.finfo(np.float64).eps) * max(float(np.abs(segments.accelerometer_mean).max()), TINY)
    force_sigma = np.maximum(segments.accelerometer_sigma_mean, floor)
    force_density = np.asarray(segments.accelerometer_sigma) * np.sqrt(step_s)
    spans, rate_sigma, rate_density, of_rate = segments.spans, None, None, 0.0
    if recording.gyroscope is not None and segments.gyroscope_sigma is not None:
        rate_sigma = np.maximum(np.asarray(segments.gyroscope_sigma_mean), TINY)
        rate_density = np.asarray(segments.gyroscope_sigma) * np.sqrt(step_s)
        of_rate = _core.flicker_scatter(recording.gyroscope, spans, None, FEWEST_POSES)
    moves_last = [float(recording.time_s[b - 1] - recording.time_s[a]) for a, b in ranges]
    variances = np.zeros((len(ranges), 4, 3))
    of_force = recording.accelerometer, force_sigma, force_density
    for k, (readings, sigma, density) in enumerate((of_force, (recording.gyroscope, rate_sigma, rate_density))):
        if readings is None or not ranges:
            continue
        quantum = recording.facts.of(("accelerometer", "gyroscope")[k]).step
        asked = np.array(ranges, dtype=np.int64), spans
        variances[:, k] = _core.unresolved_variance(readings, asked, recording.time_s, step_s, quantum)
        if k == 0:
            # For a gyro rounding is estimated with the angles of moves and the place of its bias.
            variances[:, 2] += rounding_of_moves(readings, ranges, quantum, segments.accelerometer_sigma) * step_s**2
        if sigma is not None and density is not None:
            variances[:, 2 + k] += _core.coloured_variance(readings, (spans, sigma), density, step_s, moves_last)
    up, error = segments.accelerometer_up, segments.accelerometer_sigma_up
    along = None if up is None or error is None else (up, np.maximum(error, floor))
    scatter = 0.0 if along is None else _core.flicker_scatter(recording.accelerometer, spans, up, FEWEST_POSES)
    noise = SessionNoise(
        pose_force_sigma=force_sigma, force_density=force_density, force_up=along, force_scatter=scatter,
        pose_rate_sigma=rate_sigma, rate_density=rate_density, rate_scatter=of_rate,
    )  # fmt: skip
    return noise, variances
