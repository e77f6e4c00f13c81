"""Means of poses with a spectral line, by a joint fit of constant and line (docs/diagnosis-method.md, 8.0)."""

from dataclasses import replace

import numpy as np

from trihedron import _core
from trihedron.arrays import TINY, FloatArray
from trihedron.records.recording import Recording
from trihedron.records.segments import Segments

FEWEST_SAMPLES = 64
"""A spectrum of fewer samples has too few frequencies to separate a line from the noise around it."""


def means_beside_lines(recording: Recording, segments: Segments) -> tuple[Segments, FloatArray]:
    """Segments whose poses with a line have mean and standard error of a fit of constant + lines; swing of the lines.

    A sinusoid of amplitude A that is no whole number of cycles moves the mean of a pose of length T by up to A/(πfT),
    and block means scatter by it. Poses without a significant line stay as they are. Samples are taken as even.

    The swing (h, 2, 3), force and rate, is the variance of a line's integral at the edge of its pose, (raw unit · s)²:
    A²/2(2πf)². A move that begins or ends in it does not begin or end at rest.
    """
    changed: dict[str, FloatArray] = {}
    swing = np.zeros((segments.n_poses, 2, 3))
    both = (("accelerometer", recording.accelerometer), ("gyroscope", recording.gyroscope))
    for s, (sensor, readings) in enumerate(both):
        mean, error = getattr(segments, f"{sensor}_mean"), getattr(segments, f"{sensor}_sigma_mean")
        sigma = getattr(segments, f"{sensor}_sigma")
        if readings is None or mean is None or error is None or sigma is None or not len(mean):
            continue
        white = sigma / np.sqrt(np.maximum(segments.n_averaged, 1))[:, None]
        # Ratio of the errors of means to white noise: a line does not change the slow noise.
        colour = np.maximum(np.median(error / np.maximum(white, TINY), axis=0), 1.0)
        new_mean, new_error = mean.copy(), error.copy()
        for k, pose in enumerate(segments.poses):
            part = readings[pose.start : pose.stop]
            if pose.disturbed or len(part) < FEWEST_SAMPLES or not np.isfinite(part).all():
                continue
            found = _core.pose_beside_lines(part, sigma)
            if found is None:
                continue
            fitted, own, integral, has_line = (np.array(of_axes) for of_axes in found)
            swing[k, s] = np.where(has_line, integral / recording.rate_hz**2, 0.0)
            new_mean[k] = np.where(has_line, fitted, mean[k])
            new_error[k] = np.where(has_line, colour * own, error[k])
        if (new_mean != mean).any():
            changed |= {f"{sensor}_mean": new_mean, f"{sensor}_sigma_mean": new_error}
            if s == 0 and segments.accelerometer_sigma_up is not None:
                moved = (new_mean != mean).any(axis=1)
                changed["accelerometer_sigma_up"] = np.where(moved, np.nan, segments.accelerometer_sigma_up)
    return (replace(segments, **changed) if changed else segments), swing  # type: ignore[arg-type]
