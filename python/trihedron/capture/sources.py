"""Sources of bytes: serial ports (and their list), TCP connections, files, standard input."""

from __future__ import annotations

import errno
import os
import re
import select
import socket
import stat
import sys
import time
from contextlib import suppress
from dataclasses import dataclass
from pathlib import Path
from typing import TYPE_CHECKING, Protocol

from trihedron.capture.errors import CaptureError, SourceEndedError, SourceLostError

if TYPE_CHECKING:
    import serial


@dataclass(frozen=True)
class Port:
    """One port: its name, the system's description, its USB identifiers, and whether this user may open it."""

    device: str
    description: str
    usb: str
    is_permitted: bool


def list_ports() -> list[Port]:
    """Serial ports sorted by name, those of USB devices first.

    Raises ``CaptureError`` when pyserial is not installed.
    """
    import_serial()
    from serial.tools.list_ports import comports

    found = []
    for port in comports():
        usb = f"{port.vid:04x}:{port.pid:04x}" if port.vid is not None else ""
        description = port.description if port.description not in (None, "n/a") else ""
        permitted = not port.device.startswith("/") or os.access(port.device, os.R_OK | os.W_OK)
        found.append(Port(port.device, description, usb, permitted))
    return sorted(found, key=lambda port: (not port.usb, port.device))


GATHER_S = 0.008
"""Time to wait for more bytes after the first one of a piece [s]; at 1 kHz it saves nine of ten wake-ups."""

POLL_S = 0.1


class Source(Protocol):
    """A source of bytes. With ``is_live`` bytes arrive in real time, so their arrival times can be used."""

    name: str
    is_live: bool

    def read(self) -> bytes:
        """The next piece, empty if none arrives within ``POLL_S``. Raises SourceLostError or SourceEndedError."""

    def reopen(self) -> bool:
        """Try once to open the source again after it was lost; return whether that succeeded."""

    def close(self) -> None:
        """Close the source."""


def import_serial() -> type[serial.Serial]:
    """The class of pyserial's ports.

    Raises ``CaptureError`` when pyserial is not installed.
    """
    try:
        import serial
    except ImportError:
        raise CaptureError("serial ports need pyserial; install it with `pip install pyserial`.") from None
    return serial.Serial


class SerialSource:
    """A serial port, or a pseudo-terminal."""

    is_live = True

    def __init__(self, port: str, baud: int = 115_200) -> None:
        self.port, self.baud = port, baud
        self.name = f"{port} at {baud} baud"
        self._identity = _usb_devices().get(port)
        self._serial = _open_serial(port, baud)

    def set_baud(self, baud: int) -> bool:
        """Set the baud rate and discard bytes received at the old one; False where the port does not support it."""
        try:
            self._serial.baudrate = baud
            self._serial.reset_input_buffer()
        except (OSError, ValueError):
            return False
        self.baud = baud
        self.name = f"{self.port} at {baud} baud"
        return True

    def read(self) -> bytes:
        port = self._serial
        try:
            first: bytes = port.read(1)
            if not first:
                # A pseudo-terminal or an adapter that was removed may read as silence; this raises then.
                _ = port.in_waiting
                return b""
            time.sleep(GATHER_S)
            waiting = port.in_waiting
            return first + port.read(waiting) if waiting else first
        except (OSError, TypeError) as error:
            raise SourceLostError(f"{self.port} went away ({_reason(error)}).") from None

    def reopen(self) -> bool:
        """Open the port again by its name, or the same USB device under another name."""
        self.close()
        same = [port for port, identity in _usb_devices().items() if identity == self._identity]
        for port in dict.fromkeys([self.port, *same]):
            if not os.path.exists(port) and not port.upper().startswith("COM"):
                continue
            try:
                self._serial = _open_serial(port, self.baud)
            except CaptureError:
                continue
            self.port = port
            self.name = f"{port} at {self.baud} baud"
            return True
        return False

    def close(self) -> None:
        # The device may have been removed already.
        with suppress(OSError):
            self._serial.close()


def _reason(error: Exception) -> str:
    text = str(getattr(error, "strerror", None) or error)
    # pyserial raises with a long text when a port is ready to read but returns nothing.
    is_gone = isinstance(error, TypeError) or "disconnected" in text or getattr(error, "errno", None) == errno.EIO
    return "unplugged" if is_gone else text[:80]


def _open_serial(port: str, baud: int) -> serial.Serial:
    made = import_serial()
    try:
        return made(port, baud, timeout=POLL_S, exclusive=True)
    except ValueError as error:
        raise CaptureError(f"{port}: {error}.") from None
    except OSError as error:
        raise CaptureError(_why_not_open(port, error)) from None


def _why_not_open(port: str, error: OSError) -> str:
    number, text = error.errno, str(error)
    if number is None:
        # pyserial wraps some errors without their number.
        told = re.search(r"\[Errno (\d+)\]", text)
        number = int(told[1]) if told else errno.EBUSY if "exclusively lock" in text else 0
    if number == errno.ENOENT or not os.path.exists(port):
        return f"there is no port {port}; `trihedron ports` lists what is plugged in."
    if number == errno.EACCES:
        return f"no permission to open {port}; {_group_advice(port)}"
    if number in (errno.EBUSY, errno.EAGAIN):
        return f"{port} is in use by another program; close the serial monitor (or other program) that holds it."
    return f"{port} cannot be opened as a serial port ({error.strerror or error})."


def _group_advice(port: str) -> str:
    try:
        import grp

        group = grp.getgrgid(os.stat(port).st_gid).gr_name
    except (ImportError, KeyError, OSError):
        return "run as a user who may use serial ports."
    return f"join its group with `sudo usermod -aG {group} $USER`, then log out and in again."


def _usb_devices() -> dict[str, tuple[object, ...]]:
    """Identity of the USB device of every port, by the port's name."""
    try:
        from serial.tools.list_ports import comports
    except ImportError:
        return {}
    return {p.device: (p.vid, p.pid, p.serial_number) for p in comports() if p.vid is not None}


class TcpSource:
    """A TCP server that sends bytes: ``tcp://host:port``."""

    is_live = True

    def __init__(self, address: str) -> None:
        self.name = address
        host, _, port = address.removeprefix("tcp://").removeprefix("tcp:").rpartition(":")
        if not host or not port.isdigit() or not 0 < int(port) < 65_536:
            raise CaptureError(f"{address}: a TCP source is written tcp://host:port, for example tcp://127.0.0.1:5000.")
        self._address = (host.strip("[]"), int(port))
        try:
            self._connect(5.0)
        except OSError as error:
            why = error.strerror or error
            raise CaptureError(f"{address}: no connection ({why}); is the device on, and is the port right?") from None

    def _connect(self, timeout_s: float) -> None:
        self._socket = socket.create_connection(self._address, timeout=timeout_s)
        self._socket.settimeout(POLL_S)

    def read(self) -> bytes:
        try:
            data = self._socket.recv(65_536)
        except TimeoutError:
            return b""
        except OSError as error:
            raise SourceLostError(f"{self.name} went away ({_reason(error)}).") from None
        if not data:
            raise SourceLostError(f"{self.name} closed the connection.")
        return data

    def reopen(self) -> bool:
        self.close()
        try:
            self._connect(1.0)
        except OSError:
            return False
        return True

    def close(self) -> None:
        self._socket.close()


class FileSource:
    """A file of bytes recorded from a device, a named pipe, or standard input (no path)."""

    def __init__(self, path: Path | None) -> None:
        self.name = "standard input" if path is None else str(path)
        try:
            where = sys.stdin.fileno() if path is None else path
            self._stream = open(where, "rb", buffering=0, closefd=path is not None)  # noqa: SIM115 -- closed by close()
        except PermissionError:
            raise CaptureError(f"{path}: no permission to read this file.") from None
        except OSError as error:
            raise CaptureError(f"{path}: cannot be read ({error.strerror}).") from None
        if self._stream.isatty():
            raise CaptureError(f"{self.name} is a keyboard; pipe the bytes of a device into it.")
        self.is_live = not stat.S_ISREG(os.fstat(self._stream.fileno()).st_mode)

    def read(self) -> bytes:
        if self.is_live and not select.select([self._stream], [], [], POLL_S)[0]:
            return b""
        data = self._stream.read(65_536)
        if not data:
            raise SourceEndedError(f"{self.name} ended.")
        return data

    def reopen(self) -> bool:
        """False: neither a file nor a pipe can be opened again."""
        return False

    def close(self) -> None:
        """Close the file; standard input stays open."""
        self._stream.close()


def open_source(where: str, baud: int | None = None) -> Source:
    """Open a port (``/dev/ttyUSB0``, ``COM3``), ``tcp://host:port``, a file, or ``-`` for standard input.

    Raises ``CaptureError`` when it cannot be opened; the message says which, why, and what to do.
    """
    if where == "-":
        return FileSource(None)
    if where.startswith("tcp:"):
        return TcpSource(where)
    if where.upper().startswith("COM") and where[3:].isdigit():
        return SerialSource(where, baud or 115_200)
    path = Path(where)
    try:
        mode = path.stat().st_mode
    except FileNotFoundError:
        what = "port" if where.startswith("/dev/") else "port or file"
        raise CaptureError(f"there is no {what} {where}; `trihedron ports` lists what is plugged in.") from None
    except OSError as error:
        raise CaptureError(f"{where}: cannot be opened ({error.strerror}).") from None
    if stat.S_ISCHR(mode):
        return SerialSource(where, baud or 115_200)
    if stat.S_ISDIR(mode):
        raise CaptureError(f"{where}: this is a directory; name a port or a file.")
    return FileSource(path)
