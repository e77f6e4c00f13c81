"""The calibration of every log of a fleet as a file of its own, which `export`, `verify` and `apply` take."""

from __future__ import annotations

import json
import re
from collections.abc import Sequence
from pathlib import Path

from trihedron.files.output import write_whole
from trihedron.fleet.logs import Job

CALIBRATIONS = "calibrations"


def write_calibrations(jobs: Sequence[Job], results: Path, folder: Path) -> None:
    """``DEVICE_LOG_KEY.json`` of every log whose result in ``results`` holds a calibration; what is there stays."""
    target = folder / CALIBRATIONS
    for job in jobs:
        path = target / f"{_plain(job.serial)}_{_plain(Path(job.path).stem)}_{job.key[:6]}.json"
        if path.exists():
            continue
        document = json.loads((results / f"{job.key}.json").read_text(encoding="utf-8")).get("calibration")
        if document is not None:
            target.mkdir(exist_ok=True)
            write_whole(path, json.dumps(document, indent=2, allow_nan=False) + "\n", overwrite=True)


def _plain(name: str) -> str:
    """A name of what every file system takes."""
    return re.sub(r"[^\w.-]+", "-", name) or "log"
