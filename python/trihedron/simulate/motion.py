"""What a person, a turntable or a shaker does with the instrument, step by step.

A motion is a start attitude and a list of steps; each starts where the last one ended, at rest. Attitudes are
quaternions (w, x, y, z) from the body frame Mz to a level frame whose z axis points up. Angles that people write are
in degrees (``_deg``), everything else is SI.
"""

from __future__ import annotations

import math
from dataclasses import dataclass, field
from typing import TypeAlias

import numpy as np
import numpy.typing as npt

from trihedron import _core
from trihedron.records.truth import SegmentKind
from trihedron.units import radians_from_degrees

FloatArray = npt.NDArray[np.float64]
Vector: TypeAlias = tuple[float, float, float]
Quaternion: TypeAlias = tuple[float, float, float, float]

LEVEL: Quaternion = (1.0, 0.0, 0.0, 0.0)
_NOWHERE: Vector = (0.0, 0.0, 0.0)


@dataclass(frozen=True)
class Hold:
    """Stand still. ``creep_deg`` turns slowly by that angle about ``creep_axis`` (body) over the whole hold."""

    duration_s: float
    name: str = ""
    creep_deg: float = 0.0
    creep_axis: Vector = (1.0, 0.0, 0.0)


@dataclass(frozen=True)
class MoveTo:
    """Bring the body direction ``up`` to the vertical by the shortest way, with a turn of heading on the way.

    ``wobble_deg`` is the size of the hand's departure from the straight turn (smooth, gone at both ends),
    ``travel_m`` how far the hand carries the case (level frame), ``arm_m`` the way from the pivot of the turn to the
    body's reference point (body frame).
    """

    up: Vector
    duration_s: float = 2.0
    heading_deg: float = 0.0
    wobble_deg: float = 0.0
    wobble_hz: float = 2.0
    travel_m: Vector = _NOWHERE
    arm_m: Vector = _NOWHERE
    ramp: float = 0.5
    name: str = ""


@dataclass(frozen=True)
class Turn:
    """Turn by a known angle about a fixed body axis; speed rises and falls over the fraction ``ramp`` of the time.

    ``error_deg`` is what the turn truly exceeds its stated angle by.
    """

    axis: Vector
    angle_deg: float
    duration_s: float
    ramp: float = 0.2
    error_deg: float = 0.0
    wobble_deg: float = 0.0
    wobble_hz: float = 2.0
    travel_m: Vector = _NOWHERE
    arm_m: Vector = _NOWHERE
    name: str = ""


@dataclass(frozen=True)
class Oscillate:
    """Swing about a body axis: ``amplitude_deg · sin(2π frequency t)``, faded in and out."""

    axis: Vector
    amplitude_deg: float
    frequency_hz: float
    duration_s: float
    fade: float = 0.1
    arm_m: Vector = _NOWHERE
    name: str = ""


@dataclass(frozen=True)
class Vibrate:
    """Shake the standing body along a level-frame direction.

    A line at ``low_hz`` when ``high_hz`` is 0, else a band: ``n_lines`` lines of random phase spread evenly over
    ``[low_hz, high_hz]``, flat in acceleration. ``rms_m_s2`` is the acceleration's root mean square.
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
    """A push during a hold: a half-second rocking and shift that leaves the pose as it was."""

    duration_s: float = 0.6
    tilt_deg: float = 0.3
    shift_m: float = 0.0005
    frequency_hz: float = 5.0
    name: str = ""


@dataclass(frozen=True, eq=False)
class Replay:
    """A rate given at evenly spaced knots over the duration, straight lines between them: a rate table's profile, or
    the moves of a real recording.

    ``rate_rad_s`` (m, 3) body frame, ``acceleration_m_s2`` (m, 3) of the reference point, level frame.
    """

    rate_rad_s: FloatArray
    acceleration_m_s2: FloatArray
    duration_s: float
    arm_m: Vector = _NOWHERE
    name: str = ""

    def __post_init__(self) -> None:
        rate, acceleration = np.asarray(self.rate_rad_s, dtype=float), np.asarray(self.acceleration_m_s2, dtype=float)
        if rate.ndim != 2 or rate.shape[1:] != (3,) or len(rate) < 2 or rate.shape != acceleration.shape:
            shapes = f"{rate.shape} and {acceleration.shape}"
            raise ValueError(f"a replay needs rate and acceleration of one shape (m, 3), m >= 2, got {shapes}")
        if not (np.isfinite(rate).all() and np.isfinite(acceleration).all()):
            raise ValueError("a replay must not hold values that are not finite")
        object.__setattr__(self, "rate_rad_s", rate)
        object.__setattr__(self, "acceleration_m_s2", acceleration)


Step: TypeAlias = Hold | MoveTo | Turn | Oscillate | Vibrate | Disturb | Replay


@dataclass(frozen=True)
class Motion:
    """Steps from a start attitude.

    ``table_tilt_deg`` leans the whole level frame about its x and y axes: what is called level is not.
    """

    steps: tuple[Step, ...]
    start: Quaternion = LEVEL
    table_tilt_deg: tuple[float, float] = (0.0, 0.0)

    @property
    def duration_s(self) -> float:
        """Sum of the steps."""
        return float(sum(step.duration_s for step in self.steps))


@dataclass(frozen=True, eq=False)
class Label:
    """One step on the motion's clock."""

    kind: SegmentKind
    name: str
    start_s: float
    stop_s: float
    axis: Vector
    turn_rad: float


@dataclass(frozen=True, eq=False)
class Plan:
    """A motion laid out in time: the tables that the kernel evaluates, and the label of every step."""

    segments: FloatArray
    wobble: FloatArray
    shake: FloatArray
    replay: FloatArray
    labels: tuple[Label, ...] = field(default=())

    @property
    def duration_s(self) -> float:
        """End of the last step."""
        return float(self.segments[-1, 0] + self.segments[-1, 1])

    def evaluate(
        self, time_s: FloatArray, gravity_m_s2: float, earth_rate_rad_s: Vector = _NOWHERE
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Attitude (n, 4), inertial rate (n, 3), its derivative (n, 3), specific force (n, 3) at the instants.

        All in the body frame at its reference point, SI. Exact: closed forms with their derivatives.
        """
        return _core.simulate_motion(
            self.segments,
            self.wobble,
            self.shake,
            self.replay,
            np.ascontiguousarray(time_s, dtype=np.float64),
            gravity_m_s2,
            earth_rate_rad_s,
        )


def quaternion_product(p: Quaternion, q: Quaternion) -> Quaternion:
    """Hamilton product: first q, then p."""
    a, b, c, d = p
    e, f, g, h = q
    w = a * e - b * f - c * g - d * h
    x = a * f + b * e + c * h - d * g
    y = a * g - b * h + c * e + d * f
    z = a * h + b * g - c * f + d * e
    norm = math.sqrt(w * w + x * x + y * y + z * z)
    return (w / norm, x / norm, y / norm, z / norm)


def quaternion_from_vector(v: npt.ArrayLike) -> Quaternion:
    """Rotation by |v| about v."""
    x, y, z = (float(c) for c in np.asarray(v, dtype=np.float64))
    angle = math.sqrt(x * x + y * y + z * z)
    if angle == 0.0:
        return LEVEL
    s = math.sin(0.5 * angle) / angle
    return (math.cos(0.5 * angle), s * x, s * y, s * z)


def vector_from_quaternion(q: Quaternion) -> FloatArray:
    """Rotation vector of angle at most π."""
    w, *xyz = q
    v = np.array(xyz)
    n = float(np.linalg.norm(v))
    if n < 1e-12:
        return 2.0 * v
    if w < 0.0:
        w, v = -w, -v
    out: FloatArray = v * (2.0 * math.atan2(n, w) / n)
    return out


def up_in_body(q: Quaternion) -> FloatArray:
    """Direction of the vertical seen from the body: the third row of the body-to-level matrix."""
    w, x, y, z = q
    return np.array([2.0 * (x * z - w * y), 2.0 * (y * z + w * x), 1.0 - 2.0 * (x * x + y * y)])


def attitude_with_up(up: npt.ArrayLike) -> Quaternion:
    """Any attitude whose body direction ``up`` points to the zenith."""
    return quaternion_product(LEVEL, quaternion_from_vector(shortest_turn(_unit(up), np.array([0.0, 0.0, 1.0]))))


def _unit(v: npt.ArrayLike) -> FloatArray:
    out: FloatArray = np.asarray(v, dtype=np.float64)
    norm = float(np.linalg.norm(out))
    if out.shape != (3,) or not math.isfinite(norm) or norm == 0.0:
        raise ValueError(f"a direction needs three numbers that are not all zero, got {np.asarray(v).tolist()}")
    return out / norm


def shortest_turn(a: FloatArray, b: FloatArray) -> FloatArray:
    """Rotation vector that turns unit vector a into unit vector b."""
    cross = np.cross(a, b)
    sine, cosine = float(np.linalg.norm(cross)), float(a @ b)
    if sine < 1e-12:
        if cosine > 0.0:
            return np.zeros(3)
        other = np.eye(3)[int(np.argmin(np.abs(a)))]
        perpendicular = np.cross(a, other)
        opposite: FloatArray = perpendicular * (math.pi / float(np.linalg.norm(perpendicular)))
        return opposite
    turn: FloatArray = cross * (math.atan2(sine, cosine) / sine)
    return turn


class _Planner:
    """Lays steps end to end, keeping the attitude."""

    def __init__(self, motion: Motion, rng: np.random.Generator) -> None:
        tilt = [radians_from_degrees(motion.table_tilt_deg[0]), radians_from_degrees(motion.table_tilt_deg[1]), 0.0]
        self.tilt = quaternion_from_vector(tilt)
        self.attitude = quaternion_product(self.tilt, motion.start)
        self.time = 0.0
        self.rng = rng
        self.rows: list[list[float]] = []
        self.wobble: list[list[float]] = []
        self.shake: list[list[float]] = []
        self.replay: list[FloatArray] = []
        self.labels: list[Label] = []

    def add(
        self,
        kind: SegmentKind,
        name: str,
        duration_s: float,
        rotation: FloatArray | None = None,
        ramp: float = 0.5,
        travel: Vector = _NOWHERE,
        arm: Vector = _NOWHERE,
        fade: float = 0.5,
        stated_rad: float | None = None,
    ) -> int:
        if not (math.isfinite(duration_s) and duration_s > 0.0):
            raise ValueError(f"step {len(self.rows)} ({kind} {name}) must last a positive time, got {duration_s} s")
        vector = np.zeros(3) if rotation is None else rotation
        angle = float(np.linalg.norm(vector))
        axis = vector / angle if angle > 0.0 else np.array([1.0, 0.0, 0.0])
        if stated_rad is not None and stated_rad < 0.0:
            axis, signed = -axis, -angle
        else:
            signed = angle
        row = [self.time, duration_s, *self.attitude, *axis, signed, ramp, *travel, *arm, fade]
        self.rows.append(row)
        stop = self.time + duration_s
        label_axis = (float(axis[0]), float(axis[1]), float(axis[2])) if angle > 0.0 else _NOWHERE
        self.labels.append(Label(kind, name, self.time, stop, label_axis, signed))
        self.time = stop
        self.attitude = quaternion_product(self.attitude, quaternion_from_vector(vector))
        return len(self.rows) - 1

    def add_wobble(self, segment: int, size_deg: float, frequency_hz: float) -> None:
        if size_deg == 0.0:
            return
        size = radians_from_degrees(size_deg) / math.sqrt(3.0)
        for factor in (0.37, 0.71, 1.0):
            amplitude = size * self.rng.normal(size=3)
            self.wobble.append([segment, *amplitude, factor * frequency_hz, self.rng.uniform(0.0, 2.0 * math.pi)])

    def step(self, step: Step) -> None:
        if isinstance(step, Hold):
            creep = radians_from_degrees(step.creep_deg) * _unit(step.creep_axis)
            self.add("hold", step.name, step.duration_s, creep if step.creep_deg else None, ramp=0.05)
        elif isinstance(step, MoveTo):
            # Body vector v turns so that the new zenith is `up`: R' = R exp(v), exp(v) up = old zenith in the body.
            turn = quaternion_from_vector(shortest_turn(_unit(step.up), up_in_body(self.attitude_above_table())))
            heading = quaternion_from_vector(radians_from_degrees(step.heading_deg) * _unit(step.up))
            rotation = vector_from_quaternion(quaternion_product(turn, heading))
            k = self.add("move", step.name, step.duration_s, rotation, step.ramp, step.travel_m, step.arm_m)
            self.add_wobble(k, step.wobble_deg, step.wobble_hz)
        elif isinstance(step, Turn):
            sign = 1.0 if step.angle_deg >= 0.0 else -1.0
            angle = radians_from_degrees(step.angle_deg + step.error_deg)
            k = self.add(
                "turn",
                step.name,
                step.duration_s,
                angle * _unit(step.axis),
                step.ramp,
                step.travel_m,
                step.arm_m,
                stated_rad=sign,
            )
            self.add_wobble(k, step.wobble_deg, step.wobble_hz)
        elif isinstance(step, Oscillate):
            k = self.add("oscillation", step.name, step.duration_s, arm=step.arm_m, fade=step.fade)
            amplitude = radians_from_degrees(step.amplitude_deg) * _unit(step.axis)
            self.wobble.append([k, *amplitude, step.frequency_hz, 0.0])
        elif isinstance(step, Vibrate):
            k = self.add("vibration", step.name, step.duration_s, fade=step.fade)
            lines = [step.low_hz] if step.high_hz == 0.0 else np.linspace(step.low_hz, step.high_hz, step.n_lines)
            peak = step.rms_m_s2 * math.sqrt(2.0 / len(lines))
            for line in lines:
                amplitude = peak / (2.0 * math.pi * float(line)) ** 2 * _unit(step.direction)
                self.shake.append([k, *amplitude, float(line), self.rng.uniform(0.0, 2.0 * math.pi)])
        elif isinstance(step, Replay):
            k = self.add("move", step.name, step.duration_s, arm=step.arm_m)
            knots = np.column_stack([np.full(len(step.rate_rad_s), float(k)), step.rate_rad_s, step.acceleration_m_s2])
            self.replay.append(knots)
            self.attitude = self.end_of_replay(knots)
        else:
            k = self.add("disturbance", step.name, step.duration_s)
            self.add_wobble(k, step.tilt_deg, step.frequency_hz)
            if step.shift_m:
                shift = step.shift_m * self.rng.normal(size=3)
                self.shake.append([k, *shift, step.frequency_hz, self.rng.uniform(0.0, 2.0 * math.pi)])

    def end_of_replay(self, knots: FloatArray) -> Quaternion:
        """Attitude after the last row, which is a replay."""
        alone = knots.copy()
        alone[:, 0] = 0.0
        empty = np.zeros((0, 6))
        end = np.array([self.time])
        q, *_ = _core.simulate_motion(np.array([self.rows[-1]]), empty, empty, alone, end, 0.0, _NOWHERE)
        w, x, y, z = (float(c) for c in q[0])
        return (w, x, y, z)

    def attitude_above_table(self) -> Quaternion:
        """Attitude relative to the table, which is what a person aims at."""
        w, x, y, z = self.tilt
        return quaternion_product((w, -x, -y, -z), self.attitude)


def plan_motion(motion: Motion, rng: np.random.Generator) -> Plan:
    """Lay a motion out in time.

    Raises
    ------
    ValueError
        Without steps, with a duration that is not positive, or a direction of zero length.
    """
    if not motion.steps:
        raise ValueError("a motion needs at least one step, for instance a Hold")
    planner = _Planner(motion, rng)
    for step in motion.steps:
        planner.step(step)
    return Plan(
        np.array(planner.rows),
        np.array(planner.wobble).reshape(-1, 6),
        np.array(planner.shake).reshape(-1, 6),
        np.concatenate(planner.replay) if planner.replay else np.zeros((0, 7)),
        tuple(planner.labels),
    )
