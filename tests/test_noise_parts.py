"""The parts of an Allan curve's sum stand in the picture, each with a name that can be read."""

import itertools

import numpy as np

import trihedron
from trihedron.report.noise_charts import NAME_DECADES, parts_of


def test_no_name_of_a_part_stands_on_another():
    rng = np.random.default_rng(5)
    n = 60_000
    crowded = 0
    for walk in (0.003, 0.03):
        readings = rng.normal(size=(n, 3)) + np.cumsum(rng.normal(0.0, walk, (n, 3)), axis=0)
        found = trihedron.allan({"t": np.arange(n) / 100.0, "gyr": np.deg2rad(readings)}, gyroscope_lsb=None)
        for axis in found.axes:
            parts = parts_of(axis, np.geomspace(0.01, n / 300.0, 400))
            crowded += len(parts) > 1
            for a, b in itertools.combinations(parts, 2):
                apart = np.abs(np.log10([a.x / b.x, a.y / b.y])) / NAME_DECADES
                assert apart.max() > 1.0, (walk, axis.name, a.name, b.name)
    assert crowded >= 4
