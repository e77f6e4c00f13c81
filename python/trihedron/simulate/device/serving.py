"""Sends a recording as a board does, over a pseudo-terminal or a TCP socket."""

import math
import os
import random
import select
import socket
import time
from collections.abc import Callable, Iterator
from dataclasses import dataclass, field
from pathlib import Path

import numpy as np

from trihedron.protocols import encoder_for
from trihedron.protocols.declared import FrameDeclaration
from trihedron.protocols.framing import Sample
from trihedron.protocols.lines import HEADERS
from trihedron.records import Recording, Truth
from trihedron.simulate.device.faults import Faults, Sent, spoil
from trihedron.units import acceleration_to_si, rate_to_si

_BOOT_TEXT = b"board v1.2 starting\r\nsensor found at 0x68\r\nranges: 4 g; 500 deg/s\r\nready\r\n"

PIECE_S = 0.004
"""Frames within this time [s] are written together, as the buffers of USB adapters do."""


@dataclass(frozen=True)
class Device:
    """A recording that a simulated board sends: protocol, faults, and ``speed`` over real time (0: no waiting).

    ``scales`` are SI per raw unit of accelerometer and gyro, for protocols in SI.
    """

    recording: Recording
    protocol: str | FrameDeclaration
    faults: Faults = field(default_factory=Faults)
    speed: float = 1.0
    seed: int = 0
    baud: int = 0
    scales: tuple[float, float] | None = None

    def pieces(self, sent: Sent) -> Iterator[tuple[float, bytes]]:
        """Yield (device time [s], bytes) piece by piece."""
        recording, faults = self.recording, self.faults
        encode = encoder_for(self.protocol)
        rng = random.Random(self.seed)
        none, absent = Faults(), np.zeros((recording.n_samples, 3))
        sensors = [absent if one is None else one for one in (recording.accelerometer, recording.gyroscope)]
        raw = np.hstack(sensors)
        in_si = (raw * np.repeat(self.scales or scales_of(recording), 3)).tolist()
        readings = raw.tolist()
        fast = 1.0 + faults.drift_ppm * 1e-6
        if faults.start_text:
            yield 0.0, _BOOT_TEXT
        if isinstance(self.protocol, str) and self.protocol in HEADERS:
            yield 0.0, HEADERS[self.protocol].encode()
        piece, start_s = bytearray(), 0.0
        for n, t in enumerate(recording.time_s.tolist()):
            if piece and t - start_s >= PIECE_S:
                yield t, bytes(piece)
                piece, start_s = bytearray(), t
            is_end = n < faults.clean_ends or n >= recording.n_samples - faults.clean_ends
            frame = encode(Sample(n, t * fast, readings[n], in_si[n]))
            piece += spoil(frame, n, none if is_end else faults, rng, sent)
        yield float(recording.time_s[-1]), bytes(piece)


def scales_of(recording: Recording, truth: Truth | None = None) -> tuple[float, float]:
    """SI per raw unit: from the unit, or for counts from the mean column norm of the true S, as in a data sheet."""
    accel, gyro = acceleration_to_si(recording.accelerometer_unit), rate_to_si(recording.gyroscope_unit)
    if truth is not None:
        accel = accel or float(np.mean(np.linalg.norm(truth.accelerometer_S, axis=0)))
        gyro = gyro or float(np.mean(np.linalg.norm(truth.gyroscope_S, axis=0)))
    return accel or 1e-3, gyro or 2e-4


class PseudoTerminal:
    """A pseudo-terminal as a serial port; ``link`` is a symbolic link whose name stays the same over disconnections.

    A reader that sets a baud rate other than the board's receives garbage, as on a real line.
    """

    def __init__(self, link: Path | None = None, baud: int = 0) -> None:
        self._link, self._baud = link, baud
        self.patience_s = math.inf
        self._wrote_s = time.monotonic()
        self._master = -1
        self.connect()
        self.name = str(link) if link is not None else self._slave_name

    def connect(self) -> None:
        """Open a new terminal under the same link."""
        import pty
        import tty

        self._master, slave = pty.openpty()
        tty.setraw(slave)
        self._slave_name = os.ttyname(slave)
        # The slave end is kept open here: a terminal without any reader hangs up.
        self._slave = slave
        if self._link is not None:
            temporary = self._link.with_name(self._link.name + ".new")
            temporary.unlink(missing_ok=True)
            temporary.symlink_to(self._slave_name)
            temporary.replace(self._link)

    def disconnect(self) -> None:
        """Close the terminal while readers still have it open."""
        if self._link is not None:
            self._link.unlink(missing_ok=True)
        os.close(self._slave)
        os.close(self._master)
        self._master = -1

    def send(self, data: bytes) -> None:
        """Write the bytes; garbled where the reader has set another baud rate."""
        if self._baud and not self._is_heard():
            data = bytes((b * 37 + 129) & 0xFF | 0x80 for b in data[::2])
        while data:
            # Without a limit, a reader that left would keep the board waiting forever.
            _, ready, _ = select.select([], [self._master], [], 0.5)
            if not ready:
                if _unread(self._slave) > 0 and time.monotonic() - self._wrote_s > self.patience_s:
                    raise BrokenPipeError("nobody reads the pseudo-terminal")
                continue
            n = os.write(self._master, data[:2048])
            self._wrote_s = time.monotonic()
            data = data[n:]

    def _is_heard(self) -> bool:
        import termios

        speed = termios.tcgetattr(self._slave)[5]
        wanted = getattr(termios, f"B{self._baud}", None)
        return wanted is None or speed == wanted

    def close(self) -> None:
        """Wait until what was sent has been read, then close the terminal."""
        # The count excludes bytes in the kernel's buffers, so it must be 0 for half a second.
        until, quiet = time.monotonic() + 10.0, 0
        while time.monotonic() < until and quiet < 10 and self.patience_s > 0.0:
            quiet = quiet + 1 if _unread(self._slave) == 0 else 0
            time.sleep(0.05)
        self.disconnect()


def _unread(handle: int) -> int:
    import fcntl
    import struct
    import termios

    raw = fcntl.ioctl(handle, termios.FIONREAD, b"\0\0\0\0")
    return int(struct.unpack("i", raw)[0])


class TcpServer:
    """A TCP server on 127.0.0.1 that accepts one reader after another."""

    def __init__(self, port: int = 0) -> None:
        self._server = socket.create_server(("127.0.0.1", port))
        self.name = f"tcp://127.0.0.1:{self._server.getsockname()[1]}"
        self._reader: socket.socket | None = None

    def connect(self) -> None:
        """Do nothing: ``send`` accepts readers when it has bytes to send."""

    def disconnect(self) -> None:
        """Close the connection under the reader."""
        if self._reader is not None:
            self._reader.close()
            self._reader = None

    def send(self, data: bytes) -> None:
        """Write all bytes, waiting for a reader if there is none."""
        while True:
            if self._reader is None:
                self._reader, _ = self._server.accept()
            try:
                self._reader.sendall(data)
                return
            except OSError:
                self.disconnect()

    def close(self) -> None:
        """End the stream, wait up to 5 s for the reader to finish, and close."""
        if self._reader is not None:
            self._reader.shutdown(socket.SHUT_WR)
            # Bytes in transit are read before the connection closes.
            select.select([self._reader], [], [], 5.0)
        self.disconnect()
        self._server.close()


def serve(
    device: Device,
    line: PseudoTerminal | TcpServer,
    said: Callable[[str], None] = lambda _text: None,
    is_wanted: Callable[[], bool] = lambda: True,
    sent: Sent | None = None,
) -> Sent:
    """Send the recording once, in real time or faster, with the device's faults; then close the line.

    Stops early where ``is_wanted`` returns False. ``sent`` is updated while frames are sent; ``said`` gets messages.
    """
    sent = Sent() if sent is None else sent
    away = sorted(device.faults.disconnect_s)
    start = time.monotonic()
    for time_s, data in device.pieces(sent):
        if device.speed > 0.0:
            ahead = start + time_s / device.speed - time.monotonic()
            if ahead > 0.0:
                time.sleep(ahead)
        if not is_wanted():
            break
        if away and time_s >= away[0]:
            away.pop(0)
            said(f"disconnected at {time_s:.1f} s")
            time.sleep(0.2)
            line.disconnect()
            time.sleep(device.faults.away_s)
            line.connect()
            said("connected again")
            start = time.monotonic() - time_s / device.speed if device.speed > 0.0 else start
        if data:
            line.send(data)
    line.close()
    return sent
