"""Frames sent = frames saved + frames counted lost, over a pseudo-terminal, with faults of every kind at once.

python benches/capture_faults.py [FRAMES PER PROTOCOL] [FAULTS] [PROTOCOL ...]
"""

from __future__ import annotations

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


def run(board: str, name: str, rate_hz: float, n: int, faults: str, folder: Path) -> tuple[int, int]:
    rng = np.random.default_rng(0)
    readings = np.round(rng.uniform(0.0, 1023.0, (n, 6)))
    recording = Recording(np.arange(n) / rate_hz, readings[:, :3], readings[:, 3:], rate_hz, "counts", "counts")
    declaration = read_frame_declaration(folder / "declared.toml")
    line = PseudoTerminal()
    # The port is open before the first byte is sent: nothing is lost for want of a reader.
    source = open_source(line.name)
    device = Device(
        recording,
        declaration if board == "declared" else board,
        replace(parse_faults(faults), clean_ends=30),
        0.0,
        seed=7,
    )
    sent = []
    thread = threading.Thread(target=lambda: sent.append(serve(device, line)))
    make = decoder_factory(declaration if name == "declared" else name, column_namer())
    recorder = Recorder(source, make, folder / f"{board}.csv", wait_for_return_s=0.0, silence_s=120.0)
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
        f"{board:20s} sent {sent[0].frames:8d} = saved {rows:8d} + lost {count.lost:6d} + {missing}   "
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


if __name__ == "__main__":
    given = sys.argv[1:]
    main(int(float(given[0])) if given else 100_000, given[1] if len(given) > 1 else "1%", tuple(given[2:]))
