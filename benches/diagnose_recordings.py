"""What the diagnosis says of every multi-pose set among real recordings, causes withheld.

python benches/diagnose_recordings.py /path/to/data [set ...]
"""

from __future__ import annotations

import sys
import time
from pathlib import Path

from trihedron.diagnose import diagnose_recording
from trihedron.estimate.accelerometer import calibrate_norm
from trihedron.estimate.joint import calibrate_joint
from trihedron.read import read_recording
from trihedron.records import Calibration
from trihedron.segment import resegment, segment_recording


def recordings(folder):
    """Name, arguments of the reader, gravity."""
    yield (
        "xsens_mti",
        {
            "accelerometer_path": folder / "xsens_mti/xsens_acc.txt",
            "gyroscope_path": folder / "xsens_mti/xsens_gyro.txt",
        },
        9.81744,
    )
    for k in range(3):
        yield f"mpu9150 unit {k}", {"path": folder / f"mpu9150/imu{k}.log", "rate_hz": 100.0}, 9.8
    for k in (1, 2, 3):
        yield f"kim run {k}", {"path": folder / f"kim/kim_imu_good{k}.txt"}, 9.79871
    for k in (2, 3, 4, 5):
        yield f"mimu4444 exp {k} device 1", {"path": folder / f"mimu4444/exp_{k}.npz", "device": 1}, 9.8184
    yield (
        "phone rec_3",
        {
            "accelerometer_path": folder / "phone/rec_3_gyro_dynamic__Acceleration.csv",
            "gyroscope_path": folder / "phone/rec_3_gyro_dynamic__AngularVelocity.csv",
        },
        9.7974,
    )
    yield "mpu6050_tomi", {"path": folder / "mpu6050_tomi/tomi_example_data_calibration.csv"}, 9.8
    yield "imucal_ferraris", {"path": folder / "imucal_ferraris/example_ferraris_session.csv", "rate_hz": 102.4}, 9.81


def main():
    folder, wanted = Path(sys.argv[1]), sys.argv[2:]
    for name, arguments, gravity in recordings(folder):
        if wanted and not any(w in name for w in wanted):
            continue
        try:
            recording = read_recording(**arguments)
            segments = segment_recording(recording)
            accelerometer, _ = calibrate_norm(
                segments.accelerometer_mean, segments.accelerometer_sigma_mean, gravity,
                raw_unit=recording.accelerometer_unit,
            )  # fmt: skip
            calibration: Calibration = calibrate_joint(recording, segments, accelerometer, gravity, "given")
            start = time.perf_counter()
            d = diagnose_recording(recording, resegment(recording, segments), calibration)
        except ValueError as error:
            print(f"\n{name}: {error}")
            continue
        seconds = time.perf_counter() - start
        print(f"\n{name}: {segments.n_holds} poses, {d.verdict} ({seconds:.1f} s)")
        for t in d.domains:
            flag = "disagrees" if t.disagrees else ""
            print(f"    {t.domain:14s} chi2/dof {t.chi2_per_dof:9.2f}  {flag} {t.rms:.3g} {t.unit}")
        for e in d.effects:
            print(f"  {e.id}  p {e.p_adjusted:.1g}  dBIC {e.delta_bic:.0f}  confounded {list(e.confounded_with)}")
            print(f"    {e.statement}")
            print("    " + ", ".join(f"{p.name} {p.value:.3g} ± {p.std:.1g} {p.unit}" for p in e.parameters[:9]))
            for h in e.held_out[:4]:
                print(
                    f"    held out {h.domain:14s} chi2/dof {h.chi2_per_dof_before:8.2f} -> {h.chi2_per_dof_after:8.2f}"
                    f"   rms {h.rms_before:.4g} -> {h.rms_after:.4g} {h.unit}"
                )
        print("  remains: " + ", ".join(f"{t.domain} {t.chi2_per_dof:.1f}" for t in d.remaining if t.disagrees))


if __name__ == "__main__":
    main()
