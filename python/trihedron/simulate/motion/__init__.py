"""Motion: steps that people write, attitudes, and the plan that the kernel evaluates."""

from __future__ import annotations

from trihedron.simulate.motion.attitude import attitude_with_up, shortest_turn, up_in_body
from trihedron.simulate.motion.plan import Plan, plan_motion
from trihedron.simulate.motion.steps import (
    LEVEL,
    Disturb,
    Motion,
    MoveTo,
    Oscillate,
    Pose,
    Quaternion,
    Replay,
    Step,
    Turn,
    Vibrate,
)

__all__ = [
    "LEVEL",
    "Disturb",
    "Motion",
    "MoveTo",
    "Oscillate",
    "Plan",
    "Pose",
    "Quaternion",
    "Replay",
    "Step",
    "Turn",
    "Vibrate",
    "attitude_with_up",
    "plan_motion",
    "shortest_turn",
    "up_in_body",
]
