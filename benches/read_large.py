"""Time and peak memory of reading a long text log; figures quoted in docs/reading.md.

python benches/read_large.py [ROWS]
"""

import resource
import subprocess
import sys
import tempfile
import time
from pathlib import Path

import numpy as np
import polars as pl

from trihedron.read import read_recording


def write_log(path: Path, n: int) -> None:
    """A still log of ``n`` rows, written in parts so that writing takes no more memory than reading."""
    rng = np.random.default_rng(1)
    part = 1_000_000
    with path.open("wb") as stream:
        for start in range(0, n, part):
            rows = min(part, n - start)
            columns = {"t": np.round((start + np.arange(rows)) / 1000.0, 3)}
            for name, mean, sigma in (("a", 9.8, 0.02), ("g", 0.01, 0.002)):
                for axis in "xyz":
                    columns[name + axis] = np.round(mean + sigma * rng.standard_normal(rows), 6)
            pl.DataFrame(columns).write_csv(stream, include_header=start == 0)


def main() -> None:
    if len(sys.argv) > 2:  # the child: read and say what it took
        start = time.perf_counter()
        recording = read_recording(sys.argv[2])
        took = time.perf_counter() - start
        peak = resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 1e6
        cell = peak * 1e9 / (recording.n_samples * 7)
        print(f"{recording.n_samples:.3g} rows x 7: {took:.1f} s, peak {peak:.2f} GB ({cell:.0f} bytes per cell)")
        return
    n = int(float(sys.argv[1])) if len(sys.argv) > 1 else 10_000_000
    with tempfile.TemporaryDirectory() as folder:
        path = Path(folder) / "long.csv"
        write_log(path, n)
        print(f"{path.stat().st_size / 1e9:.2f} GB of text")
        subprocess.run([sys.executable, __file__, "child", str(path)], check=True)


if __name__ == "__main__":
    main()
