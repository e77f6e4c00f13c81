"""CAPTURE: from a board on the desk to a log, and a guide through its calibration.

``open_source`` → ``find_protocol`` → :class:`Recorder`, an iterator of blocks that writes the log meanwhile:

>>> from trihedron.capture import Recorder, find_protocol, open_source
>>> source = open_source("/dev/ttyUSB0")  # doctest: +SKIP
>>> found = find_protocol(source)  # doctest: +SKIP
>>> recorder = Recorder(source, found.make_decoder, Path("log.csv"), first_bytes=found.first_bytes)  # doctest: +SKIP
>>> for block in recorder:  # doctest: +SKIP
...     print(block.time_s[-1], block.values[-1])
"""

from __future__ import annotations

from trihedron.arrivals import ClockFit, ClockLine
from trihedron.capture.account import Count, clock_sentence
from trihedron.capture.detection import Found, find_protocol
from trihedron.capture.errors import CaptureError, DiskError, SourceEndedError, SourceLostError
from trihedron.capture.guide import Guide
from trihedron.capture.log import GrowingLog
from trihedron.capture.ports import Port, list_ports
from trihedron.capture.protocols import (
    PROTOCOLS,
    Decoder,
    Frame,
    LineColumns,
    NameColumns,
    decoder_factory,
    name_by_position,
)
from trihedron.capture.recorder import Block, Recorder
from trihedron.capture.sequence import Sequence, Tally
from trihedron.capture.sources import Source, open_source
from trihedron.capture.timeline import Timeline

__all__ = [
    "PROTOCOLS",
    "Block",
    "CaptureError",
    "ClockFit",
    "ClockLine",
    "Count",
    "Decoder",
    "DiskError",
    "Found",
    "Frame",
    "GrowingLog",
    "Guide",
    "LineColumns",
    "NameColumns",
    "Port",
    "Recorder",
    "Sequence",
    "Source",
    "SourceEndedError",
    "SourceLostError",
    "Tally",
    "Timeline",
    "clock_sentence",
    "decoder_factory",
    "find_protocol",
    "list_ports",
    "name_by_position",
    "open_source",
]
