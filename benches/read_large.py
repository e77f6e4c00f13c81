"""Time and peak memory of reading a long text log; figures quoted in docs/reading.md.

python benches/read_large.py [ROWS]           stamps rounded to a millisecond
python benches/read_large.py [ROWS] late      a quarter of the stamps late by up to two steps, one row in 10 000 lost
python benches/read_large.py [ROWS] swapped   neighbours swapped here and there, so that all rows are put in order
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


def write_log(path: Path, n: int, *, late: bool = False, swapped: bool = False) -> None:
    """A still log of ``n`` rows, written in parts so that writing takes no more memory than reading."""
    rng = np.random.default_rng(1)
    part, last_s = 1_000_000, 0.0
    with path.open("wb") as stream:
        for start in range(0, n, part):
            rows = min(part, n - start)
            time_s = (start + np.arange(rows)) / 1000.0
            if late:
                # As of a queue: what overtakes nothing.
                delay = np.where(rng.random(rows) < 0.25, rng.uniform(0.0, 2e-3, rows), 0.0)
                time_s = np.maximum.accumulate(np.maximum(time_s + delay, last_s))
                last_s = float(time_s[-1])
            columns = {"t": np.round(time_s, 6 if late else 3)}
            for name, mean, sigma in (("a", 9.8, 0.02), ("g", 0.01, 0.002)):
                for axis in "xyz":
                    columns[name + axis] = np.round(mean + sigma * rng.standard_normal(rows), 6)
            frame = pl.DataFrame(columns)
            if late:
                frame = frame.filter(rng.random(rows) > 1e-4)
            if swapped:
                order = np.arange(len(frame))
                left = 2 * rng.choice(len(frame) // 2 - 1, len(frame) // 1000, replace=False)
                order[left], order[left + 1] = left + 1, left
                frame = frame[order]
            frame.write_csv(stream, include_header=start == 0)


def main() -> None:
    if sys.argv[1:2] == ["child"]:  # read and say what it took
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
        write_log(path, n, late="late" in sys.argv[2:], swapped="swapped" in sys.argv[2:])
        print(f"{path.stat().st_size / 1e9:.2f} GB of text")
        subprocess.run([sys.executable, __file__, "child", str(path)], check=True)


if __name__ == "__main__":
    main()
