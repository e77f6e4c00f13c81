"""Faults of a serial line: bytes lost, doubled, flipped; frames cut, missing, sent twice; random bytes in between."""

from __future__ import annotations

import random
from dataclasses import dataclass, field
from typing import Any

from trihedron.errors import InputError

KINDS = ("missing", "cut", "flipped", "garbage", "byte_lost", "byte_doubled", "twice")
SIZED = {**{kind: kind for kind in KINDS}, "drift": "drift_ppm", "away": "away_s"}
"""Faults with one size, by their fields."""


@dataclass(frozen=True)
class Faults:
    """Probability of each fault per frame, and instants at which the board disconnects.

    ``missing``: the frame is not sent. ``cut``: only its beginning is sent. ``flipped``: one bit is inverted.
    ``garbage``: 1 to 40 random bytes precede it. ``byte_lost``, ``byte_doubled``: one byte. ``twice``: sent twice.
    ``drift_ppm``: the board clock runs fast by that. ``start_text``: lines printed first. ``disconnect_s``: instants at
    which the board disconnects for ``away_s``. The first and last ``clean_ends`` frames have no faults: losses before
    the first and after the last saved frame cannot be counted.
    """

    missing: float = 0.0
    cut: float = 0.0
    flipped: float = 0.0
    garbage: float = 0.0
    byte_lost: float = 0.0
    byte_doubled: float = 0.0
    twice: float = 0.0
    drift_ppm: float = 0.0
    disconnect_s: tuple[float, ...] = ()
    away_s: float = 1.0
    start_text: bool = False
    clean_ends: int = 0


def parse_faults(text: str) -> Faults:
    """``"1%"`` (every kind), or ``"cut=1%,garbage=0.5%,drift=50ppm,disconnect=20,away=2,text"``.

    Raises ``InputError`` when a fault is unknown or its size is not a number.
    """
    chosen: dict[str, Any] = {}
    for part in (piece.strip() for piece in text.split(",") if piece.strip()):
        key, equals, value = part.partition("=")
        key = key.strip().replace("-", "_")
        if not equals and key == "text":
            chosen["start_text"] = True
            continue
        if not equals:
            chosen.update(dict.fromkeys(KINDS, _size(part, part)))
            continue
        if key == "disconnect":
            chosen["disconnect_s"] = (*chosen.get("disconnect_s", ()), _size(value, part))
        elif key in SIZED:
            chosen[SIZED[key]] = _size(value, part)
        else:
            known = ", ".join((*KINDS, "drift", "disconnect", "away", "text"))
            raise InputError(f"--faults: there is no fault '{key}'; there are {known}.")
    made = Faults(**chosen)
    for kind in KINDS:
        if not 0.0 <= getattr(made, kind) < 1.0:
            raise InputError(f"--faults: {kind} is a chance per frame, between 0 and 100 %.")
    return made


def _size(text: str, whole: str) -> float:
    text = text.strip()
    number, scale = text.removesuffix("ppm").removesuffix("s"), 1.0
    if text.endswith("%"):
        number, scale = text[:-1], 0.01
    try:
        return float(number) * scale
    except ValueError:
        raise InputError(f"--faults: '{whole}' has no size; write for example cut=1%.") from None


@dataclass
class Sent:
    """Counts of what the board sent: frames made (one reading each), bytes, and occurrences of each fault."""

    frames: int = 0
    bytes: int = 0
    faults: dict[str, int] = field(default_factory=lambda: dict.fromkeys(KINDS, 0))
    untouched: list[int] = field(default_factory=list)

    def sentence(self) -> str:
        """The counts as one sentence."""
        struck = ", ".join(f"{n} {kind.replace('_', ' ')}" for kind, n in self.faults.items() if n)
        return f"{self.frames} frames, {self.bytes} bytes sent" + (f"; faults: {struck}" if struck else "")


def spoil(frame: bytes, number: int, faults: Faults, rng: random.Random, sent: Sent) -> bytes:
    """The frame's bytes with random faults applied; counted in ``sent``."""
    sent.frames += 1
    if not any(getattr(faults, kind) > 0.0 for kind in KINDS):
        sent.bytes += len(frame)
        return frame
    struck = [kind for kind in KINDS if rng.random() < getattr(faults, kind)]
    for kind in struck:
        sent.faults[kind] += 1
    if not struck:
        sent.untouched.append(number)
    out = bytearray(frame)
    if "flipped" in struck:
        out[rng.randrange(len(out))] ^= 1 << rng.randrange(8)
    if "byte_lost" in struck:
        del out[rng.randrange(len(out))]
    if "byte_doubled" in struck:
        at = rng.randrange(len(out))
        out[at:at] = out[at : at + 1]
    if "cut" in struck:
        out = out[: rng.randrange(1, len(out))]
    if "twice" in struck:
        out = out * 2
    if "missing" in struck:
        out = bytearray()
    if "garbage" in struck:
        out = bytearray(rng.randrange(256) for _ in range(rng.randrange(1, 41))) + out
    sent.bytes += len(out)
    return bytes(out)
