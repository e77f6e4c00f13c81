"""``python benches/review_walk DELIVERABLE [--sessions N] [--first SEED] [--only WORDS]``: ask it anew."""

import argparse
import sys
from pathlib import Path

sys.path.insert(0, str(Path(__file__).parents[1]))

from review_walk import causes, hands


def main() -> None:
    """Print the table of one deliverable."""
    parser = argparse.ArgumentParser()
    parser.add_argument("deliverable")
    parser.add_argument("--sessions", type=int, default=10)
    parser.add_argument("--first", type=int, default=0)
    parser.add_argument("--only", default="", help="settings whose name holds this")
    given = parser.parse_args()
    run = causes.run if given.deliverable in causes.SETTINGS else hands.run
    run(given.deliverable, given.sessions, given.first, given.only)


if __name__ == "__main__":
    main()
