"""How time grows with the length of a log and with the number of poses, ours and others."""

import time
from pathlib import Path

import numpy as np

from rival_paths import attitude, norm


def seconds(function, arguments):
    """Fastest of three calls, or of as many as fit into 0.1 s, on whatever cores there are."""
    function(*arguments)
    best, start, calls = np.inf, time.perf_counter(), 0
    while calls < 3 or time.perf_counter() - start < 0.1:
        begun = time.perf_counter()
        function(*arguments)
        best, calls = min(best, time.perf_counter() - begun), calls + 1
        if time.perf_counter() - start > 3.0:
            break
    return best


def curve(path, sizes, function, module):
    path.plot(sizes, [seconds(function, module.data(n)) for n in sizes], marker=".")


def draw(path: Path) -> None:
    import matplotlib.pyplot as plt

    figure, (left, right) = plt.subplots(1, 2, figsize=(10, 4), layout="constrained")
    steps = [10**k for k in range(2, 8)]
    for name, function in attitude.TRAJECTORY.items():
        if function is None or name.startswith("pyins"):
            continue
        made = function() if function.__name__ == "numba_chain" else function
        curve(left, steps[:3] if name.startswith("SciPy") else steps, made, attitude)
    # Below right no line goes: the fits begin at what a call costs, and those of SciPy lie above all others.
    place = {"loc": "lower right", "fontsize": "small"}
    left.legend(
        [name for name, f in attitude.TRAJECTORY.items() if f is not None and not name.startswith("pyins")], **place
    )
    left.set(xlabel="steps", ylabel="seconds", title="attitude at every step", xscale="log", yscale="log")
    poses = [18, 50, 200, 1000, 10_000, 100_000, 1_000_000]
    for name, function in norm.FIT.items():
        if function is None:
            continue
        made = function() if function.__name__ == "ours" else function
        curve(right, poses[:5] if name.startswith("SciPy") else poses, made, norm)
    right.legend([name for name, function in norm.FIT.items() if function is not None], **place)
    right.set(xlabel="poses or samples", ylabel="seconds", title="fit of the norm", xscale="log", yscale="log")
    for axes in (left, right):
        axes.grid(which="major", alpha=0.3)
    figure.savefig(path, dpi=110)
