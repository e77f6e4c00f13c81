"""S and b as source code of C, Python and Rust: ``true = S raw + b``."""

import numpy as np

from trihedron.files.formats.contract import ExportOptions, Format, heading, row
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
    for name, sensor in calibration.sensors:
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


def to_python(calibration: Calibration, _options: ExportOptions) -> str:
    """Arrays and a function for NumPy."""
    lines = [f"# {line}" for line in heading(calibration, "true = S @ raw + b, raw to true.")]
    lines += ["", "import numpy as np", ""]
    for name, sensor in calibration.sensors:
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


def to_rust(calibration: Calibration, _options: ExportOptions) -> str:
    """A module without std: constants and a function."""
    lines = [f"// {line}" for line in heading(calibration, "true = S * raw + b, raw to true, row by row.")]
    lines += ["", "/// Linear model of one sensor: `true = S raw + b`.", "#[derive(Clone, Copy, Debug)]"]
    lines += ["pub struct Sensor {", "    pub s: [[f64; 3]; 3],", "    pub b: [f64; 3],", "}", ""]
    for name, sensor in calibration.sensors:
        rows = ", ".join(f"[{row(r)}]" for r in sensor.S)
        lines += [
            f"/// {sensor.raw_unit} to {sensor.si_unit}.",
            "#[allow(clippy::excessive_precision)]",
            f"pub const {name.upper()}: Sensor = Sensor {{ s: [{rows}], b: [{row(sensor.b)}] }};",
            "",
        ]
    lines += [
        "impl Sensor {",
        "    /// Raw reading to true value.",
        "    #[must_use]",
        "    pub const fn correct(&self, raw: [f64; 3]) -> [f64; 3] {",
        "        let (s, b) = (&self.s, &self.b);",
        "        [",
        *(f"            s[{i}][0] * raw[0] + s[{i}][1] * raw[1] + s[{i}][2] * raw[2] + b[{i}]," for i in range(3)),
        "        ]",
        "    }",
        "}",
        "",
    ]
    return "\n".join(lines)


FORMATS = (Format("c", to_c), Format("python", to_python), Format("rust", to_rust))
