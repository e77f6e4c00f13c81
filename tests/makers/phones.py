"""Text logs of apps on phones."""

from __future__ import annotations

import io
import zipfile

import numpy as np

from hand_made_sessions import G
from makers.layout import SI, Layout, dates, in_si, layout, nanoseconds, session, text, written


@layout
def gnsslogger() -> Layout:
    """GnssLogger (Google): one record type per line, headers in remarks, other records between."""
    s = session(100)
    a, w = in_si(s, 7)
    head = "# \n# Header Description:\n# \n# Version: v3.0.6.4 Platform: 14 Manufacturer: Google Model: Pixel 7\n# \n"
    head += "# Raw,utcTimeMillis,TimeNanos,LeapSecond,TimeUncertaintyNanos,FullBiasNanos\n# \n"
    head += "# Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,"
    head += "UnixTimeMillis\n# \n"
    head += "# UncalAccel,utcTimeMillis,elapsedRealtimeNanos,UncalAccelXMps2,UncalAccelYMps2,UncalAccelZMps2,"
    head += "BiasXMps2,BiasYMps2,BiasZMps2\n# \n"
    head += "# UncalGyro,utcTimeMillis,elapsedRealtimeNanos,UncalGyroXRadPerSec,UncalGyroYRadPerSec,"
    head += "UncalGyroZRadPerSec,DriftXRadPerSec,DriftYRadPerSec,DriftZRadPerSec\n# \n"
    lines, others = [], 0
    for k in range(s.n):
        ms, ns = 1709294400000 + 10 * k, 88_000_000_000 + 10_000_000 * k
        for name, v in (("UncalAccel", a[k]), ("UncalGyro", w[k])):
            lines.append(f"{name},{ms},{ns}," + ",".join(repr(float(x)) for x in v) + ",0.0,0.0,0.0")
        if k % 100 == 0:
            lines.append(f"Raw,{ms},{ns},18,12.5,-1393284000000")
            lines.append(f"Fix,GPS,59.94,30.31,12.0,0.0,3.8,{ms}")
            others += 2
    content = head + "\n".join(lines) + "\n"
    return Layout("GnssLogger", {"gnss_log.txt": content.encode()}, 100, a, w, SI, 2 * s.n + others, {}, False, True)


def _zip(members: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


@layout
def phyphox_zip() -> Layout:
    """phyphox, several sensors, CSV (comma, decimal point) exported as .zip with meta/."""
    s = session(100)
    members = {}
    for name, quantity, unit, late_s, v in (
        ("Accelerometer.csv", "Acceleration", "m/s^2", 0.0, s.force),
        ("Gyroscope.csv", "Gyroscope", "rad/s", 0.0031, s.rate),
    ):
        head = ",".join(['"Time (s)"', *(f'"{quantity} {x} ({unit})"' for x in "xyz")]) + "\n"
        members[name] = (head + written(s.time_s + late_s, *v.T, form="{:.9E}")).encode()
    members["meta/device.csv"] = b'"property","value"\n"version","1.1.16"\n"deviceModel","Pixel 7"\n'
    members["meta/time.csv"] = (
        b'"event","experiment time","system time","system time text"\n'
        b'"START",0.000000000E0,1.709294400E9,"2024-03-01 12:00:00.000 UTC+00:00"\n'
    )
    a = np.array([[float(f"{v:.9E}") for v in row] for row in s.force])
    # The gyro starts 3.1 ms later: the first reading of the accelerometer has no partner and is reported.
    return Layout("phyphox (zip)", {"phyphox.zip": _zip(members)}, 100, a[1:], None, SI, 2 * s.n, {}, False, True)


@layout
def phyphox_csv() -> Layout:
    """phyphox with tabs and a decimal comma, as exported for Excel in Europe."""
    s = session(100)
    head = "\t".join(['"Time (s)"', *(f'"Acceleration {x} (m/s^2)"' for x in "xyz"), '"Absolute acceleration (m/s^2)"'])
    v = np.column_stack([s.time_s, s.force, np.linalg.norm(s.force, axis=1)])
    body = "".join("\t".join(f"{x:.9E}".replace(".", ",") for x in row) + "\n" for row in v)
    a = np.array([[float(f"{x:.9E}") for x in row] for row in s.force])
    return Layout("phyphox (decimal comma)", {"Raw Data.csv": (head + "\n" + body).encode()}, 100, a, None, SI, s.n)


@layout
def sensor_logger_zip() -> Layout:
    """Sensor Logger (K. T. H. Choi): axes in the order z y x, gravity only in TotalAcceleration, ns since 1970."""
    s = session(100)
    members = {}
    gravity_out = s.force - s.force.mean(axis=0)
    for name, v in (
        ("Accelerometer.csv", gravity_out),
        ("TotalAcceleration.csv", s.force),
        ("Gyroscope.csv", s.rate),
        ("Gravity.csv", s.force),
    ):
        head = "time,seconds_elapsed,z,y,x\n"
        members[name] = (head + written(nanoseconds(s), s.time_s, v[:, 2], v[:, 1], v[:, 0])).encode()
    members["Metadata.csv"] = b"version,device name,platform\n3,Pixel 7,android\n"
    rows = 2 * s.n
    return Layout("Sensor Logger (zip)", {"walk.zip": _zip(members)}, 100, s.force, s.rate, SI, rows, {}, False, True)


@text("SensorLog (iOS)", "sensorlog.csv", 100, ("g", "rad/s"))
def sensorlog_ios(s, a, w):
    """SensorLog (B. Thomas, iOS): long names with units, gravity in g in accelerometerAcceleration."""
    names = ["loggingTime(txt)", "loggingSample(N)", "accelerometerTimestamp_sinceReboot(s)"]
    names += [f"accelerometerAcceleration{x}(G)" for x in "XYZ"] + ["gyroTimestamp_sinceReboot(s)"]
    names += [f"gyroRotation{x}(rad/s)" for x in "XYZ"] + [f"motionUserAcceleration{x}(G)" for x in "XYZ"]
    t = 12345.6 + s.time_s
    zeros = [np.round(0.001 * np.random.default_rng(i).standard_normal(s.n), 6) for i in range(3)]
    timestamps = dates(s, "%Y-%m-%dT%H:%M:%S.%f", 3)
    body = written([f"{x}+01:00" for x in timestamps], np.arange(1, s.n + 1), t, *a.T, t, *w.T, *zeros)
    return ",".join(names) + "\n" + body


@text("AndroSensor", "Sensor_record.csv", 50, digits=(4, 4))
def androsensor(s, a, w):
    """AndroSensor: semicolons, names with units, a date whose milliseconds follow a colon."""
    names = [f"ACCELEROMETER {x} (m/s²)" for x in "XYZ"] + [f"GRAVITY {x} (m/s²)" for x in "XYZ"]
    names += [f"LINEAR ACCELERATION {x} (m/s²)" for x in "XYZ"] + [f"GYROSCOPE {x} (rad/s)" for x in "XYZ"]
    names += ["Time since start in ms", "YYYY-MO-DD HH-MI-SS_SSS"]
    linear = [np.round(0.01 * np.random.default_rng(i).standard_normal(s.n), 4) for i in range(3)]
    timestamps = [x.replace(".", ":") for x in dates(s, "%Y-%m-%d %H:%M:%S.%f", 3)]
    ms = np.rint(1000 * s.time_s).astype(int)
    body = written(*a.T, *a.T, *linear, *w.T, ms, timestamps, separator=";")
    return ";".join(names) + "\n" + body


@layout
def matlab_mobile() -> Layout:
    """MATLAB Mobile: a table per sensor, Timestamp as 01-Mar-2024 12:00:00.000."""
    s = session(100)
    a, w = in_si(s)
    head = "Timestamp,X,Y,Z\n"
    timestamps = dates(s, "%d-%b-%Y %H:%M:%S.%f", 3)
    files = {
        "Acceleration.csv": (head + written(timestamps, *a.T)).encode(),
        "AngularVelocity.csv": (head + written(timestamps, *w.T)).encode(),
    }
    return Layout("MATLAB Mobile", files, 100, a, w, SI, 2 * s.n, {}, True)


@layout
def metabase() -> Layout:
    """MbientLab MetaBase: epoc (ms), a timestamp with points in the clock, x-axis (g) and (deg/s)."""
    s = session(100)
    a, w = np.round(s.force / G, 3), np.round(np.degrees(s.rate), 3)
    ms = [1709294400000 + round(1000 * t) for t in s.time_s]
    timestamps = dates(s, "%Y-%m-%dT%H.%M.%S.%f", 3)
    files = {}
    for name, v, unit in (("MetaWear_Accelerometer.csv", a, "g"), ("MetaWear_Gyroscope.csv", w, "deg/s")):
        head = "epoc (ms),timestamp (-0700),elapsed (s)," + ",".join(f"{x}-axis ({unit})" for x in "xyz") + "\n"
        files[name] = (head + written(ms, timestamps, np.round(s.time_s, 3), *v.T)).encode()
    return Layout("MbientLab MetaBase", files, 100, a, w, ("g", "deg/s"), 2 * s.n, {}, True)


@text("Physics Toolbox", "physics.csv", 100, ("g", "rad/s"), (4, 4))
def physics_toolbox(s, a, w):
    """Physics Toolbox Sensor Suite, multi record: g-force in g, linear acceleration beside it, angular velocity."""
    names = ["time", "gFx", "gFy", "gFz", "TgF", "ax", "ay", "az", "wx", "wy", "wz"]
    linear = [np.round(0.02 * np.random.default_rng(i).standard_normal(s.n), 4) for i in range(3)]
    return ",".join(names) + "\n" + written(np.round(s.time_s, 4), *a.T, np.full(s.n, 1.0), *linear, *w.T)


@text("MARS logger", "gyro_accel.csv", 200)
def mars_logger(s, a, w):
    """MARS logger (Android, iOS): gyro_accel.csv, ns, units in brackets without blanks."""
    head = "Timestamp[nanosec],gx[rad/s],gy[rad/s],gz[rad/s],ax[m/s^2],ay[m/s^2],az[m/s^2],Unix time[nanosec]\n"
    return head + written(15219875000000 + 5000000 * np.arange(s.n), *w.T, *a.T, nanoseconds(s))
