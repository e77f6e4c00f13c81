"""Records and functions that formats of other programs share: options, noise, temperature, headings, parsed results."""

from collections.abc import Callable, Mapping, Sequence
from dataclasses import dataclass, replace
from types import MappingProxyType

import numpy as np
import numpy.typing as npt

from trihedron.arrays import AXES, FloatArray
from trihedron.errors import InputError
from trihedron.files.plausible import LARGEST_SI_FACTOR, has_one_handedness
from trihedron.records import Calibration, SensorCalibration
from trihedron.sensor_model import axis_scales
from trihedron.thermal_model import parameters_at
from trihedron.units import (
    STANDARD_GRAVITY_M_S2,
    AccelerationUnit,
    RateUnit,
    acceleration_lsb_to_si,
    acceleration_to_si,
    degrees_from_radians,
    mg_from_m_s2,
    mm_s2_from_m_s2,
    rate_lsb_to_si,
    rate_to_si,
)

LARGEST_LSB_RATIO = 1.1
"""Ratio of nominal and calibrated LSB above which they are of another range or part: parts are within 10 % of data
sheets, and their scales as a rule within 3 %."""


@dataclass(frozen=True)
class NoiseFigure:
    """One noise term of one sensor, SI, one number for its axes; an upper limit (``is_limit``) if not detected."""

    value: float
    is_limit: bool = False


@dataclass(frozen=True)
class SensorNoise:
    """White density N [SI/√Hz] and random walk K [SI/√s]."""

    N: NoiseFigure
    K: NoiseFigure


@dataclass(frozen=True)
class Thermal:
    """Temperature dependence of a bias: ``sum_n c_n (T - reference)^n``, n = 1 to 3, is added to the readings.

    ``coefficients`` (3, 3): row per order 1 to 3, column per axis. ``misfit`` is the largest residual of the cubic,
    ``scale`` the largest relative change of S over ``range_degc``; a file cannot represent either.
    """

    reference_degc: float
    coefficients: FloatArray
    range_degc: tuple[float, float] | None
    misfit: float = 0.0
    scale: float = 0.0


@dataclass(frozen=True)
class ExportOptions:
    """Content of another program's file besides S and b.

    ``accelerometer_noise``, ``gyroscope_noise`` from a static log; ``rate_hz`` of the samples; ``topic`` on which they
    are published; ``accel_lsb``, ``gyro_lsb`` the LSB that the target's driver assumes (``3.33 mg``);
    ``current_parameters`` the text of a file with the flight controller's parameters during the log.
    """

    accelerometer_noise: SensorNoise | None = None
    gyroscope_noise: SensorNoise | None = None
    rate_hz: float | None = None
    topic: str = "/imu0"
    accel_lsb: str = ""
    gyro_lsb: str = ""
    current_parameters: str = ""


@dataclass(frozen=True)
class Format:
    """One file format. ``write`` returns text, or text by file name ending; ``read`` a calibration, or ``None`` where
    the text is of another format. With ``in_si`` the target expects readings in SI. ``pair`` are the parts of two file
    names that differ where each sensor has a file; their texts are read as one, separated by a form feed."""

    name: str
    write: Callable[[Calibration, ExportOptions], str | dict[str, str]]
    read: Callable[[str], Calibration | None] | None = None
    in_si: bool = False
    pair: tuple[str, str] | None = None


def of_si_readings(calibration: Calibration, target: str, options: ExportOptions) -> Calibration:
    """The calibration for readings that the target's driver converts to SI.

    Raises ``InputError`` when it is for counts and the LSB is not given, or is another than the calibrated one.
    """
    made, unsaid = {}, []
    for name, sensor in calibration.sensors:
        found = float(np.exp(np.mean(np.log(np.linalg.norm(sensor.S, axis=0)))))
        if name == "accelerometer":
            unit, lsb = acceleration_to_si(AccelerationUnit(sensor.raw_unit)), options.accel_lsb
            lsb_to_si, option, size = acceleration_lsb_to_si, "--accel-lsb", f"{mg_from_m_s2(found):.3g} mg"
        else:
            unit, lsb = rate_to_si(RateUnit(sensor.raw_unit)), options.gyro_lsb
            lsb_to_si, option, size = rate_lsb_to_si, "--gyro-lsb", f"{degrees_from_radians(found):.3g} deg/s"
        if unit is None and not lsb:
            unsaid.append(f"{option} '{size}'")
            continue
        nominal = lsb_to_si(lsb) if unit is None else unit
        if unit is None and not 1.0 / LARGEST_LSB_RATIO <= nominal / found <= LARGEST_LSB_RATIO:
            raise InputError(
                f"{option} '{lsb}' is {nominal / found:.3g} times the {size} per count that this calibration found: "
                f"state the size of a count at the range that {target}'s driver sets, the one of this log."
            )
        made[name] = _rescaled(sensor, nominal)
    if unsaid:
        raise InputError(
            f"{target} expects readings in SI and this calibration maps counts: state the data sheet's size of a "
            f"count, as its driver assumes it, near what was calibrated: {' '.join(unsaid)}; or export to c, rust or "
            "python."
        )
    return replace(calibration, **made)  # type: ignore[arg-type]


def _rescaled(sensor: SensorCalibration, unit: float) -> SensorCalibration:
    scale = np.r_[np.full(9, 1.0 / unit), np.ones(3)]
    covariance = sensor.covariance * np.outer(scale, scale)
    return replace(sensor, S=sensor.S / unit, covariance=covariance, raw_unit=sensor.si_unit)


def heading(
    calibration: Calibration, equation: str, held: tuple[str, ...] = (), corrected_in: str = "", read_in: str = ""
) -> list[str]:
    """Comments at the head of a file: source, equation, units (those of the calibration unless the target has its own),
    trust, and effects it lacks, except those ``held``."""
    sensors = [sensor for _, sensor in calibration.sensors]
    rows = [
        f"Calibration of {calibration.recording_source or 'an unnamed recording'}, written by trihedron.",
        equation,
        f"Readings in: {read_in or ', '.join(sensor.raw_unit for sensor in sensors)}. "
        f"Corrected in: {corrected_in or ', '.join(sensor.si_unit for sensor in sensors)}.",
    ]
    if not calibration.is_trustworthy:
        rows.append("NOT TO BE TRUSTED: see the findings of the calibration.")
    if not has_one_handedness(calibration):
        rows.append("One of the triads is mirrored against the other: check the signs of the axes before use.")
    effects = [effect for effect in effect_ids(calibration) if effect not in held]
    if effects:
        rows.append(f"Not in this file, which has no fields for these effects: {', '.join(effects)}.")
    if "thermal" not in held:
        rows += lost_temperature(calibration)
    return [row.replace("\n", " ").replace("\r", " ") for row in rows]


def effect_ids(calibration: Calibration) -> list[str]:
    """Ids of the effects of an extended calibration."""
    effects = calibration.extensions.get("effects")
    return [str(effect["id"]) for effect in effects] if isinstance(effects, list | tuple) else []


def effect_parameters(calibration: Calibration, effect_id: str) -> dict[str, float]:
    """Parameters by name of one effect of an extended calibration; empty where it lacks the effect."""
    effects = calibration.extensions.get("effects")
    for effect in effects if isinstance(effects, list | tuple) else ():
        if effect["id"] == effect_id:
            return {str(p["name"]): float(p["value"]) for p in effect["parameters"] if p["value"] is not None}
    return {}


def thermal_of(calibration: Calibration, name: str) -> Thermal | None:
    """Temperature dependence of a sensor's bias in raw units, from the effects of one recording or of several.

    An effect is ``v (T - reference)`` on an axis in SI, which changes the reading by v times the axis's sensitivity.
    """
    sensor = getattr(calibration, name)
    if sensor is None:
        return None
    limits = calibration.extensions.get("valid_range")
    stated = limits.get("temperature_degc") if isinstance(limits, Mapping) else None
    range_degc = None if stated is None else (float(stated[0]), float(stated[1]))
    if "thermal" in calibration.extensions and range_degc is not None:
        return _through_sessions(calibration, name, range_degc)
    values = effect_parameters(calibration, f"{'accel' if name == 'accelerometer' else 'gyro'}-thermal-bias")
    if not values:
        return None
    references = calibration.extensions.get("references", {})
    reference = float(references.get("temperature_degc", 25.0)) if isinstance(references, Mapping) else 25.0
    coefficients = np.zeros((3, 3))
    for order, symbol in enumerate(("bias_per_kelvin", "bias_per_kelvin2", "bias_per_kelvin3")):
        coefficients[order] = [values.get(f"{symbol}_{axis}", 0.0) for axis in AXES]
    return Thermal(reference, coefficients / axis_scales(sensor.S), range_degc)


def _through_sessions(calibration: Calibration, name: str, range_degc: tuple[float, float]) -> Thermal | None:
    """A cubic fitted to the raw readings at zero input; exact where the bias is a cubic and S is constant."""
    thermal = calibration.extensions["thermal"]
    reference = float(thermal["reference_degc"])  # type: ignore[index]
    own = slice(0, 12) if name == "accelerometer" else slice(12, 24)

    def at(degc: float) -> tuple[FloatArray, FloatArray]:
        parameters = parameters_at(calibration, degc)[own]
        S = parameters[:9].reshape(3, 3)
        return S, np.asarray(-np.linalg.solve(S, parameters[9:]), dtype=np.float64)

    S0, zero = at(reference)
    knots = np.linspace(*range_degc, 33)
    seen = [at(float(degc)) for degc in knots]
    half = max(float(np.abs(knots - reference).max()), 1e-9)
    u = (knots - reference) / half
    powers = u[:, None] ** np.arange(1, 4)
    wanted = np.array([one - zero for _, one in seen])
    scaled = np.linalg.lstsq(powers, wanted, rcond=None)[0]
    misfit = float(np.abs(wanted - powers @ scaled).max())
    scale = max(float(np.abs(np.linalg.solve(S0, S) - np.eye(3)).max()) for S, _ in seen)
    coefficients = scaled / half ** np.arange(1, 4)[:, None]
    return Thermal(reference, coefficients, range_degc, misfit, scale)


def lost_temperature(calibration: Calibration) -> list[str]:
    """Sentences, with sizes, on the temperature dependence that a file of constants cannot represent."""
    said = []
    for name, sensor in calibration.sensors:
        thermal = thermal_of(calibration, name)
        if thermal is None or thermal.range_degc is None:
            continue
        t = np.linspace(*thermal.range_degc, 33)[:, None] - thermal.reference_degc
        moved = sum(t ** (n + 1) * thermal.coefficients[n] for n in range(3))
        bias = float(np.abs(np.asarray(moved) @ sensor.S.T).max())
        size = (
            f"{mm_s2_from_m_s2(bias):.3g} mm/s^2"
            if name == "accelerometer"
            else f"{degrees_from_radians(bias):.3g} deg/s"
        )
        said.append(
            f"This file contains the {name} at {thermal.reference_degc:.1f} degC: its change from "
            f"{thermal.range_degc[0]:.1f} to {thermal.range_degc[1]:.1f} degC is lost, up to {size} of bias and "
            f"{100 * thermal.scale:.2g} % of scale."
        )
    return said


def row(values: npt.NDArray[np.floating]) -> str:
    """Numbers with all digits, separated by commas."""
    return ", ".join(number(float(v)) for v in values)


def number(value: float) -> str:
    """All digits of a number, with a decimal point: YAML 1.1 reads ``4e-05`` as a string."""
    text = repr(value + 0.0)
    return text.replace("e", ".0e") if "e" in text and "." not in text else text


def short(value: float) -> str:
    """A number with four digits, which is finer than the interval of any noise."""
    return number(float(f"{value:.4g}"))


def matrix_rows(values: FloatArray, indent: int) -> list[str]:
    """Rows of a matrix as a YAML sequence of sequences."""
    return [f"{' ' * indent}- [{row(r)}]" for r in values]


def given(
    maker: str,
    sensors: Mapping[str, tuple[FloatArray, FloatArray]],
    *,
    units: Mapping[str, str] | None = None,
    without_bias: Sequence[str] = (),
    g_sensitivity: FloatArray | None = None,
    **more: object,
) -> Calibration:
    """A calibration from another program's file: ``(S, b)`` by sensor, without uncertainty.

    ``units`` are those of the readings; where the file does not state them, SI is assumed for scales near 1 and counts
    for others. ``without_bias`` names sensors whose bias the file lacks. ``more`` is added to the extensions.
    """
    made = {}
    for name, (S, b) in sensors.items():
        si = "m/s^2" if name == "accelerometer" else "rad/s"
        sizes = np.linalg.svd(np.asarray(S, dtype=np.float64), compute_uv=False)
        is_si = sizes[0] <= LARGEST_SI_FACTOR and sizes[-1] >= 1.0 / LARGEST_SI_FACTOR
        raw = (units or {}).get(name) or (si if is_si else "counts")
        made[name] = SensorCalibration(S, b, np.zeros((12, 12)), raw, si, f"file of {maker}")
    extensions: dict[str, object] = {"maker": maker, **more}
    if without_bias:
        extensions["without_bias"] = tuple(without_bias)
    if g_sensitivity is not None and np.any(g_sensitivity):
        values = [float(v) for v in g_sensitivity.ravel()]
        names = [f"G_{i}{j}" for i in AXES for j in AXES]
        parameters = [{"name": name, "value": value} for name, value in zip(names, values, strict=True)]
        model = {"variant": "", "values": values}
        extensions["effects"] = [{"id": "gyro-g-sensitivity", "parameters": parameters, "model": model}]
    gyro = made.get("gyroscope")
    return Calibration(
        accelerometer=made["accelerometer"],
        gyroscope=gyro,
        covariance=np.zeros((12, 12) if gyro is None else (24, 24)),
        frame="case",
        gravity_m_s2=STANDARD_GRAVITY_M_S2,
        gravity_source="standard gravity; the file states none",
        extensions=MappingProxyType(extensions),
    )
