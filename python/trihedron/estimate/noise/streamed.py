"""Noise of logs that do not fit into memory: one pass over their chunks, in bounded memory."""

from collections.abc import Iterable, Sequence
from dataclasses import replace

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.estimate.noise.allan import (
    STREAM_BUDGET_BYTES,
    as_readings,
    check_question,
    checked_clusters,
    curve_with_intervals,
    default_clusters,
)
from trihedron.estimate.noise.axis import blank_axis
from trihedron.estimate.noise.identify import Channel, sudden_changes
from trihedron.estimate.noise.screening import readout
from trihedron.estimate.noise.spectrum import LONGEST_TRANSFORM
from trihedron.records import AllanCurve, Noise, NoiseAxis

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

    Slow terms come from means over the whole log, fast ones from its first million readings. Steps are detected, a
    warm-up and a wave subtracted, in the means; impacts are not excluded. Raises ``InputError`` when a chunk has
    missing readings or another number of channels, or the log is too short.
    """
    check_question(rate_hz, "overlapping", 0.95)
    sizes = default_clusters(n_samples or 1 << 44) if clusters is None else checked_clusters(clusters)
    stream: _core.AllanStream | None = None
    head: list[FloatArray] = []
    kept = 0
    for chunk in chunks:
        readings = as_readings(chunk)
        if stream is None:
            stream = _stream_of(readings.shape[1], sizes, budget_bytes)
        stream.extend(readings)
        if kept < HEAD:
            head.append(np.array(readings[: HEAD - kept], dtype=np.float64))
            kept += len(head[-1])
    if stream is None:
        raise InputError("the log holds no chunk of readings")
    found, variance, terms, stride, n, means = stream.finish()
    lengths = np.array(found)
    # Longer clusters start at every ``stride``-th reading only, at least 64 times per cluster: they contain the
    # information of every start and have its degrees of freedom.
    weight = np.repeat((n - 2.0 * lengths + 1.0)[:, np.newaxis], len(means), axis=1)
    curve = curve_with_intervals(
        "overlapping", rate_hz, n, lengths, variance.T, terms.T, weight, 0.95, tuple(names), tuple(units), stride
    )
    heads = np.ascontiguousarray(np.concatenate(head).T)
    axes = tuple(_axis(stream, c, mean, heads[c], curve) for c, mean in enumerate(means))
    return Noise(axes=axes, curve=curve, source=source)


def _stream_of(channels: int, sizes: Sequence[int], budget_bytes: int) -> _core.AllanStream:
    return _core.AllanStream(channels, sizes, max(budget_bytes // (8 * channels), _core.AllanStream.LEAST_BUDGET))


def _axis(stream: _core.AllanStream, c: int, mean: float, head: FloatArray, curve: AllanCurve) -> NoiseAxis:
    rate_hz, n = curve.rate_hz, curve.n_samples
    blank = blank_axis(curve.names[c], curve.units[c], rate_hz, n, mean, readout(head))
    means, size = stream.means(c, -(-n // LONGEST_TRANSFORM))
    channel = Channel(means, rate_hz / size, blank.name, blank.unit, head=head)
    steps, _ = sudden_changes(means, channel.rate_hz)
    return replace(channel, steps=steps).without_changes().identified(blank, curve, c)
