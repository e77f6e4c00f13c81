"""Detects baud rate and protocol: every candidate decodes the same bytes, and the one that decodes most is taken."""

import re
import time
from collections.abc import Callable, Iterable, Sequence
from dataclasses import dataclass
from itertools import pairwise

from trihedron.capture.errors import CaptureError, SourceEndedError, SourceLostError
from trihedron.capture.sources import SerialSource, Source
from trihedron.protocols import PROTOCOLS, decoder_factory
from trihedron.protocols.declared import FrameDeclaration
from trihedron.protocols.framing import Decoder, Frame
from trihedron.protocols.lines import NameColumns, name_by_position

_AS_LOG = "read the log itself with `trihedron check`"
_FILES: tuple[tuple[bytes, str, str], ...] = (
    (rb"....ftyp", "a video", "write its motion data as CSV (GoPro's with gopro-telemetry) and check that"),
    (rb"DEVC\0", "a GoPro GPMF stream", "write its ACCL and GYRO as CSV with gopro-telemetry and check that"),
    (rb"ULog|\xa3\x95\x80", "a log of an autopilot", _AS_LOG),
    (rb"#ROSBAG|\x89MCAP|SQLite ", "a bag of ROS", _AS_LOG),
)
_FOR_VNIMU = "send $VNWRG,06,19*XX to the sensor for $VNIMU lines"
_WITMOTION = "WitMotion packets without acceleration and rate"
_BLUETOOTH = "WitMotion's Bluetooth packets, which carry no checksum"
_STREAMS: tuple[tuple[bytes, str, str], ...] = (
    (rb"\$VN[A-Z]{3},", "VectorNav text without acceleration and rate", _FOR_VNIMU),
    (rb"\xff\x5a[\x00-\x3f]\x00", "SBG sbgECom without IMU data", "switch the message IMU data (3) on in sbgCenter"),
    (rb"\x55\x61.{18}(?=\x55)", _BLUETOOTH, "connect the sensor by its serial port"),
    (rb"\x55[\x53-\x5f].{9}(?=\x55)", _WITMOTION, "switch both on in the maker's program"),
    (rb"\xfa\xff\x32", "Xsens MTData of the old kind", "set the sensor to MTData2 in MT Manager"),
    (rb"ue[\x80-\x9f]", "MicroStrain MIP", "record it with SensorConnect and check the CSV"),
    (rb"\xb5b\x10", "u-blox messages", "convert ESF-RAW to CSV and check that"),
    (rb"\xaaD[\x12\x13]", "NovAtel binary messages", "log RAWIMUSA as text and check that"),
    (rb"#RAWIMU|%RAWIMU", "NovAtel text", "save it to a file and check that"),
    (rb"\xfd.[\x00\x01]\x00", "MAVLink", "download the autopilot's log and check that"),
    (rb"\$(?:G[PNALB]|BD)[A-Z]{3},", "NMEA text of a receiver, which holds no IMU", "name the port of the IMU"),
)
MOST_BETWEEN = 2048
"""Largest mean spacing of message starts [bytes]: in random bytes two given ones occur once in 65 536."""


def foreign(heard: Iterable[bytes]) -> tuple[str, str] | None:
    """A known format among the pieces that is not decoded here, and what to do instead; None where there is none."""
    for data in heard:
        for start, kind, remedy in _FILES:
            if re.match(start, data, re.DOTALL):
                return kind, remedy
        for start, kind, remedy in _STREAMS:
            n = len(re.findall(start, data, re.DOTALL))
            if n >= max(3, len(data) // MOST_BETWEEN):
                return kind, remedy
        if _of_one_layout(data):
            return "VectorNav binary output", _FOR_VNIMU
    return None


def _of_one_layout(data: bytes) -> bool:
    """Whether the bytes are VectorNav binary: a header of 0xFA, groups and fields, repeated at a constant distance."""
    for head in {match[0] for match in re.finditer(rb"\xfa[\x01-\x3f]..", data, re.DOTALL)}:
        places = [match.start() for match in re.finditer(re.escape(head), data)]
        steps = [b - a for a, b in pairwise(places)]
        if len(steps) >= 3 and steps.count(steps[0]) > 0.8 * len(steps) and steps[0] < MOST_BETWEEN:
            return True
    return False


BAUDS = (115_200, 921_600, 57_600, 9_600, 230_400, 460_800, 38_400, 1_000_000, 2_000_000, 19_200, 3_000_000)
"""Baud rates to try, the most common first."""

LISTEN_S = 0.5
LONGEST_LISTEN_S = 2.0
ENOUGH_FRAMES = 6
GOOD_SHARE = 0.5
"""Smallest share of bytes decoded: a wrong baud rate or protocol decodes almost none, the right one nearly all."""


@dataclass(frozen=True)
class Found:
    """The detected protocol, the bytes read to detect it, and the share of them that it decodes."""

    protocol: str
    make_decoder: Callable[[], Decoder]
    first_bytes: bytes
    share: float


Makers = list[tuple[str, Callable[[], Decoder]]]
"""Names of the protocols tried, and functions that make their decoders."""


def share_understood(make: Callable[[], Decoder], data: bytes) -> tuple[float, int]:
    """Share of the bytes that belong to frames (0 to 1), and the number of frames."""
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
    """Read bytes, at every usual baud rate where none is given, until one protocol (or the given one) decodes them.

    Raises ``CaptureError`` when the device sends nothing, or no protocol decodes what it sends.
    """
    names: Sequence[str | FrameDeclaration] = list(PROTOCOLS) if protocol is None else [protocol]
    makers = [(one if isinstance(one, str) else one.name, decoder_factory(one, name_columns)) for one in names]
    if baud is not None and isinstance(source, SerialSource) and source.baud != baud:
        source.set_baud(baud)
    if baud is not None or not isinstance(source, SerialSource):
        return _best(source, makers, silence_s)
    heard: list[bytes] = []
    deadline = time.monotonic() + silence_s
    for candidate in BAUDS:
        if candidate != source.baud and not source.set_baud(candidate):
            continue
        wait = max(deadline - time.monotonic(), LISTEN_S) if not heard else LISTEN_S
        data = _listen(source, LISTEN_S, wait)
        found = _judged(makers, data)
        if found is None and 0 < len(data) < 200:
            # A slow device: read for longer before this baud rate is rejected.
            data += _listen(source, LONGEST_LISTEN_S, 0.0)
            found = _judged(makers, data)
        if found is not None:
            return found
        heard += [data] if data else []
    if not heard:
        raise silent(source, silence_s)
    raise _not_understood(source, heard, makers, at_all_bauds=True)


def _best(source: Source, makers: Makers, silence_s: float) -> Found:
    """The protocol of a source whose bytes are as they are: a file, a connection, a port of a given baud rate."""
    started = time.monotonic()
    data = _listen(source, LISTEN_S, silence_s)
    while True:
        found = _judged(makers, data)
        if found is not None:
            return found
        if time.monotonic() - started > LONGEST_LISTEN_S and data:
            raise _not_understood(source, [data], makers)
        if time.monotonic() - started > silence_s and not data:
            raise silent(source, silence_s)
        try:
            data += source.read()
        except (SourceEndedError, SourceLostError):
            if not data:
                raise CaptureError(f"{source.name}: it is empty.") from None
            found = _judged(makers, data, fewest=1, least=0.0)
            if found is None:
                raise _not_understood(source, [data], makers) from None
            return found


def _judged(makers: Makers, data: bytes, *, fewest: int = ENOUGH_FRAMES, least: float = GOOD_SHARE) -> Found | None:
    best: Found | None = None
    for name, make in makers:
        share, n = share_understood(make, data)
        if n >= fewest and share >= least and (best is None or share > best.share + 0.05):
            best = Found(name, make, data, share)
    return best


def _listen(source: Source, for_s: float, silence_s: float) -> bytes:
    """Bytes received within ``for_s`` [s] of the first one, for which to wait at most ``silence_s`` [s]."""
    data = b""
    until = time.monotonic() + max(silence_s, for_s)
    while time.monotonic() < until:
        try:
            piece = source.read()
        except (SourceEndedError, SourceLostError) as error:
            if isinstance(error, SourceLostError) and not data:
                raise
            return data
        if piece and not data:
            until = time.monotonic() + for_s
        data += piece
        if not source.is_live and len(data) > 200_000:
            break
    return data


def silent(source: Source, silence_s: float) -> CaptureError:
    """The error for a device that sends nothing."""
    return CaptureError(
        f"{source.name}: not one byte came in {silence_s:g} s; is the board powered and sending, and is this its port?"
    )


def _not_understood(source: Source, heard: list[bytes], makers: Makers, *, at_all_bauds: bool = False) -> CaptureError:
    known = foreign(heard)
    if known is not None:
        return CaptureError(f"{source.name}: this is {known[0]}, which is not decoded here; {known[1]}.")
    n = sum(map(len, heard))
    tried = "no known protocol" if len(makers) > 1 else f"no {makers[0][0]} frame"
    if at_all_bauds:
        return CaptureError(
            f"{source.name}: {n} bytes came, and at none of {len(BAUDS)} usual baud rates is there {tried}; say --baud "
            "if it is unusual, or declare the frame in a .toml file (docs/capture.md)."
        )
    remedy = "leave --baud out to have it found" if isinstance(source, SerialSource) else "say another --protocol"
    return CaptureError(
        f"{source.name}: {n} bytes came and there is {tried} in them; {remedy}, or declare the frame in a .toml file "
        "(docs/capture.md)."
    )
