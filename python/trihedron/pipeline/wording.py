"""What the command says by its flags, said by the parameters of the Python functions."""

from __future__ import annotations

import re
from dataclasses import replace

from trihedron.records import Finding

_PARAMETERS = {
    "--accel-unit": "accelerometer_unit",
    "--gyro-unit": "gyroscope_unit",
    "--time-unit": "time_unit",
    "--columns": "columns",
    "--rate": "rate_hz",
    "--device": "device",
    "--topic": "topic",
    "--instance": "instance",
    "--accel": "accelerometer_path",
    "--gyro": "gyroscope_path",
}
_COLUMNS = re.compile(r"--columns ((?:\w[\w.]*=|[\w-]+,)[\w=,.-]*\w)(\.{3})?")
_FLAG = re.compile("|".join(sorted(map(re.escape, _PARAMETERS), key=len, reverse=True)) + r"(?![\w-])")


def in_python(text: str) -> str:
    """A sentence with ``--columns ax=1`` as ``columns="ax=1"`` and other flags as the parameters they stand for."""
    text = _COLUMNS.sub(lambda m: f'columns="{m[1]}{m[2] or ""}"', text)
    return _FLAG.sub(lambda m: _PARAMETERS[m[0]], text)


def finding_in_python(finding: Finding) -> Finding:
    """A finding whose action names parameters instead of flags."""
    action = in_python(finding.action)
    return finding if action == finding.action else replace(finding, action=action)
