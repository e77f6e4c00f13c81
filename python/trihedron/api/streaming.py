"""Logs larger than memory: poses, calibration and corrected readings, a piece of the log at a time.

Memory holds only the statistics of blocks of a tenth of a second (:func:`segment_file`), the rows of moves and of the
ends of poses (:func:`calibrate_file`), or one piece (:func:`apply_file`). See docs/larger-than-memory.md.
"""

from __future__ import annotations

import io
import os
from dataclasses import replace
from pathlib import Path
from typing import Any, cast

import numpy as np

from trihedron.api.applying import AnyCalibration, calibration_of, check_units
from trihedron.api.calibrating import calibrate
from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.files.output import Temporary
from trihedron.ranges import merged
from trihedron.read.on_disk import LogOnDisk, Triad
from trihedron.records import Move, Pose, Progress, Recording, Segments
from trihedron.records.results import CalibrationResult
from trihedron.segment import BlockSums, segment_blocks
from trihedron.sensor_model import correct

PIECE_ROWS = 1 << 18
KEPT_S = 60.0
"""A pose longer than twice this keeps only a minute of samples at either end, next to the moves; its mean and the
standard error of the mean remain those of the whole pose."""


def segment_file(log: LogOnDisk, *, progress: Progress | None = None) -> Segments:
    """Poses and moves of a log on disk: equal to those of :func:`trihedron.segment` on the whole log."""
    notify = progress or (lambda _fraction, _text: None)
    # The segmentation only reads rows, which these types support.
    view = cast("Recording", log)
    sums = BlockSums(view)
    width = sums.length * max(1, PIECE_ROWS // sums.length)
    done = 0
    for part in log.log.chunks(width):
        triads = [part[:, t.first : t.first + 3] for t in (log.accelerometer, log.gyroscope) if t is not None]
        sums.add([np.ascontiguousarray(t, dtype=np.float64) for t in triads])
        done += len(part)
        notify(0.8 * done / log.n_samples, f"{done} of {log.n_samples} rows")
    return segment_blocks(view, sums.channels(), progress=lambda f, text: notify(0.8 + 0.2 * f, text))


def calibrate_file(log: LogOnDisk, *, progress: Progress | None = None, **options: Any) -> CalibrationResult:
    """Calibrate a log on disk from the statistics of its poses and the rows of its moves; options as for ``calibrate``.

    The result is that of :func:`trihedron.calibrate` on the whole log, if no pose is longer than two minutes.
    """
    notify = progress or (lambda _fraction, _text: None)
    segments = segment_file(log, progress=lambda f, text: notify(0.7 * f, text))
    recording, shown = condensed(log, segments)
    notify(0.8, f"fitting {recording.n_samples} of {log.n_samples} rows")
    return calibrate(recording, segments=shown, **options)


def condensed(log: LogOnDisk, segments: Segments) -> tuple[Recording, Segments]:
    """The rows of moves and of the ends of poses, at their own times, and the segments with indices of these rows.

    Means, standard errors and durations remain those of whole poses.
    """
    kept = max(round(KEPT_S * log.rate_hz), 1)
    ranges: list[tuple[int, int]] = []
    for pose in segments.poses:
        if pose.stop - pose.start <= 2 * kept:
            ranges.append((pose.outer_start, pose.outer_stop))
        else:
            ranges += [(pose.outer_start, pose.start + kept), (pose.stop - kept, pose.outer_stop)]
    ranges += [(move.start, move.stop) for move in segments.moves]
    joined = merged(ranges or [(0, log.n_samples)])
    starts = np.array([a for a, _ in joined])
    offsets = np.concatenate([[0], np.cumsum([b - a for a, b in joined])])

    def place(row: int) -> int:
        k = int(np.searchsorted(starts, row, side="right")) - 1
        return int(offsets[k] + min(row - joined[k][0], joined[k][1] - joined[k][0]))

    def stack(triad: Triad | None) -> FloatArray | None:
        return None if triad is None else np.concatenate([triad[a:b] for a, b in joined])

    recording = Recording(
        np.concatenate([log.time_s[a:b] for a, b in joined]),
        stack(log.accelerometer),
        stack(log.gyroscope),
        log.rate_hz,
        log.accelerometer_unit,
        log.gyroscope_unit,
        source=log.source,
    )
    poses = tuple(_moved_pose(pose, place, kept) for pose in segments.poses)
    moves = tuple(Move(m.index, m.pose_before, m.pose_after, place(m.start), place(m.stop)) for m in segments.moves)
    as_read = None if segments.as_read is None else replace(segments.as_read, poses=poses, moves=moves)
    return recording, replace(segments, poses=poses, moves=moves, as_read=as_read)


def _moved_pose(pose: Pose, place: Any, kept: int) -> Pose:
    disturbed = tuple(
        (place(a), place(b))
        for a, b in pose.disturbed
        if pose.stop - pose.start <= 2 * kept or b <= pose.start + kept or a >= pose.stop - kept
    )
    stop = place(pose.stop - 1) + 1
    return Pose(
        pose.index,
        place(pose.start),
        stop,
        place(pose.outer_start),
        max(place(pose.outer_stop - 1) + 1, stop),
        disturbed,
        pose.is_unsteady,
    )


def apply_file(
    calibration: AnyCalibration,
    log: LogOnDisk,
    output: str | os.PathLike[str],
    *,
    overwrite: bool = False,
    progress: Progress | None = None,
) -> int:
    """Correct a log on disk piece by piece into a .npy file (n, 4 or 7): time [s], specific force, angular rate.
    Returns the number of rows.

    Raises ``InputError`` when the calibration depends on temperature or has effects, which are not supported here;
    when units differ; when the output exists.
    """
    target = Path(output)
    known = calibration_of(calibration)
    if target.suffix.lower() != ".npy":
        raise InputError(f"{target}: a log that is corrected in pieces is written as .npy; give this ending.")
    if target.exists() and not overwrite:
        raise InputError(f"{target}: this exists and was left alone; choose another name or add --force.")
    if known.extensions.get("effects") or known.extensions.get("thermal"):
        raise InputError("this calibration follows temperature or compensates effects: apply it to the log as a whole.")
    check_units(known, cast("Recording", log))
    sensors = [(log.accelerometer, known.accelerometer), (log.gyroscope, known.gyroscope)]
    used = [(triad, sensor) for triad, sensor in sensors if triad is not None and sensor is not None]
    if not used:
        raise InputError(f"{log.source}: the calibration contains none of its sensors.")
    shape = (log.n_samples, 1 + 3 * len(used))
    header = io.BytesIO()
    np.lib.format.write_array_header_1_0(header, {"descr": "<f8", "fortran_order": False, "shape": shape})
    with Temporary(Path(os.path.realpath(target))) as temporary:
        temporary.write(header.getvalue())
        for start in range(0, log.n_samples, PIECE_ROWS):
            rows = slice(start, min(start + PIECE_ROWS, log.n_samples))
            columns = [log.time_s[rows][:, None], *(correct(t[rows], s.S, s.b) for t, s in used)]
            temporary.write(np.hstack(columns).astype("<f8").tobytes())
            if progress is not None:
                progress(rows.stop / log.n_samples, f"{rows.stop} of {log.n_samples} rows")
        temporary.put_in_place(None, overwrite=overwrite)
    return log.n_samples
