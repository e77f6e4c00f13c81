"""Lines that MotionCal reads from a board: ``Raw:`` or ``Uni:``, then accelerometer, gyro and magnetometer."""

import re

from trihedron.read.text.dialect import NEARLY_ALL, Rewritten

_LINE = re.compile(r"\s*(?:(\d\d:\d\d:\d\d\.\d+) -> )?(Raw|Uni): *((?:-?\d+\.?\d*(?:,\s*|\s*$)){9})")
_OTHER = re.compile(r"[^,]*?[^\W\d]\w*:")
"""Calibration and orientation, which the sketches print between the readings."""
_UNITS = {"Raw": ("counts", "counts"), "Uni": ("m/s^2", "rad/s")}
_JUDGED = 200


def rewritten(text: str) -> Rewritten | None:
    """A table of the raw readings, or of those in SI units where there are no others; None for another format."""
    lines = text.split("\n")
    sample = [line for line in lines[:_JUDGED] if line.strip()]
    found = [_LINE.fullmatch(line.rstrip()) for line in lines]
    kinds = {one[2] for one in found[:_JUDGED] if one is not None}
    if not kinds or sum(_OTHER.match(line) is not None for line in sample) < NEARLY_ALL * len(sample):
        return None
    kind = min(kinds)
    is_timed = any(one is not None and one[1] for one in found)
    units = zip(("acc", "gyr", "mag"), (*_UNITS[kind], "uT"), strict=True)
    names = [f"{name} {axis} [{unit}]" for name, unit in units for axis in "xyz"]
    rows, numbers = [",".join(["arrival time"] * is_timed + names)], [1]
    for number, (line, one) in enumerate(zip(lines, found, strict=True), start=1):
        if one is not None and one[2] == kind:
            rows.append(",".join([one[1] or ""] * is_timed + [one[3]]))
            numbers.append(number)
        elif line.strip():
            # A damaged line of readings is unchanged, so that the reader of tables reports it.
            rows.append(line if one is None and f"{kind}:" in line else f"# {line}")
            numbers.append(number)
    return Rewritten.of(rows, numbers)
