"""``python benches/review_walk DELIVERABLE [--sessions N] [--first SEED] [--only WORDS]``: ask it anew."""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from review_walk import causes, hands, programs


def main() -> None:
    """Print the table of one deliverable."""
    parser = argparse.ArgumentParser()
    parser.add_argument("deliverable")
    parser.add_argument("--sessions", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", default="", help="settings whose name holds this")
    given = parser.parse_args()
    rooms = ((causes.SETTINGS, causes.run), (programs.GROUPS, programs.run), (hands.GROUPS, hands.run))
    run = next(run for known, run in rooms if given.deliverable in known)
    run(given.deliverable, given.sessions, given.first, given.only)


if __name__ == "__main__":
    main()
