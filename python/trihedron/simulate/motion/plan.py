"""A motion as tables of consecutive steps in time, which the Rust kernel evaluates."""

import math
from dataclasses import dataclass, field

import numpy as np
from scipy.spatial.transform import Rotation

from trihedron import _core
from trihedron.arrays import FloatArray
from trihedron.errors import InputError
from trihedron.records.truth import SegmentKind
from trihedron.simulate.motion.attitude import VERTICAL, quaternion_of, rotation_of, shortest_turn, unit
from trihedron.simulate.motion.steps import (
    NOWHERE,
    Motion,
    MoveTo,
    Oscillate,
    Pose,
    Replay,
    Step,
    Turn,
    Vector,
    Vibrate,
)
from trihedron.units import radians_from_degrees


@dataclass(frozen=True, eq=False)
class Label:
    """One step: its kind and name, start and stop [s], axis (body) and signed angle [rad]."""

    kind: SegmentKind
    name: str
    start_s: float
    stop_s: float
    axis: Vector
    turn_rad: float


@dataclass(frozen=True, eq=False)
class Plan:
    """A motion as the tables that the Rust kernel evaluates, with the label of every step."""

    segments: FloatArray
    wobble: FloatArray
    shake: FloatArray
    replay: FloatArray
    labels: tuple[Label, ...] = field(default=())

    @property
    def duration_s(self) -> float:
        """End of the last step [s]."""
        return float(self.segments[-1, 0] + self.segments[-1, 1])

    def evaluate(
        self, time_s: FloatArray, gravity_m_s2: float, earth_rate_rad_s: Vector = NOWHERE
    ) -> tuple[FloatArray, FloatArray, FloatArray, FloatArray]:
        """Attitude (n, 4), inertial rate (n, 3), its derivative (n, 3), specific force (n, 3) at the instants.

        Body frame, at its reference point, SI. Exact: closed forms and their derivatives.
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


class _Planner:
    """Appends steps to the tables and tracks time and attitude."""

    def __init__(self, motion: Motion, rng: np.random.Generator) -> None:
        # The steps refer to the tilted table.
        self.tilt = Rotation.from_rotvec([*motion.table_tilt_deg, 0.0], degrees=True)
        self.attitude = self.tilt * rotation_of(motion.start)
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
        travel: Vector = NOWHERE,
        arm: Vector = NOWHERE,
        fade: float = 0.5,
        stated_rad: float | None = None,
    ) -> int:
        if not (math.isfinite(duration_s) and duration_s > 0.0):
            raise InputError(f"step {len(self.rows)} ({kind} {name}) must last a positive time, got {duration_s} s")
        vector = np.zeros(3) if rotation is None else rotation
        angle = float(np.linalg.norm(vector))
        axis = vector / angle if angle > 0.0 else np.array([1.0, 0.0, 0.0])
        if stated_rad is not None and stated_rad < 0.0:
            axis, signed = -axis, -angle
        else:
            signed = angle
        row = [self.time, duration_s, *quaternion_of(self.attitude), *axis, signed, ramp, *travel, *arm, fade]
        self.rows.append(row)
        stop = self.time + duration_s
        label_axis = (float(axis[0]), float(axis[1]), float(axis[2])) if angle > 0.0 else NOWHERE
        self.labels.append(Label(kind, name, self.time, stop, label_axis, signed))
        self.time = stop
        if angle > 0.0:
            self.attitude = self.attitude * Rotation.from_rotvec(vector)
        return len(self.rows) - 1

    def add_wobble(self, segment: int, size_deg: float, frequency_hz: float) -> None:
        if size_deg == 0.0:
            return
        size = radians_from_degrees(size_deg) / math.sqrt(3.0)
        for factor in (0.37, 0.71, 1.0):
            amplitude = size * self.rng.normal(size=3)
            self.wobble.append([segment, *amplitude, factor * frequency_hz, self.rng.uniform(0.0, 2.0 * math.pi)])

    def step(self, step: Step) -> None:
        if isinstance(step, Pose):
            creep = radians_from_degrees(step.settling_deg) * unit(step.settling_axis)
            self.add("pose", step.name, step.duration_s, creep if step.settling_deg else None, ramp=0.05)
        elif isinstance(step, MoveTo):
            # R' = R exp(v) has `up` vertical if exp(v) rotates `up` to the old vertical in the body frame.
            vertical = (self.attitude.inv() * self.tilt).apply(VERTICAL)
            turn = Rotation.from_rotvec(shortest_turn(unit(step.up), vertical))
            heading = Rotation.from_rotvec(radians_from_degrees(step.heading_deg) * unit(step.up))
            rotation = (turn * heading).as_rotvec()
            k = self.add("move", step.name, step.duration_s, rotation, step.ramp, step.travel_m, step.arm_m)
            self.add_wobble(k, step.wobble_deg, step.wobble_hz)
        elif isinstance(step, Turn):
            sign = 1.0 if step.angle_deg >= 0.0 else -1.0
            angle = radians_from_degrees(step.angle_deg + step.error_deg)
            k = self.add(
                "turn",
                step.name,
                step.duration_s,
                angle * unit(step.axis),
                step.ramp,
                step.travel_m,
                step.arm_m,
                stated_rad=sign,
            )
            self.add_wobble(k, step.wobble_deg, step.wobble_hz)
        elif isinstance(step, Oscillate):
            k = self.add("oscillation", step.name, step.duration_s, arm=step.arm_m, fade=step.fade)
            amplitude = radians_from_degrees(step.amplitude_deg) * unit(step.axis)
            self.wobble.append([k, *amplitude, step.frequency_hz, 0.0])
        elif isinstance(step, Vibrate):
            k = self.add("vibration", step.name, step.duration_s, fade=step.fade)
            lines = [step.low_hz] if step.high_hz == 0.0 else np.linspace(step.low_hz, step.high_hz, step.n_lines)
            peak = step.rms_m_s2 * math.sqrt(2.0 / len(lines))
            for line in lines:
                amplitude = peak / (2.0 * math.pi * float(line)) ** 2 * unit(step.direction)
                self.shake.append([k, *amplitude, float(line), self.rng.uniform(0.0, 2.0 * math.pi)])
        elif isinstance(step, Replay):
            k = self.add("move", step.name, step.duration_s, arm=step.arm_m)
            knots = np.column_stack([np.full(len(step.rate_rad_s), float(k)), step.rate_rad_s, step.acceleration_m_s2])
            self.replay.append(knots)
            self.attitude = rotation_of(attitudes_of_replay(self.rows[-1], knots)[-1])
        else:
            k = self.add("disturbance", step.name, step.duration_s)
            self.add_wobble(k, step.tilt_deg, step.frequency_hz)
            if step.shift_m:
                shift = step.shift_m * self.rng.normal(size=3)
                self.shake.append([k, *shift, step.frequency_hz, self.rng.uniform(0.0, 2.0 * math.pi)])


def attitudes_of_replay(row: list[float], knots: FloatArray) -> FloatArray:
    """(m, 4) attitude at every knot (m, 7) of a segment alone, which is a replay."""
    alone, empty = knots.copy(), np.zeros((0, 6))
    alone[:, 0] = 0.0
    t = row[0] + np.linspace(0.0, row[1], len(knots))
    q, *_ = _core.simulate_motion(np.array([row]), empty, empty, alone, t, 0.0, NOWHERE)
    return q


def plan_motion(motion: Motion, rng: np.random.Generator) -> Plan:
    """Convert a motion to tables in time.

    Raises ``InputError`` when there are no steps, a duration is not positive, or a direction has zero length.
    """
    if not motion.steps:
        raise InputError("a motion needs at least one step, for instance a Pose")
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
