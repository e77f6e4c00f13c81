"""Correlations as a triangle of cells."""

from __future__ import annotations

from html import escape

from trihedron.report.chart import Matrix

CELL = 10
NAMES = 62
"""Width for the names; a cell has a width of ten."""
SEEN = 0.05
"""Correlation below which a cell is empty."""


def drawn_matrix(matrix: Matrix, caption: str) -> str:
    """A cell per pair, with the same order of rows and columns; names beside the rows and at the end of columns."""
    n = len(matrix.names)
    cells, words = [], []
    for i, name in enumerate(matrix.names):
        words.append(f'<text class="row" x="-3" y="{CELL * i + 7.5}">{escape(name)}</text>')
        words.append(
            f'<text class="col" transform="translate({CELL * i + 3} {CELL * i - 2})rotate(-45)">{escape(name)}</text>'
        )
        for j in range(i):
            r = float(matrix.values[i, j])
            if abs(r) >= SEEN:
                side = "pos" if r > 0.0 else "neg"
                cells.append(
                    f'<path class="cell {side}" fill-opacity="{abs(r):.2f}" d="M{CELL * j} {CELL * i}h9v9h-9z"/>'
                )
    frame = "".join(f"M0 {CELL * i + 9.5}H{CELL * i + 9}" for i in range(n))
    box = f"{-NAMES} -34 {CELL * n + NAMES + 30} {CELL * n + 38}"
    return (
        f'<div class="matrix"><div class="ptitle">{escape(matrix.title)}</div>'
        f'<svg role="img" aria-label="{escape(f"{matrix.title}: {caption}")}" viewBox="{box}">'
        f'<path class="rim" d="{frame}"/>{"".join(cells)}{"".join(words)}</svg></div>'
    )
