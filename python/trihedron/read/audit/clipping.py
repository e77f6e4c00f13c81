"""Clipping: extreme values that the signal runs into and stays at. Found from the data, never from a nominal range."""

from __future__ import annotations

from collections.abc import Callable

from trihedron.arrays import AXES
from trihedron.records import Finding, FindingCode
from trihedron.records.channel_facts import Limit

Place = Callable[[int], str]


def short(sensor: str) -> str:
    """The sensor's name in a sentence."""
    return "gyro" if sensor == "gyroscope" else sensor


def audit_clipping(sensor: str, walls: tuple[Limit, ...], place: Place) -> list[Finding]:
    """One finding per sensor that names every wall."""
    if not walls:
        return []
    first = min(int(w.runs[0, 0]) for w in walls)
    numbers = {f"{AXES[w.axis]}_{'high' if w.is_high else 'low'}_count": float(w.count) for w in walls}
    numbers |= {f"{AXES[w.axis]}_{'high' if w.is_high else 'low'}_value": w.value for w in walls}
    return [
        Finding.of(
            FindingCode.CLIPPING,
            sensor=short(sensor),
            walls=[(AXES[w.axis], w.value, w.count, len(w.runs)) for w in walls],
            where=place(first),
            count=sum(w.count for w in walls),
            sample=first,
            numbers=numbers,
        )
    ]
