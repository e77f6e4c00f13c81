"""Noise of a static log: identified from a recording, or from a file read in pieces."""

from __future__ import annotations

import os
from collections.abc import Iterator, Sequence
from dataclasses import replace
from pathlib import Path

import numpy as np
import numpy.typing as npt

from trihedron.api.applying import AnyCalibration, calibration_of, check_units, doubted
from trihedron.api.reading import AnyRecording, recording_of
from trihedron.errors import InputError
from trihedron.estimate.noise.grid import readings_of, scale_of, temperature_of
from trihedron.estimate.noise.identify import identify_noise
from trihedron.estimate.noise.planning import recording_length_s
from trihedron.estimate.noise.streamed import stream_noise
from trihedron.read.on_disk import open_chunks
from trihedron.records import Calibration, Finding, Noise, Recording, TermName
from trihedron.sensor_model import axis_scales
from trihedron.units import AccelerationUnit, RateUnit

IN_MEMORY_BYTES = 1 << 29
"""Largest log that is read whole into memory: disturbances can then be found and excluded."""


def allan(
    recording: AnyRecording,
    *,
    exclude_s: Sequence[tuple[float, float]] = (),
    automatic: bool = True,
    clusters: Sequence[int] | None = None,
    accelerometer_lsb: str | None = None,
    gyroscope_lsb: str | None = None,
    calibration: AnyCalibration | None = None,
) -> Noise:
    """Noise terms of every axis of a static recording, in SI units where they are known (docs/noise.md).

    Parameters
    ----------
    recording : Recording, or what trihedron.read takes
        A static log, an hour or more.
    exclude_s : sequence of (float, float)
        Intervals [s] to exclude.
    automatic : bool
        Whether disturbances are found and excluded.
    clusters : sequence of int, optional
        Readings per cluster of the Allan curve; evenly spaced in the logarithm when not given.
    accelerometer_lsb, gyroscope_lsb : str, optional
        The LSB of a log in counts: ``"0.05 deg/s"``.
    calibration : CalibrationResult, Calibration or path, optional
        A calibration of the unit: it gives the LSB of every axis.

    Returns
    -------
    Noise
        Q, N, B, K and R of every axis with 95 % intervals, and the best averaging time.

    Raises
    ------
    ValueError
        When the log is too short or has too many gaps; one sentence says why and what to do.

    Examples
    --------
    >>> noise = np.random.default_rng(1).normal(0.0, 0.01, (20000, 3))
    >>> static = trihedron.Recording(np.arange(20000) / 100.0, noise + [0.0, 0.0, 9.81], None, 100.0)
    >>> white = trihedron.allan(static).axis("accel x").terms["N"].value  # m/s²/√Hz
    """
    recording = recording_of(recording)
    doubts: tuple[Finding, ...] = ()
    if calibration is not None:
        if accelerometer_lsb is not None or gyroscope_lsb is not None:
            raise InputError("the size of a count is given twice: by a calibration and by itself; give one.")
        known = calibration_of(calibration)
        recording, doubts = _in_si(recording, known), doubted(known)
    readings, names, units = readings_of(recording, gyroscope_lsb, accelerometer_lsb)
    found = identify_noise(
        readings,
        recording.rate_hz,
        names=names,
        units=units,
        exclude_s=exclude_s,
        automatic=automatic,
        clusters=clusters,
        temperature_degc=temperature_of(recording),
        source=recording.source,
    )
    # Findings about the log come before those about its noise.
    return replace(found, findings=(*_beside_noise(recording.findings, found.findings), *doubts, *found.findings))


def _beside_noise(of_log: Sequence[Finding], of_noise: Sequence[Finding]) -> Iterator[Finding]:
    """Findings of a log that concern its noise: lost samples do not bias the terms, and the repetition of whole rows is
    stated once."""
    is_repeated = any(finding.code == "repeated-rows" for finding in of_noise)
    for one in of_log:
        if one.code == "time-gap":
            yield Finding.of(
                "time-gap",
                "static",
                count=int(one.numbers["count"]),
                lost_samples=int(one.numbers["lost_samples"]),
                fraction=one.numbers["fraction"],
                longest_s=one.numbers["longest_s"],
            )
        elif one.code != "repeated-rows" or not is_repeated:
            yield one


def _in_si(recording: Recording, known: Calibration) -> Recording:
    """Every axis divided by its sensitivity; axes are not rotated, so that every axis keeps the steps of its ADC."""
    check_units(known, recording)
    accelerometer, gyroscope = (
        readings if sensor is None or readings is None else readings * axis_scales(sensor.S)
        for readings, sensor in (
            (recording.accelerometer, known.accelerometer),
            (recording.gyroscope, known.gyroscope),
        )
    )
    return replace(
        recording,
        accelerometer=accelerometer,
        gyroscope=gyroscope,
        accelerometer_unit=AccelerationUnit.M_S2,
        gyroscope_unit=recording.gyroscope_unit if known.gyroscope is None else RateUnit.RAD_S,
    )


def noise_of_file(
    path: str | os.PathLike[str],
    *,
    columns: str,
    rate_hz: float,
    accelerometer_unit: str | AccelerationUnit | None = None,
    gyroscope_unit: str | RateUnit | None = None,
    accelerometer_lsb: str | None = None,
    gyroscope_lsb: str | None = None,
    exclude_s: Sequence[tuple[float, float]] = (),
    automatic: bool = True,
) -> Noise:
    """Noise of a .npy, Parquet or text log of any size in bounded memory; its columns are as given, not detected.

    Up to half a gigabyte the log is read whole; beyond, in one pass (:func:`stream_noise`) that excludes no
    disturbance.

    Raises ``InputError`` when file, columns, excluded intervals or LSBs do not match.
    """
    log = open_chunks(Path(path), columns)
    stated = {"g": (gyroscope_unit, gyroscope_lsb), "a": (accelerometer_unit, accelerometer_lsb)}
    sensors = [scale_of(role[0], *stated[role[0]]) for role in log.roles]
    names = [f"{name} {role[1]}" for role, (name, _, _) in zip(log.roles, sensors, strict=True)]
    factor, units = [scale for _, scale, _ in sensors], [unit for _, _, unit in sensors]
    scales = np.array(factor)
    is_scaled = bool(np.any(scales != 1.0))

    def scaled(part: npt.NDArray[np.float64]) -> npt.NDArray[np.float64]:
        return part * scales if is_scaled else part

    if 8 * log.n_rows * len(log.roles) <= IN_MEMORY_BYTES:
        return identify_noise(
            scaled(log.rows(0, log.n_rows)),
            rate_hz,
            names=names,
            units=units,
            exclude_s=exclude_s,
            automatic=automatic,
            source=str(path),
        )
    if exclude_s:
        raise InputError(f"{path}: nothing can be excluded from a log that is read in one pass; cut the file instead.")
    parts = (scaled(part) for part in log.chunks())
    return stream_noise(parts, rate_hz, n_samples=log.n_rows, names=names, units=units, source=str(path))


def recording_lengths(noise: Noise, relative: float) -> dict[str, dict[TermName, float | None]]:
    """Recording time [s] for a relative uncertainty ``relative`` of each term present, by axis; None beyond a month.

    Raises ``InputError`` when ``relative`` is no positive fraction.
    """
    return {
        axis.name: {term: recording_length_s(axis, term, relative) for term in TermName if axis.terms[term].is_present}
        for axis in noise.axes
    }
