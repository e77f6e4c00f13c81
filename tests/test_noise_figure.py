"""The picture of an Allan curve: what the sum holds is drawn and named, and what is named lies in the picture."""

import numpy as np
import pytest

from noise_series import series
from trihedron.estimate.noise.identify import identify_noise
from trihedron.report.chart import Line, Note
from trihedron.report.noise_charts import allan_chart


@pytest.fixture(scope="module")
def noise():
    rng = np.random.default_rng(5)
    n, rate_hz = 1 << 17, 100.0
    t = np.arange(n) / rate_hz
    hum = 5e-3 * np.sin(2.0 * np.pi * 12.3 * t)
    readings = [
        series(rng, n, rate_hz, N=1e-2, B=2e-3, K=1e-5) + hum,
        series(rng, n, rate_hz, N=1e-2, B=1e-3),
        series(rng, n, rate_hz, Q=1e-4, N=1e-3, R=1e-5),
    ]
    return identify_noise(np.column_stack(readings), rate_hz)


def test_the_sum_is_made_of_lines_that_are_drawn_and_each_has_a_name(noise):
    unnamed = 0
    for axis, panel in zip(noise.axes, allan_chart(noise.curve, "rad/s", noise.axes).panels, strict=True):
        parts = [mark for mark in panel.marks if isinstance(mark, Line) and mark.name == "parts of the sum"]
        total = next(mark for mark in panel.marks if isinstance(mark, Line) and mark.name == "their sum")
        # What is excluded moves the sum by less than its line is wide.
        np.testing.assert_allclose(np.sqrt(sum(part.y**2 for part in parts)), total.y, rtol=2e-3)
        names = [mark.text for mark in panel.marks if isinstance(mark, Note) and mark.colour == "ink"]
        assert len(names) == len(parts)
        assert {name[0] for name in names} >= {term.value for term in axis.terms if axis.terms[term].is_present}
        unnamed += sum("<" in name for name in names)
    assert unnamed > 0
