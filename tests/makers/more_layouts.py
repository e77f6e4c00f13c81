"""Layouts tried after the reader was written, by somebody who had not read it: the same contract as ``layout.py``."""

from __future__ import annotations

from functools import reduce
from operator import xor

import numpy as np

from hand_made_sessions import G
from makers.layout import EPOCH_S, Layout, dates, layout, nanoseconds, session, text, written

VNIMU = {"rate_hz": 100, "columns": "ax=5,ay=6,az=7,gx=8,gy=9,gz=10"}


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


@text("Gyroflow", "video.gcsv", 200, counts=(2048, 16.4))
def gyroflow_gcsv(s, a, w):
    """Gyroflow's .gcsv (its technical documents): scales in a preamble, whole numbers everywhere, time included."""
    head = "GYROFLOW IMU LOG\nversion,1.3\nid,custom_logger_name\norientation,YxZ\nnote,development_test\n"
    head += "fwversion,FIRMWARE_0.1.0\ntimestamp,1644159993\nvendor,potatocam\nvideofilename,videofilename.mp4\n"
    head += f"tscale,0.001\ngscale,{np.pi / 180 / 16.4:.8g}\nascale,{1 / 2048:.8g}\nt,gx,gy,gz,ax,ay,az\n"
    return head + written(np.rint(1e3 * s.time_s).astype(int), *w.T, *a.T)


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


@text("PlotJuggler", "imu.csv", 100)
def plotjuggler(s, a, w):
    """PlotJuggler's CSV export of sensor_msgs/Imu: __time, whole paths of topics as names."""
    paths = [f"/imu/data/angular_velocity/{x}" for x in "xyz"] + ["/imu/data/header/stamp"]
    paths += [f"/imu/data/linear_acceleration/{x}" for x in "xyz"] + [f"/imu/data/orientation/{x}" for x in "xyzw"]
    stamp = np.round(EPOCH_S + s.time_s, 6)
    body = written(stamp, *w.T, stamp, *a.T, *np.tile([0.0, 0.1, 0.2, 0.97], (s.n, 1)).T)
    return "__time," + ",".join(paths) + "\n" + body


@text("bagpy", "imu-data.csv", 100)
def bagpy(s, a, w):
    """bagpy's message_by_topic: Time, then every field by its path, timestamps in seconds and nanoseconds apart."""
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
    return ",".join(names) + "\n" + body


@text("ADIS evaluation", "adis.csv", 200, counts=(4000, 100), options={"rate_hz": 200})
def adis_evaluation(s, a, w):
    """Analog Devices' IMU evaluation software: register names, counts of 16 bits, a sample number and no time."""
    names = ["DATA_CNTR", *(f"{x}_GYRO_OUT" for x in "XYZ"), *(f"{x}_ACCL_OUT" for x in "XYZ"), "TEMP_OUT"]
    return ",".join(names) + "\n" + written(np.arange(s.n), *w.T, *a.T, np.full(s.n, 250) + np.arange(s.n) // 900)


@text("Excel, Europe", "messung.csv", 100, ("g", "deg/s"), (5, 4))
def excel_europe(s, a, w):
    """A table saved by a German Excel: semicolons, decimal commas, day first, a comma before the milliseconds."""
    head = "Zeit;Acc_X [g];Acc_Y [g];Acc_Z [g];Gyr_X [deg/s];Gyr_Y [deg/s];Gyr_Z [deg/s]\r\n"
    body = written(dates(s, "%d.%m.%Y %H:%M:%S.%f", 3), *a.T, *w.T, separator=";", end="\r\n").replace(".", ",")
    return head + body.replace("01,03,2024", "01.03.2024")


@text("American clock", "log.csv", 100)
def american_clock(s, a, w):
    """Loggers of the United States: month first, twelve hours with AM and PM, over noon."""
    body = written(dates(s, "%m/%d/%Y %I:%M:%S.%f", 3), *a.T, *w.T)
    body = "".join(line.replace(",", " PM,", 1) + "\n" for line in body.splitlines())
    head = "Date Time,Accel X (m/s^2),Accel Y (m/s^2),Accel Z (m/s^2),Gyro X (rad/s),Gyro Y (rad/s),Gyro Z (rad/s)\n"
    return head + body


@text("MicroStrain MIP", "gx5.csv", 100, ("g", "rad/s"))
def microstrain_mip(s, a, w):
    """MicroStrain MIP Monitor: DATA_START, GPS week and time of week, g and rad/s by the descriptors x8004, x8005."""
    names = "GPS TFlags,GPS Week,GPS TOW,X Accel [x8004],Y Accel [x8004],Z Accel [x8004],"
    names += "X Gyro [x8005],Y Gyro [x8005],Z Gyro [x8005]\n"
    head = "Session Name,test\nDevice,3DM-GX5-25\n\nDATA_START\n" + names
    return head + written(np.full(s.n, 7), np.full(s.n, 2303), np.round(475200 + s.time_s, 4), *a.T, *w.T)


@text("VectorNav $VNIMU", "vn100.txt", 100, digits=(3, 6), options=VNIMU)
def vectornav_lines(s, a, w):
    """VectorNav $VNIMU lines (VN-100 manual): magnetic field, acceleration, rate, temperature, pressure, checksum."""
    rng = np.random.default_rng(2)
    lines = []
    for k in range(s.n):
        field = rng.normal([0.2, -0.1, 0.4], 0.001)
        numbers = [f"{v:+08.4f}" for v in field] + [f"{v:+07.3f}" for v in a[k]] + [f"{v:+010.6f}" for v in w[k]]
        line = "VNIMU," + ",".join([*numbers, "+25.1", "+101.325"])
        lines.append(f"${line}*{reduce(xor, line.encode()):02X}\r\n")
    return "".join(lines)
