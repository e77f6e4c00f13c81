"""What every attack shares: files to begin with, a child process per case, and how long one may take."""

from __future__ import annotations

import io
import os
import re
import signal
import tempfile
import zipfile
from abc import ABC, abstractmethod
from collections.abc import Iterator, Sequence
from pathlib import Path
from typing import Any

import numpy as np

from small_session import made_elsewhere

LONGEST_S = 10
"""Of the processor's time; a loaded machine may take ``PATIENCE`` times as long by the clock."""
LONGEST_WORK_S = 60
"""Of ``HEAVY`` commands, where they do their work: a demonstration, a diagnosis of every log of a folder."""
PATIENCE = 6
CONTROL = re.compile("[\x00-\x08\x0b-\x1f\x7f-\x9f\u202a-\u202e]")


class TooLong(BaseException):
    """A case that was still running after ten seconds."""


def _too_long(_number: int, _frame: Any) -> None:
    raise TooLong


class Attack(ABC):
    def __init__(self, seed: int) -> None:
        self.seed = seed
        self.folder = Path(tempfile.mkdtemp(prefix="attack-"))
        self.files = originals()

    def rng(self, number: int) -> np.random.Generator:
        return np.random.default_rng([self.seed, number, len(type(self).__name__)])

    def describe(self, number: int) -> str:
        """What a case does, in one line."""
        return self._case(number)[0]

    def _case(self, number: int) -> tuple[str, Any]:
        """Name and damaged content of a file."""
        raise NotImplementedError

    @abstractmethod
    def run(self, number: int) -> str:
        """``taken``, ``rejected`` or ``FAILED: why``."""

    def longest_s(self, _number: int) -> int:
        """Seconds of the processor that a case may take."""
        return LONGEST_S

    def run_forked(self, numbers: Sequence[int]) -> Iterator[tuple[int, str]]:
        """Outcomes of cases in a child of this process; a case that ends its process, or outlives it, has failed."""
        todo = list(numbers)
        while todo:
            heard, told = os.pipe()
            child = os.fork()
            if child == 0:
                os.close(heard)
                self._child(todo, told)
            os.close(told)
            with os.fdopen(heard) as stream:
                for line in stream:
                    number, outcome = line.rstrip("\n").split(" ", 1)
                    todo.remove(int(number))
                    yield int(number), outcome
            _, status = os.waitpid(child, 0)
            if todo:
                yield todo.pop(0), f"FAILED: the process ended with {status}"

    def _child(self, todo: list[int], told: int) -> None:
        signal.signal(signal.SIGALRM, _too_long)
        noise = os.open(self.folder / f"stderr-{os.getpid()}", os.O_RDWR | os.O_CREAT, 0o600)
        os.dup2(noise, 2)
        for number in todo:
            os.ftruncate(noise, 0)
            longest = self.longest_s(number)
            signal.alarm(PATIENCE * longest)
            # A library that holds the interpreter gets no exception: the process itself is ended.
            signal.setitimer(signal.ITIMER_VIRTUAL, 3 * longest)
            try:
                outcome = self.run(number)
            except TooLong:
                outcome = f"FAILED: longer than {PATIENCE * longest} s"
            except BaseException as error:
                outcome = f"FAILED: {type(error).__name__}: {str(error)[:200]!r}"
            signal.alarm(0)
            signal.setitimer(signal.ITIMER_VIRTUAL, 0)
            spoken = os.pread(noise, 2000, 0)
            if b"panicked" in spoken or b"Traceback" in spoken:
                outcome = f"FAILED: on stderr: {spoken[:300]!r}"
            os.write(told, f"{number} {outcome}\n".replace("\r", " ").encode(errors="replace"))
        os._exit(0)


def originals() -> dict[str, bytes]:
    """Good files of every kind, by name."""
    folder = made_elsewhere()
    files = {path.name: path.read_bytes() for path in folder.iterdir() if path.is_file()}
    rows = np.load(folder / "log.npy")[:400]
    plain = b"\n".join(files["log.csv"].split(b"\n")[:401]) + b"\n"
    buffers = {name: io.BytesIO() for name in ("npy", "npz", "zip", "gz", "npz1")}
    np.save(buffers["npy"], rows)
    np.savez_compressed(buffers["npz"], counts=np.tile(rows[:, None, 1:], (1, 2, 1)), t_s=rows[:, 0], fs_hz=100.0)
    np.savez(buffers["npz1"], t=rows[:, 0], acc=rows[:, 1:4], gyr=rows[:, 4:])
    with zipfile.ZipFile(buffers["zip"], "w", zipfile.ZIP_DEFLATED) as archive:
        for name, columns in (("Accelerometer.csv", (0, 1, 2, 3)), ("Gyroscope.csv", (0, 4, 5, 6))):
            text = "time,x,y,z\n" + "\n".join(",".join(f"{v:.8g}" for v in row) for row in rows[:, columns])
            archive.writestr(name, text)
    import gzip

    buffers["gz"].write(gzip.compress(plain))
    files |= {"short.csv": plain, "a.npy": buffers["npy"].getvalue(), "a.npz": buffers["npz"].getvalue()}
    files |= {"b.npz": buffers["npz1"].getvalue(), "a.zip": buffers["zip"].getvalue(), "a.gz": buffers["gz"].getvalue()}
    quoted = b"\n".join(b",".join(b'"' + c + b'"' for c in line.split(b",")) for line in plain.split(b"\n")[:-1])
    files["quoted.csv"] = quoted + b"\n"
    files["axis.json"] = b'{"white": 0.002, "walk": [1e-5, 1e-5, 2e-5]}'
    files["poses.csv"] = b"pitch,roll,hold\n" + b"".join(b"%d,%d,%d\n" % (10 * k, 5 * k, k + 1) for k in range(12))
    files["curve.csv"] = b"tau_s,adev\n" + b"".join(b"%g,%g\n" % (2**k, 1 / (1 + k)) for k in range(12))
    files["frame.toml"] = (
        b'name = "x"\nsync = "AA 55"\nlength = 16\n[checksum]\nkind = "xor8"\n'
        b'[[field]]\nname = "ax"\ntype = "i16"\nat = 2\nscale = 0.001\nunit = "g"\nrole = "value"\n'
    )
    return files
