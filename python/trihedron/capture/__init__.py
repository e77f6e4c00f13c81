"""Capture: recording a log from a connected board, and a guide through its calibration.

``open_source`` → ``find_protocol`` → :class:`Recorder`, an iterator of blocks that also writes the log:

>>> from trihedron.capture import Recorder, find_protocol, open_source
>>> source = open_source("/dev/ttyUSB0")  # doctest: +SKIP
>>> found = find_protocol(source)  # doctest: +SKIP
>>> recorder = Recorder(source, found.make_decoder, Path("log.csv"), first_bytes=found.first_bytes)  # doctest: +SKIP
>>> for block in recorder:  # doctest: +SKIP
...     print(block.time_s[-1], block.values[-1])
"""

from trihedron.capture.detection import find_protocol
from trihedron.capture.guide import Guide
from trihedron.capture.recorder import Recorder
from trihedron.capture.sources import open_source

__all__ = ["Guide", "Recorder", "find_protocol", "open_source"]
