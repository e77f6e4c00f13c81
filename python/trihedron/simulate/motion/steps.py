"""Steps of a motion made by hand, by a turntable or by a shaker.

A motion is a start attitude and a list of steps; each starts static, in the attitude in which the previous one ended.
Attitudes are quaternions (w, x, y, z) from the body frame to a level frame whose z axis points up. Angles with the
suffix ``_deg`` are in degrees, everything else is SI.
"""

from dataclasses import dataclass
from typing import TypeAlias

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError

Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
NOWHERE: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Pose:
    """Static pose; it settles by ``settling_deg`` about ``settling_axis`` (body) over the whole pose."""

    duration_s: float
    name: str = ""
    settling_deg: float = 0.0
    settling_axis: Vector = (1.0, 0.0, 0.0)


@dataclass(frozen=True)
class MoveTo:
    """Rotate so that the body direction ``up`` points up, by the shortest rotation combined with a change of heading.

    ``wobble_deg`` is the size of the hand's deviation from that rotation (smooth, zero at both ends), ``travel_m`` the
    displacement of the case (level frame), ``arm_m`` the vector from the pivot of the rotation to the body's reference
    point (body frame).
    """

    up: Vector
    duration_s: float = 2.0
    heading_deg: float = 0.0
    wobble_deg: float = 0.0
    wobble_hz: float = 2.0
    travel_m: Vector = NOWHERE
    arm_m: Vector = NOWHERE
    ramp: float = 0.5
    name: str = ""


@dataclass(frozen=True)
class Turn:
    """Turn by a stated angle about a fixed body axis; the rate rises and falls over the fraction ``ramp`` of the time.

    The true angle is ``angle_deg + error_deg``.
    """

    axis: Vector
    angle_deg: float
    duration_s: float
    ramp: float = 0.2
    error_deg: float = 0.0
    wobble_deg: float = 0.0
    wobble_hz: float = 2.0
    travel_m: Vector = NOWHERE
    arm_m: Vector = NOWHERE
    name: str = ""


@dataclass(frozen=True)
class Oscillate:
    """Swing about a body axis: ``amplitude_deg · sin(2π frequency t)``, faded in and out."""

    axis: Vector
    amplitude_deg: float
    frequency_hz: float
    duration_s: float
    fade: float = 0.1
    arm_m: Vector = NOWHERE
    name: str = ""


@dataclass(frozen=True)
class Vibrate:
    """Vibrate without rotation along a level-frame direction.

    A sinusoid at ``low_hz`` when ``high_hz`` is 0, else a band: ``n_lines`` sinusoids of random phase spread evenly
    over ``[low_hz, high_hz]``, flat in acceleration. ``rms_m_s2`` is the rms of the acceleration.
    """

    direction: Vector
    rms_m_s2: float
    low_hz: float
    duration_s: float
    high_hz: float = 0.0
    n_lines: int = 40
    fade: float = 0.02
    name: str = ""


@dataclass(frozen=True)
class Disturb:
    """A disturbance of a pose: rocking and displacement for about half a second; the attitude after it is as before."""

    duration_s: float = 0.6
    tilt_deg: float = 0.3
    shift_m: float = 0.0005
    frequency_hz: float = 5.0
    name: str = ""


@dataclass(frozen=True, eq=False)
class Replay:
    """Rate and acceleration at evenly spaced knots over the duration, linear between them: a rate table's profile, or
    a move of a real recording.

    ``rate_rad_s`` (m, 3) in the body frame, ``acceleration_m_s2`` (m, 3) of the reference point in the level frame.
    """

    rate_rad_s: FloatArray
    acceleration_m_s2: FloatArray
    duration_s: float
    arm_m: Vector = NOWHERE
    name: str = ""

    def __post_init__(self) -> None:
        rate, acceleration = np.asarray(self.rate_rad_s, dtype=float), np.asarray(self.acceleration_m_s2, dtype=float)
        if rate.ndim != 2 or rate.shape[1:] != (3,) or len(rate) < 2 or rate.shape != acceleration.shape:
            shapes = f"{rate.shape} and {acceleration.shape}"
            raise InputError(f"a replay needs rate and acceleration of one shape (m, 3), m >= 2, got {shapes}")
        if not (np.isfinite(rate).all() and np.isfinite(acceleration).all()):
            raise InputError("a replay must not hold values that are not finite")
        object.__setattr__(self, "rate_rad_s", rate)
        object.__setattr__(self, "acceleration_m_s2", acceleration)


Step: TypeAlias = Pose | MoveTo | Turn | Oscillate | Vibrate | Disturb | Replay


@dataclass(frozen=True)
class Motion:
    """A start attitude and the steps that follow.

    ``table_tilt_deg`` tilts the table, to which all attitudes refer, about the level x and y axes.
    """

    steps: tuple[Step, ...]
    start: Quaternion = LEVEL
    table_tilt_deg: tuple[float, float] = (0.0, 0.0)

    @property
    def duration_s(self) -> float:
        """Total duration of the steps [s]."""
        return float(sum(step.duration_s for step in self.steps))
