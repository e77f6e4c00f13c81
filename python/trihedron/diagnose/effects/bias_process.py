"""Bias that drifts in time, or differs from pose to pose, and that no logged channel explains."""

from abc import abstractmethod
from collections.abc import Sequence
from dataclasses import replace
from typing import ClassVar

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.diagnose.context import Context
from trihedron.diagnose.effects.contract import (
    ACCELEROMETER,
    GYRO,
    PRIOR_SCALES,
    SENSORS,
    Effect,
    Variant,
    on_axes,
    per_axis,
    per_axis_parameters,
)
from trihedron.records.diagnosis import EffectParameter
from trihedron.records.words import Words, why_not
from trihedron.session.drift import TYPICAL, WARM_UP_FRACTIONS
from trihedron.session.noise import FEWEST_POSES
from trihedron.session.rounding import UNIFORM

STEP, STEP_TIME = "step", "step_time"
N_STEPS = 8
"""Places of a step that are tried; of those spread evenly, one half a place away still has most of its evidence."""
COSINES = (1, 2, 3, 4)
"""Half periods of a slow curve in the session: as many bends as a fit of S and b leaves to twenty poses."""


class BiasProcess(Effect):
    """Random changes of a bias: a strength of the session's noise beyond what the part explains
    (:mod:`diagnose.bias_strengths`), not columns of the readings."""

    sensor: ClassVar[int]
    """0 accelerometer, 1 gyro."""
    walks: ClassVar[bool]
    """Whether the bias walks from pose to pose; otherwise it is drawn anew in each."""

    @property
    def unit(self) -> str:
        """SI unit of the bias."""
        return SENSORS[self.sensor].unit

    def unavailable(self, context: Context) -> str | None:
        return super().unavailable(context) or (why_not("six-poses") if context.obs.n_poses < FEWEST_POSES else None)

    @abstractmethod
    def of_strength(self, size: FloatArray, std: FloatArray) -> tuple[tuple[EffectParameter, ...], Words]:
        """Parameters and sentence for the size along every axis, SI (3,), with standard uncertainties."""


class BiasDrift(BiasProcess):
    """Warm-up exponential, straight line, slow curve or step per axis, or a walk stronger than the part's noise
    explains."""

    walks = True
    typical: ClassVar[float]
    """Bias change of typical parts, SI."""

    @property
    def shows_as(self) -> int:
        """Sensor whose bias the poses show where it drifts: either one's as a gyro's in a log of one orientation."""
        return self.sensor

    def variants(self, context: Context) -> list[Variant]:
        """Line, warm-up exponentials, a slow curve of some cosines per axis, and steps (after a shock)."""
        out = [self._along(context, context.elapsed[:, None], ("drift",), "line")]
        out += [self._warm_up(context, fraction * _duration_s(context)) for fraction in WARM_UP_FRACTIONS]
        cosines = np.cos(np.pi * np.outer(context.elapsed, COSINES))
        out.append(self._along(context, cosines, [f"cosine{k}" for k in COSINES], "curve"))
        return out + self._steps(context)

    def _warm_up(self, context: Context, tau_s: float) -> Variant:
        """An exponential with one time constant; its parameters are, per axis, the bias at the first sample above that
        of a warm sensor."""
        lasts_s = _duration_s(context)
        tau_s = max(tau_s, WARM_UP_FRACTIONS[0] * lasts_s)
        decay = np.exp(-context.elapsed[:, None] * lasts_s / tau_s)
        return self._along(context, decay, ("warm_up",), "warm-up", {"time_constant": (tau_s, "s")})

    def _steps(self, context: Context) -> list[Variant]:
        """Steps at the likeliest places between poses, chosen by the poses alone among all."""
        times, h = context.time_s[: context.obs.n_poses], context.obs.n_poses
        out = []
        for k in np.argsort(_left_by_steps(context, self.shows_as))[:N_STEPS]:
            at_s = float(0.5 * (times[k] + times[k + 1]))
            after = (context.time_s[:, None] > at_s).astype(np.float64)
            made = self._along(context, after, (STEP,), STEP, {STEP_TIME: (at_s, "s")})
            sigma = float(times[k + 1] - times[k]) * np.sqrt(UNIFORM)
            out.append(replace(made, shape_sigma=sigma, n_places=max((h - 1) / N_STEPS, 1.0)))
        return out

    def _along(
        self, context: Context, curves: FloatArray, symbols: Sequence[str], label: str,
        shape: dict[str, tuple[float, str]] | None = None,
    ) -> Variant:  # fmt: skip
        """``curves`` (points, k) over time, zero on average over the poses, as the session's bias is."""
        weights = context.obs.segments.duration_s
        centred = curves - np.average(curves[: len(weights)], axis=0, weights=weights)
        parts = ((symbol, values[:, None], self.unit) for symbol, values in zip(symbols, centred.T, strict=True))
        return on_axes(context, self.sensor, *parts, label=label, shape=shape)

    def sizes(self, context: Context, variant: Variant) -> FloatArray:  # noqa: ARG002
        return np.full(variant.distortion.n_parameters, self.typical)

    def reshaped(self, context: Context, variant: Variant, value: float) -> Variant | None:
        return self._warm_up(context, value) if variant.label == "warm-up" else None

    def is_plausible(self, variant: Variant, value: FloatArray, covariance: FloatArray) -> bool:  # noqa: ARG002
        """Whether the peak-to-peak range of the curve is that of a part's bias, within two standard deviations of parts
        that differ tenfold (0.1 g, 5 °/s; chambers of 90 K show as much); a larger one indicates a disturbed pose."""
        side = (variant.distortion.force, variant.distortion.rate)[self.sensor]
        if side is None:
            return True
        # Contiguous per axis: ptp over rows of three takes ten times as long.
        drift = np.ascontiguousarray((side.reshape(-1, len(value)) @ value).reshape(len(side), 3).T)
        return float(np.ptp(drift, axis=1).max(initial=0.0)) < 2.0 / PRIOR_SCALES[-1] * self.typical

    def of_strength(
        self, size: FloatArray, std: FloatArray, *, is_counts: bool = False, variant: Variant | None = None
    ) -> tuple[tuple[EffectParameter, ...], Words]:
        """Parameters and sentence of a random walk, or of the step or curve of a ``variant``; readings of a log of one
        orientation may be counts of unknown scale."""
        if variant is None:
            said = self.reported("walk", range=size, is_counts=is_counts)
        elif variant.label == STEP:
            at_s, _ = variant.shape[STEP_TIME]
            said = self.reported("step", range=size, step_time=at_s, is_counts=is_counts)
        else:
            said = self.reported("static", range=size, is_counts=is_counts)
        return per_axis_parameters("range", size, std, self.unit), said

    def statement(self, parameters: tuple[EffectParameter, ...]) -> str:
        values = {p.name: p.value for p in parameters}
        if STEP_TIME not in values:
            return super().statement(parameters)
        step = [values[name] for name in per_axis(STEP)]
        return self.reported("step", range=step, step_time=values[STEP_TIME], is_counts=False)


class AccelBiasDrift(BiasDrift):
    """Accelerometer bias drift: seen in the norm of gravity from pose to pose."""

    id, sensor = "accel-bias-drift", ACCELEROMETER
    confounded_with = ("accel-bias",)
    typical = TYPICAL[0]


class GyroBiasDrift(BiasDrift):
    """Gyro bias drift: seen in the static rates from pose to pose."""

    id, sensor, needs_gyro = "gyro-bias-drift", GYRO, True
    confounded_with = ("gyro-bias",)
    typical = TYPICAL[1]


def _left_by_steps(context: Context, sensor: int) -> FloatArray:
    """(poses - 1,) sum of squares that a step of the bias behind each pose leaves in the means of the poses, beside S
    and b. Gravity shows an accelerometer's bias along the vertical only."""
    error, up = context.static_errors(sensor), context.fitted.state.up
    seen, known = (np.ones((len(error), 1)),) * 2
    if sensor == ACCELEROMETER:
        error, seen, known = np.einsum("ni,ni->n", up, error)[:, None], up, context.norm_columns
    out = np.zeros(len(error) - 1)
    for k in range(len(out)):
        later = np.arange(len(error))[:, None] > k
        columns = np.hstack([known, np.where(later, seen, 0.0)])
        out[k] = ((error - columns @ np.linalg.lstsq(columns, error)[0]) ** 2).sum()
    return out


def _duration_s(context: Context) -> float:
    return float(context.obs.time_s[-1] - context.obs.time_s[0])


class GyroBiasRepeatability(BiasProcess):
    """The bias of every axis is drawn anew in every pose, beyond noise and drift."""

    is_spread = True
    id, sensor, walks = "gyro-bias-repeatability", GYRO, False
    needs_gyro = True

    def of_strength(self, size: FloatArray, std: FloatArray) -> tuple[tuple[EffectParameter, ...], Words]:
        return per_axis_parameters("sigma", size, std, self.unit), self.reported("scatter", sigma=size)


class AccelBiasRepeatability(BiasProcess):
    """Bias drawn anew in every pose, one sigma for all axes: the norm of gravity does not separate the axes."""

    is_spread = True
    id, sensor, walks = "accel-bias-repeatability", ACCELEROMETER, False

    def of_strength(self, size: FloatArray, std: FloatArray) -> tuple[tuple[EffectParameter, ...], Words]:
        sigma, error = float((size**2).mean() ** 0.5), float((std**2).mean() ** 0.5)
        return (EffectParameter("sigma", sigma, error, self.unit),), self.reported("scatter", sigma=sigma)
