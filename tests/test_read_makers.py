"""Logs laid out as each maker's program writes them come out with their numbers, units, rate and all their rows."""

import sys
from pathlib import Path

import numpy as np
import pytest

from trihedron.read import read_recording
from trihedron.records import Severity

sys.path.insert(0, str(Path(__file__).parents[1] / "benches" / "formats"))
import more_layouts  # noqa: F401 -- its layouts join the others
from layouts import LAYOUTS

SENSORS = ("accelerometer", "gyroscope")


def read_layout(made, folder):
    paths = []
    for name, content in made.files.items():
        path = folder / name
        path.write_bytes(content)
        paths.append(path)
    if made.per_sensor:
        return read_recording(accelerometer_path=paths[0], gyroscope_path=paths[1], **made.options)
    return read_recording(paths[0], **made.options)


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_log_of_this_maker_is_read_as_it_was_written(tmp_path, name):
    made = LAYOUTS[name]()
    recording = read_layout(made, tmp_path)
    for sensor, wanted, unit in zip(SENSORS, (made.accelerometer, made.gyroscope), made.units, strict=True):
        found = getattr(recording, sensor)
        if wanted is not None:
            np.testing.assert_allclose(found, wanted, rtol=0, atol=1e-12)
            assert getattr(recording, f"{sensor}_unit").value == unit
    # Stamps are rounded to a millisecond or a hundredth in some layouts: a few parts in a thousand over 20 s.
    assert recording.rate_hz == pytest.approx(made.rate_hz, rel=2e-3)
    assert recording.rows_in_file == made.rows
    assert recording.rows_in_file == recording.rows_read + recording.rows_reported
    assert not [f for f in recording.findings if f.severity is Severity.SERIOUS]
