"""What a protocol is: bytes in, frames out, remains counted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol


class Frame(NamedTuple):
    """One frame as it was sent.

    ``counter`` counts frames and ``ticks`` is the device's clock, where the protocol has them (raw, wrapping);
    ``values`` the numbers of its columns; ``text`` the same for the log, digit for digit.
    """

    counter: int | None
    ticks: int | None
    values: tuple[float, ...]
    text: str


class Decoder(Protocol):
    """Takes bytes as they come, in pieces of any size, and gives whole frames.

    ``columns`` names the values; it is empty until the protocol knows them. ``counter_modulus`` and
    ``clock_modulus`` say where counter and clock wrap (0: they do not), ``tick_s`` is one tick of the clock in seconds
    (0: no clock). ``corrupt`` counts pieces that began or looked like a frame and were none; ``skipped_bytes`` the
    bytes outside frames.
    """

    name: str
    columns: tuple[str, ...]
    counter_modulus: int
    clock_modulus: int
    tick_s: float
    corrupt: int
    skipped_bytes: int

    def feed(self, data: bytes) -> list[Frame]:
        """Frames that are complete with these bytes."""
        ...

    def finish(self) -> list[Frame]:
        """Frames that stand in the remaining bytes, when no more will come."""
        ...


_PRINTED = frozenset("0123456789+-.eE \tnaNinfINF")


def printed_numbers(texts: Sequence[str]) -> list[float] | None:
    """Numbers as a board prints them; ``None`` where one is none, or holds what Python alone reads past: a bit that
    flips makes form feeds and underscores.
    """
    if not all(map(_PRINTED.issuperset, texts)):
        return None
    try:
        return list(map(float, texts))
    except ValueError:
        return None
