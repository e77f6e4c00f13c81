"""GTSAM's combined preintegration: covariances of continuous noise, N² and K²; S and b are applied before it."""

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, heading, number, of_si_readings, row
from trihedron.files.formats.noise_keys import limits, required
from trihedron.records import Calibration


def to_gtsam(calibration: Calibration, options: ExportOptions) -> str:
    """A Python module: S and b to apply, and the parameters of ``PreintegrationCombinedParams``."""
    known = of_si_readings(calibration, "GTSAM", options)
    figures = required(known, options, "GTSAM")
    lines = [f"# {line}" for line in heading(known, "true = S @ raw + b; preintegrate what is true.")]
    lines += [f"# {limit}" for limit in limits(options)]
    lines += ["import numpy as np", ""]
    for name, sensor in known.sensors:
        lines += [f"S_{name.upper()} = np.array([{', '.join(f'[{row(r)}]' for r in sensor.S)}])"]
        lines += [f"B_{name.upper()} = np.array([{row(sensor.b)}])"]
    lines += ["", "", "def preintegration_params():"]
    lines += ["    import gtsam", ""]
    lines += [f"    params = gtsam.PreintegrationCombinedParams.MakeSharedU({number(known.gravity_m_s2)})"]
    for setter, one in (
        ("setAccelerometerCovariance", figures.accel_N),
        ("setGyroscopeCovariance", figures.gyro_N),
        ("setBiasAccCovariance", figures.accel_K),
        ("setBiasOmegaCovariance", figures.gyro_K),
    ):
        lines.append(f"    params.{setter}({number(float(np.square(one.value)))} * np.eye(3))")
    return "\n".join([*lines, "    return params", ""])


FORMATS = (Format("gtsam", to_gtsam, in_si=True),)
