"""The table of layouts: every maker's file read, its rows counted, its numbers compared with what was written.

python benches/formats/table.py [--write docs/reading-makers.md]
"""

from __future__ import annotations

import sys
import tempfile
from pathlib import Path

import numpy as np

sys.path.extend([str(Path(__file__).parents[2] / "tests"), str(Path(__file__).parents[1])])
from makers import LAYOUTS, Layout
from trihedron.read import ReadError, read_recording
from trihedron.records import Recording

HEAD = "| maker | file | rows in file = read + reported | rate [Hz] | units | gravest finding | verdict |\n"
HEAD += "|---|---|---|---|---|---|---|\n"
RANK = ("note", "warning", "serious")


def read_layout(made: Layout, folder: Path) -> Recording:
    """The recording of a layout's file, or of its two."""
    paths = [folder / name for name in made.files]
    for path, content in zip(paths, made.files.values(), strict=True):
        path.write_bytes(content)
    if made.per_sensor:
        return read_recording(accelerometer_path=paths[0], gyroscope_path=paths[1], **made.options)
    return read_recording(paths[0], **made.options)


def verdict(made: Layout, recording: Recording) -> str:
    """``as written``, or the first thing that is not."""
    pairs = ((recording.accelerometer, made.accelerometer), (recording.gyroscope, made.gyroscope))
    for found, wanted in pairs:
        if wanted is None:
            continue
        if found is None or found.shape != wanted.shape:
            return "OTHER SHAPE"
        if not np.allclose(found, wanted, rtol=0.0, atol=1e-12):
            return f"DIFFERS by {np.nanmax(np.abs(found - wanted)):.2g}"
    units = (recording.accelerometer_unit.value, recording.gyroscope_unit.value)
    if any(u != w for u, w, (_, v) in zip(units, made.units, pairs, strict=True) if v is not None):
        return "OTHER UNIT"
    if abs(recording.rate_hz / made.rate_hz - 1.0) > 2e-3:
        return "OTHER RATE"
    if recording.rows_in_file != made.rows or recording.rows_in_file != recording.rows_read + recording.rows_reported:
        return "ROWS LOST"
    return "as written"


def main() -> int:
    rows, wrong = [], 0
    for make in LAYOUTS.values():
        made = make()
        said = " ".join(f"--{k.removesuffix('_hz')} {v}" for k, v in made.options.items())
        name = " + ".join(made.files) + (f" ({said})" if said else "")
        with tempfile.TemporaryDirectory() as folder:
            try:
                r = read_layout(made, Path(folder))
            except ReadError as error:
                rows.append(f"| {made.maker} | {name} | error: {str(error)[-90:]} | | | | NOT READ |")
                wrong += 1
                continue
        found = verdict(made, r)
        wrong += found != "as written"
        units = []
        if r.accelerometer is not None:
            units.append(r.accelerometer_unit.value)
        if r.gyroscope is not None:
            units.append(r.gyroscope_unit.value)
        gravest = max((f.severity.value for f in r.findings), key=RANK.index)
        codes = sorted({f.code for f in r.findings if f.severity.value == gravest != "note"})
        grave = gravest + (f": {', '.join(codes)}" if codes else "")
        counts = f"{r.rows_in_file} = {r.rows_read} + {r.rows_reported}"
        rows.append(f"| {made.maker} | {name} | {counts} | {r.rate_hz:.5g} | {', '.join(units)} | {grave} | {found} |")
    text = HEAD + "\n".join(rows) + f"\n\n{len(rows)} layouts, {wrong} not as written.\n"
    print(text)
    if "--write" in sys.argv:
        target = Path(sys.argv[sys.argv.index("--write") + 1])
        target.write_text(
            "# Makers' layouts\n\nMade by `python benches/formats/table.py --write docs/reading-makers.md`: files laid "
            "out as each maker's program writes them (each generator of `tests/makers/` names the "
            "document), read without options except those given after the file's name.\n\n" + text
        )
    return int(wrong > 0)


if __name__ == "__main__":
    raise SystemExit(main())
