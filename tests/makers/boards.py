"""Text logs of open boards and of sketches on them."""

from __future__ import annotations

import numpy as np

from makers.layout import dates, plain, text, written


@text("OpenLog Artemis", "dataLog00001.TXT", 50, ("mg", "deg/s"), (2, 2))
def openlog_artemis(s, a, w):
    """SparkFun OpenLog Artemis: rtcDate, rtcTime, accelerometer in mg, gyro in deg/s, a comma at each end."""
    head = "rtcDate,rtcTime,aX,aY,aZ,gX,gY,gZ,mX,mY,mZ,imu_degC,output_Hz,\n"
    mag = [np.round(20 + 0.3 * np.random.default_rng(i).standard_normal(s.n), 2) for i in range(3)]
    clock = dates(s, "%m/%d/%Y"), dates(s, "%H:%M:%S.%f", 2)
    return head + written(*clock, *a.T, *w.T, *mag, np.full(s.n, 24.31), np.full(s.n, 50.0), end=",\n", form="{:.2f}")


@text("WitMotion", "20240301120000.txt", 100, ("g", "deg/s"), (4, 4))
def witmotion(s, a, w):
    """WitMotion's recorder: tabs, Chiptime as a date, ax(g), wx(deg/s), T(°)."""
    names = ["Chiptime", *(f"a{x}(g)" for x in "xyz"), *(f"w{x}(deg/s)" for x in "xyz")]
    head = "\t".join([*names, *(f"Angle{x}(deg)" for x in "XYZ"), "T(°)"]) + "\r\n"
    angles = [np.round(10 + 0.1 * np.random.default_rng(i).standard_normal(s.n), 3) for i in range(3)]
    timestamps = dates(s, "%Y-%m-%d %H:%M:%S.%f", 3)
    return head + written(timestamps, *a.T, *w.T, *angles, np.full(s.n, 28.25), separator="\t", end="\r\n")


@text("Arduino (monitor timestamps)", "monitor.txt", 100, digits=(3, 4))
def arduino_monitor(s, a, w):
    """Arduino IDE 1.8 serial monitor with 'Show timestamp': 12:00:00.000 -> before every line, names in the first."""
    timestamps = dates(s, "%H:%M:%S.%f", 3)
    ms = np.rint(1000 * s.time_s).astype(int)
    lines = [f"{timestamps[0]} -> millis,ax,ay,az,gx,gy,gz"]
    lines += [f"{t} -> {row}" for t, row in zip(timestamps, written(ms, *a.T, *w.T).splitlines(), strict=True)]
    return "\n".join(lines) + "\n"


@text("Arduino (labelled)", "plotter.txt", 100, digits=(3, 4))
def arduino_plotter(s, a, w):
    """Arduino Serial Plotter's protocol: label:value pairs on a line, blanks or commas between."""
    labels = ["t_ms", "ax", "ay", "az", "gx", "gy", "gz"]
    rows = zip(np.rint(1000 * s.time_s).astype(int), *a.T, *w.T, strict=True)
    lines = [" ".join(f"{label}:{plain(v)}" for label, v in zip(labels, row, strict=True)) for row in rows]
    return "\n".join(lines) + "\n"


@text("i2cdevlib MPU6050_raw", "mpu.txt", 100, counts=(16384, 131), options={"rate_hz": 100.0})
def i2cdevlib(s, a, w):
    """i2cdevlib MPU6050_raw: 'a/g:' and six counts behind tabs, no time."""
    head = "Initializing I2C devices...\nTesting device connections...\nMPU6050 connection successful\n"
    return head + written(["a/g:"] * s.n, *a.T, *w.T, separator="\t")


@text("Adafruit (three lines)", "adafruit.txt", 20, digits=(2, 2), options={"rate_hz": 20.0})
def adafruit(s, a, w):
    """Adafruit_MPU6050 basic_readings: three lines and a blank one for each reading."""
    parts = ["Adafruit MPU6050 test!\nMPU6050 Found!\n"]
    for k in range(s.n):
        parts.append("Acceleration X: {:.2f}, Y: {:.2f}, Z: {:.2f} m/s^2\n".format(*a[k]))
        parts.append("Rotation X: {:.2f}, Y: {:.2f}, Z: {:.2f} rad/s\n".format(*w[k]))
        parts.append("Temperature: 29.94 degC\n\n")
    return "".join(parts)
