"""Speed and memory of the Allan deviation beside allantools and a plain NumPy version, same data, one run.

python benches/allan_speed.py             10 million readings, 100 clusters; about four minutes
python benches/allan_speed.py 1000000     another length
"""

import gc
import resource
import statistics
import sys
import threading
import time
from pathlib import Path

import allantools
import numpy as np

from trihedron.estimate.noise import allan_deviation


def prefix_sums(x, clusters):
    """The textbook in NumPy: one running sum, three slices."""
    p = np.concatenate([[0.0], np.cumsum(x - x.mean())])
    out = []
    for m in clusters.tolist():
        d = p[2 * m :] - 2 * p[m:-m] + p[: -2 * m]
        out.append(np.sqrt(np.dot(d, d) / (2.0 * m**2 * len(d))))
    return np.array(out)


def oracle(x, clusters):
    return allantools.oadev(x - x.mean(), rate=1.0, data_type="freq", taus=clusters)[1]


def ours(x, clusters):
    return allan_deviation(x, 1.0, clusters).deviation[:, 0]


def timed(function, *arguments):
    gc.collect()
    began, worked = time.perf_counter(), time.process_time()
    value = function(*arguments)
    return time.perf_counter() - began, time.process_time() - worked, value


def resident():
    for line in Path("/proc/self/status").read_text().splitlines():
        if line.startswith("VmRSS"):
            return int(line.split()[1]) * 1024
    return 0


def peak_above(function, *arguments):
    """Largest resident memory above that before the call, bytes, by a watching thread."""
    gc.collect()
    base, peak, stop = resident(), 0, threading.Event()

    def watch():
        nonlocal peak
        while not stop.is_set():
            peak = max(peak, resident() - base)
            time.sleep(0.001)

    watcher = threading.Thread(target=watch)
    watcher.start()
    function(*arguments)
    stop.set()
    watcher.join()
    return peak


def main():
    n = int(float(sys.argv[1])) if len(sys.argv) > 1 else 10_000_000
    x = np.random.default_rng(1).normal(size=n)
    clusters = np.unique(np.round(np.geomspace(1, n / 10, 150)).astype(int))
    clusters = clusters[np.linspace(0, len(clusters) - 1, 100).astype(int)]
    allan_deviation(x[:1000], 1.0)
    times = {"ours": [], "NumPy prefix sums": [], "allantools.oadev": []}
    work = {name: [] for name in times}
    for _ in range(3):
        # Interleaved, so that whatever else the machine does falls on all of them.
        for name, function in (
            ("ours", ours),
            ("NumPy prefix sums", prefix_sums),
            ("ours", ours),
            ("allantools.oadev", oracle),
        ):
            seconds, processor, value = timed(function, x, clusters)
            times[name].append(seconds)
            work[name].append(processor)
            if name == "ours":
                reference = value
            else:
                assert np.allclose(value, reference, rtol=1e-8), name
    medians = {name: statistics.median(values) for name, values in times.items()}
    for name, seconds in medians.items():
        per, ratio = 1e9 * seconds / n / len(clusters), seconds / medians["ours"]
        print(f"{name:20s} {seconds:8.3f} s  {per:6.3f} ns per reading and cluster  {ratio:6.1f} x ours")
    least = {name: min(values) for name, values in times.items()}
    print("best of each: " + ", ".join(f"{name} {s:.3f} s ({s / least['ours']:.1f} x)" for name, s in least.items()))
    # On a machine that does other work as well, processor time is what one run has in common with the next.
    work = {name: statistics.median(values) for name, values in work.items()}
    print("processor time: " + ", ".join(f"{name} {s:.3f} s ({s / work['ours']:.1f} x)" for name, s in work.items()))
    peak = peak_above(ours, x, clusters)
    share = peak / x.nbytes
    print(f"memory beside the input: {share:.2f} x its bytes ({peak / 2**20:.0f} MiB); in all {1 + share:.2f} x")
    print(f"largest resident set of the process: {resource.getrusage(resource.RUSAGE_SELF).ru_maxrss / 2**20:.2f} GiB")


if __name__ == "__main__":
    main()
