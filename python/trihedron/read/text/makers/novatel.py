"""NovAtel's RAWIMU messages in ASCII (RAWIMUA, RAWIMUXA and their short forms): increments of velocity and angle in
counts."""

import re

from trihedron.read.text.dialect import Rewritten

_COUNTS = r"(-?\d+),(-?\d+),(-?\d+),(-?\d+),(-?\d+),(-?\d+)"
_MESSAGE = re.compile(
    rf"\s*[#%]RAWIMUS?X?A,[^;]*;(?:[0-9a-fA-F]+,\d+,)?\d+,(\d+\.\d+),[0-9a-fA-F]+,{_COUNTS}(?:\*[0-9a-fA-F]+)?\s*"
)
_ANY = re.compile(r"\s*[#%$<][A-Za-z0-9]+,")
_HEADER = "tow [s],acc x [counts],acc y [counts],acc z [counts],gyro x [counts],gyro y [counts],gyro z [counts]"


def rewritten(text: str) -> Rewritten | None:
    """A table of GPS seconds and counts per sample on X, Y, Z; the messages contain Z, -Y, X, and the sign of Y is
    changed here.

    Other messages become remarks, which the reader counts. None where there is no RAWIMU message.
    """
    if "RAWIMU" not in text[:100_000]:
        return None
    lines = text.split("\n")
    rows, numbers, n_messages = [_HEADER], [1], 0
    for number, line in enumerate(lines, start=1):
        if not line.strip():
            continue
        found = _MESSAGE.fullmatch(line)
        if found is not None:
            tow, *counts = found.groups()
            acc_z, acc_y, acc_x, gyro_z, gyro_y, gyro_x = map(int, counts)
            rows.append(f"{tow},{acc_x},{-acc_y},{acc_z},{gyro_x},{-gyro_y},{gyro_z}")
            n_messages += 1
        else:
            # A damaged RAWIMU message is unchanged, so that the reader of tables reports its line.
            rows.append(f"# {line}" if _ANY.match(line) and "RAWIMU" not in line else line.lstrip("#% "))
        numbers.append(number)
    if not n_messages:
        return None
    return Rewritten.of(rows, numbers)
