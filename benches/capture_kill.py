"""kill -9 at random instants of a recording at 1 kHz: how much is lost, and does every file read?

python benches/capture_kill.py [KILLS] [PRIORITY of the recorder, as of nice: -15 on a machine that is busy]
"""

from __future__ import annotations

import random
import signal
import subprocess
import sys
import tempfile
import threading
import time
from pathlib import Path

import numpy as np

import trihedron
from trihedron.records import Recording
from trihedron.simulate.device import Device, PseudoTerminal, Sent, serve

RATE_HZ = 1000.0


def kill_once(seed: int, folder: Path, priority: int) -> tuple[float, int]:
    """Seconds of readings that were sent and are not in the file, and its rows."""
    n = int(60 * RATE_HZ)
    readings = np.round(np.random.default_rng(seed).uniform(0.0, 1023.0, (n, 6)))
    recording = Recording(np.arange(n) / RATE_HZ, readings[:, :3], readings[:, 3:], RATE_HZ, "counts", "counts")
    link, log, sent, ended = folder / f"tty{seed}", folder / f"log{seed}.csv", Sent(), threading.Event()
    line = PseudoTerminal(link)
    device = Device(recording, "xsens-mtdata2", seed=seed)

    def board() -> None:
        try:
            serve(device, line, is_wanted=lambda: not ended.is_set(), sent=sent)
        except OSError:
            return

    thread = threading.Thread(target=board, daemon=True)
    command = [sys.executable, "-m", "trihedron", "capture", str(link), "-o", str(log), "--protocol", "xsens-mtdata2"]
    command = [*(["nice", "-n", str(priority)] if priority else []), *command, "--baud", "115200"]
    process = subprocess.Popen(command, stderr=subprocess.DEVNULL)
    thread.start()
    while not (log.exists() and log.stat().st_size > 2000):
        time.sleep(0.01)
    time.sleep(random.Random(seed).uniform(0.0, 2.0))
    process.send_signal(signal.SIGKILL)
    sent_then = sent.frames
    process.wait()
    ended.set()
    line.patience_s = 0.0
    thread.join()
    back = trihedron.read(log)
    last = int(back.auxiliary["device_ticks"][-1])
    return sent_then / RATE_HZ - last * 1e-4, back.n_samples


def main(kills: int = 50, priority: int = 0) -> None:
    with tempfile.TemporaryDirectory() as folder:
        lost = []
        for seed in range(kills):
            seconds, rows = kill_once(seed, Path(folder), priority)
            lost.append(seconds)
            print(f"{seed:3d}  {rows:6d} rows read back, {1e3 * seconds:6.0f} ms lost", flush=True)
    print(f"{kills} kills: lost median {1e3 * np.median(lost):.0f} ms, most {1e3 * max(lost):.0f} ms; every file reads")


if __name__ == "__main__":
    main(*(int(word) for word in sys.argv[1:]))
