"""Quality of a reference: its error, its gaps, and whether it was computed from this gyro."""

from collections.abc import Iterator

import numpy as np

from trihedron.arrays import AXES, FloatArray
from trihedron.estimate.reference.likelihood import STRENGTHS
from trihedron.estimate.reference.motion import MotionFit
from trihedron.estimate.reference.residuals import fine_s, rate_left
from trihedron.estimate.reference.slip import Slip
from trihedron.gravity import EARTH_RATE_RAD_S
from trihedron.probability import chdtri
from trihedron.ranges import edges_of
from trihedron.records import Finding
from trihedron.records.reference import AgainstReference, Estimate, ReferenceError, Sign
from trihedron.sensor_model import reframing

WHITE, WORLD, BODY = (STRENGTHS.index(one) for one in ("white", "world", "body"))
SQUARE = np.radians(0.01)
"""No mounting is accurate to 0.01°: a smaller angle means that the reference's body frame is the gyro's."""
QUIET_PARTS = 50
"""The quietest 1/50 of the log gives an upper limit of the static noise."""
QUIETER = 0.8
"""Ratio of the difference's noise, which contains the gyro's, to static noise below which the two are dependent."""


def error_of(found: MotionFit, k: int = 0) -> ReferenceError:
    """Error of the reference in recording k: posterior medians of its strengths, rows, gaps and deviating intervals."""
    problem, draws = found.problems[k], np.exp(found.fitted.draws[:, k])
    middle = np.median(draws, axis=0)
    rows = problem.blocks.rows()
    seen = rows[:, 0] > 0
    time = problem.blocks.time_s()
    lost = found.points[k].deviates(time)
    slow = np.sqrt(np.sum(draws[:, [WORLD, BODY]] ** 2, axis=1))
    is_body = middle[BODY] > middle[WORLD]
    return ReferenceError(
        white_rad=float(middle[WHITE]),
        slow_rad=(float(np.median(slow)), float(np.quantile(slow, 0.025)), float(np.quantile(slow, 0.975))),
        slow_s=float(middle[(BODY if is_body else WORLD) + 1]),
        is_of_body=bool(is_body),
        rows=int(rows[:, 0].sum()),
        rows_left_out=int(rows[:, 1].sum()),
        gaps_s=_runs(time, ~seen & ~lost & (np.cumsum(seen) > 0) & (np.cumsum(seen[::-1])[::-1] > 0)),
        apart_s=_runs(time, lost),
        signs=signs_of_this_gyro(found, k),
    )


def _runs(time: FloatArray, where: np.ndarray) -> tuple[tuple[float, float], ...]:
    """Start and end times of every run of True."""
    last = len(time) - 1
    return tuple((float(time[a]), float(time[min(b, last)])) for a, b in edges_of(where))


def signs_of_this_gyro(found: MotionFit, k: int) -> tuple[Sign, ...]:
    """Evidence that the reference was computed from this gyro: it then confirms S and b, but does not measure them."""
    if found.sides[k].reference.motion.attitude is None:
        return ()
    out = []
    own, noise = residual_density(found, k), noise_at_rest(found, k)
    if own < QUIETER * noise:
        out.append(Sign("quieter-than-gyro", float(own), float(noise)))
    cov = found.covariance(k, ("S", "b"))
    change = reframing(found.value(k, "S").reshape(3, 3), found.value(k, "b"), "symmetric")
    cosine = np.clip((np.trace(change.rotation) - 1.0) / 2.0, -1.0, 1.0)
    angle, sigma = float(np.arccos(cosine)), float(np.sqrt(np.trace(change.tilt @ cov @ change.tilt.T) / 3.0))
    if angle < SQUARE + sigma and sigma < SQUARE:
        out.append(Sign("mounted-without-error", angle, sigma))
    return tuple(out)


def residual_density(found: MotionFit, k: int) -> float:
    """White density [rad/s/√Hz] of the difference between gyro and reference from some 0.1 to 5 Hz."""
    side = found.sides[k]
    _, rate = rate_left(side, found.points[k])
    # Means of a random walk over neighbouring blocks differ by 2/3 of its variance per block; the median is robust
    # to impacts and divided by that of chi-square with 3 degrees of freedom.
    return float(np.sqrt(np.median(np.sum(rate**2, axis=1)) * fine_s(side) / (2.0 / 3.0 * chdtri(3.0, 0.5))))


def noise_at_rest(found: MotionFit, k: int) -> float:
    """White density [rad/s/√Hz] of the gyro's noise in the quietest part of the log; motion adds to it elsewhere."""
    side = found.sides[k]
    rate = side.corrected(found.points[k])
    n = max(len(rate) // QUIET_PARTS, 8)
    change = np.sum(np.diff(rate, axis=0) ** 2, axis=1) / 6.0
    total = np.concatenate([[0.0], np.cumsum(change)])
    return float(np.sqrt((total[n:] - total[:-n]).min() / n * side.grid.step_s))


# The Earth's rate in the world frame of a reference: a vector of known length, whose direction a good gyro shows.


RESOLVED = 1.0 / 3.0
"""Largest σ of the vector, relative to its length, with which its direction is determined."""
FAR = 3.0
"""Standard uncertainties by which the estimate may be shorter than the Earth's rate."""


def earth_of(found: MotionFit, k: int) -> Estimate | None:
    """The vector in the world frame [rad/s] with its length imposed; ``None`` where the log does not determine it.

    A reference computed from a gyro rotates with the Earth: the estimate is then too short.
    """
    if "earth" not in found.places[k] or found.sides[k].reference.motion.attitude is None:
        return None
    value, covariance = found.value(k, "earth"), found.covariance(k, ("earth",))
    sigma = float(np.sqrt(np.linalg.eigvalsh(covariance)[-1]))
    length = float(np.linalg.norm(value))
    if sigma > RESOLVED * EARTH_RATE_RAD_S or EARTH_RATE_RAD_S - length > FAR * sigma:
        return None
    along = value / length
    gain = covariance @ along / float(along @ covariance @ along)
    return Estimate(
        AXES, value + gain * (EARTH_RATE_RAD_S - length), covariance - np.outer(gain, covariance @ along), "rad/s"
    )


# Findings on a reference that affect the result.


UPRIGHT = np.cos(np.radians(45.0))
"""Component of the vertical along an axis to which it is nearer than to the horizontal."""
COLOURED = 3.0
"""Factor on the accelerometer's uncertainties above which its residuals are not explained by the noise model."""
LEFT_OUT = 0.05


def remarks(result: AgainstReference, is_turned: bool, slip: Slip | None) -> Iterator[Finding]:
    """Findings of a fit: independence of the reference, direction of up, outliers, slip or deviations, misfit."""
    error = result.error
    if is_turned:
        yield Finding.of("reference-turned-round")
    if result.vertical is not None and (up := result.vertical.value)[2] < -UPRIGHT:
        yield Finding.of("reference-upside-down", up_x=up[0], up_y=up[1], up_z=up[2])
    if error.signs:
        seen = {sign.kind: sign.seen for sign in error.signs}
        yield Finding.of(
            "reference-not-independent",
            is_quiet="quieter-than-gyro" in seen,
            is_square="mounted-without-error" in seen,
            angle_rad=seen.get("mounted-without-error", float("nan")),
        )
    yield from of_error(error, slip)
    force = result.accelerometer
    if force is not None and force.widened > COLOURED:
        yield Finding.of("reference-misfit", sensor="accelerometer", widened=force.widened)


def of_error(error: ReferenceError, slip: Slip | None, *, is_of_noise: bool = False) -> Iterator[Finding]:
    """Findings of the reference alone: outliers, and a slip or deviating intervals; white noise contains no slip."""
    if error.rows_left_out > LEFT_OUT * (error.rows + error.rows_left_out):
        rows = error.rows + error.rows_left_out
        yield Finding.of("reference-outliers", left_out=error.rows_left_out, rows=rows)
    if slip is not None:
        yield Finding.of(
            "reference-apart",
            "slipped-in-noise" if is_of_noise else "slipped",
            at_s=slip.at_s,
            angle_rad=slip.angle_rad,
            sigma_rad=slip.sigma_rad,
        )
    elif apart := error.apart_s:
        yield Finding.of("reference-apart", start_s=apart[0][0], end_s=apart[-1][1], n=len(apart))
