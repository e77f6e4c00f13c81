"""Reference motion of a log (rate table, tracking, robot, another unit) and the results of a fit to it."""

from dataclasses import dataclass, field
from types import MappingProxyType
from typing import Any, ClassVar, Literal

import numpy as np

from trihedron.arrays import FloatArray, sigmas_of
from trihedron.errors import InputError
from trihedron.records.finding import Finding
from trihedron.records.plain import Layout, Plain

NAMED_FROM = 8.0
"""Score above which an effect is accepted, and one clock offset preferred to another (docs/reference.md)."""


@dataclass(frozen=True, eq=False)
class ReferenceMotion:
    """Known motion of a rigid body on a clock of its own.

    ``time_s`` (n,) since the first row, ``start_epoch_s`` its origin; ``attitude`` (n, 3, 3) from reference body to
    reference world; ``rate`` (n, 3) [rad/s] and ``specific_force`` (n, 3) [m/s²] in the reference's body; ``position``
    (n, 3) [m] in its world. ``is_stepwise``: the rate is constant from each row to the next (commands of a rate table).
    """

    time_s: FloatArray
    attitude: FloatArray | None = None
    rate: FloatArray | None = None
    position: FloatArray | None = None
    specific_force: FloatArray | None = None
    is_stepwise: bool = False
    start_epoch_s: float = 0.0
    source: str = "memory"
    sha256: str = ""
    findings: tuple[Finding, ...] = ()

    def __post_init__(self) -> None:
        n = len(self.time_s)
        if n < 2 or not np.all(np.isfinite(self.time_s)) or np.any(np.diff(self.time_s) <= 0.0):
            raise InputError("a reference needs at least two rows with times that increase")
        if self.attitude is None and self.rate is None:
            raise InputError("a reference needs attitude or rate")
        for name, shape in (
            ("attitude", (n, 3, 3)),
            ("rate", (n, 3)),
            ("position", (n, 3)),
            ("specific_force", (n, 3)),
        ):
            value = getattr(self, name)
            if value is not None and value.shape != shape:
                raise InputError(f"{name} must have shape {shape}, got {value.shape}")

    @property
    def kind(self) -> str:
        """The kind of reference in words."""
        if self.specific_force is not None:
            return "the log of another unit"
        if self.attitude is None:
            return "commanded rate, in steps" if self.is_stepwise else "rate"
        return "attitude" if self.position is None else "attitude and position"


@dataclass(frozen=True, eq=False)
class Estimate(Plain):
    """Named parameters (n,) with their covariance (n, n) in one SI unit.

    ``score`` of an effect: twice its gain in log evidence, corrected for multiple testing; ``shown_from`` is the
    detection limit in multiples of its data-sheet size (infinite: no size would be detected).
    """

    names: tuple[str, ...]
    value: FloatArray
    covariance: FloatArray
    unit: str
    score: float | None = None
    shown_from: float | None = None
    LAYOUT: ClassVar[Layout] = Layout({}, lambda estimate, _: {"std": estimate.std.tolist()}, ("covariance",))

    @property
    def std(self) -> FloatArray:
        """(n,) standard errors."""
        return sigmas_of(self.covariance)


@dataclass(frozen=True, eq=False)
class FitToReference(Plain):
    """One sensor fitted to a reference: ``truth in the reference's body = S raw + b``.

    ``covariance`` (12, 12) as a calibration's; ``rms`` [SI] of the residuals of samples, low-pass filtered to the
    compared band (up to ``band_hz``), ``rms_held_out`` cross-validated (NaN in a short log); ``n_rows`` residuals of
    three components, ``n_left_out`` excluded as outliers; ``widened`` the excess of the scatter between blocks of time
    over the noise (an accelerometer's).
    """

    S: FloatArray
    b: FloatArray
    covariance: FloatArray
    rms: float
    rms_held_out: float
    band_hz: float
    n_rows: int
    n_left_out: int
    widened: float
    LAYOUT: ClassVar[Layout] = Layout(
        {"n_rows": "rows", "n_left_out": "left_out"}, lambda fit, _: fit.sigmas(), ("covariance",)
    )

    def sigmas(self) -> dict[str, Any]:
        """Standard errors of S (3, 3) and b (3,), as plain lists."""
        sigma = sigmas_of(self.covariance)
        return {"sigma_S": sigma[:9].reshape(3, 3).tolist(), "sigma_b": sigma[9:].tolist()}


@dataclass(frozen=True)
class ReplayStage:
    """Cross-validated error of the attitude integrated from the gyro over ``horizon_s``: rms [rad]."""

    stage: str
    horizon_s: float
    error_rad: float
    n: int


SignKind = Literal["quieter-than-gyro", "mounted-without-error"]


@dataclass(frozen=True)
class Sign(Plain):
    """Evidence that a reference was computed from this very gyro: the measured value and the value to compare with.

    White density of gyro minus reference and that of the static gyro [rad/s/√Hz]; angle between their frames and its
    standard uncertainty [rad].
    """

    kind: SignKind
    seen: float
    against: float


@dataclass(frozen=True)
class ReferenceError(Plain):
    """A reference's own error, per axis, and its missing rows.

    ``white_rad`` of the mean over a second; ``slow_rad`` the rms of its slow error with a 95 % interval, ``slow_s``
    its time constant, ``is_of_body`` whether it turns with the body (markers) or is fixed in the world (tracker).
    ``rows`` used and ``rows_left_out`` as outliers; ``gaps_s`` and outlying intervals ``apart_s``, beginning and
    end in the log's time; ``signs`` that it is not independent of this gyro.
    """

    white_rad: float
    slow_rad: tuple[float, float, float]
    slow_s: float
    is_of_body: bool
    rows: int
    rows_left_out: int
    gaps_s: tuple[tuple[float, float], ...]
    apart_s: tuple[tuple[float, float], ...]
    signs: tuple[Sign, ...]


@dataclass(frozen=True, eq=False)
class BiasOverTime(Plain):
    """The gyro's bias b in ``ω = S w' + b`` over the log's time (m,), (m, 3) [rad/s] with σ (m, 3).

    It includes a g-sensitivity within data-sheet limits, times the recording's mean specific force.
    """

    time_s: FloatArray
    value: FloatArray
    sigma: FloatArray


@dataclass(frozen=True, eq=False)
class ErrorOverTime(Plain):
    """Smoothed slow error of the reference's attitude over the log's time (m,): rotation vectors (m, 3) [rad] along the
    axes of the reference's world; NaN where the reference has no rows."""

    time_s: FloatArray
    angle: FloatArray


NOWHERE = ErrorOverTime(np.zeros(0), np.zeros((0, 3)))


@dataclass(frozen=True, eq=False)
class AgainstReference(Plain):
    """Fit of a log to a reference: clocks, mounting, lever arm, both sensors, effects, replay.

    ``clock_offset_s``: by how much the reference's clock is ahead at ``clock_middle_s`` of the log, and its σ.
    ``earth_rate``: along the axes of the reference's world, where the log determines it; else it is included in the
    uncertainties of the gyro's parameters.
    ``cross_covariance`` (12, 12) of the accelerometer's S and b with the gyro's: a constant rotation error of the
    reference's body rotates both.
    """

    kind: str
    source: str
    clock_offset_s: tuple[float, float]
    clock_middle_s: float
    clock_rate_ppm: tuple[float, float] | None
    overlap_s: float
    correlation: float
    gyroscope: FitToReference
    accelerometer: FitToReference | None
    mounting: Estimate
    lever_arm: Estimate | None
    vertical: Estimate | None
    effects: MappingProxyType[str, Estimate]
    replay: tuple[ReplayStage, ...]
    error: ReferenceError
    bias: BiasOverTime
    findings: tuple[Finding, ...] = ()
    earth_rate: Estimate | None = None
    cross_covariance: FloatArray = field(default_factory=lambda: np.zeros((12, 12)))
    apart: ErrorOverTime = NOWHERE
    LAYOUT: ClassVar[Layout] = Layout(
        {},
        lambda found, _: {"clock": found.clock()},
        ("clock_offset_s", "clock_middle_s", "clock_rate_ppm", "findings", "cross_covariance", "apart"),
    )

    def clock(self) -> dict[str, Any]:
        """Offset [s] and relative rate [ppm] of the reference's clock, with standard uncertainties."""
        rate, rate_std = self.clock_rate_ppm or (None, None)
        offset, offset_std = self.clock_offset_s
        return {
            "offset_s": offset, "offset_std_s": offset_std, "at_s": self.clock_middle_s,
            "rate_ppm": rate, "rate_std_ppm": rate_std,
        }  # fmt: skip
