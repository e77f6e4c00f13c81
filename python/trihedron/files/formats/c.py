"""S and b as a C header: ``true = S raw + b``."""

from __future__ import annotations

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, heading
from trihedron.files.plausible import named_sensors
from trihedron.records import Calibration


def to_c(calibration: Calibration, _options: ExportOptions) -> str:
    """A header with one struct per sensor, and the correction in double and float."""
    lines = [
        f"/* {line.replace('*/', '* /')} */"
        for line in heading(calibration, "true = S * raw + b, raw to true, row by row.")
    ]
    lines += ["#ifndef TRIHEDRON_CALIBRATION_H", "#define TRIHEDRON_CALIBRATION_H", ""]
    lines += ["typedef struct { double S[3][3]; double b[3]; } trihedron_sensor;"]
    lines += ["typedef struct { float S[3][3]; float b[3]; } trihedron_sensor_f;", ""]
    for name, sensor in named_sensors(calibration):
        lines.append(f"/* {name}: {sensor.raw_unit} to {sensor.si_unit} */")
        for kind, suffix, end in (("trihedron_sensor", "", ""), ("trihedron_sensor_f", "_f", "f")):
            rows = ",\n     ".join("{" + ", ".join(f"{v!r}{end}" for v in _floats(r)) + "}" for r in sensor.S)
            bias = ", ".join(f"{v!r}{end}" for v in _floats(sensor.b))
            lines += [
                f"static const {kind} trihedron_{name}{suffix} = {{",
                f"    {{{rows}}},",
                f"    {{{bias}}}}};",
                "",
            ]
    for kind, suffix, real in (("trihedron_sensor", "", "double"), ("trihedron_sensor_f", "_f", "float")):
        lines += [
            "#if defined(__GNUC__)",
            "__attribute__((unused))",
            "#endif",
            f"static void trihedron_correct{suffix}(const {kind} *sensor, const {real} raw[3], {real} corrected[3])",
            "{",
            "    int i, j;",
            "    for (i = 0; i < 3; ++i) {",
            "        corrected[i] = sensor->b[i];",
            "        for (j = 0; j < 3; ++j) corrected[i] += sensor->S[i][j] * raw[j];",
            "    }",
            "}",
            "",
        ]
    # Unused arrays and functions must not cause compiler warnings.
    text = "\n".join([*lines, "#endif", ""])
    return text.replace(
        "static const trihedron",
        "#if defined(__GNUC__)\n__attribute__((unused))\n#endif\nstatic const trihedron",
    )


def _floats(values: np.ndarray) -> list[float]:
    return [float(v) + 0.0 for v in values]


FORMAT = Format("c", to_c)
