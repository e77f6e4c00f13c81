"""Pictures of a simulation beside its recording: stages, spectra, Allan curves."""

from types import SimpleNamespace

import numpy as np
import pytest

from trihedron.records.diagnosis import NoiseDifference
from trihedron.report.diagnosis_charts import allan_chart, allan_of, noise_pictures

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


def test_an_allan_curve_is_made_of_octaves_that_adjoin():
    """A band between that one side lacks would be drawn as a dip."""
    low = (0.5, 1.0, 2.0, 16.0, 32.0)
    found = SimpleNamespace(noise_compared=[octave("gyroscope", "x", one, 1e-4, 2e-4) for one in low])
    recording = allan_chart(found).panels[0].marks[0]
    # From half a period of 4 Hz on.
    assert recording.x.min() == pytest.approx(0.5 / 4.0)
    alone = SimpleNamespace(noise_compared=[octave("gyroscope", "x", one, 1e-4, 2e-4) for one in (0.5, 32.0)])
    assert [picture.name for picture in noise_pictures(alone)] == ["spectra-both"]
