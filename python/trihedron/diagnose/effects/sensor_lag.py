"""A delay between the sensors, or a low-pass of one of them, by the first two moments of its response.

A reading y that trails the truth x by a pure delay δ has x(t) = y(t + δ); after a low-pass whose impulse response has
the mean τ and the variance v, x(t) = y(t + τ) - v/2 y''(t + τ). First order has v = τ², n equal poles τ²/n, a running
mean τ²/3, Butterworth's of second order 0. Columns are computed for a time of a grid and scale with their parameter,
which must come out near one.
"""

import math
from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray, sigmas_of
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import SENSORS, Effect, Variant, measured, on_axes
from trihedron.diagnose.session.solve import Distortion
from trihedron.probability import CLEAR
from trihedron.records.diagnosis import EffectParameter

TIMES_S = (0.004, 0.016, 0.064)
"""Times tried; of those between, the columns are computed for the size found."""
SEPARATE, DELAYS, BOTH = "per axis", ", without smoothing", "smoothing_of_both"


class _Late(Effect):
    """Readings of one sensor that trail the motion. One more parameter is no part of it: the smoothing of both sensors
    beyond that of the session (eq. 11.6d), which a calibration finds wrong where one is late."""

    needs_moves = True
    size = 0.015
    """s: one or two samples of a slow log, or the delay of a filter."""

    def sizes(self, context: Context, variant: Variant) -> FloatArray:
        sizes = super().sizes(context, variant)
        if variant.names[-1] == BOTH:
            # The variance of a filter's response is up to the square of its lag.
            sizes[1:] = 1.0
        return sizes

    def is_plausible(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:  # noqa: ARG002
        # Farther than half-way to the next time, that one fits better, or the mechanism does not.
        sigma, away = CLEAR * float(sigmas_of(covariance)[0]), math.sqrt(TIMES_S[1] / TIMES_S[0])
        return bool(max(1.0 / away - sigma, 0.0) < value[0] < away + sigma)

    def parameters(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> tuple[EffectParameter, ...]:
        lags = super().parameters(variant, value, covariance)
        if variant.names[-1] != BOTH:
            return lags
        own = slice(1, len(value) - 1)
        return lags[0], *measured(variant.names[own], value[own], sigmas_of(covariance)[own], ["1"] * (len(value) - 2))


class SensorLag(_Late):
    """Low-pass of one sensor's readings: its lag τ and smoothing v/τ², or a lag of first order per axis."""

    id = "sensor-lag"

    def variants(self, context: Context) -> list[Variant]:
        out = []
        for sensor, side in enumerate(SENSORS):
            late = -context.derivative(context.axis_motion(sensor))
            label = f"{side.label}, {SEPARATE}"
            out.append(on_axes(context, sensor, (f"{side.label}_lag", late, "s"), label=label))
        every = [
            _low_pass(context, sensor, t, f"{side.label}, {1e3 * t:.0f} ms")
            for t in TIMES_S
            for sensor, side in enumerate(SENSORS)
        ]
        return [*out, *every, *(_unsmoothed(one) for one in every)]

    def rescaled(self, context: Context, variant: Variant, value: FloatArray) -> Variant | None:
        if SEPARATE in variant.label or not value[0] > 0.0:
            return None
        sensor = int(variant.label.startswith(SENSORS[1].label))
        made = _low_pass(context, sensor, variant.scale * float(value[0]), variant.label.removesuffix(DELAYS))
        return _unsmoothed(made) if variant.label.endswith(DELAYS) else made

    def is_plausible(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:
        if SEPARATE in variant.label:
            return bool((value > -CLEAR * sigmas_of(covariance)).all() and (value > 0.0).any())
        return super().is_plausible(variant, value, covariance)


def _low_pass(context: Context, sensor: int, lag_s: float, label: str) -> Variant:
    """What a low-pass adds to readings: by a lag of this size, by a variance of its square, and by one of both
    sensors.

    That of the gyro on a clock that is late by the lag: the accelerometer is early, and the rate keeps its phase. With
    the lag in the rate a fit that begins without one ends in another minimum.
    """
    step = max(0.5 * lag_s, 1.0 / context.obs.recording.rate_hz)

    def smoothed(values: FloatArray, at: float) -> FloatArray:
        here, after, before = (context.shifted(values, t) for t in (at, at + step, at - step))
        return np.asarray(0.5 * (lag_s / step) ** 2 * (after - 2.0 * here + before))

    early_s = -lag_s if sensor else lag_s
    early, none = context.force - context.shifted(context.force, early_s), np.zeros_like(context.force)
    both = smoothed(context.force, early_s), smoothed(context.rate, 0.0)
    own = (none, both[1]) if sensor else (both[0], none)
    columns = (np.stack(side, axis=2) for side in ((early, own[0], both[0]), (none, own[1], both[1])))
    names = f"{SENSORS[sensor].label}_lag", f"{SENSORS[sensor].label}_smoothing", BOTH
    return Variant(Distortion(*columns), names, ("s",) * 3, label=label, scale=lag_s)


def _unsmoothed(low_pass: Variant) -> Variant:
    """A low-pass that does not smooth, or a delay."""
    columns, names = low_pass.distortion.of((0, 2)), (low_pass.names[0], BOTH)
    return replace(low_pass, distortion=columns, names=names, units=("s",) * 2, label=low_pass.label + DELAYS)


class AccelGyroTimeOffset(_Late):
    """Accelerometer readings belong to an earlier instant: the reading at t is f(t − δ); at δ < 0 the gyro is late."""

    id = "accel-gyro-time-offset"

    def variants(self, context: Context) -> list[Variant]:
        return [_offset(context, t, f"{1e3 * t:.0f} ms") for t in TIMES_S]

    def rescaled(self, context: Context, variant: Variant, value: FloatArray) -> Variant | None:
        return _offset(context, variant.scale * float(value[0]), variant.label)


def _offset(context: Context, delay_s: float, label: str) -> Variant:
    """What a delay adds to readings."""
    late = _unsmoothed(_low_pass(context, int(delay_s < 0.0), abs(delay_s), ""))
    return replace(late, names=("accelerometer_delay", BOTH), label=label, scale=delay_s)
