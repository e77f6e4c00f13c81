"""Text logs of open boards and of sketches on them."""

from __future__ import annotations

import numpy as np

from hand_made_sessions import G
from makers.layout import COUNTS, SI, Layout, dates, layout, plain, session, written


@layout
def openlog_artemis() -> Layout:
    """SparkFun OpenLog Artemis: rtcDate, rtcTime, accelerometer in mg, gyro in deg/s, a comma at each end."""
    s = session(50)
    a, w = np.round(1000 * s.force / G, 2), np.round(np.degrees(s.rate), 2)
    head = "rtcDate,rtcTime,aX,aY,aZ,gX,gY,gZ,mX,mY,mZ,imu_degC,output_Hz,\n"
    mag = [np.round(20 + 0.3 * np.random.default_rng(i).standard_normal(s.n), 2) for i in range(3)]
    body = written(
        dates(s, "%m/%d/%Y"),
        dates(s, "%H:%M:%S.%f", 2),
        *a.T,
        *w.T,
        *mag,
        np.full(s.n, 24.31),
        np.full(s.n, 50.0),
        end=",\n",
        form="{:.2f}",
    )
    return Layout("OpenLog Artemis", {"dataLog00001.TXT": (head + body).encode()}, 50, a, w, ("mg", "deg/s"), s.n)


@layout
def witmotion() -> Layout:
    """WitMotion's recorder: tabs, Chiptime as a date, ax(g), wx(deg/s), T(°)."""
    s = session(100)
    a, w = np.round(s.force / G, 4), np.round(np.degrees(s.rate), 4)
    names = ["Chiptime", *(f"a{x}(g)" for x in "xyz"), *(f"w{x}(deg/s)" for x in "xyz")]
    head = "\t".join([*names, *(f"Angle{x}(deg)" for x in "XYZ"), "T(°)"]) + "\r\n"
    angles = [np.round(10 + 0.1 * np.random.default_rng(i).standard_normal(s.n), 3) for i in range(3)]
    timestamps = dates(s, "%Y-%m-%d %H:%M:%S.%f", 3)
    body = written(timestamps, *a.T, *w.T, *angles, np.full(s.n, 28.25), separator="\t", end="\r\n")
    return Layout("WitMotion", {"20240301120000.txt": (head + body).encode()}, 100, a, w, ("g", "deg/s"), s.n)


@layout
def arduino_monitor() -> Layout:
    """Arduino IDE 1.8 serial monitor with 'Show timestamp': 12:00:00.000 -> before every line, names in the first."""
    s = session(100)
    a, w = np.round(s.force, 3), np.round(s.rate, 4)
    timestamps = dates(s, "%H:%M:%S.%f", 3)
    ms = np.rint(1000 * s.time_s).astype(int)
    lines = [f"{timestamps[0]} -> millis,ax,ay,az,gx,gy,gz"]
    lines += [f"{t} -> {row}" for t, row in zip(timestamps, written(ms, *a.T, *w.T).splitlines(), strict=True)]
    text = "\n".join(lines) + "\n"
    return Layout("Arduino (monitor timestamps)", {"monitor.txt": text.encode()}, 100, a, w, SI, s.n)


@layout
def arduino_plotter() -> Layout:
    """Arduino Serial Plotter's protocol: label:value pairs on a line, blanks or commas between."""
    s = session(100)
    a, w = np.round(s.force, 3), np.round(s.rate, 4)
    labels = ["t_ms", "ax", "ay", "az", "gx", "gy", "gz"]
    ms = np.rint(1000 * s.time_s).astype(int)
    rows = zip(ms, *a.T, *w.T, strict=True)
    lines = [" ".join(f"{label}:{plain(v)}" for label, v in zip(labels, row, strict=True)) for row in rows]
    return Layout("Arduino (labelled)", {"plotter.txt": ("\n".join(lines) + "\n").encode()}, 100, a, w, SI, s.n)


@layout
def i2cdevlib() -> Layout:
    """i2cdevlib MPU6050_raw: 'a/g:' and six counts behind tabs, no time."""
    s = session(100)
    a, w = np.rint(16384 * s.force / G), np.rint(131 * np.degrees(s.rate))
    body = written(["a/g:"] * s.n, *a.astype(int).T, *w.astype(int).T, separator="\t")
    text = "Initializing I2C devices...\nTesting device connections...\nMPU6050 connection successful\n" + body
    return Layout("i2cdevlib MPU6050_raw", {"mpu.txt": text.encode()}, 100, a, w, COUNTS, s.n, {"rate_hz": 100.0})


@layout
def adafruit() -> Layout:
    """Adafruit_MPU6050 basic_readings: three lines and a blank one for each reading."""
    s = session(20)
    a, w = np.round(s.force, 2), np.round(s.rate, 2)
    parts = ["Adafruit MPU6050 test!\nMPU6050 Found!\n"]
    for k in range(s.n):
        parts.append("Acceleration X: {:.2f}, Y: {:.2f}, Z: {:.2f} m/s^2\n".format(*a[k]))
        parts.append("Rotation X: {:.2f}, Y: {:.2f}, Z: {:.2f} rad/s\n".format(*w[k]))
        parts.append("Temperature: 29.94 degC\n\n")
    text = "".join(parts)
    return Layout("Adafruit (three lines)", {"adafruit.txt": text.encode()}, 20, a, w, SI, s.n, {"rate_hz": 20.0})
