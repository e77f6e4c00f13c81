"""Interface of a protocol decoder: bytes in, frames out, corrupt and skipped bytes counted."""

from __future__ import annotations

from collections.abc import Sequence
from typing import NamedTuple, Protocol


class Frame(NamedTuple):
    """One frame as sent.

    ``counter`` counts frames and ``ticks`` is the device's clock, where the protocol has them (raw, wrapping);
    ``values`` are the numbers of its columns, ``text`` the same numbers as written to the log, digit for digit.
    """

    counter: int | None
    ticks: int | None
    values: tuple[float, ...]
    text: str


class Decoder(Protocol):
    """Converts bytes, in pieces of any size, to complete frames.

    ``columns`` names the values; it is empty until they are known. ``counter_modulus`` and ``clock_modulus`` are the
    values at which counter and clock wrap (0: they do not), ``tick_s`` is one tick of the clock in seconds (0: no
    clock). ``learned`` names the attributes that the first frames determine, and that a decoder of the same device
    takes over after a reconnection. ``corrupt`` counts pieces that look like the beginning of a frame but are none;
    ``skipped_bytes`` counts bytes outside frames.
    """

    name: str
    columns: tuple[str, ...]
    counter_modulus: int
    clock_modulus: int
    tick_s: float
    learned: tuple[str, ...]
    corrupt: int
    skipped_bytes: int

    def feed(self, data: bytes) -> list[Frame]:
        """Frames that are complete with these bytes."""
        ...

    def finish(self) -> list[Frame]:
        """Frames in the remaining bytes, at the end of the stream."""
        ...


_PRINTED = frozenset("0123456789+-.eE \tnaNinfINF")


def printed_numbers(texts: Sequence[str]) -> list[float] | None:
    """Numbers as a board prints them; ``None`` where one is not a number, or contains characters that only Python
    accepts in a number, such as form feeds and underscores from flipped bits.
    """
    if not all(map(_PRINTED.issuperset, texts)):
        return None
    try:
        return list(map(float, texts))
    except ValueError:
        return None
