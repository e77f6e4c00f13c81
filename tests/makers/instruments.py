"""Text logs of makers of instruments, autopilots, wearables, and of research tools."""

from __future__ import annotations

import numpy as np

from hand_made_sessions import G
from makers.layout import EPOCH_S, SI, Layout, dates, in_si, layout, nanoseconds, session, text, written


@text("ETH ASL (EuRoC)", "data.csv", 200)
def euroc(s, a, w):
    """ASL dataset format (ETH ASL, EuRoC MAV): imu0/data.csv."""
    head = "#timestamp [ns],w_RS_S_x [rad s^-1],w_RS_S_y [rad s^-1],w_RS_S_z [rad s^-1],"
    head += "a_RS_S_x [m s^-2],a_RS_S_y [m s^-2],a_RS_S_z [m s^-2]\n"
    return head + written(nanoseconds(s), *w.T, *a.T)


@text("Kalibr", "imu0.csv", 200)
def kalibr(s, a, w):
    """Kalibr wiki, 'Bag format': imu0.csv of bagcreater and bagextractor, omega [rad/s], alpha [m/s²], ns."""
    head = "timestamp,omega_x,omega_y,omega_z,alpha_x,alpha_y,alpha_z\n"
    return head + written(nanoseconds(s), *w.T, *a.T)


@text("Movella DOT", "dot.csv", 60, ("m/s^2", "deg/s"))
def movella_dot(s, a, w):
    """Movella DOT app and Data Exporter: preamble, SampleTimeFine in microseconds, FreeAcc beside Acc, Gyr in deg/s."""
    head = "sep=,\nDeviceTag:,Movella DOT 1\nFirmwareVersion:,2.4.0\nAppVersion:,2023.6.1\nSyncStatus:,Synced\n"
    head += "OutputRate:,60Hz\nFilterProfile:,General\nMeasurement Mode:,Custom Mode 5\n"
    head += "StartTime:,2024-03-01_12-00-00_000\n© Movella Technologies B. V. 2005-2023\n\n"
    head += "PacketCounter,SampleTimeFine,Euler_X,Euler_Y,Euler_Z,FreeAcc_X,FreeAcc_Y,FreeAcc_Z,"
    head += "Acc_X,Acc_Y,Acc_Z,Gyr_X,Gyr_Y,Gyr_Z,Mag_X,Mag_Y,Mag_Z,\n"
    k = np.arange(s.n)
    fine = (4186350000 + np.rint(k * 1e6 / 60)).astype(np.int64) % 2**32
    other = [np.round(0.01 * np.random.default_rng(i).standard_normal(s.n), 6) for i in range(9)]
    return head + written(k, fine, *other[:6], *a.T, *w.T, *other[6:], end=",\n")


@text("Xsens MTi (MT Manager)", "MT_0380.txt", 100)
def xsens_mt_manager(s, a, w):
    """MT Manager ASCII export: // lines, then names and tabs; SampleTimeFine counts 100 µs."""
    head = "// Start Time: Unknown\n// Update Rate: 100.0Hz\n// Filter Profile: general\n// Firmware Version: 1.8.2\n"
    head += "PacketCounter\tSampleTimeFine\tAcc_X\tAcc_Y\tAcc_Z\tGyr_X\tGyr_Y\tGyr_Z\tMag_X\tMag_Y\tMag_Z\n"
    k = np.arange(s.n)
    mag = [np.round(0.4 + 0.001 * np.random.default_rng(i).standard_normal(s.n), 6) for i in range(3)]
    return head + written(k + 100, 51000 + 100 * k, *a.T, *w.T, *mag, separator="\t", form="{}")


@layout
def ardupilot_csv() -> Layout:
    """mavlogdump.py --format csv --types IMU of a vehicle with two IMUs: one row per IMU, separated by column I."""
    first, second = session(50, 1), session(50, 2)
    head = "timestamp,TimeUS,I,GyrX,GyrY,GyrZ,AccX,AccY,AccZ,EG,EA,T,GH,AH,GHz,AHz\n"
    lines = []
    for k in range(first.n):
        for i, s in enumerate((first, second)):
            us = 61000000 + 20000 * k + 7 * i
            values = [*np.round(s.rate[k], 9), *np.round(s.force[k], 7)]
            numbers = ",".join(repr(float(v)) for v in values)
            lines.append(f"{EPOCH_S + us * 1e-6:.8f},{us},{i},{numbers},0,0,{40 + i},1,1,2000,2000\n")
    a, w = np.round(second.force, 7), np.round(second.rate, 9)
    files = {"IMU.csv": (head + "".join(lines)).encode()}
    return Layout("ArduPilot (mavlogdump CSV, 2 IMUs)", files, 50, a, w, SI, 2 * first.n, {"instance": 1})


@text("PX4 (ulog2csv)", "log_sensor_combined_0.csv", 250)
def px4_ulog2csv(s, a, w):
    """pyulog's ulog2csv: sensor_combined, microseconds."""
    head = "timestamp,gyro_rad[0],gyro_rad[1],gyro_rad[2],gyro_integral_dt,accelerometer_timestamp_relative,"
    head += "accelerometer_m_s2[0],accelerometer_m_s2[1],accelerometer_m_s2[2],accelerometer_integral_dt\n"
    us = 112500000 + 4000 * np.arange(s.n)
    fill = np.full(s.n, 4000)
    return head + written(us, *w.T, fill, 0 * fill, *a.T, fill)


@layout
def px4_ulog2csv_two_topics() -> Layout:
    """ulog2csv of sensor_accel and sensor_gyro: bare x y z, the sensor in the file's name."""
    s = session(200)
    a, w = in_si(s)
    us = 5000000 + 5000 * np.arange(s.n)
    device = np.full(s.n, 1310988)
    heads = "timestamp,timestamp_sample,device_id,x,y,z,temperature,error_count\n"
    temperature = np.full(s.n, 45.25)
    files = {}
    for name, v in (("log_sensor_accel_0.csv", a), ("log_sensor_gyro_0.csv", w)):
        files[name] = (heads + written(us + 120, us, device, *v.T, temperature, 0 * device)).encode()
    return Layout("PX4 (ulog2csv, two topics)", files, 200, a, w, SI, 2 * s.n, {}, True)


@text("ROS (rostopic echo -p)", "imu.csv", 100)
def rostopic_echo(s, a, w):
    """rostopic echo -b -p /imu: ``field.header.stamp`` in ns, covariances between."""
    cov = [f"field.{{}}_covariance{i}" for i in range(9)]
    names = ["%time", "field.header.seq", "field.header.stamp", "field.header.frame_id"]
    names += [f"field.orientation.{x}" for x in "xyzw"] + [c.format("orientation") for c in cov]
    names += [f"field.angular_velocity.{x}" for x in "xyz"] + [c.format("angular_velocity") for c in cov]
    names += [f"field.linear_acceleration.{x}" for x in "xyz"] + [c.format("linear_acceleration") for c in cov]
    zeros = [np.zeros(s.n)] * 9
    timestamps = nanoseconds(s)
    q = [np.zeros(s.n)] * 3 + [np.ones(s.n)]
    body = written(timestamps, np.arange(s.n), timestamps, ["imu"] * s.n, *q, *zeros, *w.T, *zeros, *a.T, *zeros)
    return ",".join(names) + "\n" + body


@text("Shimmer (Consensys)", "shimmer.csv", 128, ("m/s^2", "deg/s"), (9, 9))
def shimmer_consensys(s, a, w):
    """ConsensysPRO export: sep line, names, units; two accelerometers, battery in mV, Unix ms."""
    prefix = "Shimmer_7EEB_"
    names = ["Timestamp_Unix_CAL", *(f"Accel_LN_{x}_CAL" for x in "XYZ"), "Battery_CAL"]
    names += [f"Gyro_{x}_CAL" for x in "XYZ"]
    units = ["ms", *["m/(s^2)"] * 3, "mV", *["deg/s"] * 3]
    head = '"sep=\t"\n' + "\t".join(prefix + n for n in names) + "\t\n" + "\t".join(units) + "\t\n"
    ms = 1000 * EPOCH_S + 1000 * s.time_s
    return head + written(ms, *a.T, np.full(s.n, 4100.5), *w.T, separator="\t", end="\t\n")


@text("Shimmer (Capture)", "capture.dat", 51.2, ("m/s^2", "deg/s"))
def shimmer_four_lines(s, a, w):
    """Shimmer Capture and LogAndStream: device, names, CAL/RAW, units."""
    names = ["Timestamp", *(f"Accelerometer {x}" for x in "XYZ"), *(f"Gyroscope {x}" for x in "XYZ")]
    rows = [["Shimmer 8A5B"] * 7, names, ["CAL"] * 7, ["mSecs", *["m/(sec^2)"] * 3, *["deg/sec"] * 3]]
    head = "".join("\t".join(r) + "\n" for r in rows)
    return head + written(1000 * s.time_s, *a.T, *w.T, separator="\t")


@text("Betaflight (blackbox_decode)", "LOG00001.01.csv", 500, counts=(2048, 1))
def betaflight(s, a, w):
    """blackbox_decode: blanks behind the commas, gyroADC in whole deg/s (gyro_scale 1), accSmooth with acc_1G 2048."""
    names = ["loopIteration", "time (us)", *(f"axisP[{i}]" for i in range(3)), *(f"gyroADC[{i}]" for i in range(3))]
    names += [*(f"accSmooth[{i}]" for i in range(3)), *(f"motor[{i}]" for i in range(4)), "flightModeFlags (flags)"]
    k = np.arange(s.n)
    zeros = [np.zeros(s.n, dtype=int)] * 3
    motors = [np.full(s.n, 48)] * 4
    body = written(4 * k, 9_000_000 + 2000 * k, *zeros, *w.T, *a.T, *motors, ["0"] * s.n, separator=", ")
    return ", ".join(names) + "\n" + body


@text("ActiGraph GT9X", "IMU.csv", 100, ("g", "deg/s"))
def actigraph(s, a, w):
    """ActiGraph GT9X Link IMU export of ActiLife: ten lines of preamble, month first, seven digits of a second."""
    head = "------------ Data Table File Created By ActiGraph GT9X Link ActiLife v6.13.4 Firmware v1.7.2 "
    head += "date format M/d/yyyy at 100 Hz  Filter Normal -----------\nSerial Number: TAS1D48140206\n"
    head += "Start Time 12:00:00\nStart Date 3/1/2024\nEpoch Period (hh:mm:ss) 00:00:00\nDownload Time 13:25:46\n"
    head += "Download Date 3/2/2024\nCurrent Memory Address: 0\nCurrent Battery Voltage: 4.18     Mode = 12\n"
    head += "--------------------------------------------------\n"
    head += "Timestamp," + "".join(f"Accelerometer {x}," for x in "XYZ")
    head += "Temperature,Gyroscope X,Gyroscope Y,Gyroscope Z\n"
    timestamps = [x + "0" for x in dates(s, "%m/%d/%Y %H:%M:%S.%f")]
    return head + written(timestamps, *a.T, np.full(s.n, 26.5), *w.T)


@text("Axivity AX6", "ax6.csv", 100, ("g", "deg/s"))
def axivity(s, a, w):
    """Axivity AX6 by OmGui or cwa-convert: no names, a date, g and deg/s."""
    return written(dates(s, "%Y-%m-%d %H:%M:%S.%f", 3), *a.T, *w.T)


@text("x-io x-IMU3", "Inertial.csv", 100, ("g", "deg/s"))
def ximu3(s, a, w):
    """x-IMU3 software: Inertial.csv, microseconds, deg/s and g."""
    names = ["Timestamp (us)", *(f"Gyroscope {x} (deg/s)" for x in "XYZ"), *(f"Accelerometer {x} (g)" for x in "XYZ")]
    return ",".join(names) + "\n" + written(392093562 + 10000 * np.arange(s.n), *w.T, *a.T)


@text("ST MEMS Studio", "lsm6dso.csv", 104, ("mg", "mdeg/s"), (0, 0))
def st_mems(s, a, w):
    """ST MEMS Studio and Unicleo: mg and mdps in brackets, microseconds."""
    names = ["time[us]", *(f"acc_{x}[mg]" for x in "xyz"), *(f"gyro_{x}[mdps]" for x in "xyz")]
    us = np.rint(np.arange(s.n) * 1e6 / 104).astype(int)
    return ",".join(names) + "\n" + written(us, *a.astype(int).T, *w.astype(int).T)


@layout
def empatica() -> Layout:
    """Empatica E4 ACC.csv: start, then rate, then whole numbers of 1/64 g."""
    s = session(32)
    a = np.rint(64 * s.force / G)
    content = "1709294400.000000, 1709294400.000000, 1709294400.000000\n32.000000, 32.000000, 32.000000\n"
    content += written(*a.astype(int).T)
    return Layout("Empatica E4", {"ACC.csv": content.encode()}, 32, a, None, ("counts", "rad/s"), s.n)
