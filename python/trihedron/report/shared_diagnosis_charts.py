"""What a page draws of several recordings diagnosed together: a shared effect in each of them, or all scores."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from trihedron.records.shared_effects import SharedCandidate, SharedEffect
from trihedron.report.chart import Bars, Chart, Level, Panel, Points, Scale
from trihedron.report.diagnosis_words import printed_unit
from trihedron.report.numbers import engineering_exponent, plain_number, unit_with_power, with_sigma

TWO_SIGMA = 2.0
ROW_PX = 26
COLUMNS = 3
BAR = 0.7
"""Of a row."""
LONGEST = 16
"""Letters of a name that stands beside its row; recordings of longer ones are counted, as the title names them."""


def shared_chart(effect: SharedEffect, names: Sequence[str]) -> Chart:
    """A panel a parameter: its value in all recordings together, then in each, with 95 % intervals."""
    panels = []
    rows = ("together", *names)
    is_counted = max(map(len, names)) > LONGEST
    beside = ("together", *(f"recording {k}" for k in range(1, len(names) + 1))) if is_counted else rows
    place = -np.arange(1.0, len(rows) + 1.0)
    for i, common in enumerate(effect.parameters):
        found = [one[i] for one in (effect.parameters, *effect.each)]
        exponent = engineering_exponent(max(abs(one.value) for one in found))
        unit = unit_with_power(exponent, printed_unit(common.unit))
        value, sigma = 10.0**-exponent * np.array([(one.value, one.std) for one in found]).T
        told = [f"{row}: {with_sigma(v, s)} {unit}" for row, v, s in zip(rows, value, sigma, strict=True)]
        marks = (
            Level(x=0.0, name="no effect"),
            Points(value[1:], place[1:], told[1:], TWO_SIGMA * sigma[1:], "one recording", "c1", is_across=True),
            Points(value[:1], place[:1], told[:1], TWO_SIGMA * sigma[:1], "together", "accent", is_across=True),
        )
        x = Scale(f"{common.name} [{unit}]", unit, includes=(0.0,))
        panels.append(Panel(x, Scale("", names=beside), marks, title=common.name, height_px=ROW_PX * (len(rows) + 1)))
    return Chart(tuple(panels), columns=min(COLUMNS, len(panels)))


def candidates_chart(candidates: Sequence[SharedCandidate]) -> Chart:
    """A bar an effect: its score in all recordings together."""
    place = -np.arange(1.0, len(candidates) + 1.0)
    score = np.array([one.score for one in candidates])
    told = [f"{one.id}: score {plain_number(one.score)}" for one in candidates]
    bars = Bars(score, place, BAR, told, "tried in all recordings together", "soft", is_across=True)
    x = Scale("score", includes=(0.0,))
    names = tuple(one.id for one in candidates)
    panel = Panel(x, Scale("", names=names), (bars, Level(x=0.0)), height_px=ROW_PX * (len(names) + 1))
    return Chart((panel,))
