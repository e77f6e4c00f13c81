"""Real recordings end to end: ``python benches/recordings.py FOLDER`` (the recordings are not part of the repository).

One line per recording: time warm (reading included), poses, norm residual and held-out gravity prediction; then what
was published about them (docs/evidence.md).
"""

import json
import sys
import time
from dataclasses import replace
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


def against_published(folder: Path) -> None:
    """Print what was published next to what is found."""
    arguments, gravity = sessions(folder)["xsens_mti"]
    result = trihedron.calibrate(trihedron.read(**arguments), gravity_m_s2=gravity, method="separate")
    published = json.loads((folder / "xsens_mti/published_imu_tk.json").read_text())
    accelerometer, gyroscope = result.accelerometer, result.gyroscope
    zero = -np.linalg.solve(accelerometer.S, accelerometer.b) - published["acc"]["bias"]
    for name, sensor, key in (("accelerometer", accelerometer, "acc"), ("gyro", gyroscope, "gyro")):
        theirs = np.array(published[key]["misalignment"]) @ np.diag(published[key]["scale"])
        # Lengths of columns do not depend on the frame.
        ratio = np.linalg.norm(sensor.S, axis=0) / np.linalg.norm(theirs, axis=0) - 1.0
        print(f"xsens_mti {name} scale: {100 * np.abs(ratio).max():.3f} % from the published one at most")
    residual = 1e3 * accelerometer.quality.rms_dof
    print(f"xsens_mti accelerometer zero: {np.abs(zero).max():.1f} counts; residual {residual:.2f} mm/s²")
    for k in range(3):
        arguments, gravity = sessions(folder)[f"mpu9150 imu{k}"]
        quality = trihedron.calibrate(
            trihedron.read(**arguments), gravity_m_s2=gravity, method="separate"
        ).accelerometer.quality
        print(f"mpu9150 imu{k}: chi-square {quality.chi2 / quality.dof:.2f} per degree of freedom ({quality.dof})")
    for k, said in ((1, 0.57), (2, 1.17), (3, 1.39)):
        arguments, gravity = sessions(folder)[f"kim {k}"]
        recording = trihedron.read(**arguments)
        segments = trihedron.segment(recording)
        alike = replace(segments, accelerometer_sigma_mean=np.full((segments.n_holds, 3), 1e-3))
        found = [
            trihedron.calibrate(recording, segments=s, gravity_m_s2=gravity, method="separate").accelerometer.quality
            for s in (alike, segments)
        ]
        values = ", ".join(f"{1e3 * quality.rms_dof:.2f}" for quality in found)
        print(f"kim {k}: {values} mm/s² (poses alike, weighed), published {said}; {found[0].dof} degrees of freedom")


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
    against_published(folder)


if __name__ == "__main__":
    main()
