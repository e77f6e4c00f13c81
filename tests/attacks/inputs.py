"""Mutated files for their readers."""

from __future__ import annotations

import os
import sys
from collections.abc import Callable
from pathlib import Path
from typing import Any

import numpy as np

from attacks.cases import Attack
from attacks.mutations import of_bytes, of_json
from trihedron.records import Recording


def read_whole(*paths: Path, **options: Any) -> Recording:
    """A recording whose rows are all accounted for."""
    from trihedron.read import read_recording

    recording = read_recording(*paths, **options)
    reported = round(sum(finding.numbers.get("rows_left_out", 0.0) for finding in recording.findings))
    assert recording.rows_in_file == recording.rows_read + reported, "rows are not accounted for"
    assert np.all(np.isfinite(recording.time_s)), "a time that is not finite"
    return recording


def answered(*readers: Callable[[], object]) -> str:
    """Whether readers took what they were given, rejected it in a sentence, or failed."""
    try:
        for reader in readers:
            with np.errstate(all="ignore"):
                reader()
    except AssertionError as error:
        return f"FAILED: {error}"
    except ValueError as error:
        text = str(error)
        if not text or len(text) > 1500 or "panicked" in text or text.count("\n") > 12:
            return f"FAILED: the rejection is {text[:300]!r}"
        return "rejected"
    return "taken"


def _readers() -> dict[str, list[Callable[[Path], object]]]:
    from trihedron.api.exporting import export
    from trihedron.files.calibration import read_calibration
    from trihedron.files.noise import read_noise
    from trihedron.files.scenario import improved_scenario
    from trihedron.protocols.declared import read_frame_declaration
    from trihedron.read.axis_noise import read_axis_noise
    from trihedron.read.pose_table import read_pose_table
    from trihedron.simulate.scenario_file import read_scenario

    def log(path: Path) -> object:
        return read_whole(path, instance=1) if path.name == "a.npz" else read_whole(path)

    def calibration(path: Path) -> object:
        known = read_calibration(path)
        return export(known, "python") if "python" in sys.argv else known

    return {
        **{name: [log] for name in ("a.npy", "a.npz", "b.npz", "a.zip", "a.gz", "short.csv", "quoted.csv")},
        "c.json": [calibration],
        "untrusted.json": [read_calibration],
        "noise.json": [read_noise],
        "axis.json": [read_axis_noise],
        "s.toml": [read_scenario, lambda path: improved_scenario(path, {}, [("dropped-samples", {"rate": 0.1})])],
        "frame.toml": [read_frame_declaration],
        "poses.csv": [lambda path: read_pose_table(path, gravity_m_s2=9.8)],
    }


class Inputs(Attack):
    """Mutated files, each given to its reader."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.readers = _readers()
        self.names = sorted(self.readers)

    def _case(self, number: int) -> tuple[str, bytes]:
        rng = self.rng(number)
        name = self.names[number % len(self.names)]
        data = self.files[name]
        if name.endswith(".json") and rng.random() < 0.6:
            return name, of_json(rng, data)
        return name, of_bytes(rng, data)

    def run(self, number: int) -> str:
        name, data = self._case(number)
        path = self.folder / f"{os.getpid()}" / name
        path.parent.mkdir(exist_ok=True)
        path.write_bytes(data)
        return answered(*(lambda reader=reader: reader(path) for reader in self.readers[name]))
