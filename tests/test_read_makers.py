"""Logs laid out as each maker's program writes them come out with their numbers, units, rate and all their rows."""

import pytest

from formats.table import LAYOUTS, read_layout, verdict
from trihedron.records import Severity


@pytest.mark.parametrize("name", LAYOUTS)
def test_a_log_of_this_maker_is_read_as_it_was_written(tmp_path, name):
    made = LAYOUTS[name]()
    recording = read_layout(made, tmp_path)
    assert verdict(made, recording) == "as written"
    assert not [f for f in recording.findings if f.severity is Severity.SERIOUS]
