"""Records of a guided session: target accuracy, progress, and the view that screens and the page show."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import InputError

LEAST_POSES = 12
"""Nine parameters of the accelerometer and three poses more: residuals with three degrees of freedom."""


@dataclass(frozen=True)
class Accuracy:
    """Target accuracy: standard error of every scale and cross term of a sensor as a fraction of its scale, and of the
    accelerometer's biases as a fraction of gravity."""

    accelerometer: float = 1e-3
    gyroscope: float = 2e-3

    @classmethod
    def parse(cls, text: str) -> Accuracy:
        """From ``"accel 0.05 %, gyro 0.1 %"``; a sensor that is not named keeps its default.

        Raises ``InputError`` when a part is not understood.
        """
        chosen: dict[str, float] = {}
        for part in (piece.strip() for piece in text.split(",") if piece.strip()):
            found = re.fullmatch(r"(acc\w*|gyr\w*)\s*[=:]?\s*([\d.eE+-]+)\s*%", part)
            try:
                size = float(found.group(2)) / 100.0 if found else 0.0
            except ValueError:
                size = 0.0
            if found is None or not 0.0 < size < 0.2:
                raise InputError(
                    f"--accuracy: '{part}' is not understood; write for example \"accel 0.05 %, gyro 0.1 %\"."
                )
            chosen["accelerometer" if found.group(1).startswith("acc") else "gyroscope"] = size
        return cls(**chosen)

    def sentence(self) -> str:
        """The accuracy as text."""
        return f"accelerometer {100 * self.accelerometer:g} %, gyro {100 * self.gyroscope:g} %"


@dataclass(frozen=True)
class Uncertain:
    """One parameter: standard error ``now``, ``after_next`` pose and ``wanted``; fractions, None where undetermined."""

    sensor: str
    name: str
    now: float | None
    after_next: float | None
    wanted: float


@dataclass(frozen=True, eq=False)
class Examination:
    """State of a session: poses (n, 3) as unit vectors along up in the body, uncertainties, the next pose.

    ``shortfall`` is the largest ratio of standard error to target (1 or less: reached). ``next_up`` (3,) is the
    most useful next pose; ``poses_needed`` the least number of further poses, None where no number suffices.
    """

    poses_up: FloatArray
    uncertain: tuple[Uncertain, ...]
    shortfall: float
    next_up: FloatArray
    next_words: str
    why: str
    poses_needed: int | None = None
    pose_s: float = 4.0
    warnings: tuple[str, ...] = ()
    rate_hz: float = 0.0
    # Raw accelerometer reading → vector along up in the body: matrix · (reading − centre).
    centre: FloatArray = field(default_factory=lambda: np.zeros(3))
    matrix: FloatArray = field(default_factory=lambda: np.eye(3))

    doubts: tuple[str, ...] = ()

    @property
    def is_good_enough(self) -> bool:
        """Whether the target is reached, with enough poses to judge the fit and no serious finding."""
        return self.shortfall <= 1.0 and len(self.poses_up) >= LEAST_POSES and not self.doubts


class Phase(Enum):
    """The step that the guide waits for."""

    BEGIN = "begin"
    POSE = "pose"
    MOVE = "move"
    CHECK = "check"
    DONE = "done"


@dataclass(frozen=True, eq=False)
class GuideView:
    """Everything that a screen shows, texts included; rebuilt with every block of readings."""

    phase: Phase
    instruction: str
    detail: str
    is_still: bool
    held_s: float
    pose_s: float
    n_poses: int
    n_checks: int
    up_now: FloatArray | None
    examination: Examination | None
    target_up: FloatArray | None
    warnings: tuple[str, ...]
    time_s: float
    accuracy: Accuracy
    n_events: int = 0

    @property
    def degrees_to_target(self) -> float | None:
        """Angle between the vertical and its target in the body [°]."""
        if self.up_now is None or self.target_up is None:
            return None
        return float(np.degrees(np.arccos(np.clip(self.up_now @ self.target_up, -1.0, 1.0))))
