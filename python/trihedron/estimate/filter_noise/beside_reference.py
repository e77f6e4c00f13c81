"""A log beside its reference: noise of both sensors for a filter, tested on the half that the fit did not see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.filter_noise.angle import angle_stretches
from trihedron.estimate.filter_noise.held_out import Errors, errors_over
from trihedron.estimate.filter_noise.shares import bounded, parts_of, shares_over
from trihedron.estimate.filter_noise.strengths import PREFERRED, Fitted, Prior, fit, forgetting
from trihedron.estimate.filter_noise.stretch import NAMES, Stretch
from trihedron.estimate.filter_noise.velocity import velocity_stretches
from trihedron.estimate.reference.fit import laid_beside
from trihedron.estimate.reference.motion import MotionFit, fit_motion
from trihedron.records import Recording
from trihedron.records.filter_noise import (
    BiasModel,
    Consistency,
    ReferenceWorth,
    SensorFilterNoise,
    StaticNoise,
)
from trihedron.records.reference import ReferenceMotion

ANGLE = Prior(
    np.append(np.log([2e-4, 2e-4, 2e-5, 3e-4, 1e-3, 8.0]), 0.0),
    np.append(np.log([30.0, 30.0, 30.0, 30.0, 30.0, 4.0]), 1.0),
    np.ones(7),
)
"""Consumer gyros and optical trackers, a factor of 30 either way and of 4 for the time constant, as for `--reference`."""
VELOCITY = Prior(
    np.append(np.log([2e-3, 2e-3, 3e-4, 1e-3, 1e-3, 8.0]), 0.0),
    ANGLE.sigma,
    np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0]),
)
"""The same of accelerometers beside a path: a millimetre of white error; a tilt of the world's attitude."""
LEAST_S = 40.0
"""Shared motion below which two halves say nothing of ten seconds."""
CALIBRATION_DRAWS, PREDICTING = 400, 20
"""Draws of the scale matrix for its share; of the strengths for a prediction."""


@dataclass(frozen=True)
class Asked:
    """What is wanted: ``horizons_s``, ``band_hz`` above which vibration is looked for, ``gravity_m_s2``, and what is
    known of each sensor at rest."""

    horizons_s: tuple[float, ...]
    band_hz: float
    gravity_m_s2: float
    gyroscope: StaticNoise | None = None
    accelerometer: StaticNoise | None = None


def beside_reference(recording: Recording, motion: ReferenceMotion, asked: Asked) -> tuple[SensorFilterNoise, ...]:
    """Gyro, and with a position the accelerometer, of a log beside attitudes.

    Raises
    ------
    ValueError
        When the reference has no attitude, or the two share too little motion.
    """
    if motion.attitude is None:
        raise RefusedError(f"{motion.source}: the reference holds rates; give attitudes, whose errors do not add up.")
    side = laid_beside(recording, motion, asked.gravity_m_s2)
    found = fit_motion([side])
    known = 0.0 if asked.gyroscope is None else asked.gyroscope.N.value
    stretches = angle_stretches(found, asked.band_hz, known)
    _refuse_short(stretches, motion)
    left = {h: calibration_left(found, h) for h in asked.horizons_s}
    out = [_sensor(stretches, ANGLE, asked, asked.gyroscope, left)]
    if motion.position is not None and side.force is not None:
        known = 0.0 if asked.accelerometer is None else asked.accelerometer.N.value
        more = velocity_stretches(side, found.points[0], asked.band_hz, known, asked.gravity_m_s2)
        nothing = {h: np.zeros(1) for h in asked.horizons_s}
        out.append(_sensor(more, VELOCITY, asked, asked.accelerometer, nothing))
    return tuple(out)


def _refuse_short(stretches: Sequence[Stretch], motion: ReferenceMotion) -> None:
    shared = sum(float(one.time_s[-1] - one.time_s[0]) for one in stretches)
    if shared < LEAST_S:
        raise RefusedError(
            f"{motion.source}: log and reference share {shared:.0f} s without a gap; give at least {LEAST_S:.0f} s."
        )


def _sensor(
    stretches: Sequence[Stretch], usual: Prior, asked: Asked, static: StaticNoise | None, left: dict[float, FloatArray]
) -> SensorFilterNoise:
    is_gyro = usual is ANGLE
    prior = informed(usual, stretches, static)
    half, held = halves(stretches)
    taught = fit(half, prior)
    found = fit(stretches, prior, taught)
    gain, sigma, tau = forgetting(stretches, found)
    is_gm = gain > PREFERRED
    draws = found.draws
    N = np.hypot(draws[:, 0], draws[:, 1])
    shares = tuple(
        share
        for h in asked.horizons_s
        for share in shares_over(
            parts_of(draws, h, None if is_gyro else asked.gravity_m_s2), _resampled(left[h], len(draws)), h
        )
    )
    return SensorFilterNoise(
        sensor="gyroscope" if is_gyro else "accelerometer",
        unit="rad/s" if is_gyro else "m/s^2",
        N=bounded(N),
        K=bounded(draws[:, 2]),
        static=static,
        bias=BiasModel("gauss-markov", gain, sigma, tau) if is_gm else BiasModel("walk", gain),
        axes_N=(),
        vibration=bounded(draws[:, 1]) if prior.is_there[1] else None,
        reference=_worth(draws),
        shares=shares,
        consistency=tuple(
            one for h in asked.horizons_s if (one := consistency(held, taught, static, h)) is not None
        ),
    )  # fmt: skip


def informed(usual: Prior, stretches: Sequence[Stretch], static: StaticNoise | None) -> Prior:
    """The usual prior with the noise at rest as a datum; without vibration where no band power stands out."""
    mean, sigma, is_there = usual.mean.copy(), usual.sigma.copy(), usual.is_there.copy()
    if static is not None and not static.N.is_limit and static.N.value > 0.0:
        mean[0] = np.log(static.N.value)
        # Ends of its interval, and no closer than one unit of a kind repeats from day to day (5 %).
        sigma[0] = max(0.25 * np.log(static.N.upper / max(static.N.lower, 1e-12)), 0.05)
        mean[1] = mean[0]
    power = np.concatenate([one.power for one in stretches])
    # Without a datum of the noise at rest only changes of the power tell vibration from it.
    shows = np.any(power > 0.0) and (static is not None or np.std(power) > 0.2 * np.mean(power))
    is_there[1] = float(shows)
    return Prior(mean, sigma, is_there)


def halves(stretches: Sequence[Stretch]) -> tuple[list[Stretch], list[tuple[Stretch, int]]]:
    """The first half of the time to learn from, and stretches with the block from which on they are held out."""
    total = sum(len(one.time_s) for one in stretches)
    learnt: list[Stretch] = []
    held, so_far = [], 0
    for one in stretches:
        n = len(one.time_s)
        cut = min(max(total // 2 - so_far, 0), n)
        if cut >= 2:
            learnt.append(one if cut == n else one.part(0, cut))
        if cut < n:
            held.append((one, cut))
        so_far += n
    return learnt, held


def consistency(
    held: Sequence[tuple[Stretch, int]], taught: Fitted, static: StaticNoise | None, horizon_s: float
) -> Consistency | None:
    """Errors over one horizon under what was taught, and under the static values with the reference taken for exact."""
    some = taught.draws[:: max(1, len(taught.draws) // PREDICTING)]
    found = errors_over(held, some, horizon_s)
    if found is None:
        return None
    beside: Errors | None = None
    if static is not None:
        plain = np.zeros(len(NAMES))
        plain[[0, 2]] = static.N.filter_value, static.K.filter_value
        # Of a path only means are compared: its white error cannot be none, and is what it is.
        plain[3] = 0.0 if held[0][0].attitude is not None else taught.mode[3]
        beside = errors_over(held, plain[None], horizon_s)
    return Consistency(
        horizon_s,
        float(np.mean(found.nees)),
        float(np.sqrt(found.predicted)),
        float(np.sqrt(found.actual)),
        len(found.nees),
        found.n_apart,
        None if beside is None else float(np.mean(beside.nees)),
        None if beside is None else float(np.sqrt(beside.predicted)),
        None if beside is None else float(np.sqrt(beside.actual)),
    )


def calibration_left(found: MotionFit, horizon_s: float) -> FloatArray:
    """(k,) mean squares [rad²] of what one scale and square axes would leave over a horizon, drawn from the fit.

    The mounting is nobody's fault, and a filter finds the bias: neither counts.
    """
    side, point = found.sides[0], found.points[0]
    grid = side.grid
    C = side.reference.attitude(grid.time_s * (1.0 + point.rate) + point.offset_s) @ point.mounting
    raw = np.where(side.seen[:, None], grid.gyroscope - grid.gyroscope[side.seen].mean(axis=0), 0.0)
    carried = np.cumsum(np.einsum("nij,nk->nijk", C, raw).reshape(len(raw), 3, 9), axis=0) * grid.step_s
    ahead = max(1, round(horizon_s / grid.step_s))
    if len(raw) <= ahead:
        return np.zeros(1)
    steps = carried[ahead:] - carried[:-ahead]
    square = np.einsum("nai,naj->ij", steps, steps) / len(steps)
    S, cov = found.value(0, "S"), found.covariance(0, ("S",))
    errors = drawn_errors(left_of(S), _across(S) @ cov @ _across(S).T)
    return np.asarray(np.einsum("ki,ij,kj->k", errors, square, errors))


def drawn_errors(seen: FloatArray, cov: FloatArray) -> FloatArray:
    """(k, 9) errors of a scale matrix seen as ``seen`` (9,) with covariance (9, 9), all elements of one unknown size.

    What noise alone makes of a perfect matrix is no error: without a common size its square would be twice counted.
    """
    sizes = np.geomspace(1e-5, 0.1, 33)
    width = [cov + size**2 * np.eye(9) for size in sizes]
    log_p = np.array([-0.5 * (np.linalg.slogdet(V)[1] + seen @ np.linalg.solve(V, seen)) for V in width])
    weight = np.exp(log_p - log_p.max())
    rng = np.random.default_rng(0)
    out = []
    for k in rng.choice(len(sizes), CALIBRATION_DRAWS, p=weight / weight.sum()):
        gain = sizes[k] ** 2 * np.linalg.inv(width[k])
        left = sizes[k] ** 2 * (np.eye(9) - gain)
        values, vectors = np.linalg.eigh(0.5 * (left + left.T))
        out.append(gain @ seen + vectors @ (np.sqrt(np.maximum(values, 0.0)) * rng.normal(size=9)))
    return np.array(out)


def _across(S: FloatArray) -> FloatArray:
    """(9, 9) derivative of what is left of S."""
    step = 1e-6 * float(np.linalg.norm(S))
    return np.array([(left_of(S + step * e) - left_of(S - step * e)) / (2.0 * step) for e in np.eye(9)]).T


def left_of(S: FloatArray) -> FloatArray:
    """(9,) S less the square, equal one that comes nearest to it; of readings in SI its scale is one."""
    u, s, vt = np.linalg.svd(S.reshape(3, 3))
    # Of counts the scale is a data sheet's, and no error.
    scale = 1.0 if 0.5 < float(np.mean(s)) < 2.0 else float(np.mean(s))
    return np.asarray(S - scale * (u @ vt).ravel())


def _worth(draws: FloatArray) -> ReferenceWorth:
    slow = np.hypot(draws[:, 4], draws[:, 5])
    return ReferenceWorth(bounded(draws[:, 3]), bounded(slow), float(np.median(draws[:, 6])))


def _resampled(values: FloatArray, n: int) -> FloatArray:
    return np.asarray(values[np.arange(n) % len(values)])
