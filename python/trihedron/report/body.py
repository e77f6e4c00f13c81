"""The body in its poses: pictures for people who are about to record."""

from __future__ import annotations

from collections.abc import Sequence
from itertools import product

import numpy as np
from matplotlib.backends.backend_agg import FigureCanvasAgg
from matplotlib.figure import Figure
from mpl_toolkits.mplot3d import Axes3D
from mpl_toolkits.mplot3d.art3d import Poly3DCollection

from trihedron.arrays import FloatArray
from trihedron.report.figures import AXIS_COLOURS, DPI, INK

# Unequal edges, so that a reader sees which way the case is turned.
HALF_EDGES = np.array([0.75, 0.55, 0.3])


def draw_body_poses(up: Sequence[Sequence[float]], columns: int = 6) -> Figure:
    """A case in every pose: ``up`` holds the body direction that points up. Axes in the colours of all figures."""
    rows = -(-len(up) // columns)
    figure = Figure(figsize=(1.6 * columns, 1.75 * rows), dpi=DPI)
    FigureCanvasAgg(figure)
    for k, direction in enumerate(up):
        axis = figure.add_subplot(rows, columns, k + 1, projection="3d")
        assert isinstance(axis, Axes3D)
        _draw_case(axis, rotation_to_up(np.asarray(direction, dtype=np.float64)))
        axis.set_title(str(k + 1), fontsize=9, pad=-4, color=INK)
    figure.subplots_adjust(left=0.0, right=1.0, bottom=0.0, top=0.97, wspace=0.0, hspace=0.05)
    return figure


def rotation_to_up(direction: FloatArray) -> FloatArray:
    """The shortest rotation (3, 3) that turns a body direction to the vertical; half a turn about axis 1 for 'down'."""
    unit = direction / np.linalg.norm(direction)
    vertical = np.array([0.0, 0.0, 1.0])
    cosine = float(unit @ vertical)
    if cosine < -1.0 + 1e-12:
        return np.diag([1.0, -1.0, -1.0])
    v = np.cross(unit, vertical)
    skew = np.array([[0.0, -v[2], v[1]], [v[2], 0.0, -v[0]], [-v[1], v[0], 0.0]])
    rotation: FloatArray = np.eye(3) + skew + skew @ skew / (1.0 + cosine)
    return rotation


def _draw_case(axis: Axes3D, rotation: FloatArray) -> None:
    corners = np.array(list(product((-1.0, 1.0), repeat=3))) * HALF_EDGES @ rotation.T
    faces = [[0, 1, 3, 2], [4, 5, 7, 6], [0, 1, 5, 4], [2, 3, 7, 6], [0, 2, 6, 4], [1, 3, 7, 5]]
    case = Poly3DCollection(
        [corners[face] for face in faces], facecolor="#EEF2F5", edgecolor="#55606A", linewidth=0.8, alpha=0.9
    )
    axis.add_collection3d(case)
    for k in range(3):
        tip = rotation[:, k] * (HALF_EDGES[k] + 0.55)
        start = rotation[:, k] * HALF_EDGES[k]
        axis.plot(*zip(start, tip, strict=True), color=AXIS_COLOURS[k], linewidth=2.0)
        axis.text(*(1.22 * tip), str(k + 1), color=AXIS_COLOURS[k], fontsize=8, ha="center", va="center")
    axis.set_xlim(-0.95, 0.95)
    axis.set_ylim(-0.95, 0.95)
    axis.set_zlim(-0.95, 0.95)
    axis.set_box_aspect((1.0, 1.0, 1.0))
    axis.view_init(elev=20.0, azim=-55.0)
    axis.set_axis_off()
