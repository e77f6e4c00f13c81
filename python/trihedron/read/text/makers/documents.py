"""Messages as indented ``key: value`` lines between ``---``, printed by ``rostopic echo`` and ``ros2 topic echo``."""

import re

from trihedron.read.text.dialect import NEARLY_ALL, Rewritten

_KEY = re.compile(r"(\s*)([^\W\d]\w*):\s*(.*?)\s*$")
_ITEM = re.compile(r"\s*- ")
_END = "---"
_JUDGED = 400


def rewritten(text: str) -> Rewritten | None:
    """A table with a row for each message and its numbers by their path (``linear_acceleration.x``); None for another
    format."""
    lines = text.split("\n")
    sample = [line for line in lines[:_JUDGED] if line.strip() != _END and line.strip()]
    if not any(line.strip() == _END for line in lines[:_JUDGED]):
        return None
    if sum(bool(_KEY.match(line) or _ITEM.match(line)) for line in sample) < NEARLY_ALL * len(sample):
        return None
    rows: list[dict[str, str]] = [{}]
    numbers = [1]
    above: list[tuple[int, str]] = []
    for number, line in enumerate(lines, start=1):
        found = _KEY.match(line)
        if line.strip() == _END:
            rows.append({})
            numbers.append(number + 1)
        elif found is not None:
            indent, key, value = len(found[1]), found[2], found[3]
            above = [*(one for one in above if one[0] < indent), (indent, key)]
            if value and not value.startswith(("[", "{")):
                rows[-1][".".join(name for _, name in above)] = value.strip("\"'").replace(",", " ")
    names = list(dict.fromkeys(name for row in rows for name in row))
    held = [(row, number) for row, number in zip(rows, numbers, strict=True) if row]
    body = [",".join(row.get(name, "") for name in names) for row, _ in held]
    return Rewritten.of([",".join(names), *body], [1, *(number for _, number in held)])
