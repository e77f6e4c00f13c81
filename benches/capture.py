"""Capture over a pseudo-terminal with a simulated board at its other end.

python benches/capture.py faults [FRAMES] [FAULTS] [BOARD ...]   frames sent = frames saved + frames counted lost
python benches/capture.py firmware [RUNS] [SECONDS] [SEED]       boards drawn at random, in real time
python benches/capture.py kill [KILLS]                           kill -9 at 1 kHz: what is lost, does every file read
python benches/capture.py cpu [RATE_HZ] [BOARD ...]              share of a core that a recording takes
"""

from __future__ import annotations

import random
import resource
import signal
import subprocess
import sys
import tempfile
import threading
import time
from concurrent.futures import ProcessPoolExecutor
from dataclasses import dataclass, replace
from itertools import pairwise
from pathlib import Path

import numpy as np

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))
import trihedron
from board import Board, counts_recording
from trihedron.api.capturing import column_namer
from trihedron.capture.protocols import decoder_factory
from trihedron.capture.recorder import Recorder
from trihedron.capture.sources import open_source
from trihedron.capture.timeline import Count
from trihedron.files.frame_declaration import FrameDeclaration, read_frame_declaration
from trihedron.records import Recording
from trihedron.simulate.device.encoders import Scales
from trihedron.simulate.device.faults import Faults, Sent, parse_faults
from trihedron.simulate.device.serving import Device, PseudoTerminal, serve

DECLARED = """
sync = "AA 55"
[checksum]
kind = "crc16-ccitt"
[[field]]
name = "counter"
type = "u16"
""" + "".join(f'[[field]]\nname = "{name}"\ntype = "i16"\n' for name in ("ax", "ay", "az", "gx", "gy", "gz"))
# What the board speaks, what it is read as, and the rate it pretends to: 115 200 baud and more.
BOARDS = {
    "xsens-mtdata2": ("xsens-mtdata2", 400.0), "xio": ("xio", 1000.0), "xio-text": ("xio", 400.0),
    "sparkfun-6dof": ("sparkfun-6dof", 100.0), "sparkfun-6dof-text": ("sparkfun-6dof-text", 100.0),
    "lines": ("lines", 1000.0), "lines-space": ("lines", 200.0), "lines-label": ("lines", 100.0),
    "lines-equals": ("lines", 100.0), "declared": ("declared", 2000.0), "sbg": ("sbg", 1000.0),
}  # fmt: skip
SHORT_S, LONG_S = 4.0, 14.0


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
        print(f"{board:20s} {account} (corrupt pieces {count.corrupt}, {count.tally})", flush=True)
    print(f"{total[0]} frames; not accounted for: {total[1]}")


@dataclass(frozen=True)
class Run:
    """One firmware run as drawn."""

    seed: int
    board: str
    rate_hz: float
    seconds: float
    faults: Faults
    declaration: str

    @classmethod
    def drawn(cls, seed: int, seconds: float) -> Run:
        rng = random.Random(seed)
        board = rng.choice(list(BOARDS))
        fastest = 500.0 if "lines" in board or board.endswith("text") else 2000.0
        away = tuple(sorted(rng.uniform(3.0, seconds - 5.0) for _ in range(rng.choice((0, 0, 1, 2)))))
        pauses = tuple(rng.uniform(3.0, seconds - 5.0) for _ in range(rng.choice((0, 1, 2))))
        faults = Faults(
            missing=rng.choice((0.0, 0.001, 0.02)), cut=rng.choice((0.0, 0.002)), flipped=rng.choice((0.0, 0.002)),
            drift_ppm=rng.uniform(-60.0, 60.0), start_text="lines" in board and rng.random() < 0.5,
            disconnect_s=away, away_s=rng.uniform(0.3, 2.5), clean_ends=30,
            pause_s=pauses, paused_s=rng.choice((0.05, 0.5, 2.0)),
        )  # fmt: skip
        count, ticks = rng.choice(("u8", "u16", "u32")), rng.choice(("", "u16", "u32"))
        declaration = DECLARED.replace('"counter"\ntype = "u16"', f'"counter"\ntype = "{count}"')
        if ticks:
            clock = f'[[field]]\nname = "ticks"\nrole = "clock"\ntick_s = 0.0001\ntype = "{ticks}"\n'
            declaration = declaration.replace('[[field]]\nname = "ax"', clock + '[[field]]\nname = "ax"')
        return cls(seed, board, rng.choice((100.0, 104.0, 250.0, 416.0, 1000.0, fastest)), seconds, faults, declaration)


def numbered(n: int, rate_hz: float) -> Recording:
    """Ten-bit readings that say which sample they are."""
    number = np.arange(n)
    noise = np.random.default_rng(0).integers(400, 600, (n, 4)).astype(float)
    accel = np.column_stack([number % 1000, number // 1000, noise[:, 0]]).astype(float)
    return Recording(number / rate_hz, accel, noise[:, 1:], rate_hz, "counts", "counts")


def _slope(sent_s: np.ndarray, read_s: np.ndarray) -> float:
    """Of times as read on times as sent. A bit flipped in a frame without a checksum is another number, not time."""
    off = read_s - sent_s
    kept = np.abs(off - np.median(off)) < 0.1
    return float(np.polyfit(sent_s[kept], read_s[kept], 1)[0])


def one_run(run: Run) -> str:
    """The account of one run; starts with ``ok`` where every sample is accounted for and time is right.

    Where a count began anew, or may have gone round, the log says that more may be lost than it counts.
    """
    n = int(run.seconds * run.rate_hz)
    with tempfile.TemporaryDirectory() as name:
        path, spoken = Path(name) / "log.csv", spoken_by(run.board, run.declaration, Path(name))
        device = Device(numbered(n, run.rate_hz), spoken, run.faults, 1.0, run.seed, scales=Scales(1.0, 1.0))
        sent, count = recorded(device, path, 4.0 if run.faults.disconnect_s else 0.0, 20.0)
        log = trihedron.read(path)
    assert log.accelerometer is not None
    values = log.accelerometer * (9.80665 if log.accelerometer_unit == "g" else 1.0)
    number = np.rint(values[:, 0]) + 1000 * np.rint(values[:, 1])
    missing = sent.frames - log.n_samples - count.lost
    worst = 0.0
    for begin, end in pairwise((0.0, *run.faults.disconnect_s, run.seconds)):
        rows = (number > (begin + 0.1) * run.rate_hz) & (number < (end - 0.3) * run.rate_hz)
        slope = _slope(number[rows] / run.rate_hz, log.time_s[rows]) if rows.sum() > 50 else 1.0
        worst = max(worst, abs(slope - 1.0) * 1e6 if end - begin > 5.0 else 0.0)
    is_accounted = missing == 0 or (missing > 0 and count.is_least)
    is_ok = is_accounted and worst < 100.0 and bool(np.all(np.diff(log.time_s) > 0.0))
    lost = f"{'at least ' * count.is_least}{count.lost}"
    account = f"sent {sent.frames} = saved {log.n_samples} + lost {lost} + {missing}; time {worst:.0f} ppm"
    return f"{'ok ' if is_ok else 'NOT'} {run.seed} {run.board} {run.rate_hz:g} Hz: {account}; {run.faults}"


def firmware(runs: str = "40", seconds: str = "30", seed: str = "0") -> None:
    """Runs side by side in real time."""
    drawn = [Run.drawn(int(seed) + number, float(seconds)) for number in range(int(runs))]
    with ProcessPoolExecutor(4) as pool:
        accounts = list(pool.map(one_run, drawn))
    print(*accounts, sep="\n")
    print(f"{sum(one.startswith('ok') for one in accounts)} of {len(accounts)} accounted for, within 100 ppm")


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


def cpu(rate_hz: str = "1000", *only: str) -> None:
    """CPU of the process over 4 and over 14 seconds, the difference over ten."""
    for protocol in only or ("xsens-mtdata2", "lines", "xio", "sparkfun-6dof"):
        spent = []
        for seconds in (SHORT_S, LONG_S):
            sent = counts_recording(int((seconds + 60.0) * float(rate_hz)), float(rate_hz))
            before = resource.getrusage(resource.RUSAGE_CHILDREN)
            with tempfile.TemporaryDirectory() as folder, Board(sent, protocol, speed=1.0) as board:
                command = capturing(board.port, f"{folder}/log.csv", BOARDS[protocol][0])
                subprocess.run([*command, "--seconds", str(seconds)], check=True, capture_output=True)
            after = resource.getrusage(resource.RUSAGE_CHILDREN)
            spent.append(after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime)
        print(f"{protocol:16s} {rate_hz} Hz: {100 * (spent[1] - spent[0]) / (LONG_S - SHORT_S):.1f} % of a core")


if __name__ == "__main__":
    {"faults": faults, "firmware": firmware, "kill": kill, "cpu": cpu}[sys.argv[1]](*sys.argv[2:])
