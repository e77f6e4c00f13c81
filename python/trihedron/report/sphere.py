"""Values by direction on a rotatable sphere about the body."""

from __future__ import annotations

import json
from html import escape

import numpy as np

from trihedron.report.chart import Sphere


def drawn_sphere(sphere: Sphere, caption: str) -> str:
    """A canvas that the page's script draws and rotates, by dragging or by the arrow keys."""
    share = np.clip(sphere.values / (sphere.limit or 1.0), -1.0, 1.0)
    points = [
        [*(round(float(c), 3) for c in direction), round(float(s), 3), told]
        for direction, s, told in zip(sphere.directions, share, sphere.said, strict=True)
        if np.isfinite(s)
    ]
    about = f"{sphere.title}: {caption} Arrow keys turn it."
    data = escape(json.dumps(points, ensure_ascii=False, separators=(",", ":")))
    return (
        f'<div class="sphere"><div class="ptitle">{escape(sphere.title)}</div>'
        f'<canvas role="img" tabindex="0" aria-label="{escape(about)}" data-points="{data}"></canvas></div>'
    )
