"""A log beside its reference: noise of both sensors for a filter, tested on the half that the fit did not see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.filter_noise.angle import angle_stretches
from trihedron.estimate.filter_noise.axes import unlike_axes_beside
from trihedron.estimate.filter_noise.held_out import Errors, errors_over
from trihedron.estimate.filter_noise.left_over import Left, left_over
from trihedron.estimate.filter_noise.shares import bounded, parts_of, shares_over
from trihedron.estimate.filter_noise.strengths import PREFERRED, Fitted, Prior, fit, forgetting
from trihedron.estimate.filter_noise.stretch import NAMES, Stretch
from trihedron.estimate.filter_noise.velocity import velocity_stretches
from trihedron.estimate.reference.fit import laid_beside
from trihedron.estimate.reference.motion import fit_motion
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
"""Consumer gyros and optical trackers, a factor of 30 either way and of 4 for the time constant (as `--reference`)."""
VELOCITY = Prior(
    np.append(np.log([2e-3, 2e-3, 3e-4, 1e-3, 1e-3, 8.0]), 0.0),
    ANGLE.sigma,
    np.array([1.0, 1.0, 1.0, 1.0, 1.0, 1.0, 0.0]),
)
"""The same of accelerometers beside a path: a millimetre of white error; a tilt of the world's attitude."""
LEAST_S = 40.0
"""Shared motion below which two halves say nothing of ten seconds."""
PREDICTING = 20
"""Draws of the strengths for a prediction."""


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
    left = left_over(found, asked.horizons_s)
    out = [_sensor(stretches, ANGLE, asked, asked.gyroscope, left)]
    if motion.position is not None and side.force is not None:
        known = 0.0 if asked.accelerometer is None else asked.accelerometer.N.value
        more = velocity_stretches(side, found.points[0], asked.band_hz, known, asked.gravity_m_s2)
        out.append(_sensor(more, VELOCITY, asked, asked.accelerometer, {}))
    return tuple(out)


def _refuse_short(stretches: Sequence[Stretch], motion: ReferenceMotion) -> None:
    shared = sum(float(one.time_s[-1] - one.time_s[0]) for one in stretches)
    if shared < LEAST_S:
        raise RefusedError(
            f"{motion.source}: log and reference share {shared:.0f} s without a gap; give at least {LEAST_S:.0f} s."
        )


def _sensor(
    stretches: Sequence[Stretch], usual: Prior, asked: Asked, static: StaticNoise | None, left: Left
) -> SensorFilterNoise:
    is_gyro = usual is ANGLE
    prior = informed(usual, stretches, static)
    half, held = halves(stretches)
    taught, did_follow = independent_or_not(half, prior, usual)
    near = (None, taught) if did_follow else (taught, None)
    found, follows = independent_or_not(stretches, prior, usual, near)
    gain, sigma, tau = forgetting(stretches, found)
    is_gm = gain > PREFERRED
    draws = found.draws
    N, K = bounded(np.hypot(draws[:, 0], draws[:, 1])), bounded(draws[:, 2])
    if follows:
        # What is left beside it is the reference's as much as the sensor's.
        assert static is not None
        N, K = static.N, replace(K, lower=0.0, is_limit=True)
    shares = tuple(
        share
        for h in asked.horizons_s
        for share in shares_over({**parts_of(draws, h, None if is_gyro else asked.gravity_m_s2), **left.get(h, {})}, h)
    )
    return SensorFilterNoise(
        sensor="gyroscope" if is_gyro else "accelerometer",
        unit="rad/s" if is_gyro else "m/s^2",
        N=N,
        K=K,
        static=static,
        bias=BiasModel("gauss-markov", gain, sigma, tau) if is_gm else BiasModel("walk", gain),
        axes_N=() if follows else unlike_axes_beside(stretches, found, N),
        vibration=bounded(draws[:, 1]) if prior.is_there[1] and not follows else None,
        reference=_worth(draws, follows),
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


def independent_or_not(
    stretches: Sequence[Stretch], prior: Prior, usual: Prior, near: tuple[Fitted | None, Fitted | None] = (None, None)
) -> tuple[Fitted, bool]:
    """The fit with noise at rest as a datum, or, where the evidence prefers it, of a reference that follows the sensor.

    A smoother over this sensor repeats part of its noise, and what is left of it beside the reference may be any less.
    ``near`` are fits of a part, of either kind.
    """
    apart = fit(stretches, prior, near[0])
    if prior.sigma[0] == usual.sigma[0] or np.log(np.median(apart.draws[:, 0])) > prior.mean[0] - prior.sigma[0]:
        return apart, False
    wide = prior.sigma.copy()
    wide[0] = usual.sigma[0]
    other = fit(stretches, Prior(prior.mean, wide, prior.is_there), near[1])
    follows = 2.0 * (other.evidence - apart.evidence) > PREFERRED
    return (other, True) if follows else (apart, False)


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


def _worth(draws: FloatArray, follows: bool) -> ReferenceWorth:
    slow = np.hypot(draws[:, 4], draws[:, 5])
    return ReferenceWorth(bounded(draws[:, 3]), bounded(slow), float(np.median(draws[:, 6])), follows)
