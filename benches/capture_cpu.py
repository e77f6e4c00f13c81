"""Share of a core that a recording takes: CPU of the process over 4 and over 14 seconds, the difference over ten.

python benches/capture_cpu.py [RATE_HZ] [PROTOCOL ...]
"""

from __future__ import annotations

import resource
import subprocess
import sys
import tempfile
import threading
from pathlib import Path

import numpy as np

from trihedron.records import Recording
from trihedron.simulate.device import Device, PseudoTerminal, serve

SHORT_S, LONG_S = 4.0, 14.0


def cpu_s(protocol: str, rate_hz: float, seconds: float, folder: Path) -> float:
    n = int((seconds + 60.0) * rate_hz)
    readings = np.round(np.random.default_rng(0).uniform(0.0, 1023.0, (n, 6)))
    recording = Recording(np.arange(n) / rate_hz, readings[:, :3], readings[:, 3:], rate_hz, "counts", "counts")
    line, ended = PseudoTerminal(), threading.Event()

    def board() -> None:
        try:
            serve(Device(recording, protocol), line, is_wanted=lambda: not ended.is_set())
        except OSError:
            return

    thread = threading.Thread(target=board, daemon=True)
    read_as = protocol.split("-")[0] if protocol.startswith(("lines", "xio")) else protocol
    command = [sys.executable, "-m", "trihedron", "capture", line.name, "-o", str(folder / "log.csv"), "--force"]
    command += ["--protocol", read_as, "--baud", "115200", "--seconds", str(seconds)]
    before = resource.getrusage(resource.RUSAGE_CHILDREN)
    thread.start()
    subprocess.run(command, check=True, capture_output=True)
    after = resource.getrusage(resource.RUSAGE_CHILDREN)
    ended.set()
    line.patience_s = 0.0
    thread.join()
    return after.ru_utime + after.ru_stime - before.ru_utime - before.ru_stime


def main(
    rate_hz: float = 1000.0, protocols: tuple[str, ...] = ("xsens-mtdata2", "lines", "xio", "sparkfun-6dof")
) -> None:
    with tempfile.TemporaryDirectory() as folder:
        for protocol in protocols:
            short, long = (cpu_s(protocol, rate_hz, seconds, Path(folder)) for seconds in (SHORT_S, LONG_S))
            share = (long - short) / (LONG_S - SHORT_S)
            print(f"{protocol:16s} {rate_hz:g} Hz: {100 * share:.1f} % of a core", flush=True)


if __name__ == "__main__":
    given = sys.argv[1:]
    main(float(given[0]) if given else 1000.0, *([tuple(given[1:])] if given[1:] else []))
