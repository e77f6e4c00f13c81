"""Blind trial of the diagnosis: healthy instruments, and mechanisms that its catalogue does not hold.

    python benches/blind.py --foreign 28 --seed 304         # mechanisms outside the catalogue
    python benches/blind.py --healthy 300 --seed 305        # false alarms, three noise grades in turn

Every recording is made by the instrument-level simulator: unit, protocol, mechanism and seed are drawn from one
generator. The answer is written to a file that the tool never opens; it is read after the verdict stands. Effects of
the catalogue, from a generator of its own: benches/blind_nuisances.py.
"""

from __future__ import annotations

import argparse
import itertools

import numpy as np

from blind_trial.draw import GRADES, Job
from blind_trial.foreign import FOREIGN
from blind_trial.score import table, trial
from trials import Result, command_line, tried


def drawn(options: argparse.Namespace) -> list[Job]:
    """The trials that the options ask for."""
    rng = np.random.default_rng(options.seed)
    asked = [(k, "") for k in range(options.healthy)]
    asked += [(k // len(FOREIGN), name) for k, name in zip(range(options.foreign), itertools.cycle(FOREIGN))]
    return [Job(GRADES[k % len(GRADES)], int(rng.integers(1 << 30)), name) for k, name in asked]


def line(result: Result) -> str:
    """A trial that went wrong in one line, with the seed that repeats it."""
    return "" if result["score"] == "right" else (
        f"  {result['label']:26s} {result['grade']:9s}{result['score']:7s}{result['verdict']:16s} "
        f"{' '.join(result['found']) or '-'} also {result['also']} | {','.join(result['disagrees'])} "
        f"| {result['seconds']:.1f} s | seed {result['seed']} {result['crash']}"
    )  # fmt: skip


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--foreign", type=int, default=0, help="recordings with a mechanism outside the catalogue")
    parser.add_argument("--healthy", type=int, default=0, help="healthy recordings")
    options = parser.parse_args()
    jobs = [job for job in drawn(options) if options.only_seed in (None, job.seed)]
    print("\n" + table(tried(trial, jobs, options, line)))


if __name__ == "__main__":
    main()
