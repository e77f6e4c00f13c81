"""Capture composed with reading: columns of a stream get the names that :func:`trihedron.read` would give them."""

from __future__ import annotations

import os
import signal
import threading
import time
from collections.abc import Callable, Iterator
from contextlib import contextmanager
from pathlib import Path
from typing import Any

from trihedron.api.naming_columns import column_namer
from trihedron.api.reading import read
from trihedron.capture.detection import Found, find_protocol
from trihedron.capture.recorder import Block, Recorder
from trihedron.capture.sources import Port, Source, list_ports, open_source
from trihedron.files.output import check_free
from trihedron.protocols import protocol_of
from trihedron.records import Recording


def open_device(
    where: str,
    *,
    protocol: str | None = None,
    baud: int | None = None,
    columns: str | None = None,
    time_unit: str | None = None,
) -> tuple[Source, Found]:
    """Open a source and detect its protocol.

    Raises ``InputError`` when it cannot be opened, sends nothing, or its protocol is unknown; nothing stays open.
    """
    wanted = protocol_of(protocol)
    namer = column_namer(columns, time_unit)
    source = open_source(where, baud)
    try:
        return source, find_protocol(source, protocol=wanted, baud=baud, name_columns=namer)
    except BaseException:
        source.close()
        raise


def recorder_of(source: Source, found: Found, output: Path, **options: Any) -> Recorder:
    """The recorder of an opened device, with the bytes that were read to detect its protocol."""
    return Recorder(source, found.make_decoder, output, first_bytes=found.first_bytes, **options)


def capture(
    port: str,
    output: str | os.PathLike[str],
    *,
    protocol: str | None = None,
    baud: int | None = None,
    seconds: float | None = None,
    rate_hz: float | None = None,
    columns: str | None = None,
    time_unit: str | None = None,
    wait_s: float = 60.0,
    overwrite: bool = False,
    on_block: Callable[[Block], bool | None] | None = None,
) -> Recording:
    """Record what a board sends into a log, written as it arrives, then read the log back.

    Parameters
    ----------
    port : str
        A serial port (``trihedron.ports()`` lists them), ``tcp://host:port`` or a file of bytes.
    output : path
        The log to write.
    protocol, baud, columns, time_unit
        Protocol, baud rate, columns of text lines and unit of the board's time; detected when not given.
    seconds : float, optional
        When to stop; Ctrl-C, or ``on_block`` returning False, stops at any time and keeps the samples received.
    rate_hz : float, optional
        Rate of a board that sends no time.
    wait_s : float
        How long to wait for a board that was unplugged.
    overwrite : bool, whether a file that exists is replaced
    on_block : callable, optional
        Called with every block of samples as it is written.

    Returns
    -------
    Recording
        The log, as ``read`` returns it from disk.

    Raises
    ------
    CaptureError
        (a ``ValueError``) when the board is silent or its protocol unknown, or the disk is full; states what is saved.

    Examples
    --------
    >>> trihedron.capture("/dev/ttyUSB0", "log.csv", seconds=60)  # doctest: +SKIP
    """
    check_free([Path(output)], overwrite=overwrite)
    source, found = open_device(port, protocol=protocol, baud=baud, columns=columns, time_unit=time_unit)
    recorder = recorder_of(source, found, Path(output), overwrite=overwrite, rate_hz=rate_hz, wait_for_return_s=wait_s)
    began_s = time.monotonic()
    with stopped_by(recorder, signal.SIGINT):
        for block in recorder:
            is_wanted = on_block is None or on_block(block) is not False
            if not is_wanted or (seconds is not None and time.monotonic() - began_s >= seconds):
                recorder.stop()
    return read(output)


@contextmanager
def stopped_by(recorder: Recorder, *numbers: int) -> Iterator[None]:
    """These signals end the recording in order, a second one the program; outside the main thread without effect."""
    if threading.current_thread() is not threading.main_thread():
        yield
        return

    def end(number: int, _frame: Any) -> None:
        recorder.stop()
        signal.signal(number, signal.default_int_handler)

    before = {number: signal.signal(number, end) for number in numbers}
    try:
        yield
    finally:
        for number, handler in before.items():
            signal.signal(number, handler)


def ports() -> list[Port]:
    """The serial ports that are plugged in.

    Returns
    -------
    list of Port
        Each with its name and the system's description of the device; empty without one.

    Raises
    ------
    CaptureError
        (a ``ValueError``) when pyserial is not installed.

    Examples
    --------
    >>> names = [port.device for port in trihedron.ports()]
    """
    return list_ports()
