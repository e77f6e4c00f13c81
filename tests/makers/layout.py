"""Text logs as their makers' programs write them: one function per layout, after the maker's document named in it.

Written from documents and from the writers' sources, not from our readers. Each returns the files, what the user has to
say, and what must come out: the readings in the log's unit, their number and the rate.
"""

from __future__ import annotations

from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime, timedelta

import numpy as np

from hand_made_sessions import G, motion

EPOCH = datetime(2024, 3, 1, 12, 0, 0)
EPOCH_S = 1709294400.0
SI = ("m/s^2", "rad/s")
COUNTS = ("counts", "counts")
SIZES = {"m/s^2": 1.0, "g": G, "mg": 1e-3 * G, "rad/s": 1.0, "deg/s": np.pi / 180, "mdeg/s": np.pi / 180e3}
LAYOUTS: dict[str, Callable[[], Layout]] = {}


@dataclass(frozen=True)
class Layout:
    """``files`` name and bytes; ``accelerometer``/``gyroscope`` (n, 3) as written; ``rows`` of all files together."""

    maker: str
    files: dict[str, bytes]
    rate_hz: float
    accelerometer: np.ndarray | None
    gyroscope: np.ndarray | None
    units: tuple[str, str]
    rows: int
    options: dict[str, object] = field(default_factory=dict)
    per_sensor: bool = False
    merged: bool = False


@dataclass(frozen=True)
class Session:
    """One part's raw readings in SI: time (n,) [s], specific force (n, 3), rate (n, 3)."""

    time_s: np.ndarray
    force: np.ndarray
    rate: np.ndarray

    @property
    def n(self) -> int:
        return len(self.time_s)


def layout(make: Callable[[], Layout]) -> Callable[[], Layout]:
    LAYOUTS[make.__name__] = make
    return make


def text(
    maker: str,
    file: str,
    rate_hz: float,
    units: tuple[str, str] = SI,
    digits: tuple[int, int] = (6, 6),
    counts: tuple[float, float] | None = None,
    options: dict[str, object] | None = None,
) -> Callable[[Callable[..., str]], Callable[[], Layout]]:
    """A layout of one file of both sensors, of which the function writes the text; ``counts`` per g and per deg/s."""

    def registered(write: Callable[..., str]) -> Callable[[], Layout]:
        def make() -> Layout:
            s = session(rate_hz)
            if counts:
                a, w = (
                    np.rint(n * v).astype(int) for n, v in zip(counts, (s.force / G, np.degrees(s.rate)), strict=True)
                )
            else:
                a, w = (np.round(v / SIZES[u], n) for v, u, n in zip((s.force, s.rate), units, digits, strict=True))
            unit = COUNTS if counts else units
            return Layout(maker, {file: write(s, a, w).encode()}, rate_hz, a, w, unit, s.n, options or {})

        LAYOUTS[write.__name__] = make
        return make

    return registered


def session(rate_hz: float, seed: int = 1) -> Session:
    """Four poses and the turns between them, 18.5 s."""
    return Session(*motion(rate_hz, seed, 4))


def written(*columns: np.ndarray, separator: str = ",", end: str = "\n", form: str = "{!r}") -> str:
    table = zip(*columns, strict=True)
    return "".join(
        separator.join(v if isinstance(v, str) else form.format(v) for v in (plain(v) for v in row)) + end
        for row in table
    )


def plain(value: object) -> object:
    return value.item() if isinstance(value, np.generic) else value


def dates(s: Session, form: str, digits: int = 6) -> list[str]:
    out = []
    for t in s.time_s:
        text = (EPOCH + timedelta(seconds=round(float(t), 6))).strftime(form)
        out.append(text[: len(text) - 6 + digits] if form.endswith("%f") else text)
    return out


def in_si(s: Session, digits: int = 6) -> tuple[np.ndarray, np.ndarray]:
    return np.round(s.force, digits), np.round(s.rate, digits)


def nanoseconds(s: Session) -> list[int]:
    return [round(EPOCH_S) * 10**9 + round(t * 1e9) for t in s.time_s]
