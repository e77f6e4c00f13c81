"""Mutated logs of every other format that is read: those of libraries, JSON, folders, and the text of makers."""

from __future__ import annotations

import json
import os
import pickle
import shutil
import subprocess
import sys
import tempfile
from collections.abc import Iterator
from dataclasses import dataclass, field
from pathlib import Path
from typing import Any

import test_read_ecosystems as ecosystems
from attacks.cases import Attack
from attacks.inputs import answered, read_whole
from attacks.mutations import of_bytes, of_json
from makers import LAYOUTS, structured
from test_read import readings

TABLE = readings(120)


@dataclass(frozen=True)
class Log:
    """The files of a log by their place below it (``""`` where it is a file itself), and what else is said of it."""

    files: dict[str, bytes]
    options: dict[str, Any] = field(default_factory=dict)
    per_sensor: bool = False


class Formats(Attack):
    """One file of a log damaged, and the log given to its reader; half of the cases are libraries' formats."""

    def __init__(self, seed: int) -> None:
        super().__init__(seed)
        self.kinds = tuple(map(sorted, kinds := _made_elsewhere()))
        self.logs = kinds[0] | kinds[1]

    def _case(self, number: int) -> tuple[str, Log]:
        rng = self.rng(number)
        names = self.kinds[number % 2]
        name = names[number // 2 % len(names)]
        log = self.logs[name]
        harmed = str(rng.choice(sorted(log.files)))
        is_document = name.endswith(".json") and rng.random() < 0.6
        data = (of_json if is_document else of_bytes)(rng, log.files[harmed])
        return name, Log(log.files | {harmed: data}, log.options, log.per_sensor)

    def run(self, number: int) -> str:
        name, log = self._case(number)
        path = self.folder / str(os.getpid()) / name
        shutil.rmtree(path.parent, ignore_errors=True)
        for place, data in log.files.items():
            file = path / place if place else path
            file.parent.mkdir(parents=True, exist_ok=True)
            file.write_bytes(data)
        if log.per_sensor:
            paths = [path / place for place in log.files]
            given = {"accelerometer_path": paths[0], "gyroscope_path": paths[1]}
        else:
            given = {"path": path / next(iter(log.files)) if name in self.kinds[1] else path}
        return answered(lambda: read_whole(**given, **log.options))


def made() -> tuple[dict[str, Log], dict[str, Log]]:
    """Logs of libraries' formats, of JSON and folders, and those of makers, by name."""
    return dict(_logs()), dict(_of_makers())


def _made_elsewhere() -> tuple[dict[str, Log], dict[str, Log]]:
    """The same, by a process of its own: this one has then written no table and can fork."""
    code = "import pickle, sys; from attacks.formats import made; sys.stdout.buffer.write(pickle.dumps(made()))"
    path = os.pathsep.join([str(Path(__file__).parents[1]), *(p for p in sys.path if p)])
    environment = {**os.environ, "PYTHONPATH": path}
    done = subprocess.run([sys.executable, "-c", code], stdout=subprocess.PIPE, check=True, env=environment)
    return pickle.loads(done.stdout)


def _logs() -> Iterator[tuple[str, Log]]:
    """A good log of every format that a library reads, of JSON, and of folders."""
    read = structured.documents(TABLE[:, 0], TABLE[:, 1:4], TABLE[:, 4:])
    for name, document in read.items():
        yield f"{name}.json", Log({"": json.dumps(document).encode()})
    yield "lines.jsonl", Log({"": b"\n".join(json.dumps(row).encode() for row in read["rows"])})
    yield "log.ulg", Log({"": ecosystems.ulog(ecosystems.raw_topics(0, TABLE))})
    yield "fifo.ulg", Log({"": ecosystems.ulog(ecosystems.batches(0, TABLE)[0])})
    yield "flash.bin", Log({"": ecosystems.dataflash(1, TABLE)})
    oxts = structured.drive(TABLE[:40, 0], TABLE[:40, 1:4], TABLE[:40, 4:])
    yield "drive", Log({f"oxts/{place}": text.encode() for place, text in oxts.items()})
    with tempfile.TemporaryDirectory() as name:
        folder = Path(name)
        for kind in ("ros1", "sqlite", "mcap"):
            ecosystems.write_bag(folder / kind, {"/imu": TABLE}, kind=kind)
        for inner in [p for kind in ("sqlite", "mcap") for p in (folder / kind).iterdir() if p.suffix != ".yaml"]:
            shutil.copy(inner, folder / f"inner{inner.suffix}")
        for write in (_matlab, _hdf5, _parquet):
            write(folder)
        for path in sorted(folder.iterdir()):
            inside = [p for p in path.rglob("*") if p.is_file()] if path.is_dir() else [path]
            yield path.name, Log({str(p.relative_to(path)).removeprefix("."): p.read_bytes() for p in inside})


def _of_makers() -> Iterator[tuple[str, Log]]:
    """The first five hundred lines of text as makers' programs write it; archives whole."""
    for name, make in LAYOUTS.items():
        made = make()
        files = {k: v if v[:2] == b"PK" else b"\n".join(v.split(b"\n")[:500]) for k, v in made.files.items()}
        yield name, Log(files, made.options, made.per_sensor)


def _matlab(folder: Path) -> None:
    from scipy.io import savemat

    columns = ecosystems.write_matlab(folder, TABLE)
    savemat(folder / "packed.mat", {"imu": columns, "note": "x"}, do_compression=True)
    savemat(folder / "unnamed.mat", {"data": TABLE})


def _hdf5(folder: Path) -> None:
    import h5py

    for name, options in (("plain.h5", {}), ("packed.h5", {"compression": "gzip", "chunks": True})):
        with h5py.File(folder / name, "w") as file:
            for key, values in (("t", TABLE[:, 0]), ("accelerometer", TABLE[:, 1:4]), ("gyroscope", TABLE[:, 4:])):
                file.create_dataset(f"imu/{key}", data=values, **options)


def _parquet(folder: Path) -> None:
    import polars as pl

    pl.DataFrame(TABLE, schema=["t", "ax", "ay", "az", "gx", "gy", "gz"]).write_parquet(folder / "log.parquet")
