"""Blind trial of the diagnosis: draw a flaw, seal it, run the tool, open the seal, score.

    python benches/blind.py --each 6 --seed 7             # every effect six times: confusion matrix
    python benches/blind.py --each 4 --size 0.5           # at half size
    python benches/blind.py --foreign 30                  # mechanisms that the catalogue does not hold
    python benches/blind.py --healthy 600                 # false alarms, three noise grades in turn
    python benches/blind.py --effect accel-cubic --each 40 --grade mpu

Every recording is made by the instrument-level simulator (mechanisms, not the catalogue's curves): noise grade, unit,
protocol, effect, axis, sign and seed are drawn from one generator. The answer is written to a file that the tool never
opens; it is read after the verdict stands (benches/blind_trial; the definitions are in docs/diagnosis.md).
"""

from __future__ import annotations

import argparse
import itertools

import numpy as np

from blind_trial.draw import GRADES, Job
from blind_trial.foreign import FOREIGN
from blind_trial.score import table, trial
from blind_trial.sizes import SIZES
from trials import Result, command_line, tried


def drawn(options: argparse.Namespace) -> list[Job]:
    """The trials that the options ask for."""
    rng = np.random.default_rng(options.seed)
    grades = options.grade or GRADES
    jobs: list[Job] = []

    def add(effects: tuple[str, ...], grade: str, scale: float = options.size, foreign: str = "") -> None:
        jobs.append(Job(effects, grade, int(rng.integers(1 << 30)), scale, foreign))

    for k in range(options.healthy):
        add((), grades[k % len(grades)], 1.0)
    effects = options.effect or list(SIZES)
    for k in range(options.each):
        for effect in effects:
            add((effect,), grades[k % len(grades)])
    for k, name in zip(range(options.foreign), itertools.cycle(FOREIGN), strict=False):
        add((), grades[k // len(FOREIGN) % len(grades)], 1.0, name)
    return jobs


def line(result: Result) -> str:
    """One trial in one line, with the seed that repeats it."""
    also = f" also {result['also']}" if result["also"] else ""
    said = " ".join(f"{e}{c or ''}" for e, c in zip(result["found"], result["confounded"], strict=True))
    return (
        f"  {result['label']:26s} {result['grade']:9s}{result['score']:11s}{result['verdict']:16s} {said or '-'}{also} "
        f"| {','.join(result['disagrees'])} | {result['seconds']:.1f} s | seed {result['seed']} "
        f"{result['crash']}"
    )


def main() -> None:
    parser = command_line(__doc__)
    parser.add_argument("--each", type=int, default=0, help="recordings of every effect, grades in turn")
    parser.add_argument("--foreign", type=int, default=0, help="recordings with a mechanism outside the catalogue")
    parser.add_argument("--healthy", type=int, default=0, help="healthy recordings")
    parser.add_argument("--effect", action="append", choices=SIZES, help="only this effect (repeatable)")
    parser.add_argument("--grade", action="append", choices=GRADES, help="only this noise grade (repeatable)")
    parser.add_argument("--size", type=float, default=1.0, help="size as a fraction of the typical one")
    parser.add_argument("--verbose", action="store_true", help="print every trial")
    options = parser.parse_args()
    if not (options.each or options.foreign or options.healthy):
        options.each = 2
    jobs = [job for job in drawn(options) if options.only_seed in (None, job.seed)]

    def shown(result: Result) -> str:
        return line(result) if options.verbose or result["score"] not in ("right", "confounded") else ""

    print("\n" + table(tried(trial, jobs, options, shown)))


if __name__ == "__main__":
    main()
