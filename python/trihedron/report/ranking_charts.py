"""What a page draws of calibrations in order: the errors of each with their intervals."""

from __future__ import annotations

import numpy as np

from trihedron.arrays import BoolArray, FloatArray
from trihedron.records.ranking import Ranking
from trihedron.report.chart import Chart, Colour, Line, Mark, Panel, Points, Scale
from trihedron.report.numbers import plain_number
from trihedron.units import mm_s2_from_m_s2

ROW_PX = 34
INTERVAL = "95 % interval"


def ranking_chart(ranking: Ranking) -> Chart:
    """A row a calibration, the best first: gravity error in static poses, and tilt error after a rotation."""
    found = ranking.candidates
    gravity = [(one.verification.norm_rms, *one.norm_interval) for one in found]
    tilt = [(one.verification.angle_rms_deg, *one.angle_interval) for one in found]
    panels = [_panel(ranking, "gravity error", "mm/s²", mm_s2_from_m_s2(1.0) * np.array(gravity))]
    if np.isfinite(tilt).any():
        panels.append(_panel(ranking, "tilt error", "°", np.array(tilt)))
    return Chart(tuple(panels), columns=len(panels))


def _panel(ranking: Ranking, what: str, unit: str, errors: FloatArray) -> Panel:
    """``errors`` (n, 3): the rms of each calibration and both ends of its interval."""
    names = tuple(one.name for one in ranking.candidates)
    place = -np.arange(1.0, len(names) + 1.0)
    rejected = np.array([one.is_rejected for one in ranking.candidates])
    # An interval of a bootstrap is not symmetric: a stroke a row, lifted between rows.
    ends = np.column_stack([errors[:, 1:], np.full(len(names), np.nan)]).ravel()
    marks: list[Mark] = [Line(ends, np.repeat(place, 3), INTERVAL, "soft")]
    kinds: tuple[tuple[BoolArray, Colour, str], ...] = ((~rejected, "c1", "fits"), (rejected, "accent", "rejected"))
    for part, colour, judged in kinds:
        if part.any():
            told = [f"{names[i]}: {plain_number(errors[i, 0])} {unit}, {judged}" for i in np.flatnonzero(part)]
            marks.append(Points(errors[part, 0], place[part], told, None, judged, colour))
    x = Scale(f"{what} [{unit}], rms", unit, includes=(0.0,))
    return Panel(x, Scale("", names=names), tuple(marks), title=what, height_px=ROW_PX * (len(names) + 1))
