"""Errors that all moves share, and what is known of the bias beside them, in the covariance of an alignment."""

from __future__ import annotations

from dataclasses import replace

import numpy as np

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


def within_step(aligned: Aligned, measured: MoveMeasurements, quantum: FloatArray) -> Aligned:
    """With the bias of undithered axes somewhere in the step ``quantum`` (3,) of its reading, about the middle of it.

    Where that is less certain than what moves tell, the estimate may lie anywhere in the step: its own distance from
    the middle adds to ``q²/12``.
    """
    axes = measured.is_undithered
    to_raw = np.linalg.inv(np.asarray(aligned.fit.gyroscope_scale))[axes]
    place = to_raw @ np.asarray(aligned.fit.rate_offset)
    of_place = np.diag(quantum[axes] ** 2 / 12.0 + np.clip(place, -0.5 * quantum[axes], 0.5 * quantum[axes]) ** 2)
    # place = S⁻¹ b + z̄
    of_all = np.zeros((len(to_raw), 24))
    of_all[:, 12:21] = np.kron(to_raw, measured.bias_mean)
    of_all[:, 21:] = to_raw
    of_fit = np.zeros((len(to_raw), len(aligned.parameters_covariance)))
    of_fit[:, -3:] = to_raw
    return replace(
        aligned,
        covariance=_told(aligned.covariance, of_all, of_place),
        parameters_covariance=_told(aligned.parameters_covariance, of_fit, of_place),
    )


def _told(covariance: FloatArray, of: FloatArray, told: FloatArray) -> FloatArray:
    """A covariance once ``of`` (m, n) the parameters is told with the covariance ``told`` (m, m)."""
    along = covariance @ of.T
    gain = np.linalg.solve(of @ along + told, along.T).T
    rest = np.eye(len(covariance)) - gain @ of
    out: FloatArray = rest @ covariance @ rest.T + gain @ told @ gain.T
    return out
