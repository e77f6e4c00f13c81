"""Real recordings end to end: ``python benches/recordings.py FOLDER`` (the recordings are not part of the repository).

One line per recording: time warm (reading included), poses, norm residual and held-out gravity prediction.
"""

import sys
import time
from pathlib import Path

import numpy as np

import trihedron


def sessions(folder: Path) -> dict[str, tuple[dict[str, object], float]]:
    """Arguments of :func:`trihedron.read` and gravity of every session."""
    xsens = {
        "accelerometer_path": folder / "xsens_mti/xsens_acc.txt",
        "gyroscope_path": folder / "xsens_mti/xsens_gyro.txt",
    }
    out: dict[str, tuple[dict[str, object], float]] = {"xsens_mti": (xsens, 9.81744)}
    for k in range(3):
        out[f"mpu9150 imu{k}"] = ({"path": folder / f"mpu9150/imu{k}.log", "rate_hz": 100.0}, 9.81)
    for k in (1, 2, 3):
        out[f"kim {k}"] = ({"path": folder / f"kim/kim_imu_good{k}.txt"}, 9.79871)
    out["mpu6050_tomi"] = ({"path": folder / "mpu6050_tomi/tomi_example_data_calibration.csv"}, 9.81)
    for k in (2, 3):
        pair = {
            f"{name}_path": next((folder / "phone").glob(f"rec_{k}*__{word}.csv"))
            for name, word in (("accelerometer", "Acceleration"), ("gyroscope", "AngularVelocity"))
        }
        out[f"phone rec_{k}"] = (pair, 9.7974)
    for k in (2, 3, 4, 5):
        out[f"mimu4444 exp_{k}, device 1"] = ({"path": folder / f"mimu4444/exp_{k}.npz", "device": 1}, 9.8184)
    return out


def main() -> None:
    """Print the table."""
    folder = Path(sys.argv[1])
    print("recording                     time poses   residual   held out     noise   gravity  verdict")
    for name, (arguments, gravity) in sessions(folder).items():
        walls = []
        for _ in range(3):
            began = time.perf_counter()
            result = trihedron.calibrate(trihedron.read(**arguments), gravity_m_s2=gravity)
            walls.append(time.perf_counter() - began)
        quality = result.accelerometer.quality
        gyroscope = result.gyroscope
        angles = None if gyroscope is None else gyroscope.quality.held_out_angle_deg
        angle = f"{np.sqrt(np.nanmean(angles**2)):7.3f} °" if angles is not None else "–"
        held = "–" if quality.held_out_rms is None else f"{1e3 * quality.held_out_rms:.2f} mm/s²"
        verdict = "good" if result.is_trustworthy else "not to be trusted"
        norms = f"{1e3 * quality.rms_dof:5.2f} mm/s² {held:>10s} {1e3 * quality.floor:4.2f} mm/s²"
        print(f"{name:26s} {min(walls):5.2f} s {result.segments.n_holds:5d} {norms} {angle:>9s}  {verdict}")


if __name__ == "__main__":
    main()
