"""Capture over a pseudo-terminal with a simulated board at its other end.

python benches/capture.py faults [FRAMES] [FAULTS] [BOARD ...]   frames sent = frames saved + frames counted lost
python benches/capture.py kill [KILLS]                           kill -9 at 1 kHz: what is lost, does every file read
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import trihedron
from board import DECLARED, Board, counts_recording
from trihedron.api.capturing import column_namer
from trihedron.capture.recorder import Recorder
from trihedron.capture.sources import open_source
from trihedron.capture.timeline import Count
from trihedron.protocols import decoder_factory
from trihedron.protocols.declared import FrameDeclaration, read_frame_declaration
from trihedron.simulate.device.faults import Sent, parse_faults
from trihedron.simulate.device.serving import Device, PseudoTerminal, serve

# What the board speaks, what it is read as, and the rate it pretends to: 115 200 baud and more.
BOARDS = {
    "xsens-mtdata2": ("xsens-mtdata2", 400.0), "xio": ("xio", 1000.0), "xio-text": ("xio", 400.0),
    "sparkfun-6dof": ("sparkfun-6dof", 100.0), "sparkfun-6dof-text": ("sparkfun-6dof-text", 100.0),
    "lines": ("lines", 1000.0), "lines-space": ("lines", 200.0), "lines-label": ("lines", 100.0),
    "lines-equals": ("lines", 100.0), "declared": ("declared", 2000.0), "sbg": ("sbg", 1000.0),
}  # fmt: skip


def capturing(port: str, log: str, protocol: str) -> list[str]:
    """The command that records a board."""
    command = [sys.executable, "-m", "trihedron", "capture", port, "-o", log]
    return [*command, "--protocol", protocol, "--baud", "115200"]


def recorded(device: Device, log: Path, wait_for_return_s: float, silence_s: float) -> tuple[Sent, Count]:
    """What the board sent and what the recorder counts, once everything is sent and the port silent."""
    line = PseudoTerminal(log.parent / "port")  # a name that stays the same when it comes back
    # The port is open before the first byte is sent: nothing is lost for want of a reader.
    source, sent, spoken = open_source(line.name), Sent(), device.protocol
    make = decoder_factory(BOARDS[spoken][0] if isinstance(spoken, str) else spoken, column_namer())
    recorder = Recorder(source, make, log, wait_for_return_s=wait_for_return_s, silence_s=silence_s)
    thread = threading.Thread(target=lambda: serve(device, line, sent=sent))
    thread.start()
    for _ in recorder:
        pass
    thread.join()
    return sent, recorder.count


def spoken_by(board: str, declaration: str, folder: Path) -> str | FrameDeclaration:
    """The board's protocol by name, or the frame that it declares."""
    if board != "declared":
        return board
    (folder / "declared.toml").write_text(declaration)
    return read_frame_declaration(folder / "declared.toml")


def faults(frames: str = "1e5", kinds: str = "1%", *only: str) -> None:
    """The account of every board, as fast as it can be read."""
    n, total = int(float(frames)), np.zeros(2, dtype=int)
    for board in only or BOARDS:
        with tempfile.TemporaryDirectory() as name:
            log, spoken = Path(name) / "log.csv", spoken_by(board, DECLARED, Path(name))
            clean = replace(parse_faults(kinds), clean_ends=30)
            device = Device(counts_recording(n, BOARDS[board][1]), spoken, clean, 0.0, seed=7)
            # A board that goes away comes back; one that has sent everything does not.
            sent, count = recorded(device, log, 5.0 if "disconnect" in kinds else 0.0, 120.0)
            rows = sum(row[0].isdigit() for row in log.open())
        missing = sent.frames - rows - count.lost
        total += (sent.frames, missing)
        account = f"sent {sent.frames:8d} = saved {rows:8d} + lost {count.lost:6d} + {missing}"
        print(f"{board:20s} {account} (corrupt pieces {count.corrupt}, {count})", flush=True)
    print(f"{total[0]} frames; not accounted for: {total[1]}")


def kill(kills: str = "50") -> None:
    """Seconds of readings that were sent and are not in the file."""
    lost = []
    with tempfile.TemporaryDirectory() as name:
        for seed in range(int(kills)):
            log = Path(name) / f"log{seed}.csv"
            board = Board(counts_recording(60_000, 1000.0, seed), "xsens-mtdata2", speed=1.0)
            process = subprocess.Popen(capturing(board.port, str(log), "xsens-mtdata2"), stderr=subprocess.DEVNULL)
            with board:
                while not (log.exists() and log.stat().st_size > 2000):
                    time.sleep(0.01)
                time.sleep(random.Random(seed).uniform(0.0, 2.0))
                process.send_signal(signal.SIGKILL)
                sent_then = board.sent.frames
                process.wait()
            lost.append(sent_then / 1000.0 - int(trihedron.read(log).auxiliary["device_ticks"][-1]) * 1e-4)
    print(f"{kills} kills: lost median {1e3 * np.median(lost):.0f} ms, most {1e3 * max(lost):.0f} ms; every file reads")


if __name__ == "__main__":
    {"faults": faults, "kill": kill}[sys.argv[1]](*sys.argv[2:])
