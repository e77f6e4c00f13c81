"""S and b as a Rust module without std: ``true = S raw + b``."""

from __future__ import annotations

from trihedron.files.formats.contract import ExportOptions, Format, heading, row
from trihedron.files.plausible import named_sensors
from trihedron.records import Calibration


def to_rust(calibration: Calibration, _options: ExportOptions) -> str:
    """A module without std: constants and a function."""
    lines = [f"// {line}" for line in heading(calibration, "true = S * raw + b, raw to true, row by row.")]
    lines += ["", "/// Linear model of one sensor: `true = S raw + b`.", "#[derive(Clone, Copy, Debug)]"]
    lines += ["pub struct Sensor {", "    pub s: [[f64; 3]; 3],", "    pub b: [f64; 3],", "}", ""]
    for name, sensor in named_sensors(calibration):
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


FORMAT = Format("rust", to_rust)
