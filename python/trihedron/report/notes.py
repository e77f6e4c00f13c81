"""Placement of labels in a panel, so that they overlap neither each other nor marks."""

from __future__ import annotations

from collections.abc import Iterable, Sequence
from dataclasses import replace
from typing import Literal

from trihedron.report.chart import Note
from trihedron.report.places import UNITS, Places

Side = Literal["above", "below", "right", "left"]
SIDES: tuple[Side, ...] = ("above", "below", "right", "left")
WIDTH_PX = 250.0
"""Width of the narrowest panel: labels that are apart there are apart in every panel."""
LETTER_PX, GLYPH_PX, GAP_PX, RISE_PX, MARK_PX = 6.2, 10.0, 6.0, 12.0, 8.0

Box = tuple[float, float, float, float]
"""Left, top, right, bottom in pixels."""


def apart(notes: Sequence[Note], at: Places, height_px: float) -> list[Note]:
    """Every note on the side with the least overlap; its preferred side comes first among equals."""
    spots = [(float(at.x(n.x)) * WIDTH_PX / UNITS, float(at.y(n.y)) * height_px / UNITS) for n in notes]
    marks = [_about(x, y, MARK_PX, MARK_PX) for x, y in spots]
    taken: list[Box] = []
    out = []
    for k, (note, spot) in enumerate(zip(notes, spots, strict=True)):
        others = [*taken, *marks[:k], *marks[k + 1 :]]
        sides: tuple[Side, ...] = (note.side, *(side for side in SIDES if side != note.side))
        boxes = {side: _box(note.text, side, *spot) for side in sides}
        best = min(sides, key=lambda side: _covered(boxes[side], others) + _outside(boxes[side], height_px))
        taken.append(boxes[best])
        out.append(replace(note, side=best))
    return out


def _box(text: str, side: Side, x: float, y: float) -> Box:
    width = LETTER_PX * len(text)
    if side in ("above", "below"):
        return _about(x, y + (-RISE_PX if side == "above" else RISE_PX), width, GLYPH_PX)
    return _about(x + (1.0 if side == "right" else -1.0) * (0.5 * width + GAP_PX), y, width, GLYPH_PX)


def _about(x: float, y: float, width: float, height: float) -> Box:
    return x - 0.5 * width, y - 0.5 * height, x + 0.5 * width, y + 0.5 * height


def _covered(box: Box, others: Iterable[Box]) -> float:
    """Area [px²] of a label that overlaps other boxes."""
    return sum(
        max(min(box[2], o[2]) - max(box[0], o[0]), 0.0) * max(min(box[3], o[3]) - max(box[1], o[1]), 0.0)
        for o in others
    )


def _outside(box: Box, height_px: float) -> float:
    """Area [px²] of a label outside the panel."""
    whole = (box[2] - box[0]) * (box[3] - box[1])
    return whole - _covered(box, [(0.0, 0.0, WIDTH_PX, height_px)])
