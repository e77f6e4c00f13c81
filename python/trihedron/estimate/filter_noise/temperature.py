"""Bias proportional to a logged temperature: columns of a stretch, and its share of the error."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.filter_noise.left_over import FLAT, Left, drawn_errors, mean_square
from trihedron.estimate.filter_noise.strengths import Fitted
from trihedron.estimate.filter_noise.stretch import NAMES, Stretch
from trihedron.records import Recording

PER_KELVIN = {"gyroscope": 4e-4, "accelerometer": 5e-3}
"""Temperature coefficient of the bias [SI/K], 1 σ over parts, as in the session's temperature effects."""
WIDE = 3.0
"""Prior σ of the columns in units of ``PER_KELVIN``: a part may be worse than most."""
SIZES = np.geomspace(1e-3, 2.0, 33)
"""Sizes of the temperature coefficient that are tried, in units of the prior σ."""
GROUPS = 40
"""Groups of draws with similar K: the coefficients of a group use the strengths of its median draw."""
LEAST_SWING_K = 0.3
"""Least temperature range [K] that is used: a sensor's own thermometer has noise of some 0.01 K."""


def beside_temperature(stretches: Sequence[Stretch], recording: Recording, per_kelvin: float) -> list[Stretch]:
    """Stretches with three columns for a bias proportional to the logged temperature, with prior σ ``WIDE per_kelvin``.

    Unchanged where no temperature was logged or its range is below ``LEAST_SWING_K``. ``per_kelvin`` is in SI/K.
    """
    degrees = recording.temperature_degc
    if degrees is None:
        return list(stretches)
    is_there = np.isfinite(degrees)
    if np.count_nonzero(is_there) < 2:
        return list(stretches)
    time, value = recording.time_s[is_there], degrees[is_there]
    heated = np.append(0.0, np.cumsum(0.5 * (value[1:] + value[:-1]) * np.diff(time)))

    def mean_of_blocks(at: FloatArray) -> FloatArray:
        # Block means reduce the thermometer's noise and resolution.
        half = 0.5 * float(np.median(np.diff(at)))
        first, last = np.clip(at - half, time[0], time[-1]), np.clip(at + half, time[0], time[-1])
        covered = np.maximum(last - first, 1e-9)
        return np.asarray((np.interp(last, time, heated) - np.interp(first, time, heated)) / covered)

    of_stretches = [mean_of_blocks(one.time_s) for one in stretches]
    every = np.concatenate(of_stretches)
    if np.ptp(every) < LEAST_SWING_K:
        return list(stretches)
    return [
        _with_columns(one, kelvin - every.mean(), WIDE * per_kelvin)
        for one, kelvin in zip(stretches, of_stretches, strict=True)
    ]


def _with_columns(stretch: Stretch, kelvin: FloatArray, size: float) -> Stretch:
    along = stretch.bias_steps @ np.kron(kelvin[:, None], size * np.eye(3))
    return replace(
        stretch,
        columns=np.hstack([stretch.columns, along]),
        centre=np.append(stretch.centre, np.zeros(3)),
        kelvin=kelvin,
        kelvin_size=size,
    )


def of_temperature(stretches: Sequence[Stretch], found: Fitted, horizons_s: Sequence[float]) -> Left:
    """Mean square errors, over all starts of every horizon, from the change of bias with temperature since the start;
    empty where no temperature was logged."""
    told = [one for one in stretches if one.kelvin is not None]
    if not told:
        return {}
    errors = _drawn(told, found)
    return {
        h: {"temperature": mean_square(np.concatenate([_since_start(one, h) for one in told]), errors)}
        for h in horizons_s
    }


def _drawn(told: Sequence[Stretch], found: Fitted) -> FloatArray:
    """(k, 3) bias per kelvin [SI/K], one for each draw of the strengths.

    A slow bias change is due to temperature or to the random walk: each coefficient is drawn under a K near its draw's.
    """
    order = np.argsort(found.draws[:, NAMES.index("bias_walk")])
    errors = np.empty((len(order), 3))
    for seed, some in enumerate(np.array_split(order, GROUPS)):
        parts = [one.coefficients(found.draws[some[len(some) // 2]]) for one in told]
        # All stretches are of one sensor; each posterior contains the prior, which counts once.
        inverses = [np.linalg.inv(cov[-3:, -3:]) for _, cov in parts]
        cov = np.linalg.inv(np.sum([one - np.eye(3) for one in inverses], axis=0) + FLAT * np.eye(3))
        seen = np.sum([inverse @ mean[-3:] for inverse, (mean, _) in zip(inverses, parts, strict=True)], axis=0)
        errors[some] = told[0].kelvin_size * drawn_errors(cov @ seen, cov, SIZES, len(some), seed)
    return errors


def _since_start(stretch: Stretch, horizon_s: float) -> FloatArray:
    """(n, 3, 3) derivative, by the bias per kelvin, of the error over a horizon from each of n starts."""
    assert stretch.kelvin is not None
    m = len(stretch.time_s)
    ahead = max(1, round(horizon_s / float(np.median(np.diff(stretch.time_s)))))
    own = stretch.bias_steps.reshape(m, 3, m, 3)[-1].transpose(1, 0, 2)[:-1]
    zero = np.zeros((1, 3, 3))
    plain, warm = (
        np.concatenate([zero, np.cumsum(own * by[:, None, None], axis=0)])
        for by in (np.ones(m - 1), stretch.kelvin[:-1])
    )
    edge = np.append(stretch.kelvin[:1], 0.5 * (stretch.kelvin[1:-1] + stretch.kelvin[:-2]))[: max(m - ahead, 0)]
    n = len(edge)
    return np.asarray(warm[ahead : ahead + n] - warm[:n] - edge[:, None, None] * (plain[ahead : ahead + n] - plain[:n]))
