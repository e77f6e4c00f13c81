"""Pictures of a simulation beside its recording: stages, spectra, Allan curves."""

import numpy as np
import pytest

from trihedron.report.diagnosis_charts import allan_of

EDGES = np.array([[2.0**k, 2.0 ** (k + 1)] for k in range(-3, 8)])


def test_the_allan_deviation_of_white_octaves_is_that_of_white_noise():
    tau = np.geomspace(0.05, 0.5, 7)
    # Octaves from 0.125 to 256 Hz: what lies beyond is below 4 % of the variance there.
    assert allan_of(EDGES, np.full(len(EDGES), 3e-3), tau) == pytest.approx(3e-3 / np.sqrt(tau), rel=0.03)
