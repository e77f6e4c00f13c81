"""Many recordings of one unit: common parameters, repeatability of each, and parameters that changed."""

from dataclasses import dataclass
from typing import Literal

from trihedron.arrays import AXES, FloatArray
from trihedron.records.calibration import Calibration
from trihedron.records.finding import Finding, Judged
from trihedron.records.frozen import Frozen

By = Literal["session", "date", "temperature"]
"""Grouping of sessions: none, by the day they began, by device, or as functions of temperature."""

ChangeKind = Literal["differs", "apart", "step", "trend", "scatter"]
"""``differs``: two sessions differ. ``apart``: one session differs from all others, which agree. ``step``: sessions
before differ from sessions after. ``trend``: the value changes linearly from session to session. ``scatter``: every
session has another value."""


@dataclass(frozen=True)
class Parameter:
    """A parameter that does not depend on the frame: its group ``id`` (``gyro-bias``), axis or pair ``name``, ``unit``,
    ``sensor``."""

    id: str
    name: str
    unit: str
    sensor: Literal["accelerometer", "gyroscope", "both"]


_PAIRS = ("xy", "xz", "yz")


def _of(prefix: Literal["accel", "gyro"], unit: str) -> tuple[Parameter, ...]:
    sensor: Literal["accelerometer", "gyroscope"] = "accelerometer" if prefix == "accel" else "gyroscope"
    return (
        *(Parameter(f"{prefix}-bias", axis, unit, sensor) for axis in AXES),
        *(Parameter(f"{prefix}-scale", axis, "1", sensor) for axis in AXES),
        *(Parameter(f"{prefix}-misalignment", pair, "rad", sensor) for pair in _PAIRS),
    )


PARAMETERS: tuple[Parameter, ...] = (
    *_of("accel", "m/s^2"),
    *_of("gyro", "rad/s"),
    *(Parameter("triad-alignment", axis, "rad", "both") for axis in AXES),
)
"""Order of every parameter vector: 9 of the accelerometer, 9 of the gyro, 3 of the rotation between them. A scale is
the natural logarithm of raw units per SI unit: differences of it are relative."""
GEOMETRY = ("accel-misalignment", "gyro-misalignment", "triad-alignment")
"""Ids of parameters that the package and the board fix: they differ between devices."""
ONE_UNIT = 0.01
"""Largest difference in relative scale, or angle [rad], between two logs of one unit: 0.03 %/K over 30 K; units differ
by several per cent (data sheets of consumer parts: 3 %)."""


@dataclass(frozen=True, eq=False)
class Session(Frozen):
    """One calibrated recording, as input to the comparison.

    ``numbers`` (9,) or (21,) are the parameters in the order of :data:`PARAMETERS`, ``covariance`` (n, n) that of the
    session's own estimate; ``drift`` (n,) the variance of the bias change from session to session (eq. 9.3), else 0.
    ``group`` is the day or the device. Temperatures are those of the poses, NaN where the log has none; ``branch`` is
    +1 for heating, -1 for cooling, 0 for neither. ``gravity_error_m_s2`` is the cross-validated rms in its poses,
    ``times_noise`` that over noise alone.
    """

    name: str
    group: str
    numbers: FloatArray
    covariance: FloatArray
    drift: FloatArray
    start_epoch_s: float = 0.0
    temperature_degc: float = float("nan")
    temperature_range_degc: tuple[float, float] = (float("nan"), float("nan"))
    branch: int = 0
    sha256: str = ""
    gravity_error_m_s2: float = float("nan")
    times_noise: float = float("nan")


@dataclass(frozen=True)
class Spread:
    """A standard deviation with its 95 % interval, from ``dof`` degrees of freedom."""

    sd: float
    low: float
    high: float
    dof: int


@dataclass(frozen=True)
class Repeated:
    """One parameter over all sessions.

    ``value`` is common to all, ``std`` its standard error, ``half_width`` of its 95 % interval; ``within`` the spread
    between sessions of a group (turn-on to turn-on), ``between`` that between groups (day to day, device to device),
    ``None`` without groups; ``own_std`` the typical uncertainty of one session.
    """

    parameter: Parameter
    value: float
    std: float
    half_width: float
    within: Spread | None
    between: Spread | None
    own_std: float


@dataclass(frozen=True)
class Change:
    """Test whether one group of parameters (by ``id``) is equal in all sessions of a unit.

    ``p_adjusted`` after Holm's procedure over the ids; ``where`` names the session (``apart``) or the first session
    after the step; ``size`` and ``std`` (3,) of that change. ``group`` is the device where several were compared.
    """

    id: str
    group: str
    kind: ChangeKind
    where: str
    names: tuple[str, ...]
    size: tuple[float, ...]
    std: tuple[float, ...]
    unit: str
    p_value: float
    p_adjusted: float
    significant: bool


@dataclass(frozen=True, eq=False)
class ThermalTerm:
    """Temperature dependence of one group of parameters: polynomial ``coefficients`` (order + 1, 3) in T - reference,
    lowest first; ``hysteresis`` (3,) half of heating minus cooling,
    ``None`` where it was not tested or not found; ``remaining`` (3,) spread of sessions about it."""

    id: str
    order: int
    coefficients: FloatArray
    covariance: FloatArray
    remaining: tuple[Spread, ...]
    hysteresis: FloatArray | None = None


@dataclass(frozen=True, eq=False)
class ThermalModel:
    """Parameters as polynomials of temperature, valid from ``low_degc`` to ``high_degc``."""

    reference_degc: float
    low_degc: float
    high_degc: float
    terms: tuple[ThermalTerm, ...]


@dataclass(frozen=True, eq=False)
class SessionsModel(Judged, Frozen):
    """Many recordings of one unit as one model: ``calibration`` is common to them, its covariance that of the *next*
    session (error of the common parameters plus the spread between sessions)."""

    by: By
    sessions: tuple[Session, ...]
    repeated: tuple[Repeated, ...]
    changes: tuple[Change, ...]
    thermal: ThermalModel | None
    calibration: Calibration
    left_out: tuple[tuple[str, str], ...] = ()
    findings: tuple[Finding, ...] = ()
