"""Text logs as their makers' programs write them: one function per layout, after the maker's document named in it.

Written from documents and from the writers' sources, not from our readers. Each returns the files, what the user has to
say, and what must come out: the readings in the log's unit, their number and the rate.
"""

from __future__ import annotations

import io
import zipfile
from collections.abc import Callable
from dataclasses import dataclass, field
from datetime import datetime, timedelta

import numpy as np
from session import G, Session, session

EPOCH = datetime(2024, 3, 1, 12, 0, 0)
EPOCH_S = 1709294400.0


@dataclass(frozen=True)
class Layout:
    """``files`` name and bytes; ``accelerometer``/``gyroscope`` (n, 3) as written; ``rows`` of all files together."""

    maker: str
    files: dict[str, bytes]
    rate_hz: float
    accelerometer: np.ndarray | None
    gyroscope: np.ndarray | None
    units: tuple[str, str]
    rows: int
    options: dict[str, object] = field(default_factory=dict)
    per_sensor: bool = False
    merged: bool = False


LAYOUTS: dict[str, Callable[[], Layout]] = {}


def layout(make: Callable[[], Layout]) -> Callable[[], Layout]:
    LAYOUTS[make.__name__] = make
    return make


def _round(values: np.ndarray, digits: int) -> np.ndarray:
    return np.round(values, digits)


def _rows(*columns: np.ndarray, separator: str = ",", end: str = "\n", form: str = "{!r}") -> str:
    table = zip(*columns, strict=True)
    return "".join(
        separator.join(v if isinstance(v, str) else form.format(v) for v in (_plain(v) for v in row)) + end
        for row in table
    )


def _plain(value: object) -> object:
    return value.item() if isinstance(value, np.generic) else value


def _dates(s: Session, form: str, digits: int = 6) -> list[str]:
    out = []
    for t in s.time_s:
        text = (EPOCH + timedelta(seconds=round(float(t), 6))).strftime(form)
        out.append(text[: len(text) - 6 + digits] if form.endswith("%f") else text)
    return out


def _si(s: Session, digits: int = 6) -> tuple[np.ndarray, np.ndarray]:
    return _round(s.force, digits), _round(s.rate, digits)


def _ns(s: Session) -> list[int]:
    return [round(EPOCH_S) * 10**9 + round(t * 1e9) for t in s.time_s]


@layout
def euroc() -> Layout:
    """ASL dataset format (ETH ASL, EuRoC MAV): imu0/data.csv."""
    s = session(200)
    a, w = _si(s)
    head = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    head += "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
    return Layout("ETH ASL (EuRoC)", {"data.csv": (head + _rows(_ns(s), *w.T, *a.T)).encode()}, 200, a, w, SI, s.n)


SI = ("m/s^2", "rad/s")


@layout
def kalibr() -> Layout:
    """Kalibr wiki, 'Bag format': imu0.csv of bagcreater and bagextractor, omega [rad/s], alpha [m/s²], ns."""
    s = session(200)
    a, w = _si(s)
    head = "timestamp,omega_x,omega_y,omega_z,alpha_x,alpha_y,alpha_z\n"
    return Layout("Kalibr", {"imu0.csv": (head + _rows(_ns(s), *w.T, *a.T)).encode()}, 200, a, w, SI, s.n)


@layout
def movella_dot() -> Layout:
    """Movella DOT app and Data Exporter: preamble, SampleTimeFine in microseconds, FreeAcc beside Acc, Gyr in deg/s."""
    s = session(60)
    a, w = _round(s.force, 6), _round(np.degrees(s.rate), 6)
    head = "sep=,\nDeviceTag:,Movella DOT 1\nFirmwareVersion:,2.4.0\nAppVersion:,2023.6.1\nSyncStatus:,Synced\n"
    head += "OutputRate:,60Hz\nFilterProfile:,General\nMeasurement Mode:,Custom Mode 5\n"
    head += "StartTime:,2024-03-01_12-00-00_000\n© Movella Technologies B. V. 2005-2023\n\n"
    head += "PacketCounter,SampleTimeFine,Euler_X,Euler_Y,Euler_Z,FreeAcc_X,FreeAcc_Y,FreeAcc_Z,"
    head += "Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z,Mag_X,Mag_Y,Mag_Z,\n"
    k = np.arange(s.n)
    fine = (4186350000 + np.rint(k * 1e6 / 60)).astype(np.int64) % 2**32
    other = [np.round(0.01 * np.random.default_rng(i).standard_normal(s.n), 6) for i in range(9)]
    body = _rows(k, fine, *other[:6], *a.T, *w.T, *other[6:], end=",\n")
    return Layout("Movella DOT", {"dot.csv": (head + body).encode()}, 60, a, w, ("m/s^2", "deg/s"), s.n)


@layout
def xsens_mt_manager() -> Layout:
    """MT Manager ASCII export: // lines, then names and tabs; SampleTimeFine counts 100 µs."""
    s = session(100)
    a, w = _si(s)
    head = "// Start Time: Unknown\n// Update Rate: 100.0Hz\n// Filter Profile: general\n// Firmware Version: 1.8.2\n"
    head += "PacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tMag_X\tMag_Y\tMag_Z\n"
    k = np.arange(s.n)
    mag = [np.round(0.4 + 0.001 * np.random.default_rng(i).standard_normal(s.n), 6) for i in range(3)]
    body = _rows(k + 100, 51000 + 100 * k, *a.T, *w.T, *mag, separator="\t", form="{}")
    return Layout("Xsens MTi (MT Manager)", {"MT_0380.txt": (head + body).encode()}, 100, a, w, SI, s.n)


@layout
def ardupilot_csv() -> Layout:
    """mavlogdump.py --format csv --types IMU of a vehicle with two IMUs: one row per IMU, separated by column I."""
    first, second = session(50, 1), session(50, 2)
    head = "timestamp,TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz\n"
    lines = []
    for k in range(first.n):
        for i, s in enumerate((first, second)):
            us = 61000000 + 20000 * k + 7 * i
            values = [*_round(s.rate[k], 9), *_round(s.force[k], 7)]
            numbers = ",".join(repr(float(v)) for v in values)
            lines.append(f"{EPOCH_S + us * 1e-6:.8f},{us},{i},{numbers},0,0,{40 + i},1,1,2000,2000\n")
    a, w = _round(second.force, 7), _round(second.rate, 9)
    return Layout(
        "ArduPilot (mavlogdump CSV, 2 IMUs)",
        {"IMU.csv": (head + "".join(lines)).encode()},
        50,
        a,
        w,
        SI,
        2 * first.n,
        {"instance": 1},
    )


@layout
def px4_ulog2csv() -> Layout:
    """pyulog's ulog2csv: sensor_combined, microseconds."""
    s = session(250)
    a, w = _si(s)
    head = "timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],gyro_integral_dt,accelerometer_timestamp_relative,"
    head += "accelerometer_m_s2[0],accelerometer_m_s2[1],accelerometer_m_s2[2],accelerometer_integral_dt\n"
    us = 112500000 + 4000 * np.arange(s.n)
    fill = np.full(s.n, 4000)
    body = _rows(us, *w.T, fill, 0 * fill, *a.T, fill)
    name = "log_sensor_combined_0.csv"
    return Layout("PX4 (ulog2csv)", {name: (head + body).encode()}, 250, a, w, SI, s.n)


@layout
def px4_ulog2csv_two_topics() -> Layout:
    """ulog2csv of sensor_accel and sensor_gyro: bare x y z, the sensor in the file's name."""
    s = session(200)
    a, w = _si(s)
    us = 5000000 + 5000 * np.arange(s.n)
    device = np.full(s.n, 1310988)
    heads = "timestamp,timestamp_sample,device_id,x,y,z,temperature,error_count\n"
    temperature = np.full(s.n, 45.25)
    files = {}
    for name, v in (("log_sensor_accel_0.csv", a), ("log_sensor_gyro_0.csv", w)):
        files[name] = (heads + _rows(us + 120, us, device, *v.T, temperature, 0 * device)).encode()
    return Layout("PX4 (ulog2csv, two topics)", files, 200, a, w, SI, 2 * s.n, {}, True)


@layout
def rostopic_echo() -> Layout:
    """rostopic echo -b -p /imu: field.header.stamp in ns, covariances between."""
    s = session(100)
    a, w = _si(s)
    cov = [f"field.{{}}_covariance{i}" for i in range(9)]
    names = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
    names += [f"field.orientation.{x}" for x in "xyzw"] + [c.format("orientation") for c in cov]
    names += [f"field.angular_velocity.{x}" for x in "xyz"] + [c.format("angular_velocity") for c in cov]
    names += [f"field.linear_acceleration.{x}" for x in "xyz"] + [c.format("linear_acceleration") for c in cov]
    zeros = [np.zeros(s.n)] * 9
    timestamps = _ns(s)
    q = [np.zeros(s.n)] * 3 + [np.ones(s.n)]
    body = _rows(timestamps, np.arange(s.n), timestamps, ["imu"] * s.n, *q, *zeros, *w.T, *zeros, *a.T, *zeros)
    return Layout("ROS (rostopic echo -p)", {"imu.csv": (",".join(names) + "\n" + body).encode()}, 100, a, w, SI, s.n)


@layout
def shimmer_consensys() -> Layout:
    """ConsensysPRO export: sep line, names, units; two accelerometers, battery in mV, Unix ms."""
    s = session(128)
    a, w = _round(s.force, 9), _round(np.degrees(s.rate), 9)
    prefix = "Shimmer_7EEB_"
    names = [
        "Timestamp_Unix_CAL",
        *(f"Accel_LN_{x}_CAL" for x in "XYZ"),
        "Battery_CAL",
        *(f"Gyro_{x}_CAL" for x in "XYZ"),
    ]
    units = ["ms", *["m/(s^2)"] * 3, "mV", *["deg/s"] * 3]
    head = '"sep=\t"\n' + "\t".join(prefix + n for n in names) + "\t\n" + "\t".join(units) + "\t\n"
    ms = 1000 * EPOCH_S + 1000 * s.time_s
    body = _rows(ms, *a.T, np.full(s.n, 4100.5), *w.T, separator="\t", end="\t\n")
    return Layout("Shimmer (Consensys)", {"shimmer.csv": (head + body).encode()}, 128, a, w, ("m/s^2", "deg/s"), s.n)


@layout
def shimmer_four_lines() -> Layout:
    """Shimmer Capture and LogAndStream: device, names, CAL/RAW, units."""
    s = session(51.2)
    a, w = _round(s.force, 6), _round(np.degrees(s.rate), 6)
    names = ["Timestamp", *(f"Accelerometer {x}" for x in "XYZ"), *(f"Gyroscope {x}" for x in "XYZ")]
    rows = [["Shimmer 8A5B"] * 7, names, ["CAL"] * 7, ["mSecs", *["m/(sec^2)"] * 3, *["deg/sec"] * 3]]
    head = "".join("\t".join(r) + "\n" for r in rows)
    body = _rows(1000 * s.time_s, *a.T, *w.T, separator="\t")
    return Layout("Shimmer (Capture)", {"capture.dat": (head + body).encode()}, 51.2, a, w, ("m/s^2", "deg/s"), s.n)


@layout
def gnsslogger() -> Layout:
    """GnssLogger (Google): one record type per line, headers in remarks, other records between."""
    s = session(100)
    a, w = _si(s, 7)
    head = "# \n# Header Description:\n# \n# Version: v3.0.6.4 Platform: 14 Manufacturer: Google Model: Pixel 7\n# \n"
    head += "# Raw,utcTimeMillis,TimeNanos,LeapSecond,TimeUncertaintyNanos,FullBiasNanos\n# \n"
    head += (
        "# Fix,Provider,LatitudeDegrees,LongitudeDegrees,AltitudeMeters,SpeedMps,AccuracyMeters,UnixTimeMillis\n# \n"
    )
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
    text = head + "\n".join(lines) + "\n"
    return Layout("GnssLogger", {"gnss_log.txt": text.encode()}, 100, a, w, SI, 2 * s.n + others, {}, False, True)


@layout
def openlog_artemis() -> Layout:
    """SparkFun OpenLog Artemis: rtcDate, rtcTime, accelerometer in mg, gyro in deg/s, a comma at each end."""
    s = session(50)
    a, w = _round(1000 * s.force / G, 2), _round(np.degrees(s.rate), 2)
    head = "rtcDate,rtcTime,aX,aY,aZ,gX,gY,gZ,mX,mY,mZ,imu_degC,output_Hz,\n"
    mag = [np.round(20 + 0.3 * np.random.default_rng(i).standard_normal(s.n), 2) for i in range(3)]
    body = _rows(
        _dates(s, "%m/%d/%Y"),
        _dates(s, "%H:%M:%S.%f", 2),
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
def betaflight() -> Layout:
    """blackbox_decode: blanks behind the commas, gyroADC in whole deg/s (gyro_scale 1), accSmooth with acc_1G 2048."""
    s = session(500)
    a, w = np.rint(2048 * s.force / G), np.rint(np.degrees(s.rate))
    names = ["loopIteration", "time (us)", *(f"axisP[{i}]" for i in range(3)), *(f"gyroADC[{i}]" for i in range(3))]
    names += [*(f"accSmooth[{i}]" for i in range(3)), *(f"motor[{i}]" for i in range(4)), "flightModeFlags (flags)"]
    k = np.arange(s.n)
    zeros = [np.zeros(s.n, dtype=int)] * 3
    motors = [np.full(s.n, 48)] * 4
    body = _rows(
        4 * k, 9_000_000 + 2000 * k, *zeros, *w.astype(int).T, *a.astype(int).T, *motors, ["0"] * s.n, separator=", "
    )
    text = ", ".join(names) + "\n" + body
    return Layout("Betaflight (blackbox_decode)", {"LOG00001.01.csv": text.encode()}, 500, a, w, COUNTS, s.n)


COUNTS = ("counts", "counts")


def _zip(members: dict[str, bytes]) -> bytes:
    buffer = io.BytesIO()
    with zipfile.ZipFile(buffer, "w", zipfile.ZIP_DEFLATED) as archive:
        for name, content in members.items():
            archive.writestr(name, content)
    return buffer.getvalue()


@layout
def phyphox_zip() -> Layout:
    """phyphox, several sensors, CSV (comma, decimal point) exported as .zip with meta/."""
    acc, gyr = session(100, 1), session(100, 1, 0.0031)
    members = {}
    for name, quantity, unit, s, v in (
        ("Accelerometer.csv", "Acceleration", "m/s^2", acc, acc.force),
        ("Gyroscope.csv", "Gyroscope", "rad/s", gyr, gyr.rate),
    ):
        head = ",".join(['"Time (s)"', *(f'"{quantity} {x} ({unit})"' for x in "xyz")]) + "\n"
        t = s.time_s + (0.0031 if s is gyr else 0.0)
        members[name] = (head + _rows(t, *v.T, form="{:.9E}")).encode()
    members["meta/device.csv"] = b'"property","value"\n"version","1.1.16"\n"deviceModel","Pixel 7"\n'
    members["meta/time.csv"] = (
        b'"event","experiment time","system time","system time text"\n'
        b'"START",0.000000000E0,1.709294400E9,"2024-03-01 12:00:00.000 UTC+00:00"\n'
    )
    a = np.array([[float(f"{v:.9E}") for v in row] for row in acc.force])
    # The gyro starts 3.1 ms later: the first reading of the accelerometer has no partner and is reported.
    return Layout("phyphox (zip)", {"phyphox.zip": _zip(members)}, 100, a[1:], None, SI, acc.n + gyr.n, {}, False, True)


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
        members[name] = (head + _rows(_ns(s), s.time_s, v[:, 2], v[:, 1], v[:, 0])).encode()
    members["Metadata.csv"] = b"version,device name,platform\n3,Pixel 7,android\n"
    rows = 2 * s.n
    return Layout("Sensor Logger (zip)", {"walk.zip": _zip(members)}, 100, s.force, s.rate, SI, rows, {}, False, True)


@layout
def sensorlog_ios() -> Layout:
    """SensorLog (B. Thomas, iOS): long names with units, gravity in g in accelerometerAcceleration."""
    s = session(100)
    a, w = _round(s.force / G, 6), _round(s.rate, 6)
    names = ["loggingTime(txt)", "loggingSample(N)", "accelerometerTimestamp_sinceReboot(s)"]
    names += [f"accelerometerAcceleration{x}(G)" for x in "XYZ"] + ["gyroTimestamp_sinceReboot(s)"]
    names += [f"gyroRotation{x}(rad/s)" for x in "XYZ"] + [f"motionUserAcceleration{x}(G)" for x in "XYZ"]
    t = 12345.6 + s.time_s
    zeros = [np.round(0.001 * np.random.default_rng(i).standard_normal(s.n), 6) for i in range(3)]
    timestamps = _dates(s, "%Y-%m-%dT%H:%M:%S.%f", 3)
    body = _rows([f"{x}+01:00" for x in timestamps], np.arange(1, s.n + 1), t, *a.T, t, *w.T, *zeros)
    text = ",".join(names) + "\n" + body
    return Layout("SensorLog (iOS)", {"sensorlog.csv": text.encode()}, 100, a, w, ("g", "rad/s"), s.n)


@layout
def androsensor() -> Layout:
    """AndroSensor: semicolons, names with units, a date whose milliseconds stand behind a colon."""
    s = session(50)
    a, w = _round(s.force, 4), _round(s.rate, 4)
    names = [f"ACCELEROMETER {x} (m/s²)" for x in "XYZ"] + [f"GRAVITY {x} (m/s²)" for x in "XYZ"]
    names += [f"LINEAR ACCELERATION {x} (m/s²)" for x in "XYZ"] + [f"GYROSCOPE {x} (rad/s)" for x in "XYZ"]
    names += ["Time since start in ms", "YYYY-MO-DD HH-MI-SS_SSS"]
    linear = [np.round(0.01 * np.random.default_rng(i).standard_normal(s.n), 4) for i in range(3)]
    timestamps = [x.replace(".", ":") for x in _dates(s, "%Y-%m-%d %H:%M:%S.%f", 3)]
    ms = np.rint(1000 * s.time_s).astype(int)
    body = _rows(*a.T, *a.T, *linear, *w.T, ms, timestamps, separator=";")
    text = ";".join(names) + "\n" + body
    return Layout("AndroSensor", {"Sensor_record.csv": text.encode()}, 50, a, w, SI, s.n)


@layout
def matlab_mobile() -> Layout:
    """MATLAB Mobile: a table per sensor, Timestamp as 01-Mar-2024 12:00:00.000."""
    s = session(100)
    a, w = _si(s)
    head = "Timestamp,X,Y,Z\n"
    timestamps = _dates(s, "%d-%b-%Y %H:%M:%S.%f", 3)
    files = {
        "Acceleration.csv": (head + _rows(timestamps, *a.T)).encode(),
        "AngularVelocity.csv": (head + _rows(timestamps, *w.T)).encode(),
    }
    return Layout("MATLAB Mobile", files, 100, a, w, SI, 2 * s.n, {}, True)


@layout
def metabase() -> Layout:
    """MbientLab MetaBase: epoc (ms), a stamp with points in the clock, x-axis (g) and (deg/s)."""
    s = session(100)
    a, w = _round(s.force / G, 3), _round(np.degrees(s.rate), 3)
    ms = [1709294400000 + round(1000 * t) for t in s.time_s]
    timestamps = _dates(s, "%Y-%m-%dT%H.%M.%S.%f", 3)
    files = {}
    for name, v, unit in (("MetaWear_Accelerometer.csv", a, "g"), ("MetaWear_Gyroscope.csv", w, "deg/s")):
        head = "epoc (ms),timestamp (-0700),elapsed (s)," + ",".join(f"{x}-axis ({unit})" for x in "xyz") + "\n"
        files[name] = (head + _rows(ms, timestamps, _round(s.time_s, 3), *v.T)).encode()
    return Layout("MbientLab MetaBase", files, 100, a, w, ("g", "deg/s"), 2 * s.n, {}, True)


@layout
def actigraph() -> Layout:
    """ActiGraph GT9X Link IMU export of ActiLife: ten lines of preamble, month first, seven digits of a second."""
    s = session(100)
    a, w = _round(s.force / G, 6), _round(np.degrees(s.rate), 6)
    head = "------------ Data Table File Created By ActiGraph GT9X Link ActiLife v6.13.4 Firmware v1.7.2 "
    head += "date format M/d/yyyy at 100 Hz  Filter Normal -----------\nSerial Number: TAS1D48140206\n"
    head += "Start Time 12:00:00\nStart Date 3/1/2024\nEpoch Period (hh:mm:ss) 00:00:00\nDownload Time 13:25:46\n"
    head += "Download Date 3/2/2024\nCurrent Memory Address: 0\nCurrent Battery Voltage: 4.18     Mode = 12\n"
    head += "--------------------------------------------------\n"
    head += (
        "Timestamp,Accelerometer X,Accelerometer Y,Accelerometer Z,Temperature,Gyroscope X,Gyroscope Y,Gyroscope Z\n"
    )
    timestamps = [x + "0" for x in _dates(s, "%m/%d/%Y %H:%M:%S.%f")]
    body = _rows(timestamps, *a.T, np.full(s.n, 26.5), *w.T)
    return Layout("ActiGraph GT9X", {"IMU.csv": (head + body).encode()}, 100, a, w, ("g", "deg/s"), s.n)


@layout
def axivity() -> Layout:
    """Axivity AX6 by OmGui or cwa-convert: no names, a date, g and deg/s."""
    s = session(100)
    a, w = _round(s.force / G, 6), _round(np.degrees(s.rate), 6)
    body = _rows(_dates(s, "%Y-%m-%d %H:%M:%S.%f", 3), *a.T, *w.T)
    return Layout("Axivity AX6", {"ax6.csv": body.encode()}, 100, a, w, ("g", "deg/s"), s.n)


@layout
def witmotion() -> Layout:
    """WitMotion's recorder: tabs, Chiptime as a date, ax(g), wx(deg/s), T(°)."""
    s = session(100)
    a, w = _round(s.force / G, 4), _round(np.degrees(s.rate), 4)
    names = ["Chiptime", *(f"a{x}(g)" for x in "xyz"), *(f"w{x}(deg/s)" for x in "xyz")]
    head = "\t".join([*names, *(f"Angle{x}(deg)" for x in "XYZ"), "T(°)"]) + "\r\n"
    angles = [np.round(10 + 0.1 * np.random.default_rng(i).standard_normal(s.n), 3) for i in range(3)]
    timestamps = _dates(s, "%Y-%m-%d %H:%M:%S.%f", 3)
    body = _rows(timestamps, *a.T, *w.T, *angles, np.full(s.n, 28.25), separator="\t", end="\r\n")
    return Layout("WitMotion", {"20240301120000.txt": (head + body).encode()}, 100, a, w, ("g", "deg/s"), s.n)


@layout
def arduino_monitor() -> Layout:
    """Arduino IDE 1.8 serial monitor with 'Show timestamp': 12:00:00.000 -> before every line, names in the first."""
    s = session(100)
    a, w = _round(s.force, 3), _round(s.rate, 4)
    timestamps = _dates(s, "%H:%M:%S.%f", 3)
    ms = np.rint(1000 * s.time_s).astype(int)
    lines = [f"{timestamps[0]} -> millis,ax,ay,az,gx,gy,gz"]
    lines += [f"{t} -> {row}" for t, row in zip(timestamps, _rows(ms, *a.T, *w.T).splitlines(), strict=True)]
    text = "\n".join(lines) + "\n"
    return Layout("Arduino (monitor timestamps)", {"monitor.txt": text.encode()}, 100, a, w, SI, s.n)


@layout
def arduino_plotter() -> Layout:
    """Arduino Serial Plotter's protocol: label:value pairs on a line, blanks or commas between."""
    s = session(100)
    a, w = _round(s.force, 3), _round(s.rate, 4)
    labels = ["t_ms", "ax", "ay", "az", "gx", "gy", "gz"]
    ms = np.rint(1000 * s.time_s).astype(int)
    rows = zip(ms, *a.T, *w.T, strict=True)
    lines = [" ".join(f"{label}:{_plain(v)}" for label, v in zip(labels, row, strict=True)) for row in rows]
    return Layout("Arduino (labelled)", {"plotter.txt": ("\n".join(lines) + "\n").encode()}, 100, a, w, SI, s.n)


@layout
def i2cdevlib() -> Layout:
    """i2cdevlib MPU6050_raw: 'a/g:' and six counts behind tabs, no time."""
    s = session(100)
    a, w = np.rint(16384 * s.force / G), np.rint(131 * np.degrees(s.rate))
    body = _rows(["a/g:"] * s.n, *a.astype(int).T, *w.astype(int).T, separator="\t")
    text = "Initializing I2C devices...\nTesting device connections...\nMPU6050 connection successful\n" + body
    return Layout("i2cdevlib MPU6050_raw", {"mpu.txt": text.encode()}, 100, a, w, COUNTS, s.n, {"rate_hz": 100.0})


@layout
def adafruit() -> Layout:
    """Adafruit_MPU6050 basic_readings: three lines and a blank one for each reading."""
    s = session(20)
    a, w = _round(s.force, 2), _round(s.rate, 2)
    parts = ["Adafruit MPU6050 test!\nMPU6050 Found!\n"]
    for k in range(s.n):
        parts.append("Acceleration X: {:.2f}, Y: {:.2f}, Z: {:.2f} m/s^2\n".format(*a[k]))
        parts.append("Rotation X: {:.2f}, Y: {:.2f}, Z: {:.2f} rad/s\n".format(*w[k]))
        parts.append("Temperature: 29.94 degC\n\n")
    text = "".join(parts)
    return Layout("Adafruit (three lines)", {"adafruit.txt": text.encode()}, 20, a, w, SI, s.n, {"rate_hz": 20.0})


@layout
def ximu3() -> Layout:
    """x-IMU3 software: Inertial.csv, microseconds, deg/s and g."""
    s = session(100)
    a, w = _round(s.force / G, 6), _round(np.degrees(s.rate), 6)
    names = ["Timestamp (us)", *(f"Gyroscope {x} (deg/s)" for x in "XYZ"), *(f"Accelerometer {x} (g)" for x in "XYZ")]
    us = 392093562 + 10000 * np.arange(s.n)
    text = ",".join(names) + "\n" + _rows(us, *w.T, *a.T)
    return Layout("x-io x-IMU3", {"Inertial.csv": text.encode()}, 100, a, w, ("g", "deg/s"), s.n)


@layout
def st_mems() -> Layout:
    """ST MEMS Studio and Unicleo: mg and mdps in brackets, microseconds."""
    s = session(104)
    a, w = np.rint(1000 * s.force / G), np.rint(1000 * np.degrees(s.rate))
    names = ["time[us]", *(f"acc_{x}[mg]" for x in "xyz"), *(f"gyro_{x}[mdps]" for x in "xyz")]
    us = np.rint(np.arange(s.n) * 1e6 / 104).astype(int)
    text = ",".join(names) + "\n" + _rows(us, *a.astype(int).T, *w.astype(int).T)
    return Layout("ST MEMS Studio", {"lsm6dso.csv": text.encode()}, 104, a, w, ("mg", "mdeg/s"), s.n)


@layout
def physics_toolbox() -> Layout:
    """Physics Toolbox Sensor Suite, multi record: g-force in g, linear acceleration beside it, angular velocity."""
    s = session(100)
    a, w = _round(s.force / G, 4), _round(s.rate, 4)
    names = ["time", "gFx", "gFy", "gFz", "TgF", "ax", "ay", "az", "wx", "wy", "wz"]
    linear = [np.round(0.02 * np.random.default_rng(i).standard_normal(s.n), 4) for i in range(3)]
    text = ",".join(names) + "\n" + _rows(_round(s.time_s, 4), *a.T, np.full(s.n, 1.0), *linear, *w.T)
    return Layout("Physics Toolbox", {"physics.csv": text.encode()}, 100, a, w, ("g", "rad/s"), s.n)


@layout
def empatica() -> Layout:
    """Empatica E4 ACC.csv: start, then rate, then whole numbers of 1/64 g."""
    s = session(32)
    a = np.rint(64 * s.force / G)
    text = "1709294400.000000, 1709294400.000000, 1709294400.000000\n32.000000, 32.000000, 32.000000\n"
    text += _rows(*a.astype(int).T)
    return Layout("Empatica E4", {"ACC.csv": text.encode()}, 32, a, None, ("counts", "rad/s"), s.n)


@layout
def mars_logger() -> Layout:
    """MARS logger (Android, iOS): gyro_accel.csv, ns, units in brackets without blanks."""
    s = session(200)
    a, w = _si(s)
    head = "Timestamp[nanosec],gx[rad/s],gy[rad/s],gz[rad/s],ax[m/s^2],ay[m/s^2],az[m/s^2],Unix time[nanosec]\n"
    ns = 15219875000000 + 5000000 * np.arange(s.n)
    return Layout(
        "MARS logger", {"gyro_accel.csv": (head + _rows(ns, *w.T, *a.T, _ns(s))).encode()}, 200, a, w, SI, s.n
    )
