"""Which baud and which protocol: every candidate reads the same bytes, and the one that understands most wins."""

from __future__ import annotations

import time
from collections.abc import Callable, Sequence
from dataclasses import dataclass

from trihedron.capture.errors import CaptureError, SourceEndedError, SourceLostError
from trihedron.capture.foreign import foreign
from trihedron.capture.protocols import PROTOCOLS, Decoder, decoder_factory
from trihedron.capture.protocols.contract import Frame
from trihedron.capture.protocols.lines import NameColumns, name_by_position
from trihedron.capture.sources import SerialSource, Source
from trihedron.records.frame_declaration import FrameDeclaration

BAUDS = (115_200, 921_600, 57_600, 9_600, 230_400, 460_800, 38_400, 1_000_000, 2_000_000, 19_200, 3_000_000)
"""In the order of how often boards use them."""

LISTEN_S = 0.5
LONGEST_LISTEN_S = 2.0
ENOUGH_FRAMES = 6
GOOD_SHARE = 0.5
"""Of the bytes: a wrong baud or protocol understands next to none, a right one nearly all."""


@dataclass(frozen=True)
class Found:
    """The protocol that understands a stream, and the bytes that were read to find it."""

    protocol: str
    make_decoder: Callable[[], Decoder]
    first_bytes: bytes
    share: float


def share_understood(make: Callable[[], Decoder], data: bytes) -> tuple[float, int]:
    """Share of the bytes that belong to frames, and how many frames: bytes before the first frame do not count."""
    decoder = make()
    frames: list[Frame] = [*decoder.feed(data), *decoder.finish()]
    if not data or not frames:
        return 0.0, 0
    return 1.0 - min(decoder.skipped_bytes / len(data), 1.0), len(frames)


def find_protocol(
    source: Source,
    *,
    protocol: str | FrameDeclaration | None = None,
    baud: int | None = None,
    name_columns: NameColumns = name_by_position,
    silence_s: float = 5.0,
) -> Found:
    """Listen, at every baud where none was given, until one protocol (of all, or the one given) understands.

    Raises
    ------
    CaptureError
        When the device is silent, or nothing understands what it sends.
    """
    names: Sequence[str | FrameDeclaration] = list(PROTOCOLS) if protocol is None else [protocol]
    makers = [(_name(name), decoder_factory(name, name_columns)) for name in names]
    if not isinstance(source, SerialSource):
        return _best(source, makers, _listen(source, LISTEN_S, silence_s), silence_s)
    heard: list[bytes] = []
    deadline = time.monotonic() + silence_s
    for candidate in BAUDS if baud is None else (baud,):
        if candidate != source.baud and not source.set_baud(candidate):
            continue
        wait = max(deadline - time.monotonic(), LISTEN_S) if not heard else LISTEN_S
        data = _listen(source, LISTEN_S, wait)
        found = _judged(makers, data)
        if found is None and data and baud is None and len(data) < 200:
            # A slow device: listen longer before this baud is given up.
            data += _listen(source, LONGEST_LISTEN_S, 0.0)
            found = _judged(makers, data)
        if found is not None:
            return found
        if baud is not None and data:
            return _best(source, makers, data, silence_s)
        heard += [data] if data else []
    if not heard:
        raise CaptureError(_silent(source, silence_s))
    raise CaptureError(_not_understood(source, heard, makers, at_all_bauds=baud is None))


def _best(source: Source, makers: list[tuple[str, Callable[[], Decoder]]], data: bytes, silence_s: float) -> Found:
    started = time.monotonic()
    while True:
        found = _judged(makers, data)
        if found is not None:
            return found
        if time.monotonic() - started > LONGEST_LISTEN_S and data:
            raise CaptureError(_not_understood(source, [data], makers, at_all_bauds=False))
        if time.monotonic() - started > silence_s and not data:
            raise CaptureError(_silent(source, silence_s))
        try:
            data += source.read()
        except (SourceEndedError, SourceLostError):
            if not data:
                raise CaptureError(f"{source.name}: it is empty.") from None
            best = max(((share_understood(m, data), n, m) for n, m in makers), key=lambda row: row[0])
            if best[0][1] == 0:
                raise CaptureError(_not_understood(source, [data], makers, at_all_bauds=False)) from None
            return Found(best[1], best[2], data, best[0][0])


def _judged(makers: list[tuple[str, Callable[[], Decoder]]], data: bytes) -> Found | None:
    best: Found | None = None
    for name, make in makers:
        share, n = share_understood(make, data)
        if n >= ENOUGH_FRAMES and share >= GOOD_SHARE and (best is None or share > best.share + 0.05):
            best = Found(name, make, data, share)
    return best


def _listen(source: Source, for_s: float, silence_s: float) -> bytes:
    """Bytes of ``for_s`` seconds after the first one, which may take ``silence_s`` to come."""
    data = b""
    until = time.monotonic() + max(silence_s, for_s)
    while time.monotonic() < until:
        try:
            piece = source.read()
        except SourceEndedError:
            return data
        except SourceLostError:
            if not data:
                raise
            return data
        if piece and not data:
            until = time.monotonic() + for_s
        data += piece
        if not source.is_live and len(data) > 200_000:
            break
    return data


def _name(protocol: str | FrameDeclaration) -> str:
    return protocol.name if isinstance(protocol, FrameDeclaration) else protocol


def _silent(source: Source, silence_s: float) -> str:
    return (
        f"{source.name}: not one byte came in {silence_s:g} s; is the board powered and sending, and is this its port?"
    )


def _not_understood(
    source: Source, heard: list[bytes], makers: list[tuple[str, Callable[[], Decoder]]], *, at_all_bauds: bool
) -> str:
    known = foreign(heard)
    if known is not None:
        return f"{source.name}: this is {known[0]}, which is not decoded here; {known[1]}."
    n = sum(map(len, heard))
    tried = "no known protocol" if len(makers) > 1 else f"no {makers[0][0]} frame"
    if at_all_bauds:
        return (
            f"{source.name}: {n} bytes came, and at none of {len(BAUDS)} usual baud rates is there {tried}; say --baud "
            "if it is unusual, or declare the frame in a .toml file (docs/capture.md)."
        )
    remedy = "leave --baud out to have it found" if isinstance(source, SerialSource) else "say another --protocol"
    return (
        f"{source.name}: {n} bytes came and there is {tried} in them; {remedy}, or declare the frame in a .toml file "
        "(docs/capture.md)."
    )
