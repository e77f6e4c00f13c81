"""Findings: problems and remarks from a closed list of codes, each with its likely cause and the next action."""

from __future__ import annotations

import math
from collections.abc import Mapping
from dataclasses import dataclass, field
from enum import Enum
from numbers import Real
from types import MappingProxyType
from typing import Any, Protocol

from trihedron.answers import ask
from trihedron.records.checked import kind_of, word_of
from trihedron.records.frozen import Frozen, freeze
from trihedron.records.plain import Plain


class Severity(str, Enum):
    """Effect of a finding on the result.

    ``NOTE``: information, for example an assumed value. ``WARNING``: the result is usable, but less reliable than it
    looks. ``SERIOUS``: the result is not to be trusted (exit status 2 on the command line).
    """

    NOTE = "note"
    WARNING = "warning"
    SERIOUS = "serious"


class FindingCode(str, Enum):
    """All finding codes, sorted by the stage that reports them. A published code keeps its meaning."""

    # read
    UNIT_ASSUMED = "unit-assumed"
    RATE_ASSUMED = "rate-assumed"
    TIME_UNIT_DETECTED = "time-unit-detected"
    TIME_GAP = "time-gap"
    TIME_JITTER = "time-jitter"
    TIME_DUPLICATE = "time-duplicate"
    TIME_BACKWARD = "time-backward"
    CLOCKS_MERGED = "clocks-merged"
    STUCK_VALUES = "stuck-values"
    INVALID_READINGS = "invalid-readings"
    CLIPPING = "clipping"
    REPEATED_ROWS = "repeated-rows"
    NON_FINITE = "non-finite"
    COARSE_RESOLUTION = "coarse-resolution"
    CORRECTED_ON_BOARD = "corrected-on-board"
    COLUMNS_RECOGNISED = "columns-recognised"
    COLUMNS_ASSUMED = "columns-assumed"
    COLUMN_LEFT_OUT = "column-left-out"
    LINE_INCOMPLETE = "line-incomplete"
    ROWS_LEFT_OUT = "rows-left-out"
    ROWS_UNACCOUNTED = "rows-unaccounted"
    DEVICE_CHOSEN = "device-chosen"
    DEVICES_INTERLEAVED = "devices-interleaved"
    SENSORS_EXCHANGED = "sensors-exchanged"
    AXES_CHANGED = "axes-changed"
    CLOCK_JUMPED = "clock-jumped"
    UNIT_DETECTED = "unit-detected"
    UNIT_CONTRADICTED = "unit-contradicted"
    RATE_STATED = "rate-stated"
    RATE_CONTRADICTED = "rate-contradicted"
    TIME_WRAPPED = "time-wrapped"
    EVEN_CLOCK = "even-clock"
    TIMESTAMPS_KEPT = "timestamps-kept"
    CLOCK_UNDECIDED = "clock-undecided"
    SAMPLES_LOST = "samples-lost"
    LOSSES_POSSIBLE = "losses-possible"
    GRAVITY_MISSING = "gravity-missing"
    TEMPERATURE_IMPLAUSIBLE = "temperature-implausible"
    # segment
    POSE_SETTLING = "pose-settling"
    BIAS_SETTLING = "bias-settling"
    POSE_DISTURBED = "pose-disturbed"
    POSE_UNSTEADY = "pose-unsteady"
    POSES_VIBRATE = "poses-vibrate"
    POSE_AT_RANGE_LIMIT = "pose-at-range-limit"
    FEW_POSES = "few-poses"
    NOT_STATIC = "not-static"
    # calibrate
    GRAVITY_DEFAULTED = "gravity-defaulted"
    LEFT_HANDED = "left-handed"
    NOT_OBSERVABLE = "not-observable"
    WEAKLY_OBSERVABLE = "weakly-observable"
    RESIDUAL_ABOVE_NOISE = "residual-above-noise"
    HELD_OUT_WORSE = "held-out-worse"
    NONLINEAR_RESIDUAL = "nonlinear-residual"
    OUTLIER_POSE = "outlier-pose"
    OUTLIER_MOVE = "outlier-move"
    TABLE_TILT = "table-tilt"
    TURN_NOT_A_MULTIPLE = "turn-not-a-multiple"
    TURN_UNCHECKED = "turn-unchecked"
    TURN_ANGLE_UNKNOWN = "turn-angle-unknown"
    BIAS_DRIFT = "bias-drift"
    GYRO_BIAS_DRIFT = "gyro-bias-drift"
    GYRO_G_SENSITIVITY = "gyro-g-sensitivity"
    NOT_CONVERGED = "not-converged"
    TURNTABLE = "turntable"
    GYROSCOPE_LEFT_OUT = "gyroscope-left-out"
    # diagnose, extended calibration
    EFFECTS_MODELLED = "effects-modelled"
    EFFECT_NOT_APPLIED = "effect-not-applied"
    # reference
    REFERENCE_NOT_INDEPENDENT = "reference-not-independent"
    REFERENCE_APART = "reference-apart"
    REFERENCE_MISFIT = "reference-misfit"
    REFERENCE_OUTLIERS = "reference-outliers"
    REFERENCE_UPSIDE_DOWN = "reference-upside-down"
    REFERENCE_TURNED_ROUND = "reference-turned-round"
    REFERENCE_OF_ITSELF = "reference-of-itself"
    REFERENCE_ONLY = "reference-only"
    # noise for a filter
    FILTER_NOISE_STATIC = "filter-noise-static"
    FILTER_NOISE_NO_STATIC = "filter-noise-no-static"
    FILTER_NOISE_OTHER_STATIC = "filter-noise-other-static"
    FILTER_NOISE_BELOW_QUIETEST = "filter-noise-below-quietest"
    FILTER_NOISE_NOT_SEPARATED = "filter-noise-not-separated"
    FILTER_NOISE_FOLLOWED = "filter-noise-followed"
    FILTER_NOISE_INCONSISTENT = "filter-noise-inconsistent"
    FILTER_NOISE_UNCERTAIN = "filter-noise-uncertain"
    FILTER_NOISE_UNSETTLED = "filter-noise-unsettled"
    FILTER_NOISE_UNCALIBRATED = "filter-noise-uncalibrated"
    ACCELEROMETER_NOMINAL = "accelerometer-nominal"
    SHARED_MOTION = "shared-motion"
    # many recordings, temperature
    PARAMETERS_CHANGED = "parameters-changed"
    SEVERAL_DEVICES = "several-devices"
    FEW_SESSIONS = "few-sessions"
    SESSION_LEFT_OUT = "session-left-out"
    OUTSIDE_VALID_RANGE = "outside-valid-range"
    TEMPERATURE_MISSING = "temperature-missing"
    # apply
    STATIC_FORCE = "static-force"
    CALIBRATION_DOUBTED = "calibration-doubted"
    # verify, check
    CALIBRATION_SHIFT = "calibration-shift"
    STATIC_RATE_ABOVE_NOISE = "static-rate-above-noise"
    WORSE_THAN_UNCALIBRATED = "worse-than-uncalibrated"
    LIMIT_EXCEEDED = "limit-exceeded"
    NOT_TESTED = "not-tested"
    CALIBRATION_IMPRECISE = "calibration-imprecise"
    SAME_RECORDING = "same-recording"
    NOT_FIT = "not-fit"
    # noise
    LOG_JUMP = "log-jump"
    LOG_IMPACT = "log-impact"
    LOG_DRIFT = "log-drift"
    LOG_MOTION = "log-motion"
    LOG_TOO_SHORT = "log-too-short"
    LOG_TURNED = "log-turned"
    TWO_LEVELS = "two-levels"
    TEMPERATURE_DRIVEN = "temperature-driven"
    SPECTRAL_LINE = "spectral-line"
    SPECTRUM_LOW_PASS = "spectrum-low-pass"
    SPECTRUM_UNEXPLAINED = "spectrum-unexplained"
    CURVE_ALONE = "curve-alone"
    SLOW_NOISE_UNRESOLVED = "slow-noise-unresolved"
    QUANTISATION_DEAD = "quantisation-dead"
    STRETCHES_EXCLUDED = "stretches-excluded"
    # kalman
    INNOVATIONS_TOO_LARGE = "innovations-too-large"
    INNOVATIONS_TOO_SMALL = "innovations-too-small"
    INNOVATIONS_CORRELATED = "innovations-correlated"
    NOISE_ASSUMED = "noise-assumed"
    SCALE_NOT_NOMINAL = "scale-not-nominal"
    POSE_NOT_A_FACE = "pose-not-a-face"


@dataclass(frozen=True)
class Finding(Frozen, Plain):
    """One problem or remark about a log or a result.

    Attributes
    ----------
    code : FindingCode
        Keeps its meaning from version to version.
    severity : Severity
        ``note``, ``warning`` or ``serious`` (not to be trusted).
    seen, cause, action : str
        One sentence with number and place; the likely cause; what to do next.
    numbers : mapping of name to float
        The figures of the sentence for machines (SI units, the unit ends the key: ``gap_s``).

    Examples
    --------
    >>> all(finding.seen.endswith(".") for finding in result.findings)
    True
    """

    code: FindingCode
    severity: Severity
    seen: str
    cause: str = ""
    action: str = ""
    numbers: MappingProxyType[str, float] = field(default_factory=lambda: MappingProxyType({}))

    def __post_init__(self) -> None:
        object.__setattr__(self, "code", word_of("code", self.code, FindingCode))
        object.__setattr__(self, "severity", word_of("severity", self.severity, Severity))
        for name in ("seen", "cause", "action"):
            kind_of(name, getattr(self, name), str)
        kind_of("numbers", self.numbers, dict, MappingProxyType)
        freeze(self)

    @classmethod
    def of(
        cls,
        code: FindingCode,
        case: str = "",
        /,
        *,
        severity: Severity | None = None,
        numbers: Mapping[str, float] | None = None,
        **values: Any,
    ) -> Finding:
        """A finding by code and values (SI); severity and sentences are from the catalogue (``report/findings``).

        ``case`` selects between the sentences of one code, ``severity`` replaces the default where the catalogue allows
        two, ``numbers`` are figures for machines whose names depend on the recording. A stage writes no sentences: they
        are looked up here.

        Raises KeyError when the catalogue lacks the case, or a placeholder of its sentences has no value.
        """
        severity, seen, cause, action = ask("words_of", code, case, severity, values)
        plain = {name: float(v) for name, v in values.items() if isinstance(v, Real) and not isinstance(v, bool)}
        # An infinite value or NaN means not estimated, and JSON cannot hold it.
        figures = {name: v for name, v in (plain | dict(numbers or {})).items() if math.isfinite(v)}
        return cls(code, severity, seen, cause, action, MappingProxyType(figures))

    def __str__(self) -> str:
        return f"{self.severity.value}: {self.seen}" + (f" {self.action}" if self.action else "")


class HasFindings(Protocol):
    @property
    def findings(self) -> tuple[Finding, ...]: ...


class Judged:
    """A record whose findings decide whether it is to be trusted."""

    @property
    def is_trustworthy(self: HasFindings) -> bool:
        """True without a serious finding."""
        return not any(finding.severity is Severity.SERIOUS for finding in self.findings)
