"""What a recording's own calibration leaves of its moves: gravity carried through each by the gyro."""

from __future__ import annotations

from dataclasses import dataclass
from itertools import pairwise

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.estimate.verification import verify_calibration
from trihedron.records import Calibration, Recording, Segments
from trihedron.units import radians_from_degrees


@dataclass(frozen=True, eq=False)
class CarriedMisses:
    """Angle (m,) [rad] by which gravity carried through each move misses the pose after it, and the moves' length.

    Moves beyond the gyro's range are none of them: what was cut off there is no zero that strays.
    """

    angle_rad: FloatArray
    duration_s: FloatArray


def carried_misses(own: Calibration, recording: Recording, segments: Segments) -> CarriedMisses:
    """What a recording's own calibration leaves of its moves."""
    checked = verify_calibration(own, recording, segments, own.gravity_m_s2, own.gravity_source)
    t = recording.time_s
    cut = np.asarray(recording.facts.of("gyroscope").at_limits(len(t)).any(axis=1))
    sound = np.array([not cut[a.stop : b.start].any() for a, b in pairwise(segments.poses)], dtype=np.bool_)
    lasts = [float(t[min(b.start, len(t) - 1)] - t[a.stop - 1]) for a, b in pairwise(segments.poses)]
    told = sound[checked.moves]
    return CarriedMisses(radians_from_degrees(1.0) * checked.angle_deg[told], np.array(lasts)[checked.moves][told])
