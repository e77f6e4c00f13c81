"""S and b as NumPy arrays: ``true = S @ raw + b``."""

from __future__ import annotations

from trihedron.files.formats.contract import ExportOptions, Format, heading, row
from trihedron.files.plausible import named_sensors
from trihedron.records import Calibration


def to_python(calibration: Calibration, _options: ExportOptions) -> str:
    """Arrays and a function for NumPy."""
    lines = [f"# {line}" for line in heading(calibration, "true = S @ raw + b, raw to true.")]
    lines += ["", "import numpy as np", ""]
    for name, sensor in named_sensors(calibration):
        rows = ",\n    ".join(f"[{row(r)}]" for r in sensor.S)
        upper = name.upper()
        lines += [
            f"# {name}: {sensor.raw_unit} to {sensor.si_unit}",
            f"S_{upper} = np.array([\n    {rows}])",
            f"B_{upper} = np.array([{row(sensor.b)}])",
            "",
        ]
    lines += ["", "def correct(raw, S, b):", '    """Readings (n, 3) in raw units to true values (n, 3)."""']
    lines += ["    return np.asarray(raw) @ S.T + b", ""]
    return "\n".join(lines)


FORMAT = Format("python", to_python)
