"""Shared by ArduPilot and PX4: parameters read from files and logs, and their composition with a calibration.

Both correct in the sensor's axes and rotate the result to the board's axes: ``R (s o (r - p(T) - o))``. Readings of a
log are corrected by that already; the exported offsets and scales replace those of the log, so that
``R (s' o (r - p'(T) - o'))`` equals the calibration applied to the log.
"""

from collections.abc import Callable, Mapping
from dataclasses import dataclass, replace

import numpy as np
from numpy.polynomial import polynomial

from trihedron.arrays import XYZ, FloatArray
from trihedron.errors import InputError
from trihedron.files.formats.contract import ExportOptions, Thermal, given, heading, of_si_readings, thermal_of
from trihedron.files.formats.losses import lost_to_a_diagonal
from trihedron.records import Calibration, Onboard, SensorCalibration
from trihedron.records.onboard import Autopilot
from trihedron.records.plain import as_plain, from_plain
from trihedron.sensor_model import axis_scales

_DEG_ROLL_PITCH_YAW = (
    (0, 0, 0), (0, 0, 45), (0, 0, 90), (0, 0, 135), (0, 0, 180), (0, 0, 225), (0, 0, 270), (0, 0, 315), (180, 0, 0),
    (180, 0, 45), (180, 0, 90), (180, 0, 135), (0, 180, 0), (180, 0, 225), (180, 0, 270), (180, 0, 315), (90, 0, 0),
    (90, 0, 45), (90, 0, 90), (90, 0, 135), (270, 0, 0), (270, 0, 45), (270, 0, 90), (270, 0, 135), (0, 90, 0),
    (0, 270, 0), (0, 180, 90), (0, 180, 270), (90, 90, 0), (180, 90, 0), (270, 90, 0), (90, 180, 0), (270, 180, 0),
    (90, 270, 0), (180, 270, 0), (270, 270, 0), (90, 180, 90), (90, 0, 270), (90, 68, 293), (0, 315, 0), (90, 315, 0),
)  # fmt: skip
"""Roll, pitch and yaw [deg] of MAVLink's MAV_SENSOR_ORIENTATION by number."""


@dataclass(frozen=True)
class AxisCorrection:
    """``turn (scale o (reading - thermal(T) - offset))``: (3, 3), (3,), (3,); ``thermal`` is None where disabled."""

    offset: FloatArray
    scale: FloatArray
    turn: FloatArray
    thermal: Thermal | None = None


Correction = Callable[[Onboard, str], AxisCorrection]


def orientation(number: float) -> FloatArray:
    """(3, 3) rotation from the sensor's to the board's axes for one of MAVLink's orientations.

    Raises ``InputError`` when the number is none of the fixed orientations.
    """
    if number != int(number) or not 0 <= number < len(_DEG_ROLL_PITCH_YAW):
        raise InputError(f"the board's orientation {number:g} is not one of MAVLink's fixed ones (0 to 40).")
    return euler(*_DEG_ROLL_PITCH_YAW[int(number)])


def euler(roll_deg: float, pitch_deg: float, yaw_deg: float) -> FloatArray:
    """(3, 3) rotation matrix yaw · pitch · roll, as in both autopilots."""
    c, s = np.cos(np.radians([roll_deg, pitch_deg, yaw_deg])), np.sin(np.radians([roll_deg, pitch_deg, yaw_deg]))
    roll = np.array([[1, 0, 0], [0, c[0], -s[0]], [0, s[0], c[0]]])
    pitch = np.array([[c[1], 0, s[1]], [0, 1, 0], [-s[1], 0, c[1]]])
    yaw = np.array([[c[2], -s[2], 0], [s[2], c[2], 0], [0, 0, 1]])
    return np.asarray(yaw @ pitch @ roll)


def parameters_in(text: str) -> dict[str, float]:
    """Values by name from a parameter file: ``NAME,VALUE``, ``NAME VALUE`` or QGroundControl's five columns."""
    out: dict[str, float] = {}
    for line in text.splitlines():
        words = line.partition("#")[0].replace(",", " ").replace("=", " ").split()
        words = words[2:4] if len(words) == 5 and words[0].isdigit() and words[1].isdigit() else words[:2]
        if len(words) == 2 and words[0][:1].isalpha():
            try:
                out[words[0].upper()] = float(words[1])
            except ValueError:
                continue
    return out


def board_of(calibration: Calibration, options: ExportOptions, autopilot: str, prefix: str) -> Onboard:
    """The corrections that the board had applied to the calibrated readings.

    Raises ``InputError`` when neither the calibration nor a parameter file states them, or the log is of another
    autopilot.
    """
    name = {"ardupilot": "ArduPilot", "px4": "PX4"}[autopilot]
    stated = calibration.extensions.get("onboard")
    known = None if stated is None else from_plain(dict(stated), Onboard)  # type: ignore[call-overload]
    if known is not None and known.autopilot != autopilot:
        raise InputError(
            f"this calibration is of a log of another autopilot ({known.autopilot}), whose axes of the sensor {name} "
            f"does not share: record with {name}, or export to {known.autopilot}."
        )
    if known is not None and known.changed:
        raise InputError(
            f"{', '.join(known.changed)} changed while readings were logged: it is not known which offsets the "
            "readings carry; record again without calibrating on board meanwhile."
        )
    text = options.current_parameters
    if text.strip().lower() == "none":
        return Onboard(known.autopilot if known else autopilot, 0, 0, "raw")  # type: ignore[arg-type]
    current = {key: value for key, value in parameters_in(text).items() if key.startswith((prefix, *_SHARED))}
    if text and not any(key.startswith(prefix) for key in current):
        raise InputError(
            f"the file of current parameters contains no {prefix}...: save the parameters of the {name} board."
        )
    if known is not None:
        return replace(known, parameters={**known.parameters, **current})
    if current:
        return Onboard(autopilot, 0, 0, "body", current)  # type: ignore[arg-type]
    if calibration.accelerometer.raw_unit == "counts":
        return Onboard(autopilot, 0, 0, "raw")  # type: ignore[arg-type]
    raise InputError(
        f"{name} logs readings that its own offsets and scales have corrected, and this calibration does not say by "
        "which: add --current-parameters FILE, the parameters of the board when the log was made (.param, .parm or "
        ".params), or --current-parameters none where the readings were raw."
    )


_SHARED = ("AHRS_ORIENTATION", "SENS_BOARD_", "SENS_EN_THERMAL", "TC_")


@dataclass(frozen=True)
class Composed:
    """Offset (3,), scale (3,) and temperature dependence of one sensor for the board."""

    offset: FloatArray
    scale: FloatArray
    thermal: Thermal | None


def composed(
    calibration: Calibration, options: ExportOptions, target: str, before: Callable[[str], AxisCorrection]
) -> tuple[Calibration, dict[str, Composed]]:
    """The calibration of the sensor's uncorrected readings in its own axes, and the board's values by sensor.

    With ``logged = R (s o (r - o))``, ``truth = S logged + b`` is ``S' r + b'`` with ``S' = Rᵀ S R diag(s)`` and
    ``b' = Rᵀ b - S' o``. The offset is the reading at zero input; the scale is along the sensitive axis.

    Raises ``InputError`` when an axis is mirrored, which a positive scale cannot represent.
    """
    known = of_si_readings(calibration, target, options)
    made, out = {}, {}
    for name in ("accelerometer", "gyroscope"):
        sensor: SensorCalibration | None = getattr(known, name)
        if sensor is None:
            continue
        own = before(name)
        S = own.turn.T @ sensor.S @ own.turn * own.scale
        b = own.turn.T @ sensor.b - S @ own.offset
        if np.any(np.diag(S) <= 0.0):
            raise InputError(
                f"an axis of the {name} is mirrored against the board and {target} stores positive scales only: "
                "set the orientation of the sensor first."
            )
        made[name] = replace(sensor, S=S, b=b, covariance=_turned(sensor.covariance, own))
        thermal = thermal_of(known, name)
        if thermal is not None:
            thermal = replace(thermal, coefficients=thermal.coefficients @ (own.turn / own.scale))
        offset = np.asarray(-np.linalg.solve(S, b), dtype=np.float64)
        out[name] = Composed(offset, axis_scales(S), thermal)
    return replace(known, **made), out  # type: ignore[arg-type]


def moved_to(thermal: Thermal, reference_degc: float) -> tuple[FloatArray, FloatArray]:
    """Coefficients (3, 3) of the same polynomial about another reference temperature, and its constant (3,) there."""
    shift = reference_degc - thermal.reference_degc
    columns = []
    for axis in range(3):
        total = np.zeros(4)
        for order in range(1, 4):
            power = polynomial.polypow([shift, 1.0], order)
            total[: order + 1] += thermal.coefficients[order - 1, axis] * power
        columns.append(total)
    whole = np.array(columns).T
    return whole[1:], whole[0]


def _turned(covariance: FloatArray, own: AxisCorrection) -> FloatArray:
    """(12, 12) covariance of ``Rᵀ S R diag(s)`` and ``Rᵀ b``, without the term S' o: only that of S is used."""
    J = np.zeros((12, 12))
    J[:9, :9] = np.kron(own.turn.T, (own.turn * own.scale).T)
    J[9:, 9:] = own.turn.T
    return np.asarray(J @ covariance @ J.T)


def against_log(
    held: Onboard, known: Onboard, correction: Correction, turns: str
) -> dict[str, tuple[FloatArray, FloatArray]]:
    """S and b by sensor that convert readings logged with parameters ``known`` to those of a board with ``held``.

    ``turns`` begins the names of the parameters that rotate the sensor's axes to the board's.
    """
    kept = {name: value for name, value in known.parameters.items() if name.startswith(turns)}
    there = Onboard(held.autopilot, known.accel, known.gyro, known.stage, {**kept, **held.parameters})
    out = {}
    for name in ("accelerometer", "gyroscope"):
        new, old = correction(there, name), correction(known, name)
        S = (new.turn * (new.scale / old.scale)) @ old.turn.T
        out[name] = (S, new.turn @ (new.scale * (old.offset - new.offset)))
    return out


def held_by(
    text: str, needed: set[str], autopilot: Autopilot, correction: Callable[[Onboard, str], AxisCorrection]
) -> Calibration | None:
    """The first IMU's parameters as a calibration of readings in the sensor's axes; None without those needed."""
    parameters = parameters_in(text)
    if not needed <= parameters.keys():
        return None
    board = Onboard(autopilot, 0, 0, "corrected", parameters)
    pairs = {}
    for name in ("accelerometer", "gyroscope"):
        own = correction(board, name)
        pairs[name] = np.diag(own.scale), -own.scale * own.offset
    return given(autopilot, pairs, board_parameters=as_plain(board))


def about(own: Calibration, board: Onboard, equation: str, turns: str) -> list[str]:
    """Comments at the head of the file, on the corrections of the log's readings and on the board's orientation too."""
    held = ("accel-thermal-bias", "gyro-thermal-bias", "thermal")
    said = [
        "The log's readings had been corrected on board; these values include that correction and replace it.",
        f"They hold for {turns}; load all of them, once.",
    ]
    if board.stage == "raw":
        said = ["The readings were raw: these values replace those of the board, in the sensor's axes as logged."]
    return [f"# {line}" for line in (*heading(own, equation, held), *lost_to_a_diagonal(own), *said)]


def range_lines(new: Thermal, held: Thermal | None, root: str, line: Callable[[str, float], str]) -> list[str]:
    """Lines of the temperatures [°C] at which the new polynomial and that of the board are both valid."""
    known = [one.range_degc for one in (new, held) if one is not None and one.range_degc is not None]
    if not known:
        return [f"# Set {root}TMIN and TMAX to the temperatures that were recorded: it is valid between them."]
    return [line(f"{root}TMIN", max(low for low, _ in known)), line(f"{root}TMAX", min(high for _, high in known))]


def said_of_misfit(thermal: Thermal, name: str) -> list[str]:
    """Sentences on the temperature dependence that a cubic of the bias cannot represent, if there is any."""
    unit = "m/s^2" if name == "accelerometer" else "rad/s"
    said = []
    if thermal.scale > 1e-6:
        said.append(f"Over the range the {name}'s scale changes by up to {100 * thermal.scale:.2g} %, which is lost.")
    if thermal.misfit > 1e-9:
        said.append(f"Up to {thermal.misfit:.2g} {unit} of the {name}'s bias is beyond a cubic and is lost.")
    return said


def triple(parameters: Mapping[str, float], name: str, default: float = 0.0) -> FloatArray:
    """(3,) values of the parameters ``name`` with ``{}`` replaced by X, Y and Z."""
    return np.array([parameters.get(name.format(axis), default) for axis in XYZ])
