"""Eight layouts of a log as loggers write them: counts, g and °/s, SI, mg; separators, headers, units of time."""

from __future__ import annotations

from dataclasses import dataclass
from pathlib import Path

import numpy as np

from desk_trial.parts import STANDARD_G
from desk_trial.readout import Log
from desk_trial.session import Made
from desk_trial.turns import DEGREE


@dataclass(frozen=True)
class Layout:
    """Header; stamps per second and their format; accelerometer's and gyro's unit (SI of one) and format, None for
    counts; the separator; whether the gyro comes first.
    """

    names: str
    ticks: float
    stamp: str
    accel: tuple[float, str] | None
    gyro: tuple[float, str] | None
    separator: str = ","
    gyro_first: bool = False


COUNTS = "%d"
LAYOUTS = (
    Layout("timestamp_us AccX AccY AccZ GyroX GyroY GyroZ", 1e6, "%d", None, None),
    Layout("t [s]|acc.x [g]|acc.y [g]|acc.z [g]|gyr.x [dps]|gyr.y [dps]|gyr.z [dps]", 1, "%.6f",
           (STANDARD_G, "%.5f"), (DEGREE, "%.4f"), ";"),
    Layout("time (s)|ax (m/s^2)|ay (m/s^2)|az (m/s^2)|wx (rad/s)|wy (rad/s)|wz (rad/s)", 1, "%.6f",
           (1.0, "%.5f"), (1.0, "%.6f")),
    Layout("micros ACCEL_XOUT ACCEL_YOUT ACCEL_ZOUT GYRO_XOUT GYRO_YOUT GYRO_ZOUT", 1e6, "%d", None, None),
    Layout("millis a_x_mg a_y_mg a_z_mg g_x_dps g_y_dps g_z_dps", 1e3, "%.3f",
           (STANDARD_G / 1000, "%.2f"), (DEGREE, "%.3f")),
    Layout("Time GyroX GyroY GyroZ AccX AccY AccZ", 1, "%.6f",
           (STANDARD_G, "%.5f"), (DEGREE, "%.4f"), "\t", True),
    Layout("ms accel_x accel_y accel_z gyro_x gyro_y gyro_z", 1e3, "%.3f", (1.0, "%.4f"), (DEGREE, "%.4f")),
    Layout("seconds wx wy wz ax ay az", 1, "%.6f", (1.0, "%.5f"), (1.0, "%.6f"), " ", True),
)  # fmt: skip
UNSTAMPED_EVERY = 3
"""Of the sessions whose stamps the logger makes up, those of every third layout write none."""


def _columns(log: Log, layout: Layout) -> tuple[list[np.ndarray], list[str]]:
    accel_unit, accel_format = layout.accel or (log.accel_step, COUNTS)
    gyro_unit, gyro_format = layout.gyro or (log.gyro_step, COUNTS)
    triads = [(log.accel / accel_unit, accel_format), (log.gyro / gyro_unit, gyro_format)]
    if layout.gyro_first:
        triads.reverse()
    columns = [np.round(x[:, j]) if f == COUNTS else x[:, j] for x, f in triads for j in range(3)]
    return columns, [f for _, f in triads for _ in range(3)]


def write(made: Made, path: Path) -> tuple[bool, tuple[float, float]]:
    """Write the log; ``(whether the rate must be told, (units per m/s², units per rad/s))``."""
    log, number = made.log, made.session.layout
    layout = LAYOUTS[number]
    unstamped = log.stamp_kind == "none" or (
        log.stamp_kind == "made" and number % UNSTAMPED_EVERY == UNSTAMPED_EVERY - 1
    )
    names = layout.names.split("|" if "|" in layout.names else " ")
    ticks, stamp = layout.ticks, layout.stamp
    if log.stamp_kind == "wrap":
        ticks, stamp = 1e6, "%d"
        names[0] = ("timestamp_us", "micros", "time_us", "t_us")[number % 4]
    columns, formats = _columns(log, layout)
    if unstamped:
        names = names[1:]
    else:
        columns, formats = [log.stamps * ticks, *columns], [stamp, *formats]
    if made.session.logs_temperature:
        columns, formats, names = [*columns, log.temperature], [*formats, "%.2f"], [*names, "temp_C"]
    if log.supply is not None:
        columns, formats, names = [*columns, log.supply], [*formats, "%.3f"], [*names, "vdd_V"]
    with path.open("w") as out:
        out.write(("# " if layout.separator == " " else "") + layout.separator.join(names) + "\n")
        np.savetxt(out, np.column_stack(columns), fmt=layout.separator.join(formats))
    accel_unit = layout.accel[0] if layout.accel else log.accel_step
    gyro_unit = layout.gyro[0] if layout.gyro else log.gyro_step
    return unstamped, (1 / accel_unit, 1 / gyro_unit)
