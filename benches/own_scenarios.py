"""Logs held against the very scenario that they were simulated with: how many are `consistent`?

    python benches/own_scenarios.py --units 30

Units of a consumer part within its tolerances, 12 to 28 poses by hand; each log is drawn with a seed that the judging
simulations do not use. What is not consistent is a false alarm.
"""

from __future__ import annotations

import argparse
import tempfile
from collections import Counter
from pathlib import Path

import trihedron
from trihedron.simulate import read_scenario, simulate

ALIKE = """profile = "{profile}"
unit = {unit}
session = {{ kind = "hand", n_poses = {poses}, hold_s = {hold} }}
"""


def main() -> None:
    parser = argparse.ArgumentParser(description=__doc__, formatter_class=argparse.RawDescriptionHelpFormatter)
    parser.add_argument("--units", type=int, default=30)
    parser.add_argument("--first", type=int, default=1)
    parser.add_argument("--profile", default="mpu")
    asked = parser.parse_args()
    verdicts: Counter[str] = Counter()
    with tempfile.TemporaryDirectory() as folder:
        for unit in range(asked.first, asked.first + asked.units):
            path = Path(folder) / f"unit{unit}.toml"
            hold = (2.5, 4.0, 6.0)[unit // 3 % 3]
            path.write_text(ALIKE.format(profile=asked.profile, unit=unit, poses=12 + 8 * (unit % 3), hold=hold))
            recording, _ = simulate(read_scenario(path), 1000 + unit)
            found = trihedron.diagnose(recording, against=path)
            verdicts[found.verdict] += 1
            if found.verdict != "consistent":
                print(unit, found.verdict, [e.id for e in found.effects])
    print(dict(verdicts))


if __name__ == "__main__":
    main()
