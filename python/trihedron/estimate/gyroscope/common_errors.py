"""Errors that all moves share, and what is known of the bias beside them, in the covariance of an alignment."""

from __future__ import annotations

from dataclasses import replace

from trihedron.arrays import FloatArray
from trihedron.estimate.gyroscope.alignment import AccelerometerPart, Aligned, from_fit
from trihedron.estimate.gyroscope.measurements import MoveMeasurements


def widened(
    aligned: Aligned, measured: MoveMeasurements, accelerometer: AccelerometerPart, errors: FloatArray
) -> Aligned:
    """With errors (m, p) of the fit's parameters, independent and of one standard deviation each."""
    if measured.still_response is not None:
        errors = errors @ measured.still_response.T
    own = errors.T @ errors
    follows = from_fit(len(own), measured, accelerometer)
    return replace(
        aligned,
        covariance=aligned.covariance + follows @ own @ follows.T,
        parameters_covariance=aligned.parameters_covariance + own,
    )
