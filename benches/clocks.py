"""The clock behind stamps, held against loggers drawn without a look at it: `python benches/clocks.py [seeds]`.

Rate, kind and losses over eight ways of stamping even samples and two of sampling unevenly, 0.1 Hz to 2 kHz, 300 to
30 000 rows (`--long`: 10⁶), losses of 0, 0.3 and 3 % (bursts of 2 to 30 besides, a fifth as often), a wandering rate.
"""

from __future__ import annotations

import sys
import time
from itertools import product

import numpy as np

from clock_trial.stamps import IRREGULAR, LAWS, Stamped, draw
from trihedron.read.clock.even import EvenClock, find_even_clock
from trihedron.records import StampKind

RATES_HZ = (0.1, 1.0, 5.0, 20.0, 100.0, 200.0, 1000.0, 2000.0)
NEAR = 40
"""Rows within which a found loss is the true one: late stamps and packets place it no better."""
KINDS = {
    "exact": {StampKind.EXACT},
    "rounded": {StampKind.ROUNDED, StampKind.EXACT},
    "milliseconds": {StampKind.ROUNDED},
    "scattered": {StampKind.SCATTERED},
    "renewal": {StampKind.IRREGULAR},
    "loop": {StampKind.IRREGULAR},
}


def matched(true: Stamped, found: EvenClock) -> tuple[int, int, int]:
    """Samples lost, missed and invented."""
    a = np.repeat(np.arange(len(true.lost_behind)), true.lost_behind)
    behind = found.lost_behind.copy()
    behind[found.pauses] = 0
    b = np.repeat(np.arange(len(behind)), behind)
    i = j = both = 0
    while i < len(a) and j < len(b):
        if abs(int(a[i]) - int(b[j])) <= NEAR:
            i, j, both = i + 1, j + 1, both + 1
        elif a[i] < b[j]:
            i += 1
        else:
            j += 1
    return len(a), len(a) - both, len(b) - both


def trial(law: str, n: int, seeds: int) -> str:
    errors, rms, right, even, counts = [], [], 0, 0, 0
    lost = missed = invented = total = 0
    spent = 0.0
    for (loss, wander), seed in product(((0.0, 0.0), (0.003, 2e-5), (0.03, 0.0)), range(seeds)):
        rate = float(np.random.default_rng([seed, n]).choice(RATES_HZ))
        true = draw(law, n, rate, seed, loss, loss / 5, wander)
        start = time.process_time()
        found = find_even_clock(true.stamp_s)
        spent += time.process_time() - start
        assert found is not None
        total += 1
        right += found.kind in KINDS.get(law, {StampKind.LATE})
        if found.kind is StampKind.IRREGULAR:
            continue
        even += 1
        counts += found.counts_losses
        if true.is_even and found.counts_losses:
            errors.append(abs(found.period_s / true.period_s - 1))
            rms.append(float(np.std(found.even_s - true.taken_s)) / true.period_s)
            here = matched(true, found)
            lost, missed, invented = lost + here[0], missed + here[1], invented + here[2]
    rate_error = f"{np.median(errors):.0e}, {np.percentile(errors, 95):.0e}" if errors else "-"
    offset = f"{np.median(rms):.3f}, {np.percentile(rms, 95):.2f}" if rms else "-"
    return (
        f"| {law} | {n} | {right}/{total} | {counts}/{total} | {rate_error} | {offset} | "
        f"{lost} | {missed} | {invented} | {1e3 * spent / total:.0f} |"
    )


def main() -> None:
    arguments = [a for a in sys.argv[1:] if a != "--long"]
    seeds = int(arguments[0]) if arguments else 12
    sizes = (1_000_000,) if "--long" in sys.argv else (300, 3000, 30_000)
    print("| stamps | rows | kind right | losses counted | rate error (median, 95 %) | even clock off by, steps |"
          " lost | missed | invented | CPU ms |")  # fmt: skip
    print("|---|---|---|---|---|---|---|---|---|---|")
    for law, n in product((*LAWS, *IRREGULAR), sizes):
        print(trial(law, n, seeds), flush=True)


if __name__ == "__main__":
    main()
