"""A log that does not fit: Allan deviation and noise terms of a thousand million readings in bounded memory.

python benches/allan_stream.py             1e9 readings, about two minutes
python benches/allan_stream.py 1e8
python benches/allan_stream.py 1e9 FILE.npy    through a file of that name (8 GB), by `trihedron allan --stream`
"""

import resource
import subprocess
import sys
import time

import numpy as np

from trihedron.estimate.noise import allan_deviation, stream_noise

RATE = 1000.0
N, K = 1e-3, 1e-6


def chunks(n, size=1 << 20):
    """White noise and a random walk in chunks."""
    rng = np.random.default_rng(5)
    level = 0.0
    for start in range(0, n, size):
        k = min(size, n - start)
        walk = level + K / np.sqrt(RATE) * np.cumsum(rng.standard_normal(k, dtype=np.float32).astype(np.float64))
        level = walk[-1]
        yield 9.81 + N * np.sqrt(RATE) * rng.standard_normal(k, dtype=np.float32) + walk


# What the process itself used: the operating system's own maximum counts pages of the process that started it.
COMMAND = """
import sys
from pathlib import Path
from trihedron.cli import main
status = main(sys.argv[1:])
print(next(line for line in Path("/proc/self/status").read_text().splitlines() if line.startswith("VmHWM")))
sys.exit(status)
"""


def through_file(n, path):
    """The same log as a .npy file, by the command, in a process of its own."""
    log = np.lib.format.open_memmap(path, mode="w+", dtype=np.float64, shape=(n, 1))
    at = 0
    for part in chunks(n):
        log[at : at + len(part), 0] = part
        at += len(part)
    del log
    said = ["--stream", "--columns", "az", "--rate", str(RATE), "--accel-unit", "m/s^2"]
    began = time.perf_counter()
    done = subprocess.run([sys.executable, "-c", COMMAND, "allan", path, *said], capture_output=True, text=True)
    spent = time.perf_counter() - began
    print(done.stdout, done.stderr)
    peak = int(done.stdout.split()[-2]) / 2**20
    print(f"{n:.0e} readings from {path}: {spent:.1f} s, largest resident set of the command {peak:.2f} GiB")


def main():
    n = int(float(sys.argv[1])) if len(sys.argv) > 1 else 1_000_000_000
    if len(sys.argv) > 2:
        through_file(n, sys.argv[2])
        return
    began = time.perf_counter()
    for _ in chunks(n):
        pass
    making = time.perf_counter() - began
    before = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    began = time.perf_counter()
    found = stream_noise(chunks(n), RATE, n_samples=n)
    spent = time.perf_counter() - began - making
    after = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss
    axis = found.axes[0]
    print(
        f"{n:.0e} readings, {len(found.curve.clusters)} clusters, stride {found.curve.stride}: {spent:.1f} s "
        f"({1e9 * spent / n:.1f} ns per reading; making the readings took {making:.1f} s)"
    )
    print(f"largest resident set {after / 2**20:.2f} GiB, of which {before / 2**20:.2f} GiB before the stream began")
    for symbol, truth in (("N", N), ("K", K)):
        term = axis.terms[symbol]
        print(f"  {symbol} {term.value:.4g} ± {term.sigma:.2g}, true {truth:g}")
    if n <= 100_000_000:
        whole = allan_deviation(np.concatenate(list(chunks(n)))[:, np.newaxis], RATE, found.curve.clusters)
        difference = np.abs(found.curve.deviation / whole.deviation - 1).max()
        print(f"  largest relative difference to the whole array: {difference:.1e}")


if __name__ == "__main__":
    main()
