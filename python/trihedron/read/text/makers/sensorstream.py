"""Android's *Sensorstream IMU+GPS*: a time, then number and three readings of each sensor that has new ones."""

import re

from trihedron.read.text.dialect import NEARLY_ALL, Rewritten

_NUMBER = r"\s*[-+]?\d+\.?\d*(?:[eE][-+]?\d+)?\s*"
_LINE = re.compile(rf"{_NUMBER}(?:,\s*\d{{1,2}}\s*(?:,{_NUMBER}){{3}})+,?\s*")
_SENSORS = {"3": "acc", "4": "gyro", "5": "mag"}
"""Numbers of the sensors that are read, without those of position, orientation and others."""
_JUDGED = 200


def rewritten(text: str) -> Rewritten | None:
    """A table of time, accelerometer [m/s²], gyro [rad/s] and magnetometer [µT]; None for another format."""
    lines = text.split("\n")
    sample = [line for line in lines[:_JUDGED] if line.strip()]
    if not sample or not _LINE.fullmatch(sample[0]) or "3" not in {s.strip() for s in sample[0].split(",")[1::4]}:
        return None
    if sum(_LINE.fullmatch(line) is not None for line in sample) < NEARLY_ALL * len(sample):
        return None
    rows, numbers = ["time [s]," + ",".join(f"{name} {axis}" for name in _SENSORS.values() for axis in "xyz")], [1]
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        fields = [field.strip() for field in line.rstrip(" ,").split(",")]
        held = {fields[k]: fields[k + 1 : k + 4] for k in range(1, len(fields) - 3, 4)}
        is_one = _LINE.fullmatch(line) is not None
        cells = [cell for sensor in _SENSORS for cell in held.get(sensor, ["", "", ""])]
        # A damaged line is unchanged, so that the reader of tables reports it.
        rows.append(",".join([fields[0], *cells]) if is_one else line)
        numbers.append(number)
    return Rewritten.of(rows, numbers)
