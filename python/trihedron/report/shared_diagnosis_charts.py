"""What a page draws of several recordings diagnosed together: the size of a shared effect in each of them."""

from __future__ import annotations

from collections.abc import Sequence

import numpy as np

from trihedron.records.shared_effects import SharedEffect
from trihedron.report.chart import Chart, Level, Panel, Points, Scale
from trihedron.report.diagnosis_words import printed_unit
from trihedron.report.numbers import engineering_exponent, power_of_ten, with_sigma

TWO_SIGMA = 2.0
ROW_PX = 26
COLUMNS = 3


def shared_chart(effect: SharedEffect, names: Sequence[str]) -> Chart:
    """A panel a parameter: its value in all recordings together, then in each, with 95 % intervals."""
    panels = []
    rows = ("together", *names)
    place = -np.arange(1.0, len(rows) + 1.0)
    for i, common in enumerate(effect.parameters):
        found = [one[i] for one in (effect.parameters, *effect.each)]
        exponent = engineering_exponent(max(abs(one.value) for one in found))
        unit = " ".join(word for word in (power_of_ten(exponent), printed_unit(common.unit)) if word)
        value, sigma = 10.0**-exponent * np.array([(one.value, one.std) for one in found]).T
        told = [f"{row}: {with_sigma(v, s)} {unit}" for row, v, s in zip(rows, value, sigma, strict=True)]
        marks = (
            Level(x=0.0, name="no effect"),
            Points(value[1:], place[1:], told[1:], TWO_SIGMA * sigma[1:], "one recording", "c1", is_across=True),
            Points(value[:1], place[:1], told[:1], TWO_SIGMA * sigma[:1], "together", "accent", is_across=True),
        )
        x = Scale(f"{common.name} [{unit}]", unit, includes=(0.0,))
        panels.append(Panel(x, Scale("", names=rows), marks, title=common.name, height_px=ROW_PX * (len(rows) + 1)))
    return Chart(tuple(panels), columns=min(COLUMNS, len(panels)))
