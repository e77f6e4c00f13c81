"""The part of the bias that follows a logged temperature: columns of a stretch, and its share of the error."""

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
"""How far biases of parts move [SI/K], one σ, as the session's effects of temperature have it."""
WIDE = 3.0
"""The columns' prior in those: a part may be worse than most."""
SIZES = np.geomspace(1e-3, 2.0, 33)
"""Of the biases per kelvin that are tried, in those of the prior."""
GROUPS = 40
"""Of draws with like K; the biases per kelvin of a group are those under the strengths in its middle."""
LEAST_SWING_K = 0.3
"""A sensor's own thermometer scatters by some hundredths."""


def beside_temperature(stretches: Sequence[Stretch], recording: Recording, per_kelvin: float) -> list[Stretch]:
    """Stretches with three columns for a bias along a logged temperature; as they are where none was logged or moved.

    ``per_kelvin`` is the size of such a bias [SI/K].
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
        # Means: a thermometer's scatter and its LSB are no temperature.
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
    """Mean squares, over all starts of every horizon, of what the temperature's change since the start makes of the
    bias; nothing where none was logged."""
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

    What moves slowly is temperature or walk: each goes with a K near that of its own draw.
    """
    order = np.argsort(found.draws[:, NAMES.index("bias_walk")])
    errors = np.empty((len(order), 3))
    for seed, some in enumerate(np.array_split(order, GROUPS)):
        parts = [one.coefficients(found.draws[some[len(some) // 2]]) for one in told]
        # One sensor in all stretches; each holds the prior, which counts once.
        inverses = [np.linalg.inv(cov[-3:, -3:]) for _, cov in parts]
        cov = np.linalg.inv(np.sum([one - np.eye(3) for one in inverses], axis=0) + FLAT * np.eye(3))
        seen = np.sum([inverse @ mean[-3:] for inverse, (mean, _) in zip(inverses, parts, strict=True)], axis=0)
        errors[some] = told[0].kelvin_size * drawn_errors(cov @ seen, cov, SIZES, len(some), seed)
    return errors


def _since_start(stretch: Stretch, horizon_s: float) -> FloatArray:
    """(n, 3, 3) what a kelvin's bias makes of the error over a horizon, from every start on."""
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
