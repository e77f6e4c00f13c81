"""Layouts tried after the reader was written, by somebody who had not read it: the same contract as ``layout.py``."""

from __future__ import annotations

import numpy as np

from hand_made_sessions import G
from makers.layout import EPOCH_S, SI, Layout, dates, in_si, layout, nanoseconds, session, written


@layout
def gcdc_x16() -> Layout:
    """Gulf Coast Data Concepts X16 (manual, 3.2): lines of ';' above and below, counts, seconds since the start."""
    s = session(100)
    a = np.rint(2048 * s.force / G).astype(int)
    head = ";Title, http://www.gcdataconcepts.com, x16-1d, ADXL345\n;Version, 1110, Build date, Dec 30 2015, SN:CCDC\n"
    head += ";Start_time, 2024-03-01, 12:00:00.000\n;Temperature, -999.00, deg C, Vbat, 1444, mv\n;SampleRate, 100,Hz\n"
    head += ";Deadband, 0, counts\n;DeadbandTimeout, 0,sec\n;Headers, time,Ax,Ay,Az\n"
    body = written(np.round(s.time_s + 0.003, 3), *a.T) + ";shutdown: switched off\n"
    return Layout("GCDC X16", {"DATA-001.csv": (head + body).encode()}, 100, a, None, ("counts", "rad/s"), s.n + 1)


@layout
def gyroflow_gcsv() -> Layout:
    """Gyroflow's .gcsv (its technical documents): scales in a preamble, whole numbers everywhere, time included."""
    s = session(200)
    a, w = np.rint(2048 * s.force / G).astype(int), np.rint(np.degrees(s.rate) * 16.4).astype(int)
    head = "GYROFLOW IMU LOG\nversion,1.3\nid,custom_logger_name\norientation,YxZ\nnote,development_test\n"
    head += "fwversion,FIRMWARE_0.1.0\ntimestamp,1644159993\nvendor,potatocam\nvideofilename,videofilename.mp4\n"
    head += f"tscale,0.001\ngscale,{np.pi / 180 / 16.4:.8g}\nascale,{1 / 2048:.8g}\nt,gx,gy,gz,ax,ay,az\n"
    body = written(np.rint(1e3 * s.time_s).astype(int), *w.T, *a.T)
    return Layout("Gyroflow", {"video.gcsv": (head + body).encode()}, 200, a, w, ("counts", "counts"), s.n)


@layout
def polar_sensor_logger() -> Layout:
    """Polar Sensor Logger (Verity Sense): semicolons, phone's date, sensor's ns since 2000, [mg] and [dps]."""
    s = session(52)
    a, w = np.rint(1000 * s.force / G).astype(int), np.round(np.degrees(s.rate), 3)
    timestamps = dates(s, "%Y-%m-%dT%H:%M:%S.%f", 3)
    ns = [n - 946684800 * 10**9 for n in nanoseconds(s)]
    head = "Phone timestamp;sensor timestamp [ns];X [{0}];Y [{0}];Z [{0}]\n"
    files = {
        "Polar_Sense_ACC.txt": (head.format("mg") + written(timestamps, ns, *a.T, separator=";")).encode(),
        "Polar_Sense_GYRO.txt": (head.format("dps") + written(timestamps, ns, *w.T, separator=";")).encode(),
    }
    return Layout("Polar Sensor Logger", files, 52, a, w, ("mg", "deg/s"), 2 * s.n, {}, True)


@layout
def plotjuggler() -> Layout:
    """PlotJuggler's CSV export of sensor_msgs/Imu: __time, whole paths of topics as names."""
    s = session(100)
    a, w = in_si(s)
    paths = [f"/imu/data/angular_velocity/{x}" for x in "xyz"] + ["/imu/data/header/stamp"]
    paths += [f"/imu/data/linear_acceleration/{x}" for x in "xyz"] + [f"/imu/data/orientation/{x}" for x in "xyzw"]
    stamp = np.round(EPOCH_S + s.time_s, 6)
    body = written(stamp, *w.T, stamp, *a.T, *np.tile([0.0, 0.1, 0.2, 0.97], (s.n, 1)).T)
    return Layout("PlotJuggler", {"imu.csv": ("__time," + ",".join(paths) + "\n" + body).encode()}, 100, a, w, SI, s.n)


@layout
def bagpy() -> Layout:
    """bagpy's message_by_topic: Time, then every field by its path, timestamps in seconds and nanoseconds apart."""
    s = session(100)
    a, w = in_si(s)
    names = ["Time", "header.seq", "header.stamp.secs", "header.stamp.nsecs", "header.frame_id"]
    names += [f"orientation.{x}" for x in "xyzw"] + [f"orientation_covariance_{k}" for k in range(9)]
    names += [f"angular_velocity.{x}" for x in "xyz"] + [f"angular_velocity_covariance_{k}" for k in range(9)]
    names += [f"linear_acceleration.{x}" for x in "xyz"] + [f"linear_acceleration_covariance_{k}" for k in range(9)]
    ns = np.array(nanoseconds(s))
    late = np.round(ns / 1e9 + 0.002, 7)
    cov = np.zeros((s.n, 9)).T
    body = written(
        late, np.arange(s.n), ns // 10**9, ns % 10**9, ["imu_link"] * s.n,
        *np.tile([0.0, 0.1, 0.2, 0.97], (s.n, 1)).T, *cov, *w.T, *cov, *a.T, *cov,
    )  # fmt: skip
    return Layout("bagpy", {"imu-data.csv": (",".join(names) + "\n" + body).encode()}, 100, a, w, SI, s.n)


@layout
def adis_evaluation() -> Layout:
    """Analog Devices' IMU evaluation software: register names, counts of 16 bits, a sample number and no time."""
    s = session(200)
    a, w = np.rint(4000 * s.force / G).astype(int), np.rint(np.degrees(s.rate) / 0.01).astype(int)
    names = ["DATA_CNTR", *(f"{x}_GYRO_OUT" for x in "XYZ"), *(f"{x}_ACCL_OUT" for x in "XYZ"), "TEMP_OUT"]
    body = written(np.arange(s.n), *w.T, *a.T, np.full(s.n, 250) + np.arange(s.n) // 900)
    content = (",".join(names) + "\n" + body).encode()
    return Layout("ADIS evaluation", {"adis.csv": content}, 200, a, w, ("counts",) * 2, s.n, {"rate_hz": 200})


@layout
def excel_europe() -> Layout:
    """A table saved by a German Excel: semicolons, decimal commas, day first, a comma before the milliseconds."""
    s = session(100)
    a, w = np.round(s.force / G, 5), np.round(np.degrees(s.rate), 4)
    head = "Zeit;Acc_X [g];Acc_Y [g];Acc_Z [g];Gyr_X [deg/s];Gyr_Y [deg/s];Gyr_Z [deg/s]\r\n"
    body = written(dates(s, "%d.%m.%Y %H:%M:%S.%f", 3), *a.T, *w.T, separator=";", end="\r\n").replace(".", ",")
    body = "\n".join(line.replace("01,03,2024", "01.03.2024") for line in body.split("\n"))
    return Layout("Excel, Europe", {"messung.csv": (head + body).encode("cp1252")}, 100, a, w, ("g", "deg/s"), s.n)


@layout
def american_clock() -> Layout:
    """Loggers of the United States: month first, twelve hours with AM and PM, over noon."""
    s = session(100)
    a, w = in_si(s)
    body = written(dates(s, "%m/%d/%Y %I:%M:%S.%f", 3), *a.T, *w.T)
    body = "".join(line.replace(",", " PM,", 1) + "\n" for line in body.splitlines())
    head = "Date Time,Accel X (m/s^2),Accel Y (m/s^2),Accel Z (m/s^2),Gyro X (rad/s),Gyro Y (rad/s),Gyro Z (rad/s)\n"
    return Layout("American clock", {"log.csv": (head + body).encode()}, 100, a, w, SI, s.n)


@layout
def microstrain_mip() -> Layout:
    """MicroStrain MIP Monitor: DATA_START, GPS week and time of week, g and rad/s by the descriptors x8004, x8005."""
    s = session(100)
    a, w = np.round(s.force / G, 6), np.round(s.rate, 6)
    names = "GPS TFlags,GPS Week,GPS TOW,X Accel [x8004],Y Accel [x8004],Z Accel [x8004],"
    names += "X Gyro [x8005],Y Gyro [x8005],Z Gyro [x8005]\n"
    head = "Session Name,test\nDevice,3DM-GX5-25\n\nDATA_START\n" + names
    body = written(np.full(s.n, 7), np.full(s.n, 2303), np.round(475200 + s.time_s, 4), *a.T, *w.T)
    return Layout("MicroStrain MIP", {"gx5.csv": (head + body).encode()}, 100, a, w, ("g", "rad/s"), s.n)


@layout
def vectornav_lines() -> Layout:
    """VectorNav $VNIMU lines (VN-100 manual): magnetic field, acceleration, rate, temperature, pressure, checksum."""
    s = session(100)
    a, w = np.round(s.force, 3), np.round(s.rate, 6)
    rng = np.random.default_rng(2)
    lines = []
    for k in range(s.n):
        field = rng.normal([0.2, -0.1, 0.4], 0.001)
        numbers = [f"{v:+08.4f}" for v in field] + [f"{v:+07.3f}" for v in a[k]] + [f"{v:+010.6f}" for v in w[k]]
        text = "VNIMU," + ",".join([*numbers, "+25.1", "+101.325"])
        check = 0
        for c in text.encode():
            check ^= c
        lines.append(f"${text}*{check:02X}\r\n")
    content = "".join(lines).encode()
    options = {"rate_hz": 100, "columns": "ax=5,ay=6,az=7,gx=8,gy=9,gz=10"}
    return Layout("VectorNav $VNIMU", {"vn100.txt": content}, 100, a, w, SI, s.n, options)
