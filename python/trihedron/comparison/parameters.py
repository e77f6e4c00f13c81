"""Parameters of a given model against those of the recording, by group (docs/diagnosis-method.md, section 9)."""

import math
from collections.abc import Mapping
from dataclasses import dataclass
from types import MappingProxyType
from typing import Literal

import numpy as np

from trihedron.arrays import AXES, TINY, FloatArray, rms_of, sigmas_of
from trihedron.comparison.fitted import FittedModel, FittedSensor
from trihedron.estimate.sessions.changes import DRIFT_DOF, holm
from trihedron.invariants import PAIRS, Invariants, invariants, rotation_vector, triad_jacobian, triad_rotation
from trihedron.probability import STRONG, chdtri, fdtrc
from trihedron.records.diagnosis import RELATIVE, ParameterDifference
from trihedron.records.words import words
from trihedron.session.noise import NOISE_DOF
from trihedron.units import STANDARD_GRAVITY_M_S2

Sensor = Literal["accelerometer", "gyroscope", "both"]

RANGE_TOLERANCE = 0.05
"""A ratio of sensitivities within 5 % of a power of two on all axes is another range setting: parts do not vary by a
factor of 1.9, and ranges are powers of two."""
MISTAKEN_UNITS: Mapping[str, tuple[tuple[float, str, str], ...]] = MappingProxyType(
    {
        "accelerometer": (
            (1.0 / STANDARD_GRAVITY_M_S2, "g", "m/s²"),
            (STANDARD_GRAVITY_M_S2, "m/s²", "g"),
            (1e3, "mm/s²", "m/s²"),
            (1e-3, "g", "mg"),
        ),
        "gyroscope": ((math.degrees(1.0), "degrees", "radians"), (math.radians(1.0), "radians", "degrees")),
    }
)
"""Reading over truth where a reading written in the first unit is read as the second."""
WOULD_SHOW = 0.1
"""Uncertainty of a model's biases, relative to the rms of the recording's, below which missing biases are noticed."""
ADRIFT = 1e-9
"""Variance, relative to its group's largest, below which a covariance counts as zero."""

NOTHING_OPEN: Mapping[str, float] = MappingProxyType({})


@dataclass(frozen=True, eq=False)
class _Group:
    """One group of parameters by id: (n,) model, recording, difference, and its covariance (n, n)."""

    id: str
    sensor: Sensor
    names: tuple[str, ...]
    model: FloatArray
    recording: FloatArray
    difference: FloatArray
    covariance: FloatArray
    unit: str
    dof: float = NOISE_DOF
    remark: str = ""
    is_relative: bool = False

    @property
    def p_value(self) -> float:
        """d'C⁻¹d/n ~ F(n, dof)."""
        n = len(self.difference)
        ridge = ADRIFT * max(float(np.trace(self.covariance)) / n, TINY)
        distance = float(self.difference @ np.linalg.solve(self.covariance + ridge * np.eye(n), self.difference))
        return max(float(fdtrc(n, self.dof, distance / n)), TINY)


@dataclass(frozen=True)
class CommonFactor:
    """A sensor whose readings are ``factor`` times as large in the recording, on all axes: another range or unit.

    ``written`` and ``taken`` name the units where one side (``side``, empty if unknown) writes the first and is read as
    the second; both are empty for another range.
    """

    sensor: Sensor
    factor: float
    written: str = ""
    taken: str = ""
    side: Literal["", "model", "recording"] = ""


@dataclass(frozen=True)
class ComparedNumbers:
    """Differences of all parameters, significant or not, and common factors of the scales."""

    parameters: tuple[ParameterDifference, ...]
    factors: tuple[CommonFactor, ...]


def compare_numbers(
    model: FittedModel,
    recording: FittedModel,
    *,
    alpha: float,
    linear: FittedModel | None = None,
    left_open: Mapping[str, float] = NOTHING_OPEN,
) -> ComparedNumbers:
    """Compare the parameters of the given ``model`` with those of the fit of the ``recording`` with its effects.

    ``alpha`` is the chance that any group of one unit on one day is called different; half of it is used here (Holm).
    ``linear`` is the recording's fit without effects: a linear calibration absorbs part of an effect that it does not
    contain, and a group counts only where it differs from this fit too. ``left_open`` are groups whose reference an
    accepted effect leaves undefined by so much: a smaller difference is no evidence, its p is 1.
    """
    groups, factors = _groups(model, recording)
    p = np.array([group.p_value for group in groups])
    if linear is not None:
        beside = {group.id: group.p_value for group in _groups(model, linear)[0]}
        p = np.array([max(value, beside.get(group.id, 0.0)) for value, group in zip(p, groups, strict=True)])
    is_judged = [float(np.abs(group.difference).max()) > left_open.get(group.id, 0.0) for group in groups]
    p = np.where(is_judged, p, 1.0)
    significant = holm(p) <= alpha / 2.0
    out: list[ParameterDifference] = []
    for group, p_value, is_significant in zip(groups, p.tolist(), significant.tolist(), strict=True):
        named = _as_gravity(group, alpha) if is_significant and group.id == "accel-scale" else group
        sigma = sigmas_of(named.covariance)
        remark = named.remark if is_significant or named.is_relative else ""
        # Scales were compared by their logarithms.
        apart = np.expm1(named.difference) if named.id in RELATIVE else named.difference
        values = (v.tolist() for v in (named.model, named.recording, apart, sigma))
        out += [
            ParameterDifference(
                named.id, named.sensor, name, before, after, change, s, named.unit, p_value, is_significant, remark
            )
            for name, before, after, change, s in zip(named.names, *values, strict=True)
        ]
    return ComparedNumbers(tuple(out), factors)


def _groups(model: FittedModel, recording: FittedModel) -> tuple[list[_Group], tuple[CommonFactor, ...]]:
    C_m, C_r = model.covariance, recording.covariance
    groups, factor = _sensor("accel", (model.accelerometer, C_m[:12, :12]), (recording.accelerometer, C_r[:12, :12]))
    factors = [factor]
    if model.gyroscope is not None and recording.gyroscope is not None:
        more, factor = _sensor("gyro", (model.gyroscope, C_m[12:, 12:]), (recording.gyroscope, C_r[12:, 12:]))
        groups += [
            *more,
            _triads((model.accelerometer, model.gyroscope, C_m), (recording.accelerometer, recording.gyroscope, C_r)),
        ]
        factors.append(factor)
    return groups, tuple(one for one in factors if one is not None)


def _sensor(
    prefix: Literal["accel", "gyro"], model: tuple[FittedSensor, FloatArray], recording: tuple[FittedSensor, FloatArray]
) -> tuple[list[_Group], CommonFactor | None]:
    """Bias, scale and misalignment of one sensor, and the common factor of its scales where it is recognised; both
    sides with the covariance (12, 12) of S and b."""
    (given, C_given), (seen, C_seen) = model, recording
    a, r = invariants(given.S, given.b), invariants(seen.S, seen.b)
    spread = given.spread(C_given)
    covariance = spread + seen.spread(C_seen)
    # A calibration file has no bias change between sessions: that of the recording is used.
    before = given.drift if np.any(given.drift) else seen.drift
    covariance[:3, :3] += np.diag(before + seen.drift)
    sensor: Sensor = "accelerometer" if prefix == "accel" else "gyroscope"
    unit = "m/s^2" if prefix == "accel" else "rad/s"
    log_m, log_r = a.log_scale, r.log_scale
    sizes: tuple[float, float] | None = None
    is_same_unit = given.unit == seen.unit
    if given.si is not None and seen.si is not None:
        in_si = log_m + math.log(given.si), log_r + math.log(seen.si)
        # ln of reading over truth: zero for a healthy sensor.
        sizes = float(np.median(in_si[0])), float(np.median(in_si[1]))
        log_m, log_r = (log_m, log_r) if is_same_unit else in_si
    # Counts against SI: only differences between axes can be compared.
    is_relative = not is_same_unit and sizes is None
    if is_relative:
        log_m, log_r = log_m - log_m.mean(), log_r - log_r.mean()
    common = _common_factor(sensor, log_r - log_m, sizes)
    if common is not None:
        log_m = log_m + math.log(common.factor)
    of_scale = covariance[3:6, 3:6]
    if is_relative:
        centre = np.eye(3) - np.ones((3, 3)) / 3.0
        of_scale = centre @ of_scale @ centre.T + np.ones((3, 3)) * np.trace(of_scale) / 3.0
    pairs = tuple(AXES[i] + AXES[j] for i, j in PAIRS)
    # S is SI per raw unit: a larger count for the same truth has the smaller S, so a scale is -ln k.
    groups = [
        _Group(f"{prefix}-bias", sensor, AXES, a.bias, r.bias, r.bias - a.bias, covariance[:3, :3], unit,
               2.0 * DRIFT_DOF, _never_added(prefix, a.bias, r.bias, spread, given.drift)),
        _Group(
            f"{prefix}-scale", sensor, AXES, np.exp(log_m), np.exp(log_r), log_r - log_m, of_scale, "1",
            remark=_relative_to(prefix, a, r, is_recording=seen.si is None) if is_relative else "",
            is_relative=is_relative,
        ),
        _Group(f"{prefix}-misalignment", sensor, pairs, a.angle, r.angle, r.angle - a.angle, covariance[6:, 6:], "rad"),
    ]  # fmt: skip
    return groups, common


def _never_added(
    prefix: str, model: FloatArray, recording: FloatArray, covariance: FloatArray, drift: FloatArray
) -> str:
    """Remark for a model whose biases are all zero within their uncertainty, where the recording's would be seen."""
    sigma = np.sqrt(np.maximum(np.diag(covariance)[:3] + drift, TINY))
    is_none = float(np.sum((model / sigma) ** 2)) < chdtri(3.0, 1.0 / STRONG)
    would_show = bool(np.all(sigma < WOULD_SHOW * rms_of(recording)))
    name = "accelerometer" if prefix == "accel" else "gyro"
    return words("biases-never-added", sensor=name) if is_none and would_show else ""


def _relative_to(prefix: str, a: Invariants, r: Invariants, *, is_recording: bool) -> str:
    """Remark that scales of counts and of SI have no common factor to compare, and the size of a count."""
    counts, side = (r, "recording") if is_recording else (a, "model")
    per_si = math.exp(float(counts.log_scale.mean()))
    if prefix == "gyro":
        return words("gyro-scales-relative", side=side, per_deg_s=per_si * math.radians(1.0))
    return words("accelerometer-scales-relative", side=side, per_g=per_si * STANDARD_GRAVITY_M_S2)


def _common_factor(sensor: Sensor, change: FloatArray, sizes: tuple[float, float] | None) -> CommonFactor | None:
    """The misread unit or the power of two by which all scales differ; ``change`` (3,) is Δ ln k."""

    def is_near(factor: float) -> bool:
        return bool(np.all(np.abs(change - math.log(factor)) < RANGE_TOLERANCE))

    for times, written, taken in MISTAKEN_UNITS[sensor]:
        if is_near(times) and (sizes is None or abs(sizes[1]) > abs(sizes[0])):
            return CommonFactor(sensor, times, written, taken, "" if sizes is None else "recording")
        if sizes is not None and is_near(1.0 / times) and abs(sizes[0]) > abs(sizes[1]):
            return CommonFactor(sensor, 1.0 / times, written, taken, "model")
    nearest = round(float(np.median(change)) / math.log(2.0))
    return CommonFactor(sensor, 2.0**nearest) if nearest and is_near(2.0**nearest) else None


def _triads(*sides: tuple[FittedSensor, FittedSensor, FloatArray]) -> _Group:
    """The rotation of the gyro triad against the accelerometer triad: ``log(R_r R_mᵀ)``; ``sides`` model, recording."""
    zero = np.zeros(3)
    turned = [triad_rotation(invariants(accel.S, zero), invariants(gyro.S, zero)) for accel, gyro, _ in sides]
    covariance = np.zeros((3, 3))
    for accel, gyro, of_both in sides:
        J = triad_jacobian(accel.S, gyro.S)
        covariance += J @ of_both @ J.T
    difference = rotation_vector(turned[1] @ turned[0].T)
    before, after = rotation_vector(turned[0]), rotation_vector(turned[1])
    return _Group("triad-alignment", "both", AXES, before, after, difference, covariance, "rad")


def _as_gravity(scale: _Group, alpha: float) -> _Group:
    """The group, or one of gravity where all accelerometer scales changed alike: the two are confounded."""
    ones = np.ones(3)
    weight = np.linalg.inv(scale.covariance + ADRIFT * np.trace(scale.covariance) * np.eye(3))
    variance = 1.0 / float(ones @ weight @ ones)
    common = variance * float(ones @ weight @ scale.difference)
    rest = scale.difference - common
    unlike = float(rest @ weight @ rest) / 2.0
    if fdtrc(2.0, NOISE_DOF, unlike) < alpha:
        return scale
    return _Group(
        "gravity", "accelerometer", ("common scale",), np.ones(1), np.exp([common]), np.array([common]),
        np.array([[variance]]), "1",
    )  # fmt: skip
