"""Pictures of a simulation beside its recording: stages, spectra, Allan curves."""

from types import SimpleNamespace

import numpy as np
import pytest

from trihedron.records.diagnosis import NoiseDifference, Stage, StageDomain
from trihedron.report.chart import Line, Points
from trihedron.report.diagnosis_against_charts import (
    allan_chart,
    allan_of,
    noise_pictures,
    spectra_chart,
    stages_chart,
    stages_pictures,
)
from trihedron.report.diagnosis_numbers import stages_blocks

EDGES = np.array([[2.0**k, 2.0 ** (k + 1)] for k in range(-3, 8)])


def test_the_allan_deviation_of_white_octaves_is_that_of_white_noise():
    tau = np.geomspace(0.05, 0.5, 7)
    # Octaves from 0.125 to 256 Hz: what lies beyond is below 4 % of the variance there.
    assert allan_of(EDGES, np.full(len(EDGES), 3e-3), tau) == pytest.approx(3e-3 / np.sqrt(tau), rel=0.03)


def octave(sensor, axis, low, model, recording):
    unit, band = "rad/s/sqrt(Hz)", (low, 2 * low)
    return NoiseDifference(
        sensor, axis, "octave", model, recording, model / recording, None, unit, 0.5, False, "", band
    )


def test_both_sides_stand_in_one_panel_per_axis_and_what_is_not_known_is_not_drawn():
    rows = [octave("gyroscope", axis, low, 1e-4, 2e-4) for axis in "xz" for low in (0.5, 1.0, 2.0)]
    rows += [octave("accelerometer", "x", 1.0, 1e-3, 1e-3)]
    found = SimpleNamespace(noise_compared=rows)
    chart = spectra_chart(found)
    assert [panel.title for panel in chart.panels] == ["gyro x", "gyro z"]
    recording, model = (mark for mark in chart.panels[0].marks if isinstance(mark, Line))
    assert model.is_dashed
    # In °/s/√Hz.
    assert np.nanmax(model.y) == pytest.approx(np.degrees(1e-4))
    assert np.nanmin(recording.y) == pytest.approx(np.degrees(2e-4))
    assert [panel.title for panel in allan_chart(found).panels] == ["gyro x", "gyro z"]
    assert [picture.name for picture in noise_pictures(found)] == ["spectra-both", "allan-both"]
    assert noise_pictures(SimpleNamespace(noise_compared=rows[-1:])) == ()


def test_an_allan_curve_is_made_of_octaves_that_adjoin():
    """A band between that one side lacks would be drawn as a dip."""
    low = (0.5, 1.0, 2.0, 16.0, 32.0)
    found = SimpleNamespace(noise_compared=[octave("gyroscope", "x", one, 1e-4, 2e-4) for one in low])
    recording = allan_chart(found).panels[0].marks[0]
    # From half a period of 4 Hz on.
    assert recording.x.min() == pytest.approx(0.5 / 4.0)
    alone = SimpleNamespace(noise_compared=[octave("gyroscope", "x", one, 1e-4, 2e-4) for one in (0.5, 32.0)])
    assert [picture.name for picture in noise_pictures(alone)] == ["spectra-both"]


def test_every_domain_is_a_slope_from_its_own_first_stage():
    stages = [
        Stage(name, (StageDomain("moves", size, None, "deg"), StageDomain("noise", 3.0, None, "dB")))
        for name, size in (("as-given", 1.0), ("numbers", 0.1), ("noise", 0.1), ("effects", 0.05))
    ]
    chart = stages_chart(SimpleNamespace(stages=stages))
    (panel,) = chart.panels
    slopes = [mark for mark in panel.marks if isinstance(mark, Points)]
    assert [slope.name for slope in slopes] == ["tilt error after rotations", "noise, octave by octave"]
    assert [list(slope.y) for slope in slopes] == [pytest.approx([100.0, 10.0, 10.0, 5.0]), pytest.approx([100.0] * 4)]
    assert "0.05 ° rms" in slopes[0].said[-1] or "0.0500 ° rms" in slopes[0].said[-1]
    assert chart.panels[0].x.names == ("as given", "parameters", "noise", "effects")
    assert len(stages_pictures(SimpleNamespace(stages=stages))) == 1
    assert stages_pictures(SimpleNamespace(stages=())) == ()


def test_a_domain_that_no_stage_changes_has_no_row():
    def stage(name, moves):
        domains = (StageDomain("moves", moves, None, "deg"), StageDomain("noise", 0.574, None, "dB"))
        return Stage(name, domains)

    found = SimpleNamespace(stages=(stage("as-given", 1.5), stage("numbers", 0.03)))
    (table,) = stages_blocks(found, {"moves": "tilt", "noise": "noise"})
    assert [row[0] for row in table.rows] == ["tilt [°]"]
    assert table.caption.endswith("noise: the same in every stage")
