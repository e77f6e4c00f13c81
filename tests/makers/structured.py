"""Logs that are no table of named columns: JSON as boards and programs write it, and the folder of a KITTI drive."""

from __future__ import annotations

import numpy as np


def documents(time_s: np.ndarray, force: np.ndarray, rate: np.ndarray) -> dict[str, object]:
    """Rows, columns, packets of four (Movesense), a payload of 100 Hz (Edge Impulse)."""
    acc, gyr = force.tolist(), rate.tolist()
    triads = [[dict(zip("xyz", row, strict=True)) for row in sensor] for sensor in (acc, gyr)]
    columns = {"acc": force.T.tolist(), "gyro": rate.T.tolist()}
    sensors = [{"name": f"{s}{a}", "units": u} for s, u in (("acc", "m/s2"), ("gyr", "rad/s")) for a in "XYZ"]
    ms = np.rint(1e3 * time_s).astype(int).tolist()
    return {
        "rows": [{"t": t, "acc": a, "gyro": w} for t, a, w in zip(time_s.tolist(), triads[0], gyr, strict=True)],
        "columns": {"t": time_s.tolist()} | {k: dict(zip("xyz", v, strict=True)) for k, v in columns.items()},
        "edge": {"payload": {"interval_ms": 10, "sensors": sensors, "values": np.hstack([force, rate]).tolist()}},
        "movesense": {
            "data": [
                {"imu": {"Timestamp": ms[k], "ArrayAcc": triads[0][k : k + 4], "ArrayGyro": triads[1][k : k + 4]}}
                for k in range(0, len(ms) // 4 * 4, 4)
            ]
        },
    }


def drive(time_s: np.ndarray, force: np.ndarray, rate: np.ndarray) -> dict[str, str]:
    """Texts of an ``oxts`` folder by their places in it."""
    files = {"timestamps.txt": "".join(f"2011-09-26 13:02:{t:012.9f}\n" for t in time_s)}
    for k, (a, w) in enumerate(zip(force.tolist(), rate.tolist(), strict=True)):
        files[f"data/{k:010d}.txt"] = " ".join(map(str, [*range(11), *a, *a, *w, *w, *range(7)]))
    return files
