"""What a guided session wants, knows and shows: nouns that the guide, its screens and the page share."""

from __future__ import annotations

import re
from dataclasses import dataclass, field
from enum import Enum

import numpy as np

from trihedron.arrays import FloatArray
from trihedron.errors import RefusedError

LEAST_POSES = 12
"""Nine numbers of the accelerometer, and three poses more than numbers: residuals that can contradict it."""


@dataclass(frozen=True)
class Accuracy:
    """Good enough: every scale and cross term of a sensor within this fraction of its scale (standard error), and the
    accelerometer's biases within the same fraction of gravity."""

    accelerometer: float = 1e-3
    gyroscope: float = 2e-3

    @classmethod
    def parse(cls, text: str) -> Accuracy:
        """From ``"accel 0.05 %, gyro 0.1 %"``; what is not said keeps its default.

        Raises
        ------
        ValueError
            When a part is not understood.
        """
        chosen: dict[str, float] = {}
        for part in (piece.strip() for piece in text.split(",") if piece.strip()):
            found = re.fullmatch(r"(acc\w*|gyr\w*)\s*[=:]?\s*([\d.eE+-]+)\s*%", part)
            try:
                size = float(found.group(2)) / 100.0 if found else 0.0
            except ValueError:
                size = 0.0
            if found is None or not 0.0 < size < 0.2:
                raise RefusedError(
                    f"--accuracy: '{part}' is not understood; write for example \"accel 0.05 %, gyro 0.1 %\"."
                )
            chosen["accelerometer" if found.group(1).startswith("acc") else "gyroscope"] = size
        return cls(**chosen)

    def sentence(self) -> str:
        """For people."""
        return f"accelerometer {100 * self.accelerometer:g} %, gyro {100 * self.gyroscope:g} %"


@dataclass(frozen=True)
class Uncertain:
    """One parameter: standard error ``now`` and after the next pose, and what is ``wanted``; fractions, or None."""

    sensor: str
    name: str
    now: float | None
    after_next: float | None
    wanted: float


@dataclass(frozen=True, eq=False)
class Examination:
    """Where a session stands: poses (n, 3) as unit vectors of the body that point up, what is known, what comes next.

    ``shortfall`` is the largest standard error over what is wanted (1 or less: good enough). ``next_up`` (3,) is the
    pose that helps most; ``poses_needed`` how many more at least, None where no number of poses would do.
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
    noise: str = ""
    # Raw accelerometer reading → up in the body: (reading - centre), turned by the rough model.
    centre: FloatArray = field(default_factory=lambda: np.zeros(3))
    matrix: FloatArray = field(default_factory=lambda: np.eye(3))

    doubts: tuple[str, ...] = ()

    @property
    def is_good_enough(self) -> bool:
        """Whether the wanted accuracy is reached, by poses enough to judge the fit and without a serious finding."""
        return self.shortfall <= 1.0 and len(self.poses_up) >= LEAST_POSES and not self.doubts


class Phase(Enum):
    """What the guide waits for."""

    BEGIN = "begin"
    POSE = "pose"
    MOVE = "move"
    CHECK = "check"
    DONE = "done"


@dataclass(frozen=True, eq=False)
class GuideView:
    """Everything that a screen shows, words included; made anew with every block of readings."""

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
        """Angle between where up is and where it should be in the body."""
        if self.up_now is None or self.target_up is None:
            return None
        return float(np.degrees(np.arccos(np.clip(self.up_now @ self.target_up, -1.0, 1.0))))
