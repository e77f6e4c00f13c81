"""Logs as collections of public data and newer apps lay them out."""

from __future__ import annotations

import json

import numpy as np

from makers.layout import SI, Layout, dates, in_si, layout, nanoseconds, session, text, written


@text("PicoQuake", "acquisition.csv", 200, ("g", "deg/s"), (4, 3))
def picoquake(s, a, w):
    """PLab PicoQuake: the rate among other settings of a remark, a count, no time, no units."""
    head = "# PLab PicoQuake Data\n# Time: 2024-04-21 15:54:46.333682, Device: D4E9 (E6632891E36F2029)\n"
    head += "# Config: data_rate = 200.0 Hz, filter = 68 Hz, acc_range = 4 g, gyro_range = 250.0 dps\n"
    return head + "\ncount,a_x,a_y,a_z,g_x,g_y,g_z\n" + written(np.arange(1, s.n + 1), *a.T, *w.T)


@text("WitMotion (app of 2023)", "witmotion.txt", 100, ("g", "deg/s"), (3, 3))
def witmotion_app(s, a, w):
    """WitMotion's newer app: angular speed under the name As, the device in brackets, an empty clock of the chip."""
    names = ["time", "DeviceName", "ChipTime()", *(f"Acc{x}(g)" for x in "XYZ"), *(f"As{x}(°/s)" for x in "XYZ")]
    other = [np.round(10 + 0.1 * np.random.default_rng(i).standard_normal(s.n), 2) for i in range(6)]
    head = "\t".join([*names, *(f"Angle{x}(°)" for x in "XYZ"), *(f"H{x}(uT)" for x in "XYZ")]) + "\t\r\n"
    clock, device = dates(s, "%Y-%m-%dT%H:%M:%S.%f", 3), ["HC-06(00:0C:BF:19:3F:0D)"] * s.n
    return head + written(clock, device, ["null"] * s.n, *a.T, *w.T, *other, separator="\t", end="\t\r\n")


@text("Malaga urban", "IMU.txt", 100)
def malaga_urban(s, a, w):
    """Malaga urban data set: names behind a per cent sign, blanks, rates of yaw, pitch and roll in this order."""
    names = ["Time", *(f"IMU_ACC_{x}" for x in "XYZ"), "IMU_YAW_VEL", "IMU_PITCH_VEL", "IMU_ROLL_VEL"]
    return "%  " + "  ".join(names) + "\n" + written(1261228995.97 + s.time_s, *a.T, *w.T[::-1], separator=" ")


@text("KAIST urban", "xsens_imu.csv", 100)
def kaist_urban(s, a, w):
    """KAIST urban data set: time in ns, quaternion, angles, rates, specific force, magnetic field; no names."""
    other = [np.round(0.1 * np.random.default_rng(i).standard_normal(s.n), 6) for i in range(10)]
    return written(nanoseconds(s), *other[:7], *w.T, *a.T, *other[7:])


@layout
def indoor_location() -> Layout:
    """Indoor location of Microsoft Research: a time, the type of the record, as many values as that type has."""
    s = session(50)
    a, w = in_si(s)
    lines = ["#\tstartTime:1574659531598", "#\tSiteID:5a05\tFloorName:F1"]
    for k, ms in enumerate(1574659531598 + np.rint(1000 * s.time_s).astype(int)):
        for name, v in (("ACCELEROMETER", a[k].tolist()), ("GYROSCOPE", w[k].tolist())):
            values = "\t".join(map(repr, v))
            lines.append(f"{ms}\tTYPE_{name}\t{values}\t3")
            lines.append(f"{ms}\tTYPE_{name}_UNCALIBRATED\t{values}\t0.01\t0.0\t0.0\t3")
    content = "\n".join(lines) + "\n"
    return Layout("Indoor location", {"trace.txt": content.encode()}, 50, a, w, SI, 4 * s.n, {}, False, True)


@layout
def bdd100k() -> Layout:
    """BDD100K: one JSON object with a list of readings for each sensor."""
    s = session(50)
    a, w = in_si(s)
    ms = 1503828163000 + np.rint(1000 * s.time_s).astype(int)
    lists = {
        name: [{"x": x, "y": y, "z": z, "timestamp": int(t)} for (x, y, z), t in zip(v.tolist(), ms, strict=True)]
        for name, v in (("gyro", w), ("accelerometer", a))
    }
    content = json.dumps({"rideID": "abc", "startTime": 1503828163000, **lists, "locations": [{"speed": 1.0}]})
    return Layout("BDD100K", {"info.json": content.encode()}, 50, a, w, SI, 2 * s.n, {}, False, True)


@layout
def columns_and_rows() -> Layout:
    """JSON of pandas (orient="split") and of recorders alike: names of the columns, and the rows."""
    s = session(100)
    a, w = in_si(s)
    names = ["time [s]", *(f"acc_{x} [m/s^2]" for x in "xyz"), *(f"gyro_{x} [rad/s]" for x in "xyz")]
    rows = np.column_stack([np.round(s.time_s, 4), a, w]).tolist()
    content = json.dumps({"version": 1, "columns": names, "data": rows, "events": [{"t": 1.2, "type": "tap"}]})
    return Layout("pandas (JSON, split)", {"replay.json": content.encode()}, 100, a, w, SI, s.n)
