"""Rows that overtook each other: put in order, nobody's array touched, and without room for a second log."""

import numpy as np

import trihedron

NAMES = ("time [s]", "ax", "ay", "az", "gx", "gy", "gz")


def overtaken(n, seed=0):
    """(n, 7) rows at 1 kHz of which some stand up to five places late, and the same in order."""
    rng = np.random.default_rng(seed)
    ordered = np.column_stack([np.arange(n) / 1000.0, rng.normal(9.8, 0.02, (n, 3)), rng.normal(0.0, 0.002, (n, 3))])
    late = np.arange(n) + np.where(rng.random(n) < 1e-2, 5.5, 0.0)
    return ordered[np.argsort(late, kind="stable")], ordered


def test_rows_are_put_in_order_and_arrays_of_the_caller_stay_as_they_were(tmp_path):
    given, ordered = overtaken(5000)
    path = tmp_path / "log.csv"
    np.savetxt(path, given, delimiter=",", header=",".join(NAMES), comments="", fmt="%.6f")
    recording = trihedron.read(path)
    assert "time-backward" in {finding.code.value for finding in recording.findings}
    np.testing.assert_allclose(recording.accelerometer, ordered[:, 1:4], atol=1e-6)
    np.testing.assert_allclose(recording.gyroscope, ordered[:, 4:], atol=1e-6)
    force, rate = np.ascontiguousarray(given[:, 1:4]), np.ascontiguousarray(given[:, 4:])
    before = force.copy(), rate.copy()
    recording = trihedron.read({"t": given[:, 0].copy(), "acc": force, "gyr": rate})
    np.testing.assert_array_equal(force, before[0])
    np.testing.assert_array_equal(rate, before[1])
    np.testing.assert_array_equal(recording.accelerometer, ordered[:, 1:4])
