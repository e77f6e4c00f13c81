"""Method 2 on the real recordings: gravity after each move, in sample and held out.

python benches/gyroscope_recordings.py FOLDER_OF_RECORDINGS
"""

from __future__ import annotations

import sys
from collections.abc import Iterator
from pathlib import Path

import numpy as np

from trihedron.estimate.accelerometer import calibrate_norm
from trihedron.estimate.gyroscope import calibrate_moves
from trihedron.read import read_recording
from trihedron.records import Recording
from trihedron.segment import segment_recording


def recordings(folder: Path) -> Iterator[tuple[str, Recording, float]]:
    """Name, recording and gravity (m/s²) of every set with moves between still poses."""
    xsens = folder / "xsens_mti"
    yield (
        "xsens_mti",
        read_recording(accelerometer_path=xsens / "xsens_acc.txt", gyroscope_path=xsens / "xsens_gyro.txt"),
        9.81744,
    )
    for unit in range(3):
        yield f"mpu9150 {unit}", read_recording(folder / "mpu9150" / f"imu{unit}.log", rate_hz=100.0), 9.8
    for run in (1, 2, 3):
        yield f"kim {run}", read_recording(folder / "kim" / f"kim_imu_good{run}.txt"), 9.79871
    for unit in (1, 5):
        yield f"mimu4444 2/{unit}", read_recording(folder / "mimu4444" / "exp_2.npz", device=unit), 9.8184
    yield "mpu6050", read_recording(folder / "mpu6050_tomi" / "tomi_example_data_calibration.csv"), 9.81


def main(folder: Path) -> None:
    """One line per recording."""
    print("recording        moves  used  in sample deg  held out deg  floor deg  chi2/dof  findings")
    for name, recording, gravity in recordings(folder):
        segments = segment_recording(recording)
        accelerometer, _ = calibrate_norm(
            segments.accelerometer_mean,
            segments.accelerometer_sigma_mean,
            gravity,
            raw_unit=recording.accelerometer_unit,
        )
        found, findings = calibrate_moves(recording, segments, accelerometer, gravity)
        quality = found.quality
        used = quality.weights > 0.0
        held = quality.held_out_angle_deg
        print(
            f"{name:16s} {len(used):5d} {used.sum():5d} {np.sqrt(np.mean(quality.angle_deg[used] ** 2)):14.3f}"
            f" {np.sqrt(np.nanmean(held**2)) if held is not None else np.nan:13.3f}"
            f" {np.degrees(quality.floor / gravity):10.3f} {quality.chi2 / max(quality.dof, 1):9.2f}"
            f"  {' '.join(sorted({f.code.value for f in findings}))}"
        )


if __name__ == "__main__":
    main(Path(sys.argv[1]))
