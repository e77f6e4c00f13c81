"""Text logs saved from consoles: of boards, and of ROS."""

from __future__ import annotations

import numpy as np

from hand_made_sessions import G
from makers.layout import SI, Layout, layout, nanoseconds, session, text, written


def _padded(value: float) -> str:
    return f"{'-' if value < 0.0 else ' '}{abs(value):08.2f}"


@text("ESP-IDF (log lines)", "monitor.txt", 50, ("g", "deg/s"), (3, 2))
def esp_idf(s, a, w):
    """ESP_LOGI: level, milliseconds since the start in brackets, a tag, then what the sketch prints, in two lines."""
    out = "I (312) main_task: Calling app_main()\n"
    for ms, x, y in zip(np.rint(1000 + 1000 * s.time_s).astype(int), a, w, strict=True):
        out += "I ({}) IMU: Accel X: {:.3f}, Y: {:.3f}, Z: {:.3f}\n".format(ms, *x)
        out += "I ({}) IMU: Gyro X: {:.2f}, Y: {:.2f}, Z: {:.2f}\n".format(ms, *y)
    return out


@text("Zephyr (sensor sample)", "zephyr.txt", 20, ("m/s^2", "deg/s"), options={"rate_hz": 20.0})
def zephyr(s, a, w):
    """Zephyr's sample of an LSM6DSO: a title above each reading, the unit behind each value as ``ms/2`` and ``dps``."""
    out = "*** Booting Zephyr OS build v3.6.0 ***\n"
    for k in range(s.n):
        out += "LSM6DSO sensor samples:\n\naccel x:{:.6f} ms/2 y:{:.6f} ms/2 z:{:.6f} ms/2\n".format(*a[k])
        out += "gyro x:{:.6f} dps y:{:.6f} dps z:{:.6f} dps\ntrig_cnt:{}\n\n".format(*w[k], k)
    return out


@text("SparkFun ICM-20948", "icm.txt", 30, ("mg", "deg/s"), (2, 2), options={"rate_hz": 30.0})
def sparkfun_icm_20948(_, a, w):
    """SparkFun's ICM-20948 library, printScaledAGMT: a label with its unit, three padded values in brackets."""
    lines = []
    for x, y in zip(a, w, strict=True):
        acc, gyr = (", ".join(map(_padded, v)) for v in (x, y))
        lines.append(f"Scaled. Acc (mg) [ {acc} ], Gyr (DPS) [ {gyr} ], Mag (uT) [  00012.00, -00003.00,  00041.00 ]\n")
    return "Initialization of the sensor returned: All is well.\n" + "".join(lines)


@text("ROS (rostopic echo)", "imu.txt", 100)
def rostopic_echo_messages(s, a, w):
    """rostopic echo /imu > imu.txt: indented keys, ``---`` behind each message."""
    cov = "[" + ", ".join(["0.0"] * 9) + "]"
    out = []
    for k, ns in enumerate(nanoseconds(s)):
        out.append(f"header: \n  seq: {k}\n  stamp: \n    secs: {ns // 10**9}\n    nsecs: {ns % 10**9:9d}\n")
        out.append(f'  frame_id: "imu"\norientation: \n  x: 0.0\n  y: 0.0\n  z: 0.0\n  w: 1.0\ncovariance: {cov}\n')
        for name, v in (("angular_velocity", w[k].tolist()), ("linear_acceleration", a[k].tolist())):
            out.append("{}: \n  x: {}\n  y: {}\n  z: {}\n".format(name, *v) + f"{name}_covariance: {cov}\n")
        out.append("---\n")
    return "".join(out)


@text("ROS 2 (topic echo --csv)", "imu.csv", 100)
def ros2_topic_echo_csv(s, a, w):
    """ros2 topic echo --csv /imu: every field of the message, and no names."""
    ns = np.array(nanoseconds(s))
    zero = [np.zeros(s.n)] * 9
    return written(ns // 10**9, ns % 10**9, ["imu"] * s.n, *zero[:3], zero[0] + 1, *zero, *w.T, *zero, *a.T, *zero)


@layout
def motioncal():
    """Adafruit's sketches for MotionCal: ``Raw:`` (8192 per g, 16 per deg/s), ``Uni:`` and now and then ``Cal1:``."""
    s = session(50)
    a, w = np.rint(8192 * s.force / G).astype(int), np.rint(16 * np.degrees(s.rate)).astype(int)
    field, out = (212, -85, 431), []
    for k in range(s.n):
        out.append("Raw:" + ",".join(map(str, (*a[k], *w[k], *field))))
        out.append(
            "Uni:"
            + ",".join([*(f"{v:.2f}" for v in s.force[k]), *(f"{v:.4f}" for v in s.rate[k]), "21.20,-8.50,43.10"])
        )
        out += ["Cal1:0.000,0.000,0.000,0.000,0.000,0.000,1.200,-3.400,0.500,48.000"] if k % 50 == 49 else []
    text = ("\n".join(out) + "\n").encode()
    options = {"rate_hz": 50.0}
    return Layout("MotionCal", {"motioncal.txt": text}, 50, a, w, ("counts", "counts"), len(out), options)


@layout
def realsense():
    """librealsense's rs-convert -p: a table of each stream with names above, the kind of stream first in each row."""
    s = session(200)
    a, w = np.round(s.force, 3), np.round(s.rate, 3)
    head = "\n\nStream Type,F#,HW Timestamp (ms),Backend Timestamp(ms),Host Timestamp(ms),3DOF_x,3DOF_y,3DOF_z\n"
    ms = np.round(1000.0 * s.time_s).astype(int)
    clocks = [np.arange(s.n) + 17, 5120 + ms, 1709294400003 + ms, 1709294400004 + ms]
    body = "".join(head + written([kind] * s.n, *clocks, *v.T) for kind, v in (("Accel", a), ("Gyro", w)))
    return Layout("RealSense (rs-convert)", {"imu_pose.csv": body.encode()}, 200, a, w, SI, 2 * s.n, {}, False, True)
