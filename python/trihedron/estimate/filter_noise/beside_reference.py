"""Noise of both sensors for a filter from a log with a reference, validated on the held-out half of the log."""

from collections.abc import Sequence
from dataclasses import dataclass, replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.estimate.filter_noise.left_over import Left, beside_temperature, left_over, of_temperature
from trihedron.estimate.filter_noise.strengths import (
    PREFERRED,
    Fitted,
    Prior,
    bounded,
    fit,
    forgetting,
    unlike_axes_beside,
    with_slow_error_of,
)
from trihedron.estimate.filter_noise.stretch import NAMES, Stretch, errors_over, matern
from trihedron.estimate.filter_noise.stretches import angle_stretches, velocity_stretches
from trihedron.estimate.reference.beside import BLOCK_S
from trihedron.estimate.reference.fit import laid_beside
from trihedron.estimate.reference.motion import fit_motion
from trihedron.estimate.reference.slip import slip_of
from trihedron.estimate.reference.worth import error_of, of_error
from trihedron.records import Finding, Recording
from trihedron.records.filter_noise import (
    CAUSES,
    BiasModel,
    Bounded,
    Cause,
    Nees,
    ReferenceWorth,
    SensorFilterNoise,
    Share,
    StaticNoise,
)
from trihedron.records.reference import ReferenceMotion
from trihedron.session.drift import PER_KELVIN

ANGLE = Prior(
    np.array([*np.log([2e-4, 2e-4, 2e-5, 3e-4, 1e-3, 8.0]), 0.0, np.log(PER_KELVIN[1])]),
    np.array([*np.log([30.0, 30.0, 30.0, 30.0, 30.0, 4.0]), 1.0, np.log(30.0)]),
    np.ones(8),
)
"""Prior for consumer gyros and optical trackers: factor 30 either way, 4 for the time constant (as `--reference`)."""
VELOCITY = replace(ANGLE, mean=np.array([*np.log([2e-3, 2e-3, 3e-4, 1e-3, 1e-3, 8.0]), 0.0, np.log(PER_KELVIN[0])]))
"""Prior for accelerometers with a reference position: 1 mm of white error; the slow error is that of the attitude and
gets its prior from the gyro's fit (`with_slow_error_of`)."""
LEAST_S = 40.0
"""Shortest shared motion: in less, the halves do not validate predictions over 10 s."""
UNTURNED = np.ones(2)
"""``turned_alike`` of a body that does not rotate."""
PREDICTING = 100
"""Number of draws of the strengths per prediction: with 20 the NEES of a flight scatters by 5 %, with 100 by 3 %."""


@dataclass(frozen=True)
class Request:
    """Options: ``horizons_s``, ``band_hz`` above which power is vibration, ``gravity_m_s2``, and the static noise of
    each sensor, where known."""

    horizons_s: tuple[float, ...]
    band_hz: float
    gravity_m_s2: float
    gyroscope: StaticNoise | None = None
    accelerometer: StaticNoise | None = None


def beside_reference(
    recording: Recording, motion: ReferenceMotion, asked: Request
) -> tuple[tuple[SensorFilterNoise, ...], tuple[Finding, ...]]:
    """Filter noise of the gyro, and with a reference position of the accelerometer, beside a reference attitude; and
    findings of the reference.

    Raises ``InputError`` when the reference has no attitude, or log and reference share less than ``LEAST_S``.
    """
    if motion.attitude is None:
        raise InputError(f"{motion.source}: the reference holds rates; give attitudes, whose errors do not add up.")
    side = laid_beside(recording, motion, asked.gravity_m_s2)
    found = fit_motion([side])
    known = 0.0 if asked.gyroscope is None else asked.gyroscope.N.value
    stretches = beside_temperature(angle_stretches(found, asked.band_hz, known), recording)
    shared = sum(float(one.time_s[-1] - one.time_s[0]) for one in stretches)
    if shared < LEAST_S:
        raise InputError(
            f"{motion.source}: log and reference share {shared:.0f} s without a gap; give at least {LEAST_S:.0f} s."
        )
    left = left_over(found, asked.horizons_s)
    of_gyro = learnt(stretches, (ANGLE, ANGLE), asked.gyroscope)
    out = [_sensor(stretches, of_gyro, asked, left)]
    if motion.position is not None and side.force is not None:
        known = 0.0 if asked.accelerometer is None else asked.accelerometer.N.value
        white = bounded(of_gyro[1].draws[:, NAMES.index("white")]).value
        more = velocity_stretches(side, found.points[0], asked.band_hz, known, asked.gravity_m_s2, white)
        more = beside_temperature(more, recording)
        # Where the reference was computed from the gyro, common errors cancel in the difference.
        half, every = (VELOCITY if one.follows else with_slow_error_of(VELOCITY, one.draws) for one in of_gyro)
        out.append(_sensor(more, learnt(more, (half, every), asked.accelerometer), asked, {}, white))
    error = error_of(found)
    return tuple(out), tuple(of_error(error, slip_of(found, 0, error), is_of_noise=True))


def learnt(
    stretches: Sequence[Stretch], usual: tuple[Prior, Prior], static: StaticNoise | None
) -> tuple[Fitted, Fitted]:
    """Fits on the first half and on all stretches, under their ``usual`` priors and the static noise."""
    half, whole = (
        independent_or_not(some, informed(one, stretches, static), one)
        for some, one in zip((halves(stretches)[0], stretches), usual, strict=True)
    )
    return half, whole


def _sensor(
    stretches: Sequence[Stretch], fits: tuple[Fitted, Fitted], asked: Request, left: Left, white_rad: float = 0.0
) -> SensorFilterNoise:
    (taught, found), quietest = fits, stretches[0].quietest
    is_gyro = stretches[0].tilts is None
    static = asked.gyroscope if is_gyro else asked.accelerometer
    gain, sigma, tau = forgetting(stretches, found)
    is_gm = gain > PREFERRED
    s = dict(zip(NAMES, found.draws.T, strict=True))
    N, K = bounded(np.hypot(s["noise"], s["vibration"])), bounded(s["bias_walk"])
    if found.follows:
        # The difference contains the reference's error as much as the sensor's: N is the static one.
        assert static is not None
        N, K = static.N, replace(K, lower=0.0, is_limit=True)
    if static is None and N.upper < quietest:
        # The quietest second contains the static noise; a reference computed from these readings hides part of it.
        N = Bounded(N.value, N.lower, quietest, True)
    tilt = None if is_gyro else asked.gravity_m_s2 * np.array([1.0, white_rad * np.sqrt(BLOCK_S)])
    # Of a horizon longer than every stretch nothing is seen.
    longest_s = max(float(one.time_s[-1] - one.time_s[0]) for one in stretches)
    horizons = [h for h in asked.horizons_s if h <= longest_s]
    warm = of_temperature(stretches, found, horizons)
    shares = tuple(
        share
        for h in horizons
        for share in shares_over(
            {**parts_of(found.draws, h, tilt, turned_alike(stretches, h)), **left.get(h, {}), **warm.get(h, {})}, h
        )
    )
    slow = bounded(np.hypot(s["world"], s["body"]))
    return SensorFilterNoise(
        sensor="gyroscope" if is_gyro else "accelerometer",
        unit="rad/s" if is_gyro else "m/s^2",
        N=N,
        K=K,
        static=static,
        bias=BiasModel("gauss-markov", gain, sigma, tau) if is_gm else BiasModel("walk", gain),
        axes_N=() if found.follows else unlike_axes_beside(stretches, found, N),
        vibration=bounded(s["vibration"]) if np.any(s["vibration"]) and not found.follows else None,
        reference=ReferenceWorth(bounded(s["white"]), slow, float(np.median(s["slow_s"])), found.follows),
        shares=shares,
        consistency=consistency(halves(stretches)[1], taught, static, asked.horizons_s),
        is_settled=found.is_settled and taught.is_settled,
        quietest=quietest,
    )


def informed(usual: Prior, stretches: Sequence[Stretch], static: StaticNoise | None) -> Prior:
    """The usual prior with the static N as a datum; without vibration where the band power does not exceed noise,
    without temperature where none was logged."""
    mean, sigma, is_there = usual.mean.copy(), usual.sigma.copy(), usual.is_there.copy()
    if static is not None and not static.N.is_limit and static.N.value > 0.0:
        mean[0] = np.log(static.N.value)
        # σ from the 95 % interval of N, at least 5 %: the repeatability of a unit from day to day.
        sigma[0] = max(0.25 * np.log(static.N.upper / max(static.N.lower, 1e-12)), 0.05)
        mean[1] = mean[0]
    power = np.concatenate([one.power for one in stretches])
    # Without a static N only a change of power separates vibration from noise.
    shows = np.any(power > 0.0) and (static is not None or np.std(power) > 0.2 * np.mean(power))
    is_there[1] = float(shows)
    is_there[7] = float(stretches[0].kelvin is not None)
    return replace(usual, mean=mean, sigma=sigma, is_there=is_there)


def independent_or_not(stretches: Sequence[Stretch], prior: Prior, usual: Prior) -> Fitted:
    """The fit with the static N as a datum, or the fit without it where the evidence prefers that.

    A reference smoothed from this sensor repeats part of its noise: N of the difference is then below the static N.
    """
    apart = fit(stretches, prior)
    if prior.sigma[0] == usual.sigma[0] or np.log(np.median(apart.draws[:, 0])) > prior.mean[0] - prior.sigma[0]:
        return apart
    wide = prior.sigma.copy()
    wide[0] = usual.sigma[0]
    other = fit(stretches, replace(prior, sigma=wide))
    return replace(other, follows=True) if 2.0 * (other.evidence - apart.evidence) > PREFERRED else apart


def halves(stretches: Sequence[Stretch]) -> tuple[list[Stretch], list[tuple[Stretch, int]]]:
    """Stretches of the first half of the time, for the fit, and stretches with their first held-out block."""
    n = np.array([len(one.time_s) for one in stretches])
    cuts = np.clip(n.sum() // 2 - (np.cumsum(n) - n), 0, n).tolist()
    learnt = [one.part(0, cut) for one, cut in zip(stretches, cuts, strict=True) if cut >= 2]
    return learnt, [(one, cut) for one, cut in zip(stretches, cuts, strict=True) if cut < len(one.time_s)]


def consistency(
    held: Sequence[tuple[Stretch, int]], taught: Fitted, static: StaticNoise | None, horizons_s: Sequence[float]
) -> tuple[Nees, ...]:
    """Held-out NEES and rms over each horizon under ``taught``, and under static N and K with an exact reference."""
    found = errors_over(held, taught.draws[:: max(1, len(taught.draws) // PREDICTING)], horizons_s)
    if static is None:
        return tuple(found)
    plain = np.zeros(len(NAMES))
    plain[[0, 2]] = static.N.filter_value, static.K.filter_value
    # The white error of a position is never 0: the fitted one is kept.
    plain[3] = 0.0 if held[0][0].tilts is None else taught.mode[3]
    exact = errors_over([(replace(one, white_rad=0.0), first) for one, first in held], plain[None], horizons_s)
    return tuple(
        replace(own, static_nees=one.nees, static_predicted=one.predicted, static_actual=one.actual)
        for own, one in zip(found, exact, strict=True)
    )


# Shares of the error over a horizon (docs/filter-noise.md).


def parts_of(
    draws: FloatArray, horizon_s: float, tilt: FloatArray | None = None, alike: FloatArray = UNTURNED
) -> dict[Cause, FloatArray]:
    """Mean squares (k,), summed over the axes, by cause, under strengths (k, 8); without calibration and temperature.

    For an angle over h: 3 N² h, 3 V² h, K² h³; for the reference 2 σ² (1 - k(h)) per axis and white error, because two
    of its errors are subtracted. A body-frame error rotates with the body: the fraction ``alike`` (n,), at times from 0
    to h, stays common (`turned_alike`). For a velocity, ``tilt`` (2,) is the acceleration per radian of slow error
    [m/s²] and the effect of the attitude's white error [m/s/√s]; two axes are affected.
    """
    s = dict(zip(NAMES, draws.T, strict=True))
    h = horizon_s
    out: dict[Cause, FloatArray] = {"static": 3.0 * s["noise"] ** 2 * h, "vibration": 3.0 * s["vibration"] ** 2 * h}
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
    """Shares of the mean squares (k,) by cause, with 95 % intervals; a cause that is not in ``parts`` has no share."""
    total = np.sum(list(parts.values()), axis=0)
    return tuple(Share(name, horizon_s, bounded(parts[name] / total)) for name in CAUSES if name in parts)


def turned_alike(stretches: Sequence[Stretch], horizon_s: float) -> FloatArray:
    """(n,) mean correlation, in the world frame, of a body-fixed vector after times from 0 to ``horizon_s``: trace/3 of
    the rotation, averaged over all starts."""
    alike = []
    for ahead in range(max(1, round(horizon_s / stretches[0].step_s)) + 1):
        pairs = [(one.attitude[ahead:], one.attitude[: len(one.attitude[ahead:])]) for one in stretches]
        starts = sum(len(later) for later, _ in pairs)
        alike.append(sum(float(np.sum(later * before)) for later, before in pairs) / (3.0 * max(starts, 1)))
    return np.array(alike)


def _twice_summed(h: float, tau_s: FloatArray, alike: FloatArray) -> FloatArray:
    """Variance (k,) of the integral over h of a unit Matérn-3/2 process, its correlation multiplied by ``alike``."""
    lag = np.linspace(0.0, h, 101)
    kernel = matern(lag[None, :], tau_s[:, None]) * np.interp(lag, np.linspace(0.0, h, len(alike)), alike)
    return np.asarray(2.0 * np.trapezoid((h - lag) * kernel, lag, axis=1))
