"""A log beside its reference: noise of both sensors for a filter, tested on the half that the fit did not see."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np
from scipy.integrate import trapezoid

from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError
from trihedron.estimate.filter_noise.angle import angle_stretches
from trihedron.estimate.filter_noise.axes import unlike_axes_beside
from trihedron.estimate.filter_noise.held_out import Errors, errors_over
from trihedron.estimate.filter_noise.left_over import Left, left_over
from trihedron.estimate.filter_noise.strengths import (
    PREFERRED,
    Fitted,
    Prior,
    bounded,
    fit,
    forgetting,
    with_slow_error_of,
)
from trihedron.estimate.filter_noise.stretch import NAMES, Stretch, matern
from trihedron.estimate.filter_noise.temperature import PER_KELVIN, beside_temperature, of_temperature
from trihedron.estimate.filter_noise.velocity import velocity_stretches
from trihedron.estimate.reference.beside import BLOCK_S
from trihedron.estimate.reference.fit import laid_beside
from trihedron.estimate.reference.motion import fit_motion
from trihedron.records import Recording
from trihedron.records.filter_noise import (
    CAUSES,
    BiasModel,
    Cause,
    Consistency,
    ReferenceWorth,
    SensorFilterNoise,
    Share,
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
    np.ones(7),
)
"""The same of accelerometers beside a path: a millimetre of white error; the slow one is that of the attitude, whose
fit knows more of it (`Learnt.told`)."""
LEAST_S = 40.0
"""Shared motion below which two halves say nothing of ten seconds."""
UNTURNED = np.ones(2)
"""A body that keeps its attitude."""
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
    stretches = beside_temperature(angle_stretches(found, asked.band_hz, known), recording, PER_KELVIN["gyroscope"])
    _refuse_short(stretches, motion)
    left = left_over(found, asked.horizons_s)
    of_gyro = learnt(stretches, (ANGLE, ANGLE), asked.gyroscope)
    out = [_sensor(of_gyro, asked, asked.gyroscope, left)]
    if motion.position is not None and side.force is not None:
        known = 0.0 if asked.accelerometer is None else asked.accelerometer.N.value
        assert out[0].reference is not None
        white = out[0].reference.white.value
        more = velocity_stretches(side, found.points[0], asked.band_hz, known, asked.gravity_m_s2, white)
        more = beside_temperature(more, recording, PER_KELVIN["accelerometer"])
        of_force = learnt(more, of_gyro.told(VELOCITY), asked.accelerometer)
        out.append(_sensor(of_force, asked, asked.accelerometer, {}, white))
    return tuple(out)


@dataclass(frozen=True, eq=False)
class Learnt:
    """Fits of a sensor's stretches: ``taught`` on the half before ``held``, ``found`` on all, each with whether the
    reference follows the sensor; the prior of all."""

    stretches: Sequence[Stretch]
    held: list[tuple[Stretch, int]]
    taught: tuple[Fitted, bool]
    found: tuple[Fitted, bool]
    prior: Prior

    def told(self, usual: Prior) -> tuple[Prior, Prior]:
        """Priors of the half and of all for another sensor beside this reference, with what this one tells of it.

        A reference computed from this sensor shares errors with it that the difference does not show.
        """
        half, whole = (
            usual if follows else with_slow_error_of(usual, fitted.draws)
            for fitted, follows in (self.taught, self.found)
        )
        return half, whole


def learnt(stretches: Sequence[Stretch], usual: tuple[Prior, Prior], static: StaticNoise | None) -> Learnt:
    """Both fits, under the usual priors of the half and of all."""
    half, held = halves(stretches)
    of_half, of_all = (informed(one, stretches, static) for one in usual)
    return Learnt(
        stretches,
        held,
        independent_or_not(half, of_half, usual[0]),
        independent_or_not(stretches, of_all, usual[1]),
        of_all,
    )


def _refuse_short(stretches: Sequence[Stretch], motion: ReferenceMotion) -> None:
    shared = sum(float(one.time_s[-1] - one.time_s[0]) for one in stretches)
    if shared < LEAST_S:
        raise RefusedError(
            f"{motion.source}: log and reference share {shared:.0f} s without a gap; give at least {LEAST_S:.0f} s."
        )


def _sensor(
    learnt: Learnt, asked: Asked, static: StaticNoise | None, left: Left, white_rad: float = 0.0
) -> SensorFilterNoise:
    stretches, taught, (found, follows) = learnt.stretches, learnt.taught[0], learnt.found
    is_gyro = stretches[0].tilts is None
    gain, sigma, tau = forgetting(stretches, found)
    is_gm = gain > PREFERRED
    draws = found.draws
    N, K = bounded(np.hypot(draws[:, 0], draws[:, 1])), bounded(draws[:, 2])
    if follows:
        # What is left beside it is the reference's as much as the sensor's.
        assert static is not None
        N, K = static.N, replace(K, lower=0.0, is_limit=True)
    tilt = None if is_gyro else asked.gravity_m_s2 * np.array([1.0, white_rad * np.sqrt(BLOCK_S)])
    warm = of_temperature(stretches, found, asked.horizons_s)
    shares = tuple(
        share
        for h in asked.horizons_s
        for share in shares_over(
            {**parts_of(draws, h, tilt, turned_alike(stretches, h)), **left.get(h, {}), **warm.get(h, {})}, h
        )
    )
    return SensorFilterNoise(
        sensor="gyroscope" if is_gyro else "accelerometer",
        unit="rad/s" if is_gyro else "m/s^2",
        N=N,
        K=K,
        static=static,
        bias=BiasModel("gauss-markov", gain, sigma, tau) if is_gm else BiasModel("walk", gain),
        axes_N=() if follows else unlike_axes_beside(stretches, found, N),
        vibration=bounded(draws[:, 1]) if learnt.prior.is_there[1] and not follows else None,
        reference=_worth(draws, follows),
        shares=shares,
        consistency=tuple(
            one for h in asked.horizons_s if (one := consistency(learnt.held, taught, static, h)) is not None
        ),
        is_settled=found.is_settled and taught.is_settled,
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
    return replace(usual, mean=mean, sigma=sigma, is_there=is_there)


def independent_or_not(stretches: Sequence[Stretch], prior: Prior, usual: Prior) -> tuple[Fitted, bool]:
    """The fit with noise at rest as a datum, or, where the evidence prefers it, of a reference that follows the sensor.

    A smoother over this sensor repeats part of its noise, and what is left of it beside the reference may be any less.
    """
    apart = fit(stretches, prior)
    if prior.sigma[0] == usual.sigma[0] or np.log(np.median(apart.draws[:, 0])) > prior.mean[0] - prior.sigma[0]:
        return apart, False
    wide = prior.sigma.copy()
    wide[0] = usual.sigma[0]
    other = fit(stretches, replace(prior, sigma=wide))
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
        plain[3] = 0.0 if held[0][0].tilts is None else taught.mode[3]
        exact = [(replace(one, given=None), first) for one, first in held]
        beside = errors_over(exact, plain[None], horizon_s)
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


# What the error over a horizon is made of (docs/filter-noise.md).


def parts_of(
    draws: FloatArray, horizon_s: float, tilt: FloatArray | None = None, alike: FloatArray = UNTURNED
) -> dict[Cause, FloatArray]:
    """Mean squares (k,) of all three axes together by cause, under strengths (k, 7), without the correction's.

    Of an angle over h: 3 N² h, 3 V² h, K² h³, and of a reference the difference of two of its errors,
    2 σ² (1 - k(h)) and white; one of the body turns with it, so that only ``alike`` (n,) of it, at times from 0 to h,
    is still the same (`turned_alike`). ``tilt`` (2,) makes it a velocity: what a radian of slow error [m/s²], and the
    white error of the attitude [m/s/√s], add over h, of two axes.
    """
    s = dict(zip(NAMES, draws.T, strict=True))
    h = horizon_s
    out: dict[Cause, FloatArray] = {"rest": 3.0 * s["noise"] ** 2 * h, "vibration": 3.0 * s["vibration"] ** 2 * h}
    out["bias"] = s["bias_walk"] ** 2 * h**3
    if tilt is None:
        same = matern(h, s["slow_s"])
        slow = s["world"] ** 2 * (1.0 - same) + s["body"] ** 2 * (1.0 - same * alike[-1])
        out["reference"] = 6.0 * (s["white"] ** 2 + slow)
    else:
        world, body = (_twice_summed(h, s["slow_s"], same) for same in (UNTURNED, alike))
        slow = s["world"] ** 2 * world + s["body"] ** 2 * body
        out["reference"] = 12.0 * s["white"] ** 2 + 2.0 * (tilt[0] ** 2 * slow + tilt[1] ** 2 * h)
    return out


def shares_over(parts: dict[Cause, FloatArray], horizon_s: float) -> tuple[Share, ...]:
    """Shares with 95 % intervals of causes' mean squares (k,); a cause without a part has no share."""
    total = np.sum(list(parts.values()), axis=0)
    return tuple(Share(name, horizon_s, bounded(parts[name] / total)) for name in CAUSES if name in parts)


def turned_alike(stretches: Sequence[Stretch], horizon_s: float) -> FloatArray:
    """(n,) how much of a vector of the body is still the same in the world, at times from 0 to ``horizon_s``: a third
    of the trace of the turn, its mean over all starts."""
    step_s = float(np.median(np.diff(stretches[0].time_s)))
    alike = []
    for ahead in range(max(1, round(horizon_s / step_s)) + 1):
        pairs = [(one.attitude[ahead:], one.attitude[: len(one.attitude) - ahead]) for one in stretches]
        starts = sum(len(later) for later, _ in pairs)
        alike.append(sum(float(np.sum(later * before)) for later, before in pairs) / (3.0 * max(starts, 1)))
    return np.array(alike)


def _twice_summed(h: float, tau_s: FloatArray, alike: FloatArray) -> FloatArray:
    """Variance of the integral over h of a Matérn-3/2 process of variance one, of which ``alike`` stays the same."""
    lag = np.linspace(0.0, h, 101)
    kernel = matern(lag[None, :], tau_s[:, None]) * np.interp(lag, np.linspace(0.0, h, len(alike)), alike)
    return np.asarray(2.0 * trapezoid((h - lag) * kernel, lag, axis=1))
