"""A board on a pseudo-terminal or a socket in a thread, for the tests of capture."""

from __future__ import annotations

import threading
from pathlib import Path

import numpy as np

from trihedron.records import Recording
from trihedron.simulate.device.faults import Faults, Sent
from trihedron.simulate.device.serving import Device, PseudoTerminal, TcpServer, serve

DECLARED = """
name = "my-board"
sync = "AA 55"
[checksum]
kind = "crc16-ccitt"
[[field]]
name = "counter"
type = "u16"
[[field]]
name = "time"
type = "u32"
unit = "us"
""" + "".join(f'[[field]]\nname = "{name}"\ntype = "i16"\n' for name in ("ax", "ay", "az", "gx", "gy", "gz"))


def counts_recording(n: int, rate_hz: float, seed: int = 0) -> Recording:
    """Readings of a ten-bit ADC, all different from row to row."""
    rng = np.random.default_rng(seed)
    readings = np.round(rng.uniform(0.0, 1023.0, (n, 6)))
    return Recording(np.arange(n) / rate_hz, readings[:, :3], readings[:, 3:], rate_hz, "counts", "counts")


class Board:
    """Sends while the ``with`` lasts; ``sent`` says what."""

    def __init__(self, recording, protocol, *, faults=None, speed=0.0, link: Path | None = None, tcp=False, baud=0):
        self.device = Device(recording, protocol, faults or Faults(), speed, seed=1, baud=baud)
        self.line = TcpServer() if tcp else PseudoTerminal(link, baud)
        self.port = self.line.name
        self.sent = Sent()
        self._ended = threading.Event()
        self._thread = threading.Thread(target=self._run, daemon=True)

    def _run(self):
        try:
            serve(self.device, self.line, is_wanted=lambda: not self._ended.is_set(), sent=self.sent)
        except OSError:
            # Its reader was killed, as a test wanted.
            return

    def __enter__(self):
        self._thread.start()
        return self

    def __exit__(self, *_):
        self._ended.set()
        self.line.patience_s = 0.0
        self._thread.join(timeout=20)
