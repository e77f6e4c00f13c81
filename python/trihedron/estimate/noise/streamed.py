"""Noise of logs that do not fit into memory: one pass over their chunks, in bounded memory."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.estimate.noise import remarks
from trihedron.estimate.noise.allan import (
    STREAM_BUDGET_BYTES,
    as_readings,
    check_question,
    checked_clusters,
    curve_with_intervals,
    default_clusters,
)
from trihedron.estimate.noise.axis import blank_axis, identify_axis, stretches_between
from trihedron.estimate.noise.screening import readout, steps_and_impacts, tail_error
from trihedron.estimate.noise.spectrum import LONGEST_TRANSFORM, ordinates_of_means
from trihedron.records.allan_curve import AllanCurve
from trihedron.records.noise import Noise, NoiseAxis

HEAD = 1 << 20
"""Readings kept from the start of the log: they determine the noise that is faster than the means."""


def stream_noise(
    chunks: Iterable[npt.ArrayLike],
    rate_hz: float,
    *,
    n_samples: int | None = None,
    names: Sequence[str] = (),
    units: Sequence[str] = (),
    clusters: Sequence[int] | None = None,
    budget_bytes: int = STREAM_BUDGET_BYTES,
    source: str = "stream",
) -> Noise:
    """Noise terms and Allan curve of a log that is read in chunks (k, channels), in one pass (docs/noise.md, 4).

    Slow terms come from means over the whole log, fast ones from its first million readings. Steps are detected in the
    means; impacts are not excluded.

    Raises ``InputError`` when a chunk has missing readings or another number of channels, or the log is too short.
    """
    check_question(rate_hz, "overlapping", 0.95)
    sizes = default_clusters(n_samples or 1 << 44) if clusters is None else checked_clusters(clusters)
    stream: _core.AllanStream | None = None
    head: list[FloatArray] = []
    kept = 0
    for chunk in chunks:
        readings = as_readings(chunk)
        if stream is None:
            budget = max(budget_bytes // (8 * readings.shape[1]), _core.AllanStream.LEAST_BUDGET)
            stream = _core.AllanStream(readings.shape[1], sizes, budget)
        stream.extend(readings)
        if kept < HEAD:
            head.append(np.array(readings[: HEAD - kept], dtype=np.float64))
            kept += len(head[-1])
    if stream is None:
        raise InputError("the log holds no chunk of readings")
    *_, n, means = stream.finish()
    channels = len(means)
    names = tuple(names) or tuple(f"channel {c + 1}" for c in range(channels))
    curve = _curve(stream, rate_hz, names, tuple(units) or ("",) * channels)
    first = np.concatenate(head)
    block = -(-n // LONGEST_TRANSFORM)
    axes = [
        _axis(stream, c, block, rate_hz, np.ascontiguousarray(first[:, c]), curve, n, means[c]) for c in range(channels)
    ]
    return Noise(axes=tuple(axes), curve=curve, source=source)


def _curve(stream: _core.AllanStream, rate_hz: float, names: tuple[str, ...], units: tuple[str, ...]) -> AllanCurve:
    """The curve of all readings of a stream.

    Longer clusters start at every ``stride``-th reading only, at least 64 times per cluster: they contain the
    information of every start and have its degrees of freedom.
    """
    found, variance, terms, stride, n, _ = stream.finish()
    clusters = np.array(found)
    starts = np.repeat((n - 2.0 * clusters + 1.0)[:, np.newaxis], len(variance), axis=1)
    return curve_with_intervals(
        "overlapping", rate_hz, n, clusters, variance.T, terms.T, starts, 0.95, names, units, stride
    )


def _axis(
    stream: _core.AllanStream,
    channel: int,
    block: int,
    rate_hz: float,
    head: FloatArray,
    curve: AllanCurve,
    n: int,
    mean: float,
) -> NoiseAxis:
    name, unit = curve.names[channel], curve.units[channel]
    blank = blank_axis(name, unit, rate_hz, n, mean, readout(head))
    if blank.sample_sigma == 0.0:
        return blank
    means, size = stream.means(channel, block)
    steps, _ = steps_and_impacts(means)
    blank = replace(blank, findings=(*remarks.events(steps, [], [], rate_hz / size, unit), *blank.findings))
    bands = ordinates_of_means(means, size, rate_hz, stretches_between(len(means), steps), head)
    return identify_axis(bands, blank, curve, channel, tail_error(head))
