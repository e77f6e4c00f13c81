"""Frames sent = frames saved + frames counted lost, over a pseudo-terminal, with faults of every kind at once.

python benches/capture_faults.py [FRAMES PER PROTOCOL] [FAULTS] [PROTOCOL ...]
    as fast as they can be sent
python benches/capture_faults.py --rates SECONDS [FAULTS] [PROTOCOL ...]
    in real time, at 100 Hz to 2 kHz, four boards at once
"""

from __future__ import annotations

import multiprocessing
import sys
import tempfile
import threading
import time
from dataclasses import replace
from pathlib import Path

import numpy as np

from trihedron.capture import Recorder, decoder_factory, open_source
from trihedron.files.frame_declaration import read_frame_declaration
from trihedron.pipeline.capturing import column_namer
from trihedron.records import Recording
from trihedron.simulate.device import Device, PseudoTerminal, parse_faults, serve

DECLARED = """
sync = "AA 55"
[checksum]
kind = "crc16-ccitt"
[[field]]
name = "counter"
type = "u16"
""" + "".join(f'[[field]]\nname = "{name}"\ntype = "i16"\n' for name in ("ax", "ay", "az", "gx", "gy", "gz"))

# What the board speaks, what it is read as, and the rate it pretends to: 115 200 baud and more.
PAIRS = (
    *(("xsens-mtdata2", "xsens-mtdata2", 400.0), ("xio", "xio", 1000.0), ("xio-text", "xio", 400.0)),
    *(("sparkfun-6dof", "sparkfun-6dof", 100.0), ("sparkfun-6dof-text", "sparkfun-6dof-text", 100.0)),
    *(("lines", "lines", 1000.0), ("lines-space", "lines", 200.0), ("lines-label", "lines", 100.0)),
    *(("lines-equals", "lines", 100.0), ("declared", "declared", 2000.0)),
)


# Real time, from the slowest to the fastest rate that cheap boards are set to.
RATES_HZ = (100.0, 200.0, 500.0, 1000.0, 2000.0)


def run(
    board: str, name: str, rate_hz: float, n: int, faults: str, folder: Path, speed: float = 0.0
) -> tuple[int, int]:
    """Record `n` frames of one board and print the account; speed 1 is real time, 0 as fast as it is read."""
    rng = np.random.default_rng(0)
    readings = np.round(rng.uniform(0.0, 1023.0, (n, 6)))
    recording = Recording(np.arange(n) / rate_hz, readings[:, :3], readings[:, 3:], rate_hz, "counts", "counts")
    declaration = read_frame_declaration(folder / "declared.toml")
    line = PseudoTerminal(folder / "port")  # a name that stays the same when it comes back
    # The port is open before the first byte is sent: nothing is lost for want of a reader.
    source = open_source(line.name)
    device = Device(
        recording,
        declaration if board == "declared" else board,
        replace(parse_faults(faults), clean_ends=30),
        speed,
        seed=7,
    )
    sent = []
    thread = threading.Thread(target=lambda: sent.append(serve(device, line)))
    # A board that goes away comes back; one that has sent everything does not.
    away_s = 5.0 if "disconnect" in faults else 0.0
    make = decoder_factory(declaration if name == "declared" else name, column_namer())
    recorder = Recorder(source, make, folder / f"{board}.csv", wait_for_return_s=away_s, silence_s=120.0)
    started = time.process_time()
    thread.start()
    for _ in recorder:
        pass
    thread.join()
    cpu = time.process_time() - started
    count = recorder.count
    rows = sum(1 for row in (folder / f"{board}.csv").open() if row[0].isdigit())
    missing = sent[0].frames - rows - count.lost
    print(
        f"{board:20s} {rate_hz:4.0f} Hz{'' if speed else ', unpaced'}: "
        f"sent {sent[0].frames:8d} = saved {rows:8d} + lost {count.lost:6d} + {missing}   "
        f"(corrupt pieces {count.corrupt}, garbled counts {count.tally.garbled}, repeated {count.tally.repeated}, "
        f"restarts {count.tally.restarts}; {1e6 * cpu / n:.0f} us of CPU per frame, the board's share included)",
        flush=True,
    )
    return sent[0].frames, missing


def main(n: int = 100_000, faults: str = "1%", only: tuple[str, ...] = ()) -> None:
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "declared.toml").write_text(DECLARED)
        chosen = [pair for pair in PAIRS if not only or pair[0] in only]
        done = [run(*pair, n, faults, Path(folder)) for pair in chosen]
    print(f"{sum(sent for sent, _ in done)} frames; not accounted for: {sum(missing for _, missing in done)}")


def one_in_real_time(job: tuple[tuple[str, str, float], str, float]) -> tuple[int, int]:
    (board, name, rate_hz), faults, seconds = job
    with tempfile.TemporaryDirectory() as folder:
        (Path(folder) / "declared.toml").write_text(DECLARED)
        return run(board, name, rate_hz, int(rate_hz * seconds), faults, Path(folder), 1.0)


def in_real_time(seconds: float, faults: str = "1%", only: tuple[str, ...] = ()) -> None:
    boards = [pair[:2] for pair in PAIRS if not only or pair[0] in only]
    jobs = [((*board, rate_hz), faults, seconds) for rate_hz in RATES_HZ for board in boards]
    # Spawned: each board and its recorder in a process of their own, as board and recorder are on a desk.
    with multiprocessing.get_context("spawn").Pool(4) as pool:
        done = pool.map(one_in_real_time, jobs, chunksize=1)
    print(f"{sum(sent for sent, _ in done)} frames; not accounted for: {sum(missing for _, missing in done)}")


if __name__ == "__main__":
    given = sys.argv[1:]
    if given[:1] == ["--rates"]:
        in_real_time(float(given[1]), given[2] if len(given) > 2 else "1%", tuple(given[3:]))
        sys.exit()
    main(int(float(given[0])) if given else 100_000, given[1] if len(given) > 1 else "1%", tuple(given[2:]))
