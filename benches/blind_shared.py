"""What recordings share: sessions of three units that share nothing, given as recordings of one.

    python benches/blind_shared.py --only none --triples 10 --seed 21                 # nothing may be shared
    python benches/blind_shared.py --only gyro-g-sensitivity --triples 10 --seed 22   # every unit has another matrix

The first counts false names, the second whether values that differ are called the instrument's.
"""

from __future__ import annotations

import argparse
import os
import tempfile
from pathlib import Path

os.environ.setdefault("OPENBLAS_NUM_THREADS", "1")

import polars as pl

import trihedron
from nuisance_trial.draw import FLAWS, G, draw

N_RECORDINGS = 3


def triple(flaw, seed, folder):
    """What is said of three sessions of three units."""
    logs = []
    for k in range(N_RECORDINGS):
        columns, _ = draw(flaw, seed * N_RECORDINGS + k)
        logs.append(Path(folder) / f"{k}.csv")
        pl.DataFrame(columns).write_csv(logs[-1])
    return trihedron.diagnose_sessions([str(log) for log in logs], gravity_m_s2=G)


def main():
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--only", choices=FLAWS, default="none")
    parser.add_argument("--triples", type=int, default=10)
    parser.add_argument("--seed", type=int, default=21)
    options = parser.parse_args()
    shared = own = 0
    for k in range(options.triples):
        with tempfile.TemporaryDirectory() as folder:
            try:
                found = triple(options.only, options.seed * 1000 + k, folder)
            except ValueError as error:
                print(f"refused: {str(error)[:100]}", flush=True)
                continue
        shared += bool(found.effects)
        own += any(one.is_of_instrument for one in found.effects)
        best = max((one.score for one in found.candidates), default=0.0)
        said = [f"{e.id} {e.score:.1f} (agree: p {e.p_agree:.1g})" for e in found.effects]
        print(f"{'; '.join(said) or 'nothing shared'} | next {best:.1f}", flush=True)
    print(f"{options.triples} triples: {shared} share an effect, {own} called the instrument's")


if __name__ == "__main__":
    main()
