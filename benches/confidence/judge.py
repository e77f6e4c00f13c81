"""``python benches/confidence --judge FILE``: coverage of every setting in a file of rows, beside what chance allows.

The elements of one session share its readings, so that a share's standard error is taken from session to session, not
from the number of elements. A setting is outside where its share is out of 93 to 97 % by more than two of those.
"""

import json

import numpy as np

FROM_PERCENT, TO_PERCENT = 93.0, 97.0
NORMAL_95 = 1.96
SURE = 2.0  # standard errors of a share by which it must miss the range to count as outside
SENSORS = {"a": ("S_f", "b_f"), "w": ("S_w", "b_w")}


def shares(row):
    """Scores of S and b of both sensors of one session's row."""
    return {"S_f": row["a"][:-3], "b_f": row["a"][-3:], "S_w": row["S"], "b_w": row["b"]}


def of_setting(rows):
    """Counts, and for each quantity its share within 1.96 [%], the standard error of that, rms z and the worst z."""
    trusted = [row for row in rows if row["answer"] == "trusted"]
    quantities = {}
    for key in ("S_f", "b_f", "S_w", "b_w") if trusted else ():
        z = np.array([shares(row)[key] for row in trusted])
        each = 100.0 * np.mean(np.abs(z) < NORMAL_95, axis=1)
        error = max(each.std() / np.sqrt(len(each)), 100.0 * np.sqrt(0.05 * 0.95 / z.size))
        quantities[key] = (each.mean(), error, np.sqrt(np.mean(z**2)), np.abs(z).max())
    counts = {kind: sum(row["answer"] == kind for row in rows) for kind in ("trusted", "marked", "none")}
    return counts, quantities


def judge(file):
    """Print a table (Markdown), what lies outside, and what is beyond four standard errors."""
    settings = {}
    for text in file.read_text().splitlines():
        row = json.loads(text)
        settings.setdefault(row["setting"], {})[row["seed"]] = row
    print("| setting | trusted, marked, none | S_f | b_f | S_ω | b_ω | worst | outside |")
    print("|---|---|---|---|---|---|---|---|")
    for name, by_seed in settings.items():
        counts, quantities = of_setting(list(by_seed.values()))
        cells = [f"{share:.1f} %, {rms:.2f}" for share, _, rms, _ in quantities.values()] or ["–"] * 4
        worst = f"{max(q[3] for q in quantities.values()):.1f} σ" if quantities else "–"
        low = [k for k, (s, e, _, _) in quantities.items() if s < FROM_PERCENT - SURE * e]
        high = [k for k, (s, e, _, _) in quantities.items() if s > TO_PERCENT + SURE * e]
        said = " ".join([*(f"{k} too small" for k in low), *(f"{k} too wide" for k in high)])
        print(f"| {name} | {', '.join(str(n) for n in counts.values())} | {' | '.join(cells)} | {worst} | {said} |")
