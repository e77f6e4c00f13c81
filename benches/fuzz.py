"""Fuzzing: mutated input files and command lines, for as long as you like; docs/evidence.md quotes it.

python benches/fuzz.py inputs 100000 [SEED]     every reader of a file that is ours or binary
python benches/fuzz.py formats 5000 [SEED]      logs of other formats: libraries', JSON, folders, makers' text
python benches/fuzz.py commands 5000 [SEED]     command lines, in child processes of one loaded process

Every case is made from SEED and its number alone; `case inputs|formats|commands NUMBER [SEED]` repeats it. A failure is
a traceback, an exception other than `ValueError`, an internal error, text of a panic, a control character on a
terminal, a wait of more than ten seconds, rows that are not accounted for, an input harmed or a file left.
"""

from __future__ import annotations

import collections
import os
import sys
import time
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1] / "tests"))

from attacks.cases import Attack
from attacks.commands import Commands
from attacks.formats import Formats
from attacks.inputs import Inputs

BATCH = 100


def main() -> None:
    if sys.argv[1] == "case":
        kind, number = sys.argv[2], int(sys.argv[3])
        seed = int(sys.argv[4]) if len(sys.argv) > 4 else 0
        print(_attack(kind, seed).describe(number))
        print(_attack(kind, seed).run(number))
        return
    kind, count = sys.argv[1], int(sys.argv[2])
    seed = int(sys.argv[3]) if len(sys.argv) > 3 else 0
    attack = _attack(kind, seed)
    began = time.monotonic()
    totals: collections.Counter[str] = collections.Counter()
    for first in range(0, count, BATCH):
        numbers = range(first, min(first + BATCH, count))
        for number, outcome in attack.run_forked(numbers):
            word = outcome.split(":")[0]
            totals[word] += 1
            if word == "FAILED":
                print(number, attack.describe(number), outcome, flush=True)
    print(f"{kind}, seed {seed}: {count} cases in {time.monotonic() - began:.0f} s; {dict(totals)}")
    sys.exit(totals["FAILED"] > 0)


def _attack(kind: str, seed: int) -> Attack:
    os.environ.setdefault("COLUMNS", "80")
    return {"inputs": Inputs, "formats": Formats, "commands": Commands}[kind](seed)


if __name__ == "__main__":
    main()
