"""Static poses of a recording and the moves between them."""

from __future__ import annotations

from dataclasses import dataclass

import numpy as np
import numpy.typing as npt

from trihedron.arrays import FloatArray, IntArray
from trihedron.records.checked import Checked
from trihedron.records.finding import Finding
from trihedron.records.presented import Presented

LEAST_POSE_S = 1.0
"""A hand that hesitates stops for a few tenths of a second; an intended pose lasts a second or more."""
SAME_POSE_RAD, LEAST_SHARE = 0.12, 0.04
"""Angle below which static means have one orientation (7°): a bias that drifts by 0.1 g turns the force by less; and
the share of them below which an orientation is handling."""


@dataclass(frozen=True)
class Pose:
    """One pose.

    ``[start, stop)`` are the samples that may be averaged: edges are trimmed, so that they contain no motion.
    ``[outer_start, outer_stop)`` is the interval as detected, before trimming. ``disturbed`` are sub-ranges
    ``(start, stop)`` inside ``[start, stop)`` with a disturbance; means exclude them. ``is_unsteady``: the pose is
    nowhere as quiet as the sensor's own noise (held in the hand, or on a vibrating support).
    """

    index: int
    start: int
    stop: int
    outer_start: int
    outer_stop: int
    disturbed: tuple[tuple[int, int], ...] = ()
    is_unsteady: bool = False

    def __post_init__(self) -> None:
        if not 0 <= self.outer_start <= self.start < self.stop <= self.outer_stop:
            raise ValueError(
                f"pose {self.index} is not a range: {self.outer_start}..{self.start}..{self.stop}..{self.outer_stop}"
            )

    def samples(self) -> npt.NDArray[np.intp]:
        """Indices that may be averaged: the range without its disturbed parts."""
        keep = np.ones(self.stop - self.start, dtype=bool)
        for first, last in self.disturbed:
            keep[max(first - self.start, 0) : max(last - self.start, 0)] = False
        return np.flatnonzero(keep) + self.start

    def undisturbed(self) -> list[tuple[int, int]]:
        """The same as ranges ``(start, stop)``."""
        out, first = [], self.start
        for begin, end in (*sorted(self.disturbed), (self.stop, self.stop)):
            if min(begin, self.stop) > first:
                out.append((first, min(begin, self.stop)))
            first = max(first, end)
        return out


@dataclass(frozen=True)
class Move:
    """The samples between two neighbouring poses: from the trimmed end of one to the trimmed start of the next, or from
    and to the middle of a pose that moves throughout.

    Integration over ``[start, stop)`` therefore contains the whole motion whatever its duration; nothing is cut.
    """

    index: int
    pose_before: int
    pose_after: int
    start: int
    stop: int


@dataclass(frozen=True, eq=False, repr=False)
class Segments(Checked, Presented):
    """Poses and moves of one recording, and the sensor noise used to detect them. Arrays of a missing sensor are None.

    Attributes
    ----------
    poses, moves : tuple of Pose, tuple of Move
        Static intervals, and the motion between two of them, as ranges of samples.
    accelerometer_sigma, gyroscope_sigma : (3,)
        White noise of one sample, raw units, measured inside the poses.
    accelerometer_mean, gyroscope_mean : (n_poses, 3)
        Mean reading of each pose, raw units.
    accelerometer_sigma_mean, gyroscope_sigma_mean : (n_poses, 3)
        Standard error of each mean, without assuming whiteness: slow noise inside a pose raises it.
    n_averaged : (n_poses,) of int
        Number of samples of each mean.
    time_mid_s, duration_s : (n_poses,)
        Middle and duration of each pose [s].
    findings : tuple of Finding
        Findings about poses and moves.
    whole : Segments or None
        The poses before they were divided at disturbances, each with all of its samples; None where none was divided.
    accelerometer_up, accelerometer_sigma_up : (n_poses, 3), (n_poses,)
        Unit vectors in raw units along which |f| grows fastest, and the standard error of the mean along them, NaN
        where only those of the axes are known: a settling body rotates gravity, which leaves |f| unchanged. None where
        the vertical is unknown.
    as_read : Segments or None
        The same with means and errors as they were read, where those of the accelerometer are without what its settling
        after rotations adds; None where it does not settle.

    Examples
    --------
    >>> segments = trihedron.segment(recording)
    >>> len(segments.moves) == segments.n_poses - 1
    True
    """

    poses: tuple[Pose, ...]
    moves: tuple[Move, ...]
    accelerometer_sigma: FloatArray | None
    gyroscope_sigma: FloatArray | None
    accelerometer_mean: FloatArray | None
    gyroscope_mean: FloatArray | None
    accelerometer_sigma_mean: FloatArray | None
    gyroscope_sigma_mean: FloatArray | None
    n_averaged: npt.NDArray[np.int64]
    time_mid_s: FloatArray
    duration_s: FloatArray
    findings: tuple[Finding, ...] = ()
    whole: Segments | None = None
    accelerometer_up: FloatArray | None = None
    accelerometer_sigma_up: FloatArray | None = None
    as_read: Segments | None = None

    def __post_init__(self) -> None:
        super().__post_init__()
        n = len(self.poses)
        for name in ("accelerometer_mean", "gyroscope_mean", "accelerometer_sigma_mean", "gyroscope_sigma_mean",
                     "accelerometer_up"):  # fmt: skip
            value = getattr(self, name)
            if value is not None and value.shape != (n, 3):
                raise ValueError(f"{name} must have shape ({n}, 3), got {value.shape}")
        if self.accelerometer_sigma_up is not None and self.accelerometer_sigma_up.shape != (n,):
            raise ValueError(f"accelerometer_sigma_up must have shape ({n},), got {self.accelerometer_sigma_up.shape}")
        for move in self.moves:
            if not (0 <= move.pose_before < n and 0 <= move.pose_after < n and move.start <= move.stop):
                raise ValueError(f"move {move.index} does not join two poses")

    @property
    def n_poses(self) -> int:
        """Number of poses."""
        return len(self.poses)

    @property
    def spans(self) -> IntArray:
        """(n_poses, 2) samples of every pose, half-open."""
        return np.array([(pose.start, pose.stop) for pose in self.poses], dtype=np.int64).reshape(-1, 2)

    @property
    def norm_sigma(self) -> FloatArray | None:
        """(n_poses, 3) standard errors of the accelerometer's means for a fit of |f| alone.

        Equal on three axes where the error along the vertical is known: only that component enters |f|.
        """
        axes, up = self.accelerometer_sigma_mean, self.accelerometer_sigma_up
        if axes is None or up is None:
            return axes
        return np.where(np.isfinite(up)[:, None], up[:, None], axes)

    def pose_name(self, start: int, stop: int) -> str:
        """Name of the pose that contains samples [start, stop), numbered from 1."""
        around = [k for k, pose in enumerate(self.poses) if pose.start <= start and stop <= pose.stop]
        return f"pose {around[0] + 1}" if around else "a vibrating pose"

    def move_name(self, start: int, stop: int) -> str:
        """Name of the move that contains samples [start, stop), numbered from 1; a disturbance is named by its pose."""
        middle = (start + stop) // 2
        around = [k for k, move in enumerate(self.moves) if move.start <= middle < move.stop]
        return f"move {around[0] + 1}" if around else f"a disturbance in {self.pose_name(middle, middle)}"

    def __repr__(self) -> str:
        poses = f"{self.n_poses} pose{'' if self.n_poses == 1 else 's'}"
        moves = f"{len(self.moves)} move{'' if len(self.moves) == 1 else 's'}"
        held = f" ({self.duration_s.sum():.1f} s still)" if self.n_poses else ""
        said = f", {len(self.findings)} findings" if self.findings else ""
        return f"<Segments: {poses}{held}, {moves}{said}>"
