"""Real references: attitude carried by the gyro on parts that no fit saw, and two units on one beam.

    python benches/reference_recordings.py ../shared/data

analog6dof: each run's gyro is taught by the first 60 % of its optical attitude and replayed over ten seconds of the
rest; then every run is replayed by the calibration of run 3. dual_xsens: rotation and lever arm, both ways round.
"""

import sys
from pathlib import Path

import numpy as np

import trihedron
from trihedron.pipeline.referring import motion_of

GRAVITY = 9.81


def degrees(stage):
    return "–" if stage is None else f"{np.degrees(stage.error_rad):.2f}° ({stage.n})"


def written(one, scale, digits):
    return ", ".join(
        f"{scale * v:.{digits}f} ± {scale * s:.{digits}f}" for v, s in zip(one.value, one.std, strict=True)
    )


def main(folder):
    analog = folder / "analog6dof"
    known = trihedron.calibrate(
        analog / "imuRaw3.csv", reference=motion_of(analog / "viconRot3.csv"), gravity_m_s2=GRAVITY
    ).calibration
    print(
        "run | clock | scale x, y, z [mrad/s per count] | one scale, bias from rest | own first part | run 3's numbers"
    )
    for k in range(1, 6):
        found = trihedron.diagnose(
            analog / f"imuRaw{k}.csv", reference=analog / f"viconRot{k}.csv", gravity_m_s2=GRAVITY, calibration=known
        ).reference
        stages = {r.stage: r for r in found.replay}
        scale = ", ".join(f"{1e3 * v:.2f}" for v in np.linalg.norm(found.gyroscope.S, axis=0))
        offset, sigma = found.clock_offset_s
        print(
            f"{k} | {1e3 * offset:+.2f} ± {1e3 * sigma:.2f} ms | {scale} | "
            f"{degrees(stages.get('one scale, bias from rest'))} | {degrees(stages.get('by the reference'))} | "
            f"{degrees(stages.get('as given'))}"
        )
    for k in (1, 2):
        for log, other in ("ab", "ba"):
            found = trihedron.diagnose(
                folder / "dual_xsens" / f"imu_{log}_45_{k}.csv",
                reference=folder / "dual_xsens" / f"imu_{other}_45_{k}.csv",
                gravity_m_s2=GRAVITY,
            ).reference
            turn = written(found.mounting, np.degrees(1.0), 3)
            arm = written(found.lever_arm, 1e3, 2)
            print(f"{log} in {other}, {k}: rotation [{turn}]°, arm [{arm}] mm")


if __name__ == "__main__":
    main(Path(sys.argv[1]))
