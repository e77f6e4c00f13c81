"""A planned experiment: the uncertainties to expect from it."""

from dataclasses import dataclass

from trihedron.records.presented import Printed


@dataclass(frozen=True)
class TurnPlan:
    """Standard errors from known turns: relative ``scale`` of each turned axis, ``bias`` [rad/s]; by least squares over
    all rows, and with the bias from static intervals of ``static_s`` first. ``n_turns`` about every axis."""

    n_turns: int
    angles_deg: tuple[float, ...]
    duration_s: float
    static_s: float
    scale: float
    bias: float
    scale_bias_first: float
    bias_bias_first: float


@dataclass(frozen=True)
class PoseWorth:
    """One pose of a set, in words, and the factor by which the largest of the nine standard errors grows without it
    (infinite: not determined)."""

    pose: str
    loss: float


@dataclass(frozen=True)
class PosePlan:
    """Standard errors of a set of poses by method 2: relative ``scale``, ``angle`` between axes [rad], ``bias`` [m/s²],
    the largest of three each; ``rank`` of nine; ``worth`` the poses in order of their ``loss``, largest first."""

    name: str
    n_poses: int
    rank: int
    scale: float
    angle: float
    bias: float
    worth: tuple[PoseWorth, ...]


@dataclass(frozen=True)
class MovePlan:
    """Gyro by moves (method 2): ``rank``, how many of the nine elements of S a set of moves determines, and the largest
    relative standard error among them (infinite: not determined)."""

    name: str
    n_moves: int
    rank: int
    scale: float


@dataclass(frozen=True)
class ExperimentPlan(Printed):
    """Uncertainties to expect from known turns, poses and moves; noise densities in rad/s/√Hz and m/s²/√Hz."""

    gyroscope_density: float
    accelerometer_density: float
    gravity_m_s2: float
    pose_s: float
    sigma_turn_rad: float
    turns: TurnPlan
    poses: tuple[PosePlan, ...]
    moves: tuple[MovePlan, ...]
