"""Panels without axes: directions on a disc."""

import math
from html import escape

from trihedron.report.chart import Disc

_RADIUS = 100.0


def drawn_disc(disc: Disc, caption: str) -> str:
    """Rim, circles of 30° and 60° above it, axes X and Y, poses taken and poses wanted."""
    circles = "".join(
        f'<circle class="rim" r="{_RADIUS * math.sqrt(1.0 - math.sin(math.radians(e))):.1f}"/>' for e in (0, 30, 60)
    )
    cross = f'<path class="rim" d="M-{_RADIUS} 0H{_RADIUS}M0-{_RADIUS}V{_RADIUS}"/>'
    names = "".join(
        f'<text x="{x}" y="{y}">{word}</text>'
        for word, x, y in (("+X", 118, 3), ("−X", -118, 3), ("+Y", 0, -111), ("−Y", 0, 119))
    )
    marks = []
    # Wanted poses are drawn on top.
    for x, y, label, said, kind in sorted(disc.points, key=lambda p: p[4]):
        px, py, tip = f"{_RADIUS * x:.1f}", f"{-_RADIUS * y:.1f}", f'data-t="{escape(said)}"'
        if kind == "taken":
            shape, drop = f'<circle class="pose" {tip} cx="{px}" cy="{py}" r="7.5"/>', 3.0
        else:
            shape, drop = f'<path class="pose" {tip} d="M{px} {py}m0-10l9 16h-18z"/>', 4.0
        name = f'<text class="{kind}" x="{px}" y="{drop - _RADIUS * y:.1f}">{escape(label)}</text>' if label else ""
        marks.append(shape + name)
    about = f"{disc.title}: {caption}"
    return (
        f'<div class="disc"><div class="ptitle">{escape(disc.title)}</div>'
        f'<svg role="img" aria-label="{escape(about)}" viewBox="-128 -122 256 244">{circles}{cross}{names}'
        f"{''.join(marks)}</svg></div>"
    )


def equal_area(up: tuple[float, float, float]) -> tuple[float, float]:
    """Lambert's azimuthal projection of a unit vector about the nearest pole; the equator has radius one."""
    factor = 1.0 / math.sqrt(1.0 + abs(up[2]))
    return up[0] * factor, up[1] * factor
