"""Noise of a static log: identified from a recording, or from a file that does not fit into memory."""

from __future__ import annotations

from collections.abc import Sequence
from dataclasses import replace

from trihedron.estimate.noise.grid import readings_of
from trihedron.estimate.noise.identify import identify_noise
from trihedron.records import Noise, Recording


def noise(
    recording: Recording,
    *,
    exclude_s: Sequence[tuple[float, float]] = (),
    automatic: bool = True,
    clusters: Sequence[int] | None = None,
) -> Noise:
    """Noise terms of every axis of a static recording, in SI units where the log tells them (docs/noise.md).

    Raises
    ------
    ValueError
        When the log is too short or has too many gaps; one sentence says why and what to do.
    """
    readings, names, units = readings_of(recording)
    found = identify_noise(
        readings,
        recording.rate_hz,
        names=names,
        units=units,
        exclude_s=exclude_s,
        automatic=automatic,
        clusters=clusters,
        source=recording.source,
    )
    # What the log is said to be comes before what its noise is.
    return replace(found, findings=(*recording.findings, *found.findings))
